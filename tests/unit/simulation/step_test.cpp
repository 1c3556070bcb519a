#include <fmt/core.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "palpate/contact/clusters.hpp"

namespace palpate {
namespace {

Vec3 rest(const Model& m, Index node) { return m.organ.surface.vertices[static_cast<std::size_t>(node)]; }

// The mean of the drawn displacement over each hat is what was read there.
void expect_drawn_as_read(const Model& model, const State& state) {
  const Organ& organ = model.organ;
  if (organ.order == 1) {
    EXPECT_EQ(state.surface.displacement, state.surface.reading);
    return;
  }
  std::vector<Vec3> mean(organ.surface_size(), Vec3::Zero());
  double largest = 0, off = 0;
  for (const Triangle& t : organ.surface.triangles)
    for (const Index i : t)
      for (const Index j : t)
        mean[static_cast<std::size_t>(i)] +=
            area_vector(organ.surface, t).norm() / (i == j ? 6 : 12) /
            organ.areas[static_cast<std::size_t>(i)] *
            state.surface.displacement[static_cast<std::size_t>(j)].cast<double>();
  for (const Index i : organ.node_of_row) {
    const auto n = static_cast<std::size_t>(i);
    largest = std::max<double>(largest, state.surface.reading[n].norm());
    off = std::max(off, (mean[n] - state.surface.reading[n].cast<double>()).norm());
  }
  EXPECT_LE(off, 1e-3 * largest);
}

// Everything the unilateral law promises, checked from the outside: on positions, forces and the compliance.
void expect_signorini(const Model& model, const State& state, const Input& input) {
  const double size = organ_size(model), tolerance = 1e-6 * size;
  ASSERT_EQ(state.status & (not_converged | bad_input | too_many_contacts), 0u);
  double peak = 0;
  for (const Contact& c : state.contacts) peak = std::max(peak, c.force.norm());
  Vec3 total = Vec3::Zero(), torque = Vec3::Zero();
  std::vector<float> u(3 * model.organ.compliance.nodes());
  std::vector<Index> rows;
  std::vector<float> forces;
  for (const Contact& c : state.contacts) {
    const auto i = static_cast<std::size_t>(c.instrument);
    const Vec3 x = contact_point(model, state, c.node);
    const Gap g = gap(model.instruments[i].shape, input.instruments[i].inverse() * x);
    const Vec3 normal = input.instruments[i].rotation * g.normal;
    EXPECT_GT(c.force.dot(normal), 0);                                   // no pulling
    EXPECT_LT(c.force.cross(normal).norm(), 3e-3 * peak);                // no friction
    EXPECT_LE(std::abs(g.distance) * c.force.norm(), tolerance * peak);  // gap * force
    EXPECT_NEAR(g.distance, c.gap_after, 5e-9);  // a surface of float32, changes of u in float32
    total += c.force;
    torque += (x - input.instruments[i].translation).cross(c.force);
    const Index row = model.organ.row_of[static_cast<std::size_t>(c.node)];
    const auto load = static_cast<std::size_t>(std::find(rows.begin(), rows.end(), row) - rows.begin());
    if (load == rows.size()) rows.push_back(row), forces.resize(forces.size() + 3);  // two may touch it
    const Vec3 f = state.organ.rotation.conjugate() * c.force;
    for (std::size_t a = 0; a < 3; ++a) forces[3 * load + a] += static_cast<float>(f[static_cast<int>(a)]);
  }
  if (model.instruments.size() == 1) {
    EXPECT_LT((total + state.wrenches[0].force).norm(), 1e-9 * (1 + total.norm()));
    EXPECT_LT((torque + state.wrenches[0].torque).norm(), 1e-9 * (1 + torque.norm()));
  }
  for (std::size_t n = 0; n < model.organ.surface_size(); ++n) {  // no node anywhere is inside
    if (model.organ.row_of[n] < 0) continue;
    for (std::size_t i = 0; i < model.instruments.size(); ++i)
      EXPECT_GE(distance(model.instruments[i].shape,
                         input.instruments[i].inverse() * contact_point(model, state, static_cast<Index>(n))),
                -tolerance);
  }
  model.organ.compliance.apply(rows, forces, u);  // the displacement is the one these forces cause
  for (std::size_t r = 0; r < model.organ.compliance.nodes(); ++r)
    for (std::size_t a = 0; a < 3; ++a)
      ASSERT_NEAR(
          u[3 * r + a],
          state.surface.reading[static_cast<std::size_t>(model.organ.node_of_row[r])][static_cast<int>(a)],
          tolerance);
  expect_drawn_as_read(model, state);
}

TEST(Step, NoContactNoForce) {
  const Model model = block_model(5, Sphere{0.03});
  State state = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.2)));
  EXPECT_EQ(state.status, 0u);
  EXPECT_TRUE(state.contacts.empty());
  for (const Vec3f& u : state.surface.displacement) EXPECT_EQ(u, Vec3f::Zero());
  step(model, state, at(Vec3(0, 0, 0.1301)));  // 0.1 mm above
  EXPECT_TRUE(state.contacts.empty());
}

