#include "palpate/elasticity/anchor.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <numeric>

#include "palpate/base/error.hpp"
#include "palpate/geometry/shapes.hpp"

namespace palpate {
namespace {

// 3 x 3 x 3 nodes at -1, 0, 1; node 9 i + 3 j + k; the upper half (z > 0) is a region of its own.
TetMesh cube() {
  TetMesh mesh = make_block({Vec3(-1, -1, -1), Vec3(1, 1, 1)}, {2, 2, 2});
  mesh.region_names = {"lower", "upper half"};
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (const Index v : mesh.tets[e])
      if (mesh.nodes[static_cast<std::size_t>(v)].z() > 0.5) mesh.regions[e] = 1;
  return mesh;
}

// b beside a, not joined.
TetMesh both(TetMesh a, const TetMesh& b, const Vec3& shift) {
  const auto first = static_cast<Index>(a.nodes.size());
  for (const Vec3& p : b.nodes) a.nodes.push_back(p + shift);
  for (Tetrahedron t : b.tets) {
    for (Index& v : t) v += first;
    a.tets.push_back(t);
    a.regions.push_back(0);
  }
  return a;
}

std::size_t count(const TetMesh& mesh, const std::string& anchor) {
  const auto flags = anchored_nodes(mesh, {parse_anchor(anchor)});
  EXPECT_EQ(flags.size(), mesh.nodes.size());
  return std::accumulate(flags.begin(), flags.end(), std::size_t{0});
}

std::string message(ErrorKind kind, const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), kind) << e.what();
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    return e.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

TEST(Anchor, EachKindTakesItsNodes) {
  const TetMesh mesh = cube();
  EXPECT_EQ(count(mesh, "box -1 -1 -1 1 1 -1"), 9u);
  EXPECT_EQ(count(mesh, "box 2 2 -0.5 -2 -2 -2"), 9u);  // any two opposite corners
  EXPECT_EQ(count(mesh, "sphere 0 0 0 1"), 7u);
  EXPECT_EQ(count(mesh, "half-space 0 0 0 0 0 -5"), 18u);  // z >= 0; the normal's length means nothing
  EXPECT_EQ(count(mesh, "region upper half"), 18u);
  EXPECT_EQ(count(mesh, "nodes 0, 2,18 18"), 3u);
  const auto flags = anchored_nodes(mesh, {parse_anchor("nodes 0,1"), parse_anchor("nodes 9")});
  EXPECT_EQ(flags[0] + flags[1] + flags[9], 3);
  EXPECT_EQ(std::accumulate(flags.begin(), flags.end(), 0), 3);
}

TEST(Anchor, APlaneThroughNodesTakesThemInSpiteOfRounding) {
  TetMesh mesh = cube();
  for (Vec3& p : mesh.nodes) p = 0.1 * (p + Vec3(3, 3, 3)) - Vec3(0.3, 0.3, 0.3);
  EXPECT_EQ(count(mesh, "half-space 0 0 -0.1 0 0 1"), 9u);
  EXPECT_EQ(count(mesh, "box -0.1 -0.1 -0.1 0.1 0.1 -0.1"), 9u);
}

TEST(Anchor, UnitsScaleLengthsAndNotNormals) {
  const auto half = std::get<AnchorHalfSpace>(parse_anchor("half-space 10 20 30 0 1 0", 1e-3));
  EXPECT_EQ(half.point, Vec3(0.01, 0.02, 0.03));
  EXPECT_EQ(half.normal, Vec3(0, 1, 0));
  const auto sphere = std::get<AnchorSphere>(parse_anchor(" sphere 1 2 3\t4 ", 1e-3));
  EXPECT_EQ(sphere.center, Vec3(1e-3, 2e-3, 3e-3));
  EXPECT_EQ(sphere.radius, 4e-3);
  const auto box = std::get<AnchorBox>(parse_anchor("box 4 5 6 1 2 3", 0.5)).box;
  EXPECT_EQ(box.min, Vec3(0.5, 1, 1.5));
  EXPECT_EQ(box.max, Vec3(2, 2.5, 3));
}

TEST(Anchor, GrammarErrorsShowTheGrammar) {
  for (const char* text : {"",
                           " ",
                           "bxo 1 2 3 4 5 6",
                           "box 1 2 3",
                           "box 1 2 3 4 5 6 7",
                           "box 1 2 3 4 5 x",
                           "box 1 2 3 4 5 nan",
                           "box 1 2 3 4 5 1e999",
                           "box 1 2 3 4 5 inf",
                           "sphere 0 0 0 0",
                           "sphere 0 0 0 -1",
                           "half-space 0 0 0 0 0 0",
                           "half-space 0 0 0 1e-300 1e-300 0",
                           "region",
                           "nodes",
                           "nodes ,",
                           "nodes 1.5",
                           "nodes 99999999999",
                           "nodes 1,x",
                           "box 1,2,3,4,5,6"}) {
    const std::string what = message(ErrorKind::usage, [&] { parse_anchor(text); });
    EXPECT_NE(what.find("box x0 y0 z0 x1 y1 z1"), std::string::npos) << what;
  }
  message(ErrorKind::usage, [] { parse_anchor("box 1e200 0 0 1 1 1", 1e200); });
  message(ErrorKind::usage, [] { anchored_nodes(cube(), {parse_anchor("nodes 0,2,27")}); });
  message(ErrorKind::usage, [] { anchored_nodes(cube(), {parse_anchor("nodes -1,2,7")}); });
  const std::string what =
      message(ErrorKind::usage, [] { anchored_nodes(cube(), {parse_anchor("region stone")}); });
  EXPECT_NE(what.find("upper half"), std::string::npos) << what;  // says which there are
}

RC_GTEST_PROP(Anchor, TextReadsBackToTheBit, (const std::array<double, 6>& x, int kind)) {
  for (const double v : x) RC_PRE(std::isfinite(v));
  const Vec3 a(x[0], x[1], x[2]), b(x[3], x[4], x[5]);
  RC_PRE(b.norm() > 1e-100 && std::isfinite(b.norm()));
  Anchor anchor = AnchorBox{{a.cwiseMin(b), a.cwiseMax(b)}};
  if (kind % 3 == 1) anchor = AnchorSphere{a, b.norm()};
  if (kind % 3 == 2) anchor = AnchorHalfSpace{a, b};
  const std::string text = to_string(anchor);
  const Anchor back = parse_anchor(text);
  RC_ASSERT(back.index() == anchor.index());
  RC_ASSERT(to_string(back) == text);
  if (const auto* box = std::get_if<AnchorBox>(&back))
    RC_ASSERT(box->box.min == a.cwiseMin(b) && box->box.max == a.cwiseMax(b));
  if (const auto* half = std::get_if<AnchorHalfSpace>(&back))
    RC_ASSERT(half->point == a && half->normal == b);
}

TEST(Anchor, NamesAndNodesReadBack) {
  EXPECT_EQ(std::get<AnchorRegion>(parse_anchor(to_string(AnchorRegion{"renal vein 2"}))).name,
            "renal vein 2");
  EXPECT_EQ(std::get<AnchorNodes>(parse_anchor(to_string(AnchorNodes{{5, 0, 70000}}))).nodes,
            (std::vector<Index>{5, 0, 70000}));
}

TEST(Anchor, RefusesWhatCanStillMove) {
  const TetMesh mesh = cube();
  const auto refused = [&](const std::vector<Anchor>& anchors) {
    return message(ErrorKind::physics, [&] { anchored_nodes(mesh, anchors); });
  };
  EXPECT_NE(refused({}).find("27 nodes"), std::string::npos);
  EXPECT_NE(refused({parse_anchor("sphere 5 5 5 1")}).find("0 of its nodes"), std::string::npos);
  EXPECT_NE(refused({parse_anchor("nodes 0,1")}).find("fewer than three"), std::string::npos);
  EXPECT_NE(refused({parse_anchor("nodes 0,1,2")}).find("on one line"), std::string::npos);
  EXPECT_NE(refused({parse_anchor("nodes 0,13,26")}).find("on one line"), std::string::npos);
}

TEST(Anchor, EveryPartMustBeHeld) {
  const TetMesh two = both(cube(), cube(), Vec3(5, 0, 0));
  const std::string what =
      message(ErrorKind::physics, [&] { anchored_nodes(two, {parse_anchor("box -1 -1 -1 1 1 1")}); });
  EXPECT_NE(what.find("part 2 of 2"), std::string::npos) << what;
  EXPECT_EQ(count(two, "half-space 0 0 -1 0 0 1"), 18u);
}

// Joined by a node or an edge only, a part turns about it; three shared nodes not on a line hold it.
TEST(Anchor, APartCanHangOnAHeldOne) {
  TetMesh mesh;
  mesh.region_names = {"tissue"};
  mesh.nodes = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1),
                Vec3(1, 1, 1), Vec3(2, 1, 1), Vec3(1, 2, 2)};
  mesh.tets = {{0, 1, 2, 3}, {1, 5, 6, 2}};
  mesh.regions = {0, 0};
  if (six_volume(mesh, mesh.tets[1]) < 0) std::swap(mesh.tets[1][2], mesh.tets[1][3]);
  const auto hold = [&](const char* nodes) { return anchored_nodes(mesh, {parse_anchor(nodes)}); };
  message(ErrorKind::physics, [&] { hold("nodes 0,1,2"); });  // shares only the edge 1-2
  EXPECT_NO_THROW(hold("nodes 0,1,2,5"));                     // a third node of its own
  EXPECT_NO_THROW(hold("nodes 5,6,1,3"));                     // held from the other side
  const auto flags = hold("nodes 0,1,2,5");
  EXPECT_EQ(flags[4], 1);  // of no tetrahedron
  EXPECT_EQ(flags[3], 0);
  EXPECT_EQ(flags[6], 0);
}

