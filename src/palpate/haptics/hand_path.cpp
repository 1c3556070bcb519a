#include "palpate/haptics/hand_path.hpp"

#include <algorithm>
#include <sstream>

#include "palpate/base/error.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/simulation/scene.hpp"

namespace palpate {

namespace {

// The instruments that the header names, in its order: NAME of each column NAME.x.
std::vector<std::string> instruments_in(const std::string& path) {
  std::istringstream text(read_file(path));
  std::string line, column;
  while (std::getline(text, line))
    if (line.find_first_not_of(" \t\r") != std::string::npos && line[0] != '#') break;
  std::vector<std::string> names;
  for (std::istringstream header(line); std::getline(header, column, ',');) {
    const std::size_t dot = column.find('.'), first = column.find_first_not_of(" \t");
    if (dot == std::string::npos || first >= dot) continue;
    const std::string name = column.substr(first, dot - first);
    if (name != "organ" && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

}  // namespace

HandPath::HandPath(const std::string& file) {
  const std::size_t hash = file.rfind('#');
  const std::string path = file.substr(0, hash);
  if (path.empty()) throw Error(ErrorKind::usage, "this device needs a motion file (.csv) after the colon");
  const std::vector<std::string> names = instruments_in(path);
  const auto which = hash == std::string::npos ? names.begin()
                                               : std::find(names.begin(), names.end(), file.substr(hash + 1));
  if (which == names.end())
    throw Error(ErrorKind::format, "{}: no {} in the header; a column NAME.x names an instrument", path,
                hash == std::string::npos ? "instrument" : "instrument '" + file.substr(hash + 1) + "'");
  const Motion motion = read_motion(path, names).motion;
  times_ = motion.times;
  const auto i = static_cast<std::size_t>(which - names.begin());
  for (const std::vector<Pose>& key : motion.poses) poses_.push_back(key[i]);
  buttons_.assign(times_.size(), 0);
  for (std::size_t k = 0; k < motion.grips.size(); ++k) buttons_[k] = motion.grips[k][i];
}

DeviceSample HandPath::at(double time) const noexcept {
  const auto after =
      static_cast<std::size_t>(std::upper_bound(times_.begin(), times_.end(), time) - times_.begin());
  DeviceSample sample;
  sample.connected = true;
  if (after > 0) sample.buttons = buttons_[after - 1];
  if (after == 0 || after == times_.size()) {
    sample.pose = after == 0 ? poses_.front() : poses_.back();
    return sample;
  }
  const Pose &a = poses_[after - 1], &b = poses_[after];
  const double length = times_[after] - times_[after - 1], t = (time - times_[after - 1]) / length;
  sample.pose = {a.rotation.slerp(t, b.rotation), a.translation + t * (b.translation - a.translation)};
  sample.velocity = (b.translation - a.translation) / length;
  const Eigen::AngleAxisd rotation(b.rotation * a.rotation.conjugate());
  sample.angular_velocity = rotation.axis() * (rotation.angle() / length);
  return sample;
}

}  // namespace palpate