TEST(Step, UnilateralLawHoldsWhilePressingSlidingAndLeaving) {
  for (const Shape& shape :
       {Shape{Sphere{0.03}}, Shape{Capsule{0.01, 0.03}}, Shape{Cuboid{Vec3(0.02, 0.015, 0.03)}},
        lattice_of(make_torus(0.03, 0.012, 40, 20), 1.5e-3),
        lattice_of(
            make_star_shaped(Vec3::Zero(), 10, [](const Vec3& d) { return 0.025 + 0.008 * d.x() * d.x(); }),
            1e-3)}) {
    for (const int order : {1, 2}) {
      const Model model = block_model(order == 1 ? 8 : 6, shape, Mode::unilateral, order);
      State state = make_state(model);
      const double top = 0.1 + half_height(shape);
      double deepest = 0, peak = 0;
      for (int k = 0; k <= 60; ++k) {
        const double t = k / 60.0, depth = 0.012 * std::min({1.0, 4 * t, 4 * (1 - t)}) - 0.001;
        const Input input =
            at(Vec3(-0.02 + 0.04 * t, 0.003, top - depth),
               Eigen::Quaterniond(Eigen::AngleAxisd(0.4 * t, Vec3(0.3, 1, 0.2).normalized())));
        step(model, state, input);
        SCOPED_TRACE(fmt::format("shape {} order {} tick {}", shape.index(), order, k));
        expect_signorini(model, state, input);
        deepest = std::max(deepest, state.deepest_before);
        peak = std::max(peak, state.wrenches[0].force.norm());
        EXPECT_LE(state.deepest_after, 1e-6 * organ_size(model));
      }
      EXPECT_GT(deepest, 0.005);
      EXPECT_GT(peak, 0.5);
      step(model, state, at(Vec3(0, 0, 0.5)));
      EXPECT_TRUE(state.contacts.empty());
      for (const Vec3f& u : state.surface.displacement)
        EXPECT_EQ(u, Vec3f::Zero());  // elastic: nothing stays
    }
  }
}

TEST(Step, EveryStorageGivesTheSameForces) {
  constexpr double tolerance = 1e-3;
  std::vector<Vec3> reference;
  for (const Storage storage : all_storages) {
    Model model = block_model(8, Sphere{0.03});
    model.organ = block_organ(8, {1, storage, tolerance, 0});
    State state = make_state(model);
    std::vector<Vec3> forces;
    for (int i = 0; i < 60; ++i) {
      const Input input = at(Vec3(0.0003 * i, 0.0002 * i, 0.13 - 0.0002 * i));
      step(model, state, input);
      forces.push_back(state.wrenches[0].force);
      if (i % 20 == 19) expect_signorini(model, state, input);
    }
    EXPECT_GE(state.contacts.size(), 6u);
    if (reference.empty()) reference = forces;
    for (std::size_t i = 0; i < forces.size(); ++i)
      EXPECT_LE((forces[i] - reference[i]).norm(), 2 * tolerance * reference[i].norm() + 1e-6)
          << storage_name(storage) << ' ' << i;
  }
}

