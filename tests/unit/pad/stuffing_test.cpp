#include "palpate/pad/stuffing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "palpate/geometry/check.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

// The bounds of the paper.
constexpr double least_angle = 10.7, largest_angle = 164.8;

PadOptions with_spacing(double cell) {
  PadOptions o;
  o.spacing = cell;
  return o;
}

long euler(const TriangleMesh& m) {
  return static_cast<long>(m.vertices.size()) - static_cast<long>(m.triangles.size()) / 2;
}

// Closed, two faces an edge, one fan a vertex; angles within the bounds; volumes add up.
void expect_sound(const Padded& padded) {
  const TriangleMesh b = boundary(padded.mesh).surface;
  const MeshReport r = check(b);
  EXPECT_EQ(r.open_edges, 0u);
  EXPECT_EQ(r.nonmanifold_edges, 0u);
  EXPECT_EQ(r.flipped_edges, 0u);
  std::vector<std::size_t> triangles(b.vertices.size(), 0);
  for (const Triangle& t : b.triangles)
    for (const Index v : t) ++triangles[static_cast<std::size_t>(v)];
  for (std::size_t v = 0; v < b.vertices.size(); ++v) {  // walk round each vertex
    std::vector<std::pair<Index, Index>> spokes;
    for (const Triangle& t : b.triangles)
      for (std::size_t k = 0; k < 3; ++k)
        if (static_cast<std::size_t>(t[k]) == v) spokes.emplace_back(t[(k + 1) % 3], t[(k + 2) % 3]);
    Index at = spokes[0].first;
    std::size_t steps = 0;
    do {
      for (const auto& [from, to] : spokes)
        if (from == at) {
          at = to;
          break;
        }
      ++steps;
    } while (at != spokes[0].first && steps <= spokes.size());
    ASSERT_EQ(steps, triangles[v]) << "several fans at vertex " << v;
  }
  EXPECT_GE(padded.report.quality.min_dihedral, least_angle);
  EXPECT_LE(padded.report.quality.max_dihedral, largest_angle);
  EXPECT_EQ(padded.report.quality.inverted, 0u);
  EXPECT_NEAR(padded.report.quality.volume, r.volume, 1e-9 * r.volume);
  // Where all features are larger than the elements.
  if (padded.report.missed.empty() && padded.report.kept == 0) {
    EXPECT_LE(padded.report.boundary_off, 0.5 * padded.report.spacing);
  }
  EXPECT_LE(padded.report.boundary_off, padded.report.spacing);
}

TEST(Stuffing, ReachesTheNumberOfSurfaceNodes) {
  const TriangleMesh kidney = make_kidney(3000);
  for (const int nodes : {100, 1000, 10000}) {
    PadOptions o;
    o.surface_nodes = nodes;
    const Padded padded = pad(kidney, {}, o);
    if (nodes <= 1000) expect_sound(padded);
    EXPECT_NEAR(static_cast<double>(padded.report.surface_nodes), nodes, 0.1 * nodes);
    EXPECT_EQ(boundary(padded.mesh).nodes.size(), padded.report.surface_nodes);
    EXPECT_TRUE(padded.report.missed.empty());
    // Facets inside of a convex surface: the volume is short by the order of the cell squared.
    EXPECT_NEAR(padded.report.quality.volume / volume(kidney), 1, 12.0 / nodes);
  }
}

TEST(Stuffing, TopologyOfTheSolid) {
  const TriangleMesh torus = make_torus(0.06, 0.02, 60, 40);
  const Padded padded = pad(torus, {}, with_spacing(0.006));
  expect_sound(padded);
  EXPECT_EQ(euler(boundary(padded.mesh).surface), 0);
  TriangleMesh shell = make_sphere(Vec3::Zero(), 1, 40, 80);  // a hollow organ
  const TriangleMesh cavity = make_sphere(Vec3(0.1, 0, 0), 0.5, 40, 80);
  for (Triangle t : cavity.triangles) {
    for (Index& v : t) v += static_cast<Index>(shell.vertices.size());
    std::swap(t[0], t[1]);
    shell.triangles.push_back(t);
  }
  shell.vertices.insert(shell.vertices.end(), cavity.vertices.begin(), cavity.vertices.end());
  const Padded hollow = pad(shell, {}, with_spacing(0.15));
  expect_sound(hollow);
  EXPECT_EQ(euler(boundary(hollow.mesh).surface), 4);
  EXPECT_NEAR(hollow.report.quality.volume, 4.0 / 3 * M_PI * (1 - 0.125), 0.1);
}

TEST(Stuffing, AnglesKeepToTheBoundsWhateverTheShape) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  double least = 180, largest = 0;
  for (int i = 0; i < 60; ++i) {
    const Vec3 middle(unit(random), unit(random), unit(random));
    const double cell = 0.1 + 0.4 * unit(random), height = 0.6 * unit(random), waves = 1 + 6 * unit(random);
    const TriangleMesh mesh = make_star_shaped(middle, 16, [&](const Vec3& way) {
      return 1 +
             height * std::sin(waves * way.x() + 1) * std::cos(waves * way.y()) * std::sin(waves * way.z());
    });
    const Padded padded = pad(mesh, {}, with_spacing(cell));
    SCOPED_TRACE(i);
    expect_sound(padded);
    least = std::min(least, padded.report.quality.min_dihedral);
    largest = std::max(largest, padded.report.quality.max_dihedral);
  }
  RecordProperty("least", std::to_string(least));
  RecordProperty("largest", std::to_string(largest));
}

