// Contact between nodes: tips and edges finer than the surface's triangles.
#include "palpate/simulation/places.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "palpate/simulation/recording.hpp"
#include "places_fixture.hpp"

namespace palpate {
namespace {

// In the middle of a face, of an edge, and beside a node: felt from a tenth of the tip's radius on at the
// latest, and as stiff as the compliance says of a force there.
TEST_F(Places, ATipIsFeltBetweenNodes) {
  take_needle();
  for (const Vec3& p :
       {Vec3(1e-3, 0.7e-3, 0), Vec3(1.5e-3, 0, 0), Vec3(1.5e-3, 1.5e-3, 0), Vec3(0.4e-3, 0.1e-3, 0)}) {
    SCOPED_TRACE(fmt::format("at {} {} mm", 1e3 * p.x(), 1e3 * p.y()));
    State state = make_state(model);
    EXPECT_EQ(press(state, p + Vec3(0, 0, 1e-6)), 0);
    double last = 0, before = 0;
    for (int k = 1; k <= 10; ++k) {
      before = last;
      last = press(state, p - Vec3(0, 0, 0.02e-3 * k));
      EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
      EXPECT_TRUE(last > 1e-4 || 0.02e-3 * k < 1.01 * felt_from * radius) << last;
    }
    ASSERT_GE(state.contacts.size(), 1u);
    const Contact& c = state.contacts[0];
    if (state.contacts.size() > 1 || c.triangle < 0) continue;
    Mat3 compliance = Mat3::Zero();  // of the place, from the whole matrix
    const Triangle& nodes = model.organ.surface.triangles[static_cast<std::size_t>(c.triangle)];
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const Index pair[] = {model.organ.row_of[static_cast<std::size_t>(nodes[i])],
                              model.organ.row_of[static_cast<std::size_t>(nodes[j])]};
        std::array<float, 9> block;
        model.organ.compliance.block({&pair[0], 1}, {&pair[1], 1}, block, 3);
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            compliance(a, b) += c.weights[static_cast<int>(i)] * c.weights[static_cast<int>(j)] *
                                static_cast<double>(block[static_cast<std::size_t>(3 * a + b)]);
      }
    EXPECT_NEAR((last - before) / 0.02e-3, 1 / compliance(2, 2), 0.03 / compliance(2, 2));
    EXPECT_NEAR(c.point.z(), -0.2e-3, 1e-6);  // at the tip
  }
}

// A force between nodes is theirs: the same wrench, the displacement that their forces cause, and no way for
// the tip into any triangle near it.
TEST_F(Places, ForcesAreTheNodes) {
  take_needle();
  State state = make_state(model);
  for (int k = 0; k <= 12; ++k) press(state, Vec3(1e-3, 0.7e-3, -0.1e-3 * k));
  Vec3 contacts = Vec3::Zero(), loads = Vec3::Zero();
  for (const Contact& c : state.contacts) contacts += c.force;
  for (std::size_t i = 0; i < state.loads.count; ++i) loads += state.loads.forces[i];
  EXPECT_LT((contacts - loads).norm(), 1e-12);
  EXPECT_LT((contacts + state.wrenches[0].force).norm(), 1e-12);
  std::vector<float> u(3 * model.organ.compliance.nodes()), forces;
  for (std::size_t i = 0; i < state.loads.count; ++i)
    for (int a = 0; a < 3; ++a) forces.push_back(static_cast<float>(state.loads.forces[i][a]));
  model.organ.compliance.apply({state.loads.rows.data(), state.loads.count}, forces, u);
  for (std::size_t i = 0; i < state.loads.count; ++i)
    for (int a = 0; a < 3; ++a)
      EXPECT_NEAR(u[static_cast<std::size_t>(3 * state.loads.rows[i] + a)], state.loads.u[i][a], 1e-8);
  const Input input = tip_at(Vec3(1e-3, 0.7e-3, -1.2e-3));
  double deepest = 0;
  for (const Triangle& t : model.organ.surface.triangles)
    for (int i = 0; i <= 40; ++i)
      for (int j = 0; i + j <= 40; ++j) {
        const Vec3 p = (deformed(model, state, t[0]) * i + deformed(model, state, t[1]) * j +
                        deformed(model, state, t[2]) * (40 - i - j)) /
                       40.0;
        if ((p - Vec3(1e-3, 0.7e-3, -1.2e-3)).norm() > 6e-3) continue;
        deepest =
            std::max(deepest, -distance(model.instruments[0].shape, input.instruments[0].inverse() * p));
      }
  EXPECT_LT(deepest, 1.1 * felt_from * radius);
}

TEST_F(Places, HeldStillTheForceStays) {
  take_needle();
  for (const double friction : {0.0, 0.3}) {
    model.settings.friction = friction;
    State state = make_state(model);
    for (int k = 0; k <= 10; ++k) press(state, Vec3(1e-3, 0.7e-3, -0.1e-3 * k));
    for (int k = 0; k < 10; ++k) press(state, Vec3(1e-3, 0.7e-3, -1e-3));
    const double force = state.wrenches[0].force.z();
    EXPECT_GT(force, 0.03);
    for (int k = 0; k < 1000; ++k) {
      ASSERT_NEAR(press(state, Vec3(1e-3, 0.7e-3, -1e-3)), force, 1e-4 * force) << k;
      ASSERT_EQ(state.status & ~strain_beyond_linear, 0u) << k;
    }
    press(state, Vec3(1e-3, 0.7e-3, 1e-3));
    EXPECT_TRUE(state.contacts.empty());
  }
}

// A blade of 1 mm, edge on, askew to the rows of nodes: with its thickness said it is felt along its edge.
TEST_F(Places, ABladesEdge) {
  const Vec3 half(10e-3, 0.5e-3, 10e-3);
  const Eigen::Quaterniond askew(Eigen::AngleAxisd(0.3, Vec3::UnitZ()));
  double felt[2];
  for (int with = 0; with < 2; ++with) {
    take(lattice_of(make_box({-half, half}), 0.25e-3), with ? 1e-3 : 0);
    State state = make_state(model);
    for (int k = 0; k <= 10; ++k) {
      step(model, state, at(Vec3(1e-3, 0.7e-3, 10e-3 - 0.1e-3 * k), askew));
      EXPECT_EQ(state.status & ~strain_beyond_linear, 0u) << k;
    }
    felt[with] = state.wrenches[0].force.z();
  }
  EXPECT_GT(felt[1], 0.15);
  EXPECT_LT(felt[0], 0.7 * felt[1]);  // what nodes alone see of it
}

// Blunt instruments, and flat sides, are the nodes' business.
TEST_F(Places, BluntOnesHaveNone) {
  for (const Shape& shape :
       {Shape{Sphere{5e-3}}, Shape{Cuboid{Vec3(8e-3, 8e-3, 0.5e-3)}}, Shape{HalfSpace{}}}) {
    take(shape);
    State state = make_state(model);
    for (int k = 0; k <= 10; ++k)
      step(model, state,
           at(Vec3(0, 0, (std::holds_alternative<HalfSpace>(shape) ? 0 : half_height(shape)) - 0.1e-3 * k),
              std::holds_alternative<HalfSpace>(shape)
                  ? Eigen::Quaterniond(Eigen::AngleAxisd(3.14159265358979, Vec3::UnitX()))
                  : Eigen::Quaterniond::Identity()));
    EXPECT_GE(state.contacts.size(), 1u);
    for (const Contact& c : state.contacts) EXPECT_EQ(c.triangle, -1);
  }
}

TEST_F(Places, OldSurfacesGiveTheSameBits) {
  const Vec3 half(10e-3, 0.5e-3, 10e-3);
  const Shape blade = lattice_of(make_box({-half, half}), 0.25e-3);
  for (const bool is_blade : {false, true})
    for (const double along : {0.1e-3, 0.9e-3})
      for (const double friction : {0.0, 0.3})
        for (const int lag : {1, 13}) {
          SCOPED_TRACE(fmt::format("blade {} {} mm a tick, friction {}, lag {}", is_blade, 1e3 * along,
                                   friction, lag));
          is_blade ? take(blade, 1e-3) : take_needle();
          model.settings.friction = friction;
          State fresh = make_state(model), late = make_state(model);
          Surface old = late.surface;
          Deformer deformer(model.organ);
          std::size_t places = 0;
          const int ticks = along > 0.5e-3 ? 40 : 120;
          for (int k = 0; k < ticks; ++k) {
            const double x = -6e-3 + std::fmod(along * k, 15e-3), z = -0.05e-3 * std::min(k, 24);
            const Vec3 p(x + (k > ticks / 2 ? 2e-3 : 0), 0.7e-3, z);
            const Input input = is_blade ? at(Vec3(p.y(), p.x(), p.z() + 10e-3)) : tip_at(p);
            step(model, fresh, input);
            if (k % lag == 0) deformer(model.organ, late.loads, old);
            tick(model, late, input, old);
            ASSERT_EQ(state_hash(fresh), state_hash(late)) << k;
            for (const Contact& c : late.contacts) places += c.triangle >= 0;
          }
          EXPECT_GT(places, 20u);
        }
}

// How deep an instrument reaches between nodes, by samples; deeper than where it is felt from.
double left_between(const Model& model, const State& state, std::size_t instrument, const Pose& pose) {
  const Faces faces(model.organ, model.instruments, *state.surface.clusters);
  double left = 0;
  for (std::size_t i = 0; i < faces.faces.size(); ++i) {
    const Triangle& t = model.organ.surface.triangles[i];
    const auto is_free = [&](Index v) { return model.organ.row_of[static_cast<std::size_t>(v)] >= 0; };
    if (!std::all_of(t.begin(), t.end(), is_free)) continue;
    if (distance(model.instruments[instrument].shape, pose.inverse() * contact_point(model, state, t[0])) >
        6e-3)
      continue;
    constexpr int n = 24;
    for (int a = 0; a <= n; ++a)
      for (int b = 0; a + b <= n; ++b) {
        const Vec3 w = Vec3(a, b, n - a - b) / n;
        if (w.maxCoeff() > 0.95) continue;  // the node's business
        const Vec3 p = w[0] * contact_point(model, state, t[0]) + w[1] * contact_point(model, state, t[1]) +
                       w[2] * contact_point(model, state, t[2]) -
                       faces.allowance(i, instrument, w) * faces.faces[i].normal;
        left = std::max(left, -distance(model.instruments[instrument].shape, pose.inverse() * p));
      }
  }
  return left;
}

// What a tick leaves between nodes is in deepest_after, and where it says that it converged, as nearly all
// do, it is little.
TEST_F(Places, WhatIsLeftIsReported) {
  take_needle();
  int ticks = 0, missed = 0;
  for (const double friction : {0.0, 0.3})
    for (const double depth : {0.8e-3, 1.7e-3})
      for (const double along : {5e-3, 1e-3, 0.3e-3}) {
        SCOPED_TRACE(fmt::format("friction {}, depth {}, {} mm a tick", friction, 1e3 * depth, 1e3 * along));
        model.settings.friction = friction;
        State state = make_state(model);
        for (double z = 0; z < depth; z += 0.1e-3) press(state, Vec3(-9e-3, 0.7e-3, -z));
        press(state, Vec3(-9e-3, 0.7e-3, -depth));
        for (double x = -9e-3 + along; x <= 9e-3; x += along) {
          const Input input = tip_at(Vec3(x, 0.7e-3, -depth));
          step(model, state, input);
          const double left = left_between(model, state, 0, input.instruments[0]);
          const double much = 1e-6 * organ_size(model) + 1e-4 * std::sqrt(2.0) * 3e-3 + 2e-3 * along;
          EXPECT_LE(left, std::max(much, state.deepest_after) + 1e-7) << x;
          EXPECT_TRUE(state.deepest_after <= 1.01 * much || state.status & not_converged) << x;
          ++ticks, missed += (state.status & not_converged) != 0;
        }
      }
  EXPECT_LE(missed, ticks / 20);
  // A blade's edge goes into a triangle at both ends of where it lies across it.
  const Vec3 half(10e-3, 0.5e-3, 10e-3);
  take(lattice_of(make_box({-half, half}), 0.25e-3), 1e-3);
  model.settings.friction = 0;
  State state = make_state(model);
  for (int k = 0; k <= 50; ++k) {
    const Input input = at(Vec3(1.78e-3, -4.08e-3, 10e-3 - 0.05e-3 * k),
                           Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Vec3::UnitZ())));
    step(model, state, input);
    const double much = 1e-6 * organ_size(model) + 1e-4 * std::sqrt(2.0) * 3e-3 + 2e-3 * 0.05e-3;
    EXPECT_LE(left_between(model, state, 0, input.instruments[0]), std::max(much, state.deepest_after) + 1e-7)
        << k;
  }
}

