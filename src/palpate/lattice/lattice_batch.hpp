// Interpolation at many points at once, by the best instructions at hand.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/base/half.hpp"
#include "palpate/base/simd.hpp"

namespace palpate {

enum class Interpolation : std::uint8_t { trilinear, hermite };

struct BatchView {
  const float* values = nullptr;         // z fastest, in a grid of `stored` places, m
  const std::uint64_t* quads = nullptr;  // or null: see Lattice
  const float* jets = nullptr;           // for hermite: distance (m) and gradient of each grid point
  std::array<std::int32_t, 3> n{};
  std::array<std::int32_t, 3> stored{};  // n, or more along y and z
  std::array<float, 3> origin{};
  float h = 0;
};

struct BatchOut {
  float* distance;  // n, m
  float* gradient;  // 3 n, x y z ...; or null
  float* outside;   // n; not 0: outside the grid, where the rest is that of its nearest point, or no number
};

// At n points, x y z ... At most 2^31 - 1 grid points. The same bits for every simd.
void interpolate_batch(const BatchView& view, Interpolation how, Simd simd, const float* points,
                       std::size_t n, const BatchOut& out);

}  // namespace palpate