// A chain of tetrahedra joined by edges, one node of each edge anchored and both of the last: the hold
// spreads from there, against the order of the tetrahedra.
TEST(Anchor, TheHoldSpreadsAlongALongChain) {
  TetMesh mesh;
  mesh.region_names = {"tissue"};
  const Index links = 50000;
  std::vector<Index> anchored;
  for (Index i = 0; i <= links; ++i) {
    const Vec3 middle(i, 0, 0), half = Vec3::Unit(1 + i % 2);
    mesh.nodes.push_back(middle - half);
    mesh.nodes.push_back(middle + half);
    anchored.push_back(2 * i);
  }
  for (Index e = 0; e < links; ++e) {
    Tetrahedron t{2 * e, 2 * e + 1, 2 * e + 2, 2 * e + 3};
    if (six_volume(mesh, t) < 0) std::swap(t[2], t[3]);
    mesh.tets.push_back(t);
    mesh.regions.push_back(0);
  }
  const std::string what =
      message(ErrorKind::physics, [&] { anchored_nodes(mesh, {AnchorNodes{anchored}}); });
  EXPECT_NE(what.find("part 1 of 50000"), std::string::npos) << what;
  anchored.push_back(2 * links + 1);
  EXPECT_NO_THROW(anchored_nodes(mesh, {AnchorNodes{anchored}}));
}

}  // namespace
}  // namespace palpate
