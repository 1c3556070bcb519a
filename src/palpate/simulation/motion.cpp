// Motions as CSV: a header that names the columns, a key a line.
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <string_view>

#include "palpate/io/atomic_file.hpp"
#include "palpate/simulation/scene.hpp"

namespace palpate {

namespace {

constexpr std::array<const char*, 7> pose_columns{"x", "y", "z", "qw", "qx", "qy", "qz"};

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> out;
  for (;;) {
    const std::size_t comma = line.find(',');
    std::string_view cell = line.substr(0, comma);
    while (!cell.empty() && (cell.front() == ' ' || cell.front() == '\t')) cell.remove_prefix(1);
    while (!cell.empty() && (cell.back() == ' ' || cell.back() == '\t' || cell.back() == '\r'))
      cell.remove_suffix(1);
    out.push_back(cell);
    if (comma == std::string_view::npos) return out;
    line.remove_prefix(comma + 1);
  }
}

double number(std::string_view cell, const std::filesystem::path& path, std::size_t line,
              const std::string& column) {
  double value = 0;
  const auto [end, status] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (status != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value))
    throw Error(ErrorKind::format, "{}:{}: '{}' in column {} is no number", path.string(), line,
                std::string(cell), column);
  return value;
}

// Columns of one body's pose in the file, -1: not there.
using PoseColumns = std::array<int, 7>;

Pose read_pose(const std::vector<double>& row, const PoseColumns& columns, double unit,
               const std::string& where) {
  const auto get = [&](std::size_t i, double otherwise) {
    return columns[i] < 0 ? otherwise : row[static_cast<std::size_t>(columns[i])];
  };
  Pose pose;
  pose.translation = unit * Vec3(get(0, 0), get(1, 0), get(2, 0));
  pose.rotation = Eigen::Quaterniond(get(3, 1), get(4, 0), get(5, 0), get(6, 0));
  if (!(pose.rotation.norm() > 1e-6))
    throw Error(ErrorKind::format, "{}: the quaternion is zero; 1 0 0 0 is no rotation", where);
  pose.rotation.normalize();
  return pose;
}

// One key's, where there are such columns.
void read_grips(const std::vector<double>& row, const std::vector<int>& columns, const std::string& where,
                std::vector<std::vector<std::uint8_t>>& grips) {
  if (std::all_of(columns.begin(), columns.end(), [](int c) { return c < 0; })) return;
  std::vector<std::uint8_t>& out = grips.emplace_back();
  for (const int c : columns) {
    const double value = c < 0 ? 0 : row[static_cast<std::size_t>(c)];
    if (value != 0 && value != 1)
      throw Error(ErrorKind::format, "{}: a grip is {}; 1 is closed, 0 open", where, value);
    out.push_back(value != 0);
  }
}

Pose between(const Pose& a, const Pose& b, double t) {
  return {a.rotation.slerp(t, b.rotation), a.translation + t * (b.translation - a.translation)};
}

}  // namespace

