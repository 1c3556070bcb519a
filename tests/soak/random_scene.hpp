// Random organs, instruments and ways for the soak test; all from a seed, the same on every machine.
#pragma once

#include <memory>
#include <random>

#include "palpate/simulation/organs.hpp"

namespace palpate::soak {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(engine_() % n); }
  bool once_in(std::size_t n) { return below(n) == 0; }
  Vec3 in_box(const Box& box) {
    Vec3 p;
    for (int a = 0; a < 3; ++a) p[a] = between(box.min[a], box.max[a]);
    return p;
  }
  Vec3 direction();
  Pose pose_in(const Box& box);

 private:
  std::mt19937_64 engine_;
};

// Blocks and blobs of a few hundred surface nodes, linear and quadratic, in every storage.
std::vector<Organ> make_organs();
// One to three of them, one to three instruments, a mode and settings.
std::vector<Model> random_models(const std::vector<Organ>& organs, Random& random);

// A way from one random pose to the next, slow or fast.
class Wanderer {
 public:
  Wanderer(const Box& where, Random& random) : where_(where), from_(random.pose_in(where)), to_(from_) {}
  Pose next(Random& random);

 private:
  Box where_;
  Pose from_, to_;
  int steps_ = 0, step_ = 0;
};

}  // namespace palpate::soak