TEST(Step, AJumpStraightToDepthEndsWhereTheWayLeads) {
  const Model model = block_model(8, Sphere{0.03});
  State slow = make_state(model), fast = make_state(model);
  for (int k = 0; k <= 40; ++k) step(model, slow, at(Vec3(0.01, 0, 0.13 - 0.01 * k / 40)));
  step(model, fast, at(Vec3(0.01, 0, 0.12)));
  expect_signorini(model, fast, at(Vec3(0.01, 0, 0.12)));
  EXPECT_EQ(slow.contacts.size(), fast.contacts.size());
  EXPECT_LT((slow.wrenches[0].force - fast.wrenches[0].force).norm(), 1e-3 * slow.wrenches[0].force.norm());
}

// The brute force: all nodes at once, on the full matrix, by projected Gauss-Seidel, for a plane (where the
// normal is known).
TEST(Step, PlaneAgreesWithAFullMatrixSolve) {
  const Model model = block_model(5, HalfSpace{});
  State state = make_state(model);
  Input input = at(Vec3(0, 0, 0.094),
                   Eigen::Quaterniond(Eigen::AngleAxisd(3.1, Vec3::UnitX())));  // faces down, a little tilted
  step(model, state, input);
  expect_signorini(model, state, input);

  const auto rows = model.organ.compliance.nodes();
  const Vec3 n = input.instruments[0].rotation * Vec3::UnitZ();
  Eigen::MatrixXd a(rows, rows);
  Eigen::VectorXd b(rows), p = Eigen::VectorXd::Zero(static_cast<int>(rows));
  for (std::size_t i = 0; i < rows; ++i) {
    b[static_cast<int>(i)] =
        n.dot(rest(model, model.organ.node_of_row[i]) - input.instruments[0].translation);
    for (std::size_t j = 0; j < rows; ++j) {
      double sum = 0;
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t l = 0; l < 3; ++l)
          sum += n[static_cast<int>(k)] *
                 static_cast<double>(model.organ.compliance.matrix()[(3 * i + k) * 3 * rows + 3 * j + l]) *
                 n[static_cast<int>(l)];
      a(static_cast<int>(i), static_cast<int>(j)) = sum;
    }
  }
  for (int sweep = 0; sweep < 20000; ++sweep)
    for (int i = 0; i < p.size(); ++i) p[i] = std::max(0.0, p[i] - (a.row(i).dot(p) + b[i]) / a(i, i));
  Vec3 total = Vec3::Zero();
  for (const Contact& c : state.contacts) {
    const int row = model.organ.row_of[static_cast<std::size_t>(c.node)];
    EXPECT_NEAR(c.force.dot(n), p[row], 1e-4 * p.maxCoeff());
    total += c.force;
  }
  EXPECT_NEAR(total.dot(n), p.sum(), 1e-5 * p.sum());
  EXPECT_GT(state.contacts.size(), 20u);
}

TEST(Step, PrescribedLawPutsEveryTouchedNodeOnTheSurface) {
  for (const Shape& shape : {Shape{Sphere{0.03}}, Shape{Cuboid{Vec3(0.02, 0.015, 0.03)}},
                             lattice_of(make_torus(0.03, 0.012, 40, 20), 1.5e-3)}) {
    const Model model = block_model(8, shape, Mode::prescribed);
    State state = make_state(model);
    for (int k = 0; k < 10; ++k) {
      const Input input = at(Vec3(0.002 * k, 0, 0.1 + half_height(shape) - 0.001 * (k + 1)));
      step(model, state, input);
      ASSERT_EQ(state.status & not_converged, 0u);
      std::size_t touched = 0;
      for (const Index node : model.organ.node_of_row) {
        const Pose inverse = input.instruments[0].inverse();
        if (distance(shape, inverse * rest(model, node)) >= 0) continue;
        ++touched;
        EXPECT_NEAR(distance(shape, inverse * deformed(model, state, node)), 0, 1e-6 * organ_size(model));
      }
      EXPECT_LE(touched, state.contacts.size());
      EXPECT_GT(touched, 0u);
      EXPECT_LE(state.deepest_after, 1e-6 * organ_size(model));
    }
  }
}

