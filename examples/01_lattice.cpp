// A rigid body as a lattice: a surface in, distances out.
// example_01_lattice [surface file, in metres]: without a file, a torus.
#include <cstdio>

#include "palpate/geometry/shapes.hpp"
#include "palpate/io/surface_file.hpp"
#include "palpate/lattice/lattice.hpp"

using namespace palpate;

int main(int argc, char** argv) try {
  // 1. A closed surface: triangles, metres.
  const TriangleMesh surface = argc > 1 ? read_surface(argv[1]).mesh : make_torus(0.03, 0.01, 64, 32);

  // 2. Exact signed distances at the points of a regular grid, 40 cells along the shortest side.
  const SignedDistanceField field(surface);
  const Box box = bounding_box(surface.vertices);
  const LatticeSamples samples = sample_lattice(field, make_grid(box, 40));
  std::printf("%zu triangles, %d x %d x %d points, sign by %s\n", surface.triangles.size(), samples.grid.n[0],
              samples.grid.n[1], samples.grid.n[2], name(samples.sign));

  // 3. Asking it: some nanoseconds a question, from any thread.
  const Lattice lattice(samples);
  for (const double t : {0.03, 0.13, 0.26, 0.47, 0.92}) {
    const Vec3 p = box.min + t * box.size();
    const LatticeSample s = lattice.sample(p);
    std::printf("(%7.4f %7.4f %7.4f) m: %9.6f m from the surface, which is exactly %9.6f m\n", p.x(), p.y(),
                p.z(), s.distance, field.at(p).distance);
  }

  // 4. What trilinear interpolation costs in accuracy.
  const InterpolationError error = estimate_error(field, samples, 10000);
  std::printf("interpolation error: at most %.2g m, %.2g m root mean square\n", error.max, error.rms);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