MotionFile read_motion(const std::filesystem::path& path, const std::vector<std::string>& instruments,
                       double unit, const std::vector<std::string>& organs) {
  const std::string text = read_file(path);
  std::vector<std::string> bodies = instruments;
  bodies.insert(bodies.end(), organs.begin(), organs.end());
  std::vector<PoseColumns> columns(bodies.size(), PoseColumns{-1, -1, -1, -1, -1, -1, -1});
  std::vector<int> grip_columns(instruments.size(), -1);
  std::vector<std::string> header;
  int time_column = -1;
  MotionFile file;
  std::size_t line_number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line(text.data() + at, end - at);
    at = end + 1;
    ++line_number;
    const auto cells = split(line);
    if (cells[0].empty() && cells.size() == 1) continue;
    if (cells[0].substr(0, 1) == "#") continue;
    if (header.empty()) {
      for (const std::string_view c : cells) header.emplace_back(c);
      for (std::size_t c = 0; c < header.size(); ++c) {
        bool known = header[c] == "time";
        if (known) time_column = static_cast<int>(c);
        for (std::size_t b = 0; b < bodies.size(); ++b)
          for (std::size_t k = 0; k < 7; ++k)
            if (header[c] == bodies[b] + "." + pose_columns[k])
              columns[b][k] = static_cast<int>(c), known = true;
        for (std::size_t i = 0; i < instruments.size(); ++i)
          if (header[c] == instruments[i] + ".grip") grip_columns[i] = static_cast<int>(c), known = true;
        if (!known)
          throw Error(ErrorKind::format,
                      "{}:{}: column '{}' is unknown; use time and NAME.x .y .z .qw .qx .qy .qz with NAME "
                      "one of {}; of "
                      "instruments .grip, too",
                      path.string(), line_number, header[c], fmt::join(bodies, ", "));
      }
      for (std::size_t i = 0; i < instruments.size(); ++i)
        file.moved.push_back(
            std::any_of(columns[i].begin(), columns[i].end(), [](int column) { return column >= 0; }));
      if (time_column < 0)
        throw Error(ErrorKind::format, "{}:{}: no column 'time'", path.string(), line_number);
      continue;
    }
    if (cells.size() != header.size())
      throw Error(ErrorKind::format, "{}:{}: {} values, the header names {}", path.string(), line_number,
                  cells.size(), header.size());
    std::vector<double> row;
    for (std::size_t c = 0; c < cells.size(); ++c)
      row.push_back(number(cells[c], path, line_number, header[c]));
    const double time = row[static_cast<std::size_t>(time_column)];
    if (!file.motion.times.empty() && !(time > file.motion.times.back()))
      throw Error(ErrorKind::format, "{}:{}: time {} does not come after {}", path.string(), line_number,
                  time, file.motion.times.back());
    file.motion.times.push_back(time);
    file.motion.poses.emplace_back();
    file.organs.emplace_back();
    const std::string where = fmt::format("{}:{}", path.string(), line_number);
    for (std::size_t b = 0; b < bodies.size(); ++b)
      (b < instruments.size() ? file.motion.poses : file.organs)
          .back()
          .push_back(read_pose(row, columns[b], unit, where));
    read_grips(row, grip_columns, where, file.motion.grips);
  }
  if (file.motion.times.empty())
    throw Error(ErrorKind::format, "{}: no poses; a header and at least one line are needed", path.string());
  return file;
}

void write_motion(const std::filesystem::path& path, const MotionFile& file,
                  const std::vector<std::string>& instruments, const std::vector<std::string>& organs) {
  std::vector<std::string> bodies = instruments;
  bodies.insert(bodies.end(), organs.begin(), organs.end());
  std::string text = "time";
  for (const std::string& b : bodies)
    for (const char* c : pose_columns) text += "," + b + "." + c;
  const bool grips = !file.motion.grips.empty();
  for (std::size_t i = 0; i < instruments.size() && grips; ++i) text += "," + instruments[i] + ".grip";
  text += "\n";
  for (std::size_t k = 0; k < file.motion.times.size(); ++k) {
    text += fmt::format("{}", file.motion.times[k]);
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const Pose& p =
          b < instruments.size() ? file.motion.poses[k][b] : file.organs[k][b - instruments.size()];
      text += fmt::format(",{},{},{},{},{},{},{}", p.translation.x(), p.translation.y(), p.translation.z(),
                          p.rotation.w(), p.rotation.x(), p.rotation.y(), p.rotation.z());
    }
    for (std::size_t i = 0; i < instruments.size() && grips; ++i)
      text += fmt::format(",{}", file.motion.grips[k][i]);
    text += "\n";
  }
  AtomicFile out(path);
  out.write(text);
  out.commit();
}

Input input_at(const MotionFile& file, double time, std::size_t organ) {
  Input input;
  input.instruments.resize(file.motion.poses.front().size());
  set_input(file, time, input, organ);
  return input;
}

void set_inputs(const MotionFile& file, double time, std::span<Input> inputs) noexcept {
  for (std::size_t organ = 0; organ < inputs.size(); ++organ) set_input(file, time, inputs[organ], organ);
}

void set_input(const MotionFile& file, double time, Input& input, std::size_t organ) noexcept {
  const std::vector<double>& times = file.motion.times;
  const auto after =
      static_cast<std::size_t>(std::upper_bound(times.begin(), times.end(), time) - times.begin());
  const std::size_t a = after == 0 ? 0 : after - 1, b = std::min(after, times.size() - 1);
  const double t = a == b ? 0 : (time - times[a]) / (times[b] - times[a]);
  input.time = time;
  input.organ = between(file.organs[a][organ], file.organs[b][organ], t);
  for (std::size_t i = 0; i < std::min(input.instruments.size(), file.motion.poses[a].size()); ++i)
    input.instruments[i] = between(file.motion.poses[a][i], file.motion.poses[b][i], t);
  input.grips.resize(input.instruments.size());
  for (std::size_t i = 0; i < input.grips.size(); ++i)
    input.grips[i] = after > 0 && i < file.motion.poses[a].size() && !file.motion.grips.empty() &&
                     file.motion.grips[a][i] != 0;
}

}  // namespace palpate
