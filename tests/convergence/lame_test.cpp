// A thick hollow sphere under inner pressure against Lame's solution.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "support/hollow_sphere.hpp"
#include "support/validation_table.hpp"

namespace palpate::test {
namespace {

TEST(Lame, HollowSphereUnderPressure) {
  // Straight sides: facets cut the sphere short by h^2, which is what is left of the displacement's error.
  struct Case {
    double poisson, stress;
  };
  for (const auto& [poisson, stress] : {Case{0.3, 0.01}, {0.45, 0.015}, {0.49, 0.04}})
    for (const int cells : {2, 4, 8}) {
      HollowSphere sphere;
      sphere.material.poisson = poisson;
      const SphereErrors e = sphere_errors(sphere, 2, cells, cells);
      std::printf("P2, nu %.2f, %d cells, %zu nodes: radial displacement %.2f %%, stress %.2f %%\n", poisson,
                  cells, e.nodes, 100 * e.displacement, 100 * e.stress);
      validation_row(
          "lame", "order,poisson,cells,nodes,displacement_error,stress_error",
          fmt::format("2,{},{},{},{:.4g},{:.4g}", poisson, cells, e.nodes, e.displacement, e.stress));
      if (cells < 8) continue;
      EXPECT_LT(e.displacement, 0.006) << poisson;
      EXPECT_LT(e.stress, stress) << poisson;
    }
}

}  // namespace
}  // namespace palpate::test
