#include "palpate/pad/delaunay.hpp"

#include <gtest/gtest.h>

#include <map>

#include "palpate/base/error.hpp"

namespace palpate {
namespace {

struct Sum {
  double volume = 0, least = 1e9;
};
Sum volumes(const std::vector<Vec3>& p, const std::vector<Tetrahedron>& tets) {
  Sum sum;
  for (const auto& t : tets) {
    const auto at = [&](std::size_t i) { return p[static_cast<std::size_t>(t[i])]; };
    const double v = (at(1) - at(0)).cross(at(2) - at(0)).dot(at(3) - at(0)) / 6;
    sum.volume += v, sum.least = std::min(sum.least, v);
  }
  return sum;
}

// Each face belongs to one tetrahedron or two.
bool fits_together(const std::vector<Tetrahedron>& tets) {
  std::map<std::array<Index, 3>, int> faces;
  for (const Tetrahedron& t : tets)
    for (std::size_t f = 0; f < 4; ++f) {
      std::array<Index, 3> face{t[(f + 1) % 4], t[(f + 2) % 4], t[(f + 3) % 4]};
      std::sort(face.begin(), face.end());
      if (++faces[face] > 2) return false;
    }
  return true;
}

TEST(Delaunay, FillsTheHull) {
  std::vector<Vec3> p(500, Vec3::Zero());
  joggle(p, 1.0);
  for (const Vec3& corner : {Vec3(-2, -2, -2), Vec3(2, -2, -2), Vec3(-2, 2, -2), Vec3(-2, -2, 2),
                             Vec3(2, 2, 2), Vec3(2, 2, -2), Vec3(2, -2, 2), Vec3(-2, 2, 2)})
    p.push_back(corner);
  const std::vector<Vec3> before = p;
  const std::vector<Tetrahedron> tets = delaunay(p);
  EXPECT_TRUE(fits_together(tets));
  const Sum sum = volumes(p, tets);
  EXPECT_NEAR(sum.volume, 64, 1e-5);
  EXPECT_GE(sum.least, 0);
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_LT((p[i] - before[i]).norm(), 1e-5);
  // No point inside any circumsphere.
  for (const Tetrahedron& t : tets) {
    const Vec3 a = p[static_cast<std::size_t>(t[0])];
    Mat3 m;
    Vec3 rhs;
    for (int k = 0; k < 3; ++k) {
      const Vec3 d = p[static_cast<std::size_t>(t[static_cast<std::size_t>(k) + 1])] - a;
      m.row(k) = d.transpose(), rhs[k] = d.squaredNorm() / 2;
    }
    if (std::abs(m.determinant()) < 1e-6) continue;
    const Vec3 c = m.inverse() * rhs;
    for (const Vec3& q : p) EXPECT_GT((q - a - c).norm(), c.norm() * (1 - 1e-6));
  }
}

// Cube grids and spheres: everything on common spheres.
TEST(Delaunay, SpecialPositions) {
  std::vector<Vec3> grid, sphere;
  for (int i = 0; i < 216; ++i) grid.push_back(Vec3(i % 6, i / 6 % 6, i / 36));
  for (int i = 0; i < 300; ++i) {
    const double z = 1 - (2 * i + 1) / 300.0, phi = 2.4 * i;
    sphere.push_back(Vec3(std::sqrt(1 - z * z) * std::cos(phi), std::sqrt(1 - z * z) * std::sin(phi), z));
  }
  for (std::vector<Vec3>* p : {&grid, &sphere}) {
    const std::vector<Vec3> before = *p;
    joggle(*p, 1e-6);
    const std::vector<Tetrahedron> tets = delaunay(*p);
    EXPECT_TRUE(fits_together(tets));
    EXPECT_GT(volumes(*p, tets).least, -1e-12);
    if (p == &grid) {
      EXPECT_NEAR(volumes(before, tets).volume, 125, 1e-3);
    }
    for (std::size_t i = 0; i < p->size(); ++i) EXPECT_LT(((*p)[i] - before[i]).norm(), 1e-4);
    std::vector<Vec3> again = before;
    joggle(again, 1e-6);
    EXPECT_EQ(delaunay(again), tets);  // the same every time
  }
}

TEST(Delaunay, Errors) {
  std::vector<Vec3> few(3, Vec3::Zero()), flat;
  for (int i = 0; i < 20; ++i) flat.push_back(Vec3(i % 5, i / 5, 0));
  EXPECT_THROW(delaunay(few), Error);
  std::vector<Vec3> same(10, Vec3(1, 2, 3));
  EXPECT_THROW(delaunay(same), Error);
}

}  // namespace
}  // namespace palpate