TEST(Step, MovingTheAnchorsFrameMovesTheBodyWithoutDeformingIt) {
  const Model model = block_model(6, Sphere{0.03});
  State here = make_state(model), there = make_state(model);
  const Pose frame{Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Vec3(1, -2, 0.5).normalized())), Vec3(3, -1, 2)};
  const Input input = at(Vec3(0.005, 0, 0.122));
  Input moved = input;
  moved.organ = frame;
  moved.instruments[0] = frame * input.instruments[0];
  step(model, here, input);
  step(model, there, moved);
  ASSERT_EQ(here.contacts.size(), there.contacts.size());
  EXPECT_LT((frame.rotation * here.wrenches[0].force - there.wrenches[0].force).norm(),
            1e-4 * here.wrenches[0].force.norm());
  for (std::size_t n = 0; n < model.organ.surface_size(); ++n)
    EXPECT_LT((here.surface.displacement[n] - there.surface.displacement[n]).norm(), 1e-6f * 0.17f);
  Input alone = at(Vec3(0, 0, 5));
  alone.organ = frame;
  step(model, there, alone);
  for (const Vec3f& u : there.surface.displacement) EXPECT_EQ(u, Vec3f::Zero());
  EXPECT_LT((deformed(model, there, 0) - frame * rest(model, 0)).norm(), 1e-12);
}

TEST(Step, TwoInstrumentsAtOnce) {
  Model model = block_model(8, Sphere{0.015});
  model.instruments.push_back({"other", Capsule{0.01, 0.01}, {}});
  State state = make_state(model);
  Input input = at(Vec3(-0.025, 0, 0.11));
  input.instruments.push_back({Eigen::Quaterniond::Identity(), Vec3(0.025, 0, 0.115)});
  step(model, state, input);
  expect_signorini(model, state, input);
  EXPECT_LT(state.wrenches[0].force.z() * -1, 0);
  EXPECT_GT(state.wrenches[0].force.z(), 0);
  EXPECT_GT(state.wrenches[1].force.z(), 0);
  input.instruments[1] = input.instruments[0];  // the same place: a node held by both
  step(model, state, input);
  EXPECT_LE(state.deepest_after, 1e-6 * organ_size(model));
}

// Two balls beside each other press the node in their groove. The second was there first: its contact comes
// first in the next tick, too.
TEST(Step, ANodeOfTwoInstrumentsIsOneLoad) {
  for (const Storage storage : {Storage::dense, Storage::hierarchical}) {
    Model model = block_model(8, Sphere{0.015});
    model.organ = block_organ(8, {1, storage, 1e-3, 0});
    model.instruments.push_back({"other", Sphere{0.015}, {}});
    State state = make_state(model);
    Input input = at(Vec3(-0.006, 0, 0.2));
    input.instruments.push_back({Eigen::Quaterniond::Identity(), Vec3(0.006, 0, 0.109)});
    step(model, state, input);
    input.instruments[0].translation.z() = 0.109;
    for (int k = 0; k < 3; ++k) {
      step(model, state, input);
      std::vector<Index> nodes,
          rows(state.loads.rows.begin(), state.loads.rows.begin() + static_cast<int>(state.loads.count));
      Vec3 contacts = Vec3::Zero(), loads = Vec3::Zero();
      for (const Contact& c : state.contacts) contacts += c.force, nodes.push_back(c.node);
      for (std::size_t i = 0; i < state.loads.count; ++i) loads += state.loads.forces[i];
      std::sort(nodes.begin(), nodes.end());
      EXPECT_NE(std::adjacent_find(nodes.begin(), nodes.end()), nodes.end());  // both bear on one
      std::sort(rows.begin(), rows.end());
      EXPECT_EQ(std::adjacent_find(rows.begin(), rows.end()), rows.end()) << k;
      EXPECT_LT((contacts - loads).norm(), 1e-12);
      expect_signorini(model, state, input);
    }
  }
}

TEST(Step, BadInputIsAStatusAndLeavesTheStateAlone) {
  const Model model = block_model(5, Sphere{0.03});
  State state = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.12)));
  const std::vector<Vec3f> before = state.surface.displacement;
  const double nan = std::nan("");
  for (Input bad : {at(Vec3(nan, 0, 0)), at(Vec3(0, 0, 1), Eigen::Quaterniond(0, 0, 0, 0)),
                    at(Vec3(0, INFINITY, 0)), at(Vec3(0, 0, -1e30)), Input{}}) {
    step(model, state, bad);
    EXPECT_EQ(state.status, bad_input);
    EXPECT_EQ(before, state.surface.displacement);
  }
  step(model, state, at(Vec3(0, 0, 0.12)));
  EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
}

