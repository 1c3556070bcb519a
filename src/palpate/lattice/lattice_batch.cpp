// Points' cells are found and their memory is asked for, a little later they are interpolated; 16 points at a
// time with AVX-512. Built without contraction to fused multiply-adds, so that all instruction sets give the
// same bits.
#include "palpate/lattice/lattice_batch.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "palpate/lattice/instruction_sets.hpp"

namespace palpate {

namespace {

// Points whose cells are found, and their memory asked for, ahead of the interpolation.
constexpr std::size_t most_ahead = 128;
constexpr std::size_t cache = std::size_t{3} << 19;  // what is smaller needs no asking

struct alignas(64) Cells {
  std::int32_t first[most_ahead];  // number of the cell's lowest point
  float t[3][most_ahead];          // where in the cell: 0..1 along each axis
  float outside[most_ahead];       // 0: within the grid
};

template <class From, class To>
[[gnu::always_inline]] inline void convert(const From& from, To& to) {
  if constexpr (std::is_arithmetic_v<To>)
    to = static_cast<To>(from);
  else
    to = __builtin_convertvector(from, To);
}

// n: of these points, up to Kernel::width.
template <class Kernel>
[[gnu::always_inline]] inline void locate(const BatchView& view, const float* points, std::size_t n,
                                          std::size_t slot, Cells& cells) {
  using V = typename Kernel::V;
  using I = typename Kernel::I;
  const float inverse = 1 / view.h;
  float last[3 * Kernel::width] = {};
  if (n < Kernel::width) std::memcpy(last, points, 3 * n * sizeof(float));
  V x[3];
  Kernel::split(n < Kernel::width ? last : points, x);
  I first{};
  V outside{};
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int32_t cells_along = view.n[a] - 1;
    const V zero{}, end = zero + static_cast<float>(cells_along);
    const V at = (x[a] - view.origin[a]) * inverse;
    V in = at > 0 ? at : zero;  // 0 where it is no number
    in = in < end ? in : end;
    outside += (at - in) * (at - in);
    I cell;
    convert(in, cell);
    cell = cell < cells_along ? cell : I{} + (cells_along - 1);
    V t;
    convert(cell, t);
    t = in - t;
    std::memcpy(cells.t[a] + slot, &t, sizeof t);
    first = first * view.stored[a] + cell;
  }
  std::memcpy(cells.first + slot, &first, sizeof first);
  std::memcpy(cells.outside + slot, &outside, sizeof outside);
}

// Asks for a cell's memory: `unit` bytes a grid point, `rows` rows of them.
[[gnu::always_inline]] inline void prefetch(const BatchView& view, const char* base, std::size_t unit,
                                            std::size_t rows, const std::int32_t* first, std::size_t n) {
  const auto row = static_cast<std::size_t>(view.stored[2]) * unit,
             sheet = row * static_cast<std::size_t>(view.stored[1]);
  for (std::size_t i = 0; i < n; ++i) {
    const char* at = base + static_cast<std::size_t>(first[i]) * unit;
    for (std::size_t m = 0; m < rows; ++m) __builtin_prefetch(at + (m >> 1) * sheet + (m & 1) * row, 0, 2);
  }
}

// A value and, where wanted, its derivatives along x, y, z, a cell's side as the unit.
template <class V>
struct Jets {
  V value, slope[3];
};

// T 5.2.2.
struct Trilinear {
  static std::size_t unit(const BatchView& view) { return view.quads ? 8 : 4; }
  static std::size_t rows(const BatchView& view) { return view.quads ? 1 : 4; }
  static const void* base(const BatchView& view) {
    return view.quads ? static_cast<const void*>(view.quads) : view.values;
  }
  template <class Kernel, class V = typename Kernel::V>
  [[gnu::always_inline]] static inline void at(const BatchView& view, const std::int32_t* first, const V* t,
                                               bool slopes, Jets<V>& out) {
    V c[8];
    Kernel::corners(view, first, c);
    const V z00 = c[1] - c[0], z01 = c[3] - c[2], z10 = c[5] - c[4], z11 = c[7] - c[6];
    const V a00 = c[0] + t[2] * z00, a01 = c[2] + t[2] * z01, a10 = c[4] + t[2] * z10,
            a11 = c[6] + t[2] * z11;
    const V y0 = a01 - a00, y1 = a11 - a10, b0 = a00 + t[1] * y0, b1 = a10 + t[1] * y1, x = b1 - b0;
    const float scale = view.quads ? view.h : 1;
    out.value = (b0 + t[0] * x) * scale;
    if (!slopes) return;
    const V e0 = z00 + t[1] * (z01 - z00), e1 = z10 + t[1] * (z11 - z10);
    out.slope[0] = x * scale, out.slope[1] = (y0 + t[0] * (y1 - y0)) * scale;
    out.slope[2] = (e0 + t[0] * (e1 - e0)) * scale;
  }
};

// Distances and their exact gradients: the trilinear interpolant, and along each of the cell's edges what the
// cubic through both ends' slopes adds to the line, blended across bilinearly: the 32-parameter brick of
// Adini & Clough (1960). Exact for polynomials of degree three, so of fourth order where the distance is
// smooth.
struct Hermite {
  // Slopes along an edge that differ by more belong to opposite sides of the medial axis or of a sharp edge.
  static constexpr float kink = 0.5f;
  static std::size_t unit(const BatchView&) { return 4 * sizeof(float); }
  static std::size_t rows(const BatchView&) { return 4; }
  static const void* base(const BatchView& view) { return view.jets; }