// Two tips that touch at less than a cell: without the check for pinched nodes the boundary is no manifold.
TEST(Stuffing, PinchedPlacesAreMended) {
  std::size_t kept = 0;
  for (int i = 0; i < 40; ++i) {
    const double gap = 0.02 * (i - 20);
    TriangleMesh two = make_sphere(Vec3(-1.001 - 0.5 * gap, 0.01 * i, 0), 1, 30, 60);
    const TriangleMesh other = make_sphere(Vec3(1.001 + 0.5 * gap, 0, 0.013 * i), 1, 30, 60);
    for (Triangle t : other.triangles) {
      for (Index& v : t) v += static_cast<Index>(two.vertices.size());
      two.triangles.push_back(t);
    }
    two.vertices.insert(two.vertices.end(), other.vertices.begin(), other.vertices.end());
    const Padded padded = pad(two, {}, with_spacing(0.3));
    SCOPED_TRACE(i);
    expect_sound(padded);
    kept += padded.report.kept;
  }
  EXPECT_GT(kept, 0u);
}

TEST(Stuffing, RegionsFollowTheirSurfaces) {
  const TriangleMesh kidney = make_kidney(3000), stone = make_stone(600);
  PadOptions o;
  o.surface_nodes = 3000;
  o.name = "kidney";
  const Padded padded = pad(kidney, {{"stone", stone}}, o);
  expect_sound(padded);
  ASSERT_EQ(padded.mesh.region_names, (std::vector<std::string>{"kidney", "stone"}));
  double inside = 0, error = 0;
  const SignedDistanceField field(stone);
  for (std::size_t i = 0; i < padded.mesh.tets.size(); ++i) {
    const Tetrahedron& t = padded.mesh.tets[i];
    Vec3 middle = Vec3::Zero();
    for (const Index v : t) middle += padded.mesh.nodes[static_cast<std::size_t>(v)] / 4;
    const double d = field.at(middle).distance;
    if (padded.mesh.regions[i] == 1) inside += six_volume(padded.mesh, t) / 6;
    if ((d < 0) != (padded.mesh.regions[i] == 1)) error = std::max(error, std::abs(d));
  }
  EXPECT_NEAR(inside / volume(stone), 1, 0.1);
  EXPECT_LT(error, 0.4 * padded.report.spacing);
}

TEST(Stuffing, SmallFeaturesAreReportedAndIslandsDropped) {
  const TriangleMesh needle = make_star_shaped(Vec3::Zero(), 40, [](const Vec3& way) {
    return 1 + std::exp(-400 * (way - Vec3::UnitZ()).squaredNorm());
  });
  const Padded padded = pad(needle, {}, with_spacing(0.25));
  expect_sound(padded);
  ASSERT_FALSE(padded.report.missed.empty());
  EXPECT_NEAR((padded.report.missed[0].at - Vec3(0, 0, 2)).norm(), 0, 0.3);
  EXPECT_GT(padded.report.missed_area, 0);
  EXPECT_EQ(check(boundary(padded.mesh).surface).components, 1u);
}

void drop_unused(TriangleMesh& mesh) {
  std::vector<Index> number(mesh.vertices.size(), -1);
  std::vector<Vec3> used;
  for (Triangle& t : mesh.triangles)
    for (Index& v : t) {
      Index& n = number[static_cast<std::size_t>(v)];
      if (n < 0)
        n = static_cast<Index>(used.size()), used.push_back(mesh.vertices[static_cast<std::size_t>(v)]);
      v = n;
    }
  mesh.vertices = used;
}

TEST(Stuffing, GivesUpWithAReason) {
  const auto message = [](const TriangleMesh& mesh, const PadOptions& o) -> std::string {
    try {
      pad(mesh, {}, o);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  TriangleMesh open = make_box({Vec3(-1, -1, -1), Vec3(1, 1, 1)}, 8);
  std::erase_if(open.triangles, [&](const Triangle& t) {  // a side, but for its rim
    return std::all_of(t.begin(), t.end(), [&](Index v) {
      const Vec3& p = open.vertices[static_cast<std::size_t>(v)];
      return p.z() == 1 && std::abs(p.x()) < 0.8 && std::abs(p.y()) < 0.8;
    });
  });
  drop_unused(open);
  EXPECT_NE(message(open, with_spacing(0.1)).find("is open"), std::string::npos);
  PadOptions repair = with_spacing(0.1);
  repair.repair = true;
  EXPECT_NE(message(open, repair).find("far from the surface"), std::string::npos);
  const TriangleMesh plate = make_box({Vec3(0, 0, 0), Vec3(1, 1, 0.001)});
  EXPECT_NE(message(make_torus(1, 0.001, 60, 10), with_spacing(0.3)).find("too little inside"),
            std::string::npos);
  EXPECT_NE(message(plate, with_spacing(1e-7)).find("too small"), std::string::npos);
  EXPECT_NE(message(plate, with_spacing(-1)).find("spacing"), std::string::npos);
  PadOptions few;
  few.surface_nodes = 3;
  EXPECT_NE(message(plate, few).find("20"), std::string::npos);
}

TEST(Stuffing, AHoleSmallerThanAnElementIsBridged) {
  TriangleMesh sphere = make_sphere(Vec3::Zero(), 1, 40, 80);
  sphere.triangles.erase(sphere.triangles.begin() + 3000, sphere.triangles.begin() + 3004);
  PadOptions o = with_spacing(0.2);
  o.repair = true;
  const Padded padded = pad(sphere, {}, o);
  expect_sound(padded);
  EXPECT_NEAR(padded.report.quality.volume, 4.0 / 3 * M_PI, 0.1);
}

}  // namespace
}  // namespace palpate
