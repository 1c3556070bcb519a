// How much linear tetrahedra lock towards incompressibility, and quadratic ones do not: Lame's hollow sphere,
// at equal unknowns and at equal surface nodes. Babuska, Suri, Numer. Math. 62 (1992).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "support/hollow_sphere.hpp"
#include "support/validation_table.hpp"

namespace palpate::test {
namespace {

SphereErrors errors(double poisson, int order, int cells) {
  HollowSphere sphere;
  sphere.material.poisson = poisson;
  const SphereErrors e = sphere_errors(sphere, order, cells, cells);
  std::printf(
      "nu %.3f, P%d, %d cells, %5zu nodes, %4zu surface nodes: displacement %5.2f %%, stress %6.2f %%\n",
      poisson, order, cells, e.nodes, e.surface, 100 * e.displacement, 100 * e.stress);
  validation_row("locking", "poisson,order,cells,nodes,surface_nodes,displacement_error,stress_error",
                 fmt::format("{},{},{},{},{},{:.4g},{:.4g}", poisson, order, cells, e.nodes, e.surface,
                             e.displacement, e.stress));
  return e;
}

// Within a tenth of what docs/validation.md says, for better or worse.
void expect_errors(const SphereErrors& e, double displacement, double stress) {
  EXPECT_NEAR(e.displacement, displacement, 0.1 * displacement);
  EXPECT_NEAR(e.stress, stress, 0.1 * stress);
}

TEST(Locking, LinearAndQuadraticTetrahedra) {
  struct Case {
    double poisson;
    std::array<double, 2> linear, as_many_unknowns, as_much_surface;  // displacement, stress
  };
  for (const Case& c : {Case{0.3, {0.0523, 0.167}, {0.0150, 0.0240}, {0.0040, 0.0062}},
                        {0.45, {0.138, 0.568}, {0.0177, 0.0353}, {0.0044, 0.0110}},
                        {0.49, {0.315, 1.70}, {0.0227, 0.0707}, {0.0050, 0.0343}},
                        {0.499, {0.504, 3.68}, {0.0257, 0.1125}, {0.0069, 0.0910}}}) {
    const SphereErrors linear = errors(c.poisson, 1, 8), as_many_unknowns = errors(c.poisson, 2, 4),
                       as_much_surface = errors(c.poisson, 2, 8);
    EXPECT_EQ(linear.nodes, as_many_unknowns.nodes);
    EXPECT_EQ(linear.surface, as_much_surface.surface);
    expect_errors(linear, c.linear[0], c.linear[1]);
    expect_errors(as_many_unknowns, c.as_many_unknowns[0], c.as_many_unknowns[1]);
    expect_errors(as_much_surface, c.as_much_surface[0], c.as_much_surface[1]);
  }
}

}  // namespace
}  // namespace palpate::test