// A triangle that a grip has stretched beyond what its nodes reach at rest is seen, however old the surface
// is.
TEST_F(Places, StretchedTrianglesAreSeen) {
  model.instruments = {{"grip", Sphere{5e-3}, {}, 0}, {"needle", Capsule{radius, length}, {}, 0}};
  State fresh = make_state(model), late = make_state(model);
  const Surface rest = late.surface;
  Input input;
  input.instruments = {Pose{}, Pose{Eigen::Quaterniond::Identity(), Vec3(0, 0, 0.2)}};
  const auto both = [&](const Vec3& grip, std::uint8_t closed) {
    input.instruments[0].translation = grip, input.grips = {closed, 0};
    step(model, fresh, input);
    tick(model, late, input, rest);
    EXPECT_EQ(state_hash(fresh), state_hash(late));
  };
  both(Vec3(0, 0, 4e-3), 0);
  both(Vec3(0, 0, 4e-3), 1);
  for (int k = 1; k <= 10; ++k) both(Vec3(0, 0, 4e-3 + 8e-3 * k), 1);
  const auto corner = [&](const Triangle& t, std::size_t k) { return contact_point(model, fresh, t[k]); };
  double farthest = 0;
  Vec3 middle = Vec3::Zero(), normal = Vec3::UnitZ();
  for (const Triangle& t : model.organ.surface.triangles) {
    if (std::any_of(fresh.grasps.begin(), fresh.grasps.end(),
                    [&](const Grasp& g) { return std::count(t.begin(), t.end(), g.node) > 0; }))
      continue;
    const Vec3 m = (corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3;
    double nearest = 1;
    for (std::size_t k = 0; k < 3; ++k) nearest = std::min(nearest, (corner(t, k) - m).norm());
    if (nearest <= farthest) continue;
    farthest = nearest, middle = m;
    normal = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).normalized();
  }
  EXPECT_GT(farthest, 1.2 * 3e-3);
  const double deep = 0.3e-3;
  input.instruments[1] = {Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), normal),
                          middle + (length + radius - deep) * normal};
  both(input.instruments[0].translation, 1);
  EXPECT_TRUE(std::any_of(fresh.contacts.begin(), fresh.contacts.end(),
                          [](const Contact& c) { return c.instrument == 1 && c.triangle >= 0; }));
}

