// Trilinear interpolation of many points at once, by the best instructions at hand.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/base/simd.hpp"

namespace palpate {

std::uint16_t to_half(float x);  // nearest, ties to even; overflow: infinity
float from_half(std::uint16_t half);

struct BatchView {
  const float* values = nullptr;         // z fastest, m
  const std::uint64_t* quads = nullptr;  // or null: see Lattice
  std::array<std::int32_t, 3> n{};
  std::array<float, 3> origin{};
  float h = 0;
};

// Distances and gradients (x y z ..., or null) at n points (x y z ...). Outside the grid, and where a point
// is no number, the distance is no number and the gradient means nothing. At most 2^31 - 1 grid points. The
// same bits for every simd.
void interpolate_batch(const BatchView& view, Simd simd, const float* points, std::size_t n, float* distance,
                       float* gradient);

}  // namespace palpate
