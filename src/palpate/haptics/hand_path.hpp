// Where a hand goes: the poses of one instrument in a motion file, at any time, without allocating.
#pragma once

#include <string>
#include <vector>

#include "palpate/haptics/device.hpp"

namespace palpate {

class HandPath {
 public:
  // "FILE.csv" or "FILE.csv#INSTRUMENT"; the first instrument in the header unless named. Columns as in
  // read_motion (scene.hpp): s, m; NAME.grip is button 0. Error(usage | file | format) with the line.
  explicit HandPath(const std::string& file);

  double begin() const noexcept { return times_.front(); }  // s
  double end() const noexcept { return times_.back(); }
  // Pose and velocities at a time, s; before the first and after the last key the hand rests there.
  DeviceSample at(double time) const noexcept;

 private:
  std::vector<double> times_;
  std::vector<Pose> poses_;
  std::vector<std::uint32_t> buttons_;
};

}  // namespace palpate
