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

constexpr std::size_t batch_size = 128;

// Up to batch_size points (x y z ...): distances, gradients (x y z ..., or null), and which are outside the
// grid (there the values are those at the nearest point of the box). At most 2^31 - 1 grid points. The same
// bits for every simd.
void interpolate_batch(const BatchView& view, Simd simd, const float* points, std::size_t n, float* distance,
                       float* gradient, std::uint8_t* outside);

}  // namespace palpate