  template <class Kernel, class V = typename Kernel::V>
  [[gnu::always_inline]] static inline void at(const BatchView& view, const std::int32_t* first, const V* t,
                                               bool slopes, Jets<V>& out) {
    const std::ptrdiff_t row = view.stored[2], sheet = row * view.stored[1];
    V c[8][4];  // corner 4 i + 2 j + k: distance in units of h, gradient
    for (std::size_t m = 0; m < 8; ++m) {
      const auto bit = [&](unsigned b) { return static_cast<std::ptrdiff_t>(m >> b & 1); };
      Kernel::jets(view.jets + 4 * (bit(2) * sheet + bit(1) * row + bit(0)), first, c[m]);
      c[m][0] *= 1 / view.h;
    }
    const V zero{};
    out = {zero, {zero, zero, zero}};
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t u = a == 0 ? 1 : 0, v = a == 2 ? 1 : 2;  // the other axes
      const V r = 1 - t[a], wu[] = {1 - t[u], t[u]}, wv[] = {1 - t[v], t[v]};
      for (std::size_t i = 0; i < 2; ++i)
        for (std::size_t j = 0; j < 2; ++j) {
          const std::size_t m = (i << (2 - u)) + (j << (2 - v)), n = m + (std::size_t{4} >> a);
          const V line = c[n][0] - c[m][0], jump = c[n][1 + a] - c[m][1 + a], jump2 = jump * jump;
          const V p = jump2 < kink * kink ? c[m][1 + a] - line : zero,
                  q = jump2 < kink * kink ? c[n][1 + a] - line : zero;
          const V bend = t[a] * r * (r * p - t[a] * q),
                  slope = r * (1 - 3 * t[a]) * p - t[a] * (2 - 3 * t[a]) * q;
          const V w = wu[i] * wv[j];
          if (a == 0) out.value += w * (c[m][0] + t[a] * line);
          out.value += w * bend;
          if (!slopes) continue;
          out.slope[a] += w * (line + slope);
          out.slope[u] += (i ? wv[j] : -wv[j]) * bend;
          out.slope[v] += (j ? wu[i] : -wu[i]) * bend;
        }
    }
    out.value *= view.h;
    for (V& slope : out.slope) slope *= view.h;
  }
};