TEST(Step, LimitsAreStatusesNeverSilent) {
  Model model = block_model(8, Sphere{0.03});
  model.settings.max_contacts = 4;
  State state = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.115)));
  EXPECT_NE(state.status & too_many_contacts, 0u);
  model.settings.max_contacts = 512;
  model.settings.max_relinearisations = 1;
  state = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.115)));
  EXPECT_NE(state.status & not_converged, 0u);
  for (int k = 0; k < 20; ++k) step(model, state, at(Vec3(0, 0, 0.115)));  // the next ticks go on from there
  EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
  step(model, state, at(Vec3(0, 0, 0.02)));  // the ball reaches into the base
  EXPECT_NE(state.status & anchor_touched, 0u);
}

// What is left is the deepest there is, also where the relinearisations were not enough and nodes that were
// only near have not come to it.
TEST(Step, WhatIsLeftIsReportedAtTheLimit) {
  Model model = block_model(14, lattice_of(make_sphere(Vec3::Zero(), 0.03, 24, 48), 1e-3));
  State state = make_state(model);
  std::size_t limited = 0;
  const auto tick_to = [&](const Vec3& p) {
    const Input input = at(p);
    step(model, state, input);
    double deepest = 0;
    for (const Index node : model.organ.node_of_row)
      deepest =
          std::max(deepest, -distance(model.instruments[0].shape,
                                      input.instruments[0].inverse() * contact_point(model, state, node)));
    EXPECT_NEAR(state.deepest_after, deepest, 1e-8) << p.transpose();
    limited += (state.status & not_converged) != 0;
  };
  for (const double down : {1e-3, 2e-3, 4e-3})
    for (const int most : {1, 2, 4}) {
      model.settings.max_relinearisations = 100;
      for (int k = 0; k < 20; ++k) tick_to(Vec3(0.3e-3 * k, 0.1e-3 * k, 0.12));  // nodes are held back
      model.settings.max_relinearisations = most;
      tick_to(Vec3(6e-3 + 0.2 * down, 2e-3, 0.12 - down));  // but not where they are foreseen
    }
  EXPECT_GT(limited, 5u);
}

TEST(Step, WhatCannotBeSimulatedIsRefused) {
  const Model good = block_model(2, Sphere{0.03});
  const auto message = [](const Model& model) -> std::string {
    try {
      make_state(model);
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::usage);
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
      return e.what();
    }
    return "none";
  };
  EXPECT_EQ(message(good), "none");
  const double nan = std::nan(""), inf = INFINITY;
  for (const Shape& shape :
       {Shape{Sphere{0}}, Shape{Sphere{-1}}, Shape{Sphere{nan}}, Shape{Sphere{inf}},
        Shape{Capsule{0.005, -0.002}}, Shape{Capsule{0, 0.01}}, Shape{Capsule{nan, 1}},
        Shape{Cuboid{Vec3(1, 0, 1)}}, Shape{Cuboid{Vec3(1, 1, -1)}}, Shape{Cuboid{Vec3(nan, 1, 1)}}}) {
    Model model = good;
    model.instruments[0].shape = shape;
    EXPECT_NE(message(model).find("instrument 'tool'"), std::string::npos) << message(model);
  }
  Model thin = good;
  thin.instruments[0].shape = Capsule{0.005, 0};  // a ball
  EXPECT_EQ(message(thin), "none");
  const auto refused = [&](const char* name, auto set) {
    Model model = good;
    set(model.settings);
    EXPECT_NE(message(model).find(name), std::string::npos) << message(model);
  };
  for (const double bad : {0.0, -1e-6, nan, inf, 0.5})
    refused("tolerance", [&](Settings& s) { s.tolerance = bad; });
  for (const double bad : {-0.1, nan, inf}) refused("friction", [&](Settings& s) { s.friction = bad; });
  for (const int bad : {0, -3})
    refused("max_relinearisations", [&](Settings& s) { s.max_relinearisations = bad; });
  for (const double bad : {0.0, nan})
    refused("gaussian_radius", [&](Settings& s) { s.gaussian_radius = bad; });
  refused("gaussian_force", [&](Settings& s) { s.gaussian_force = nan; });
}

