#include "palpate/io/atomic_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include "palpate/base/error.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

class AtomicFileTest : public ::testing::Test {
 protected:
  fs::path folder =
      fs::path(::testing::TempDir()) /
      fmt::format("atomic-{}-{}", getpid(), ::testing::UnitTest::GetInstance()->current_test_info()->name());
  void SetUp() override { fs::create_directories(folder); }
  void TearDown() override { fs::remove_all(folder); }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), {}));
  }
};

TEST_F(AtomicFileTest, IsThereWholeOrNotAtAll) {
  const fs::path path = folder / "a.txt";
  {
    AtomicFile file(path);
    file.write("half");
    EXPECT_FALSE(fs::exists(path));
  }
  EXPECT_EQ(files(), 0u);
  {
    AtomicFile file(path);
    file.write("one ");
    file.write("two");
    file.commit();
  }
  EXPECT_EQ(read_file(path), "one two");
  EXPECT_EQ(files(), 1u);
  {
    AtomicFile file(path);
    file.write("never");
  }
  EXPECT_EQ(read_file(path), "one two");
}

TEST_F(AtomicFileTest, KeepsLinksAndDevices) {
  fs::create_symlink("real.txt", folder / "link.txt");
  AtomicFile file(folder / "link.txt");
  file.write("x");
  file.commit();
  EXPECT_TRUE(fs::is_symlink(folder / "link.txt"));
  EXPECT_EQ(read_file(folder / "real.txt"), "x");
  AtomicFile null("/dev/null");
  null.write("x");
  null.commit();
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_F(AtomicFileTest, NamesPathAndReason) {
  try {
    AtomicFile file(folder / "missing" / "a.txt");
    FAIL() << "opened in a folder that is not there";
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::file);
    EXPECT_NE(std::string(e.what()).find("missing/a.txt"), std::string::npos);
    EXPECT_NE(std::string(e.what()).find("No such file"), std::string::npos);
  }
  EXPECT_THROW(AtomicFile{folder}, Error);
  EXPECT_THROW(read_file(folder), Error);
  EXPECT_THROW(read_file(folder / "missing"), Error);
  EXPECT_THROW(read_file("/dev/zero"), Error);
}

TEST(AtomicFile, NoticesAFullDisk) {
  AtomicFile file("/dev/full");
  EXPECT_THROW(
      {
        file.write(std::string(1 << 20, 'x'));
        file.commit();
      },
      Error);
}

}  // namespace
}  // namespace palpate