template <class Kernel, class Interpolant>
[[gnu::always_inline]] inline void interpolate(const BatchView& view, const Cells& cells, std::size_t slot,
                                               std::size_t n, const BatchOut& out) {
  using V = typename Kernel::V;
  V t[3];
  for (std::size_t a = 0; a < 3; ++a) std::memcpy(&t[a], cells.t[a] + slot, sizeof(V));
  Jets<V> jets;
  Interpolant::template at<Kernel>(view, cells.first + slot, t, out.gradient != nullptr, jets);
  std::memcpy(out.distance, &jets.value, n == Kernel::width ? sizeof(V) : n * sizeof(float));
  std::memcpy(out.outside, cells.outside + slot, n == Kernel::width ? sizeof(V) : n * sizeof(float));
  if (!out.gradient) return;
  const float inverse = 1 / view.h;
  for (V& slope : jets.slope) slope *= inverse;
  if (n == Kernel::width) return Kernel::join(jets.slope, out.gradient);
  float last[3 * Kernel::width];
  Kernel::join(jets.slope, last);
  std::memcpy(out.gradient, last, 3 * n * sizeof(float));
}

// A ring: while some points are interpolated the memory of the next ones is on its way.
template <class Kernel, class Interpolant>
[[gnu::always_inline]] inline void run(const BatchView& view, const float* points, std::size_t n,
                                       const BatchOut& out) {
  constexpr std::size_t width = Kernel::width;
  const std::size_t ahead = std::min(most_ahead, (n + width - 1) / width * width);
  const std::size_t grid = std::size_t(view.n[0]) * std::size_t(view.stored[1]) * std::size_t(view.stored[2]);
  const std::size_t unit = Interpolant::unit(view);
  const bool ask = n > width && grid * unit > cache;
  Cells cells;
  for (std::size_t i = 0, slot = 0; i < n + ahead; i += width, slot = (slot + width) % ahead) {
    if (i >= ahead) {
      const std::size_t at = i - ahead;
      interpolate<Kernel, Interpolant>(
          view, cells, slot, std::min(width, n - at),
          {out.distance + at, out.gradient ? out.gradient + 3 * at : nullptr, out.outside + at});
    }
    if (i < n) {
      locate<Kernel>(view, points + 3 * i, std::min(width, n - i), slot, cells);
      if (ask)
        prefetch(view, static_cast<const char*>(Interpolant::base(view)), unit, Interpolant::rows(view),
                 cells.first + slot, width);
    }
  }
}

using Run = void(const BatchView&, const float*, std::size_t, const BatchOut&);
template <class Interpolant>
void run_portable(const BatchView& v, const float* p, std::size_t n, const BatchOut& out) {
  run<Eight, Interpolant>(v, p, n, out);
}
template <class Interpolant>
void run_one(const BatchView& v, const float* p, std::size_t n, const BatchOut& out) {
  run<One, Interpolant>(v, p, n, out);
}
#if defined(__x86_64__)
template <class Interpolant>
[[gnu::flatten]] PALPATE_AVX2 void run_avx2(const BatchView& v, const float* p, std::size_t n,
                                            const BatchOut& out) {
  run<Avx2, Interpolant>(v, p, n, out);
}
template <class Interpolant>
[[gnu::flatten]] PALPATE_AVX512 void run_avx512(const BatchView& v, const float* p, std::size_t n,
                                                const BatchOut& out) {
  run<Avx512, Interpolant>(v, p, n, out);
}
#endif

template <class Interpolant>
Run* chosen(std::size_t n, Simd simd) {
  if (n == 1) return run_one<Interpolant>;
#if defined(__x86_64__)
  if (simd == Simd::avx2) return run_avx2<Interpolant>;
  if (simd == Simd::avx512) return run_avx512<Interpolant>;
#endif
  return run_portable<Interpolant>;
}

}  // namespace

void interpolate_batch(const BatchView& view, Interpolation how, Simd simd, const float* points,
                       std::size_t n, const BatchOut& out) {
  if (n == 0) return;
  Run* const run = how == Interpolation::hermite ? chosen<Hermite>(n, simd) : chosen<Trilinear>(n, simd);
  run(view, points, n, out);
}

}  // namespace palpate
