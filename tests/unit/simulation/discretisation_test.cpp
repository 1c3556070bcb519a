#include "palpate/simulation/discretisation.hpp"

#include <gtest/gtest.h>

#include "fixtures.hpp"
#include "palpate/compliance/ordering.hpp"

namespace palpate {
namespace {

PinchResult pinched(int cells, int order, bool everywhere = true, double poisson = 0.45) {
  Organ organ = block_organ(cells, {.order = order, .pinch = false});
  organ.materials[0].poisson = poisson;
  const ElementNodes nodes = element_nodes(organ.mesh, order);
  const FreeStiffness k = remove_anchored(assemble_stiffness(organ.mesh, nodes, organ.materials),
                                          with_middles(anchored_nodes(organ.mesh, organ.anchors), nodes));
  return pinch(organ, nodes, k, Cholesky(k.matrix, nested_dissection(k.matrix)), {}, everywhere);
}

// The reference of linear tetrahedra is what quadratic ones give, which another path computes.
TEST(Discretisation, OfLinearTetrahedraAgainstQuadraticOnes) {
  for (const double poisson : {0.3, 0.45}) {
    const PinchResult linear = pinched(6, 1, true, poisson), quadratic = pinched(6, 2, true, poisson);
    const double error = quadratic.work / linear.work - 1;
    EXPECT_GT(error, 0.02);
    EXPECT_NEAR(linear.figures.stiffness, error, 0.05 * error) << poisson;
    EXPECT_GT(linear.figures.displacement, 0.01);
    EXPECT_EQ(linear.figures.against, 2);
  }
}

TEST(Discretisation, FallsWithTheOrderAndWithFinerMeshes) {
  double last = 1;
  for (const int cells : {4, 8}) {
    const PinchResult linear = pinched(cells, 1), quadratic = pinched(cells, 2);
    EXPECT_GT(quadratic.figures.stiffness, 0);
    EXPECT_LT(quadratic.figures.stiffness, 0.2 * linear.figures.stiffness);
    EXPECT_LT(quadratic.figures.stiffness, last);
    EXPECT_EQ(quadratic.figures.against, 3);
    last = quadratic.figures.stiffness;
  }
}

TEST(Discretisation, NearTheJawsIsMostOfIt) {
  const double near = pinched(10, 2, false).figures.stiffness, all = pinched(10, 2, true).figures.stiffness;
  EXPECT_LE(near, all * 1.02);
  EXPECT_GT(near, 0.7 * all);
}

TEST(Discretisation, JawsAreAcrossFromTheAnchor) {
  const Discretisation d = pinched(6, 1).figures;
  EXPECT_NEAR(d.at.z(), 0.1, 1e-12);
  EXPECT_LT(std::hypot(d.at.x(), d.at.y()), 0.02);
}

TEST(Discretisation, IsOfTheModel) {
  const Organ organ = block_organ(4, {.order = 2});
  EXPECT_EQ(organ.discretisation.against, 3);
  EXPECT_GT(organ.discretisation.stiffness, 0);
  EXPECT_NE(to_string(organ.discretisation).find("too stiff"), std::string::npos);
  EXPECT_EQ(block_organ(4).discretisation.against, 0);
}

}  // namespace
}  // namespace palpate
