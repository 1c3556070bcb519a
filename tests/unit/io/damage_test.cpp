// Damaged files: whatever the bytes, a mesh or an Error, and never much more memory than the file is big. The
// long campaign is tests/fuzz/fuzz_io.cpp.
#include "damage.hpp"

#include <gtest/gtest.h>

#include "io_test.hpp"
#include "palpate/geometry/triangle_mesh.hpp"
#include "surface_samples.hpp"

namespace palpate {
namespace {

// Reads the bytes; false and a reason where that is anything but a sound mesh or an honest error.
::testing::AssertionResult survives(const TempFolder& folder, const std::string& name,
                                    const std::string& bytes) {
  const std::string complaint = read_damaged(folder / name, bytes);
  return complaint.empty() ? ::testing::AssertionSuccess() : ::testing::AssertionFailure() << complaint;
}

std::vector<SurfaceSample> own_samples() {
  std::vector<SurfaceSample> all = own_surface_samples();
  for (const int type : {2, 4, 16, 1024}) all.push_back({"volume.nii", nifti1(type == 4, type), 0, 0, 0});
  return all;
}

TEST(Damage, TruncatedAnywhere) {
  const TempFolder folder;
  for (const SurfaceSample& s : own_samples())
    for (std::size_t n = 0; n < s.bytes.size(); ++n)
      ASSERT_TRUE(survives(folder, s.name, s.bytes.substr(0, n))) << n;
}

TEST(Damage, BytesChanged) {
  const TempFolder folder;
  for (const SurfaceSample& s : own_samples())
    for (unsigned seed = 0; seed < 300; ++seed)
      ASSERT_TRUE(survives(folder, s.name, damaged(s.bytes, seed))) << s.name << " seed " << seed;
}

TEST(Damage, OfWhatOthersLibrariesRead) {
  const TempFolder folder;
  unsigned seed = 0;
  for (const SurfaceSample& s : surface_samples()) {
    const std::string extension = std::filesystem::path(s.name).extension();
    if (extension != ".iv" && extension != ".wrl" && extension != ".glb") continue;
    for (int i = 0; i < 3; ++i, ++seed)
      ASSERT_TRUE(survives(folder, s.name, damaged(s.bytes, seed))) << s.name << " seed " << seed;
    ASSERT_TRUE(survives(folder, s.name, s.bytes.substr(0, s.bytes.size() * (seed % 10) / 10))) << s.name;
  }
}

TEST(Damage, AsFoundByFuzzing) {
  const TempFolder folder;
  const std::pair<const char*, std::string> found[] = {
      {"a.vtk", "\n vtk DataFile Version 5.1\n"},  // the version was looked for on an empty line
  };
  for (const auto& [name, bytes] : found) EXPECT_TRUE(survives(folder, name, bytes)) << bytes;
}

}  // namespace
}  // namespace palpate
