#include "palpate/io/container.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <thread>

#include "io_test.hpp"
#include "palpate/io/atomic_file.hpp"

namespace palpate {
namespace {

struct Numbers {
  std::vector<float> f;
  std::vector<double> d;
  std::vector<std::int32_t> i;
  std::vector<std::int64_t> l;
  std::vector<std::uint8_t> b;
};

Numbers numbers() {
  Numbers n{std::vector<float>(600), std::vector<double>(7), {1, -2, 3}, {1L << 40, -1}, {0, 255}};
  std::iota(n.f.begin(), n.f.end(), 0.5f);
  std::iota(n.d.begin(), n.d.end(), -1.25);
  return n;
}

void write(const std::filesystem::path& path, const Numbers& n) {
  ContainerWriter out(path, "model", 3);
  out.attribute("provenance", std::string("made of käse"));
  out.attribute("h", 0.125);
  out.attribute("count", std::int64_t{-7});
  out.array<float>("matrix/values", n.f, {20, 30}, "m/N", "compliance");
  out.array<double>("nodes", n.d, {7}, "m", "nodes");
  out.array<std::int32_t>("matrix/index", n.i, {3}, "", "rows");
  out.array<std::int64_t>("long", n.l, {1, 2, 1}, "", "");
  out.array<std::uint8_t>("flags", n.b, {2}, "", "");
  out.array<float>("none", std::span<const float>(), {0, 3}, "m", "nothing");
  out.commit();
}

ErrorKind reading(const std::filesystem::path& path) {
  return kind_of([&] {
    ContainerReader in(path, "model", 3);
    for (const char* name : {"matrix/values", "none"}) in.vector<float>(name);
    in.vector<double>("nodes"), in.vector<std::int32_t>("matrix/index"), in.vector<std::int64_t>("long"),
        in.vector<std::uint8_t>("flags");
  });
}

TEST(Container, GivesBackWhatWasWritten) {
  const TempFolder folder;
  const Numbers n = numbers();
  write(folder / "a.h5", n);
  const ContainerReader in(folder / "a.h5", "model", 5);
  EXPECT_EQ(in.version(), 3);
  EXPECT_EQ(in.text("provenance"), "made of käse");
  EXPECT_EQ(in.number("h"), 0.125);
  EXPECT_EQ(in.number("count"), -7);
  EXPECT_EQ(in.integer("count"), -7);
  EXPECT_EQ(in.shape("matrix/values"), (std::vector<std::size_t>{20, 30}));
  EXPECT_EQ(in.shape("none"), (std::vector<std::size_t>{0, 3}));
  EXPECT_EQ(in.vector<float>("matrix/values"), n.f);
  EXPECT_EQ(in.vector<double>("nodes"), n.d);
  EXPECT_EQ(in.vector<std::int32_t>("matrix/index"), n.i);
  EXPECT_EQ(in.vector<std::int64_t>("long"), n.l);
  EXPECT_EQ(in.vector<std::uint8_t>("flags"), n.b);
  EXPECT_TRUE(in.vector<float>("none").empty());
  EXPECT_TRUE(in.has("matrix/index"));
  EXPECT_FALSE(in.has("matrix"));
  EXPECT_EQ(container_kind(folder / "a.h5"), "model");
}

TEST(Container, SameContentsSameBytes) {
  const TempFolder folder;
  write(folder / "a.h5", numbers());
  write(folder / "b.h5", numbers());
  EXPECT_EQ(read_file(folder / "a.h5"), read_file(folder / "b.h5"));
}

TEST(Container, RefusesWhatDoesNotFit) {
  const TempFolder folder;
  write(folder / "a.h5", numbers());
  const ContainerReader in(folder / "a.h5", "model", 3);
  std::vector<float> f(599), g(7);
  EXPECT_EQ(kind_of([&] { in.array<float>("matrix/values", f); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { in.array<float>("nodes", g); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { in.vector<float>("absent"); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { in.vector<float>("matrix"); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { in.text("count"); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { in.integer("h"); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { in.number("absent"); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { ContainerReader(folder / "a.h5", "lattice", 3); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { ContainerReader(folder / "a.h5", "model", 2); }), ErrorKind::format);
  EXPECT_EQ(kind_of([&] { ContainerReader(folder / "b.h5", "model", 2); }), ErrorKind::file);
  EXPECT_EQ(kind_of([&] { ContainerReader(folder.path, "model", 2); }), ErrorKind::file);
  folder.write("text", "solid nothing");
  EXPECT_EQ(kind_of([&] { ContainerReader(folder / "text", "model", 2); }), ErrorKind::format);
  EXPECT_EQ(container_kind(folder / "text"), "");
}

TEST(Container, NoticesEveryTruncation) {
  const TempFolder folder;
  write(folder / "a.h5", numbers());
  const std::string whole = read_file(folder / "a.h5");
  for (std::size_t size = 0; size < whole.size(); size += size < 64 || whole.size() - size < 200 ? 1 : 97) {
    folder.write("b.h5", whole.substr(0, size));
    ASSERT_EQ(reading(folder / "b.h5"), ErrorKind::format) << size;
  }
  folder.write("b.h5", whole + '\0');
  EXPECT_EQ(reading(folder / "b.h5"), ErrorKind::format);
}

TEST(Container, NoticesEveryDamagedByte) {
  const TempFolder folder;
  write(folder / "a.h5", numbers());
  const std::string whole = read_file(folder / "a.h5");
  for (std::size_t at = 0; at < whole.size(); at += 7) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << at % 8));
    folder.write("b.h5", damaged);
    ASSERT_EQ(reading(folder / "b.h5"), ErrorKind::format) << at;
  }
  ASSERT_EQ(reading(folder / "a.h5"), ErrorKind{});
}

TEST(Container, UnverifiedReadsSkipTheChecksum) {
  const TempFolder folder;
  const Numbers n = numbers();
  write(folder / "a.h5", n);
  std::string bytes = read_file(folder / "a.h5");
  const std::string needle(reinterpret_cast<const char*>(n.f.data()), 40);
  bytes[bytes.find(needle)] ^= 1;
  folder.write("a.h5", bytes);
  const ContainerReader in(folder / "a.h5", "model", 3);
  std::vector<float> f(600);
  EXPECT_EQ(kind_of([&] { in.array<float>("matrix/values", f); }), ErrorKind::format);
  in.array<float>("matrix/values", f, false);
  EXPECT_NE(f[0], n.f[0]);
  EXPECT_EQ(f[1], n.f[1]);
}

TEST(Container, LeavesNothingWhenTheDiskIsFull) {
  const TempFolder folder;
  write(folder / "a.h5", numbers());
  const auto size = std::filesystem::file_size(folder / "a.h5");
  const std::string before = read_file(folder / "a.h5");
  for (std::size_t limit = 0; limit < size; limit += 100) {
    const FileSizeLimit full(limit);
    ASSERT_EQ(kind_of([&] { write(folder / "a.h5", numbers()); }), ErrorKind::file) << limit;
    ASSERT_EQ(kind_of([&] { write(folder / "b.h5", numbers()); }), ErrorKind::file) << limit;
  }
  EXPECT_EQ(read_file(folder / "a.h5"), before);
  EXPECT_EQ(folder.files(), 1u);
}

TEST(Container, LeavesNothingWhenInterruptedOrDropped) {
  const TempFolder folder;
  const std::atomic<bool> stop{true};
  const std::vector<float> values(100);
  EXPECT_EQ(kind_of([&] {
              ContainerWriter out(folder / "a.h5", "model", 1);
              out.array<float>("a", values, {100}, "", "", Progress{{}, &stop});
            }),
            ErrorKind::interrupted);
  { ContainerWriter out(folder / "a.h5", "model", 1); }
  EXPECT_EQ(folder.files(), 0u);
  EXPECT_EQ(kind_of([&] { ContainerWriter(folder / "no/such/a.h5", "model", 1); }), ErrorKind::file);
}

TEST(Container, ThreadsMayUseTheirOwn) {
  const TempFolder folder;
  const Numbers n = numbers();
  std::vector<std::thread> threads;
  std::atomic<int> good{0};
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      const auto path = folder / (std::to_string(t) + ".h5");
      for (int i = 0; i < 5; ++i) {
        write(path, n);
        good += ContainerReader(path, "model", 3).vector<float>("matrix/values") == n.f;
      }
    });
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(good, 20);
}

}  // namespace
}  // namespace palpate