// Between an anchor and the nodes beside it a tip is felt, the stiffer the nearer the anchor is.
TEST_F(Places, BesideAnAnchor) {
  take_needle();
  const Eigen::Quaterniond lying(Eigen::AngleAxisd(0.5 * 3.14159265358979, Vec3::UnitY()));
  for (const double friction : {0.0, 0.3}) {
    SCOPED_TRACE(friction);
    model.settings.friction = friction;
    double last = 0, most = 0;
    for (const double z : {-27.5e-3, -28e-3, -28.5e-3, -29e-3}) {  // nodes at -27 mm, the anchor at -30 mm
      State state = make_state(model);
      const auto push = [&](double depth, double down) {
        step(model, state, at(Vec3(30e-3 - depth + length + radius, 1e-3, z - down), lying));
        EXPECT_EQ(state.status & ~(strain_beyond_linear | anchor_touched), 0u)
            << z << ' ' << depth << ' ' << down;
        return state.wrenches[0].force.x();
      };
      double force = 0;
      for (int k = 0; k <= 10; ++k) force = push(0.02e-3 * k, 0);
      EXPECT_GT(force, 1.05 * last) << z;
      EXPECT_LT(force, 1) << z;
      most = std::max(most, force);
      if (z == -29e-3)  // and on, beyond the anchor: it comes to an end
        for (int k = 1; k <= 40; ++k) {
          const double next = push(0.2e-3, 0.05e-3 * k);
          EXPECT_LT(std::abs(next - force), 0.5 * most) << k;
          force = next, most = std::max(most, force);
        }
      last = force;
    }
    EXPECT_EQ(last, 0);
  }
}

