// Scene files (TOML) and motions (CSV): what `palpate simulate` runs. docs/scenes.md shows both with units.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/simulation/organs.hpp"

namespace palpate {

// Poses over time, one row a key: time_s, then per instrument x y z (m) qw qx qy qz. Between keys: linear and
// slerp.
struct Motion {
  std::vector<double> times;             // s, increasing
  std::vector<std::vector<Pose>> poses;  // [key][instrument]
  // Likewise, not 0: the grip is closed from this key on. Or empty: none ever is.
  std::vector<std::vector<std::uint8_t>> grips;
};
// Header line names the columns: time, NAME.x, NAME.y, NAME.z, NAME.qw, NAME.qx, NAME.qy, NAME.qz
// (an instrument's name or an organ's), and of an instrument NAME.grip, 0 or 1. Missing columns: fixed, open.
// Error(format) with the line.
struct MotionFile {
  Motion motion;                          // of the instruments, in the given order
  std::vector<std::vector<Pose>> organs;  // [key][organ]
  std::vector<std::uint8_t> moved;        // of each instrument: the file has a column of its pose
};
MotionFile read_motion(const std::filesystem::path& path, const std::vector<std::string>& instruments,
                       double unit = 1.0, const std::vector<std::string>& organs = {"organ"});
void write_motion(const std::filesystem::path& path, const MotionFile& motion,
                  const std::vector<std::string>& instruments,
                  const std::vector<std::string>& organs = {"organ"});
Input input_at(const MotionFile& motion, double time, std::size_t organ = 0);
// The same without allocating, into an input that has its instruments and grips; into one an organ.
void set_input(const MotionFile& motion, double time, Input& input, std::size_t organ = 0) noexcept;
void set_inputs(const MotionFile& motion, double time, std::span<Input> inputs) noexcept;

struct Scene {
  std::vector<Model> models;        // one an organ, the same instruments in all (organs.hpp)
  std::vector<std::string> organs;  // their names; a single [organ] is "organ"
  MotionFile motion;
  double dt = 0.001;      // s
  std::size_t steps = 0;  // to the end of the motion unless given
};
// Paths in the file are relative to the file. Bakes what is not baked: an organ given as a surface or as
// tetrahedra is padded and precomputed, an instrument given as a surface becomes a lattice.
Scene read_scene(const std::filesystem::path& path, int threads = 0, const Progress& progress = {});

// What the author of a scene may not have thought of, a sentence each: instruments that are thick by their
// box, but in places thinner than the organs' triangles, where they are felt at nodes only (Instrument::tip).
std::vector<std::string> advice(const Scene& scene);
// How thin a solid is through its surface's triangles, m; `most` where it is nowhere thinner.
double thinnest_part(const Instrument& instrument, double most);

}  // namespace palpate
