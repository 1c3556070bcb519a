// What the solver makes of what its caller foresees.
#include "palpate/contact/solver.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

namespace palpate {
namespace {

// A node beside a blade of 0.2 mm that has come up past it, foreseen on the blade's other side, and that not
// by way of the blade but over its edge: it has not gone there.
TEST(ContactSolver, APlaceThatIsForeseenIsNotOnTheWay) {
  HugeArray<float> matrix(9);
  for (std::size_t i = 0; i < 9; ++i) matrix[i] = i % 4 == 0 ? 1e-3f : 0.0f;  // m/N
  const Compliance c = Compliance::dense(std::move(matrix), 1);
  const Shape blade = Cuboid{Vec3(1e-4, 1e-2, 1e-2)};
  const std::vector<PlacedShape> shapes(
      1, PlacedShape(blade, Pose{Eigen::Quaterniond::Identity(), Vec3(0, -1e-2, 0)}));
  for (const double friction : {0.0, 0.3}) {
    SCOPED_TRACE(fmt::format("friction {}", friction));
    ContactBlock block(1, 1, 1);
    ContactSolver solver(1, 1, block.plane());
    const Index row = 0;
    block.require(c, {&row, 1});
    ContactPoint p;
    p.node = p.row = p.instrument = p.slot = 0;
    p.rest = Vec3(-2e-4, -0.3e-3, 0);
    p.path = path_from(shapes[0], shapes[0].to_shape * Vec3(p.rest + Vec3(0, 1e-3, 0)));
    p.foreseen_u = Vec3(0.4e-3, 0, 0);
    const SolveResult r = solver.solve(block, shapes, {&p, 1}, friction, {1e-7, 100, true, true});
    EXPECT_TRUE(r.converged);
    EXPECT_EQ(p.force, Vec3::Zero());
    EXPECT_NEAR(p.gap, 1e-4, 1e-9);
  }
}

}  // namespace
}  // namespace palpate