// A short needle lies still in the crater of a ball, between two rows of nodes. The ball goes away in one
// tick: the tissue springs back up to the needle, and bears it as if it had been pressed in there.
TEST_F(Places, TissueThatSpringsBackMeetsANeedle) {
  model.instruments = {{"ball", Sphere{10e-3}, {}, 0}, {"needle", Capsule{radius, 3e-3}, {}, 0}};
  const Pose away{Eigen::Quaterniond::Identity(), Vec3(0, 0, 0.05)};
  for (const double height : {-1.2e-3, -2e-3, -3e-3}) {
    const Pose lying{Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitX())),
                     Vec3(1.2e-3, 0.4e-3, height)};
    State pressed = make_state(model), fresh = make_state(model), late = make_state(model);
    const Surface rest = late.surface;
    Input input;
    input.instruments = {away, lying};
    for (double z = 0; z >= height; z -= 0.1e-3)
      input.instruments[1].translation.z() = z, step(model, pressed, input);
    // Twice, until the places rest, as the others will.
    input.instruments[1] = lying, step(model, pressed, input), step(model, pressed, input);
    const double force = pressed.wrenches[1].force.z();
    EXPECT_GT(force, 0.02);
    const auto both = [&] {
      step(model, fresh, input);
      tick(model, late, input, rest);
      EXPECT_EQ(state_hash(fresh), state_hash(late));
    };
    input.instruments[1] = away;
    for (int k = 0; k <= 14; ++k) input.instruments[0].translation = Vec3(0, 0, 10e-3 - 0.5e-3 * k), both();
    input.instruments[1] = lying, both(), both();
    EXPECT_EQ(fresh.wrenches[1].force, Vec3::Zero());
    input.instruments[0] = away, both();
    EXPECT_NEAR(fresh.wrenches[1].force.z(), force, 0.01 * force) << height;
    both();
    EXPECT_NEAR(fresh.wrenches[1].force.z(), force, 0.001 * force) << height;
    EXPECT_EQ(fresh.status & ~strain_beyond_linear, 0u);
  }
}

