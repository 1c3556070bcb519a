// Label volumes: NIfTI-1 and -2, .nii and .nii.gz, any orientation. Read here: of damaged files niftilib
// crashes on many.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "palpate/base/vec.hpp"

namespace palpate {

struct LabelVolume {
  std::array<std::size_t, 3> size{};     // voxels along i, j, k
  Eigen::Matrix<double, 3, 4> to_world;  // (i, j, k, 1) of a voxel's centre to metres
  std::vector<std::int32_t> labels;      // i fastest: labels[i + size[0] * (j + size[1] * k)]
};

// By the name: .nii or .nii.gz.
bool is_label_file(const std::filesystem::path& path);

// Integer volumes, or float volumes whose values are whole numbers. Error(format) otherwise.
LabelVolume read_labels(const std::filesystem::path& path);
// The same from a file's bytes; `name` is its name in messages.
LabelVolume parse_labels(const std::string& bytes, const std::string& name);

}  // namespace palpate