TEST(Step, GaussianForceWithoutCollision) {
  const Model model = block_model(8, Sphere{0.01}, Mode::gaussian);
  State state = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.1)));
  Vec3 total = Vec3::Zero();
  for (const Contact& c : state.contacts) total += c.force;
  EXPECT_LT((total - Vec3(0, 0, -1)).norm(), 1e-5);
  EXPECT_LT((state.wrenches[0].force - Vec3(0, 0, 1)).norm(), 1e-12);
  Index lowest = 0;
  for (std::size_t i = 0; i < state.surface.displacement.size(); ++i)
    if (state.surface.displacement[i].z() < state.surface.displacement[static_cast<std::size_t>(lowest)].z())
      lowest = static_cast<Index>(i);
  EXPECT_LT((rest(model, lowest) - Vec3(0, 0, 0.1)).norm(), 0.013);  // the deepest dent is under the force
}

// Of two bells over all of the organ there is no room for each contact: the forces are whole, the status says
// that contacts are left out.
TEST(Step, ContactsOfGaussianForcesWithoutRoom) {
  Model model = block_model(8, Sphere{0.01}, Mode::gaussian);
  model.settings.gaussian_radius = 0.1, model.settings.max_contacts = 300;
  State one = make_state(model);
  step(model, one, at(Vec3(0, 0, 0.1)));
  EXPECT_EQ(one.status & ~strain_beyond_linear, 0u);
  model.instruments.push_back(model.instruments[0]);
  State state = make_state(model);
  Input input = at(Vec3(0, 0, 0.1));
  input.instruments.push_back(input.instruments[0]);
  step(model, state, input);
  EXPECT_NE(state.status & too_many_contacts, 0u);
  for (const Wrench& wrench : state.wrenches) EXPECT_EQ(wrench.force, one.wrenches[0].force);
}

TEST(Step, AGaussianForceFarAwayIsNone) {
  const Model model = block_model(5, Sphere{0.01}, Mode::gaussian);
  State state = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.1)));
  EXPECT_GT(state.wrenches[0].force.norm(), 0.9);
  step(model, state, at(Vec3(0, 0, 1.1)));
  EXPECT_EQ(state.wrenches[0].force, Vec3::Zero());
}

// More points than the organ has nodes: the first two instruments have the same ones, the third has others,
// too.
TEST(Step, NodesInSeveralInstrumentsTakeNoRoomFromOthers) {
  Model model = block_model(6, HalfSpace{});
  model.instruments = {3, model.instruments[0]};
  double force[2] = {};
  for (const bool widest_first : {false, true}) {
    State state = make_state(model);
    Input input = at(Vec3(0, 0, 0.08));  // solid below
    input.instruments = {3, input.instruments[0]};
    input.instruments[widest_first ? 0 : 2].translation.z() = 0.101;
    step(model, state, input);
    EXPECT_EQ(state.status & not_converged, 0u);
    for (const Wrench& w : state.wrenches) force[widest_first] += w.force.z();
  }
  EXPECT_LT(force[0], -1);
  EXPECT_NEAR(force[0], force[1], 1e-5 * std::abs(force[1]));
}

TEST(Step, ImprintStays) {
  const Model model = block_model(8, Sphere{0.03}, Mode::imprint);
  State state = make_state(model);
  step(model, state, at(Vec3(0, 0, 0.12)));
  EXPECT_GT(state.contacts.size(), 3u);
  const std::vector<Vec3f> dent = state.surface.displacement;
  step(model, state, at(Vec3(0, 0, 0.5)));
  EXPECT_EQ(dent, state.surface.displacement);
  float deepest = 0;
  for (const Vec3f& u : dent) deepest = std::min(deepest, u.z());
  EXPECT_NEAR(deepest, -0.01, 0.001);
}

TEST(Step, SameInputsSameBits) {
  const Model model = block_model(7, Sphere{0.03});
  State a = make_state(model), b = make_state(model);
  for (int k = 0; k < 30; ++k) {
    const Input input = at(Vec3(0.001 * k, 0, 0.125 - 0.0003 * k));
    step(model, a, input);
    step(model, b, input);
    ASSERT_EQ(a.surface.displacement, b.surface.displacement);
    ASSERT_EQ(a.wrenches[0].force, b.wrenches[0].force);
  }
}

}  // namespace
}  // namespace palpate