// A lattice's margin is not the needle: on a coarse lattice with a wide one it still has places.
TEST_F(Places, AMarginDoesNotMakeBlunt) {
  Faces faces;
  const Surface rest = make_surface(model.organ);
  for (const double margin : {1e-3, 2.5e-3}) {
    TriangleMesh needle = surface_of_primitive(Capsule{radius, 5e-3});
    const Shape shape = std::make_shared<const Lattice>(sample_lattice(
        SignedDistanceField(needle), make_grid_spaced(bounding_box(needle.vertices), 0.25e-3, margin)));
    for (const bool drawn : {false, true}) {
      const std::vector<Instrument> instruments{{"needle", shape, drawn ? needle : TriangleMesh{}, 0}};
      faces = Faces(model.organ, instruments, *rest.clusters);
      ASSERT_EQ(faces.thickness.size(), 1u);
      EXPECT_NEAR(faces.thickness[0], radius, 0.1 * radius) << margin << drawn;
    }
  }
  const std::vector<Instrument> ball{
      {"ball", lattice_of(make_sphere(Vec3::Zero(), 4e-3, 24, 32), 0.5e-3), {}, 0}};
  EXPECT_TRUE(Faces(model.organ, ball, *rest.clusters).empty());
}

// A needle that grips takes the nodes round its tip with it.
TEST_F(Places, AGripBetweenNodes) {
  take_needle();
  State state = make_state(model);
  Input input;
  for (int k = 0; k <= 6; ++k) {
    input = tip_at(Vec3(1e-3, 0.7e-3, -0.1e-3 * k));
    step(model, state, input);
  }
  step(model, state, input);  // held still, more exactly
  const Vec3 pressed = state.wrenches[0].force;
  input.grips = {1};
  step(model, state, input);
  step(model, state, input);
  EXPECT_EQ(state.grasps.size(), 3u);
  EXPECT_LT((state.wrenches[0].force - pressed).norm(), 1e-3 * pressed.norm());  // closing changes no force
  input.instruments[0].translation.z() += 2e-3;
  step(model, state, input);
  EXPECT_LT(state.wrenches[0].force.z(), -0.01);  // pulled
  input.grips = {0};
  step(model, state, input);
  EXPECT_TRUE(state.grasps.empty());
  EXPECT_TRUE(state.contacts.empty());
}

}  // namespace
}  // namespace palpate
