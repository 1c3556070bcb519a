// Grasped nodes go with the instrument and pull at it; against dense solves, and by what a grip may not do:
// make energy, leave something behind, or change what others feel.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <fstream>
#include <set>

#include "fixtures.hpp"
#include "palpate/base/error.hpp"
#include "palpate/simulation/loop.hpp"
#include "palpate/simulation/recording.hpp"
#include "palpate/simulation/scene.hpp"
#include "unit/io/io_test.hpp"

namespace palpate {
namespace {

constexpr std::uint8_t closed = 1, open = 0;

Input with_grip(const Vec3& p, std::uint8_t grip,
                const Eigen::Quaterniond& q = Eigen::Quaterniond::Identity()) {
  Input input = at(p, q);
  input.grips = {grip};
  return input;
}

// A ball of 3 cm radius on top of the block; pressed in by 8 mm, it grasps.
struct Grip : ::testing::TestWithParam<std::tuple<double, int>> {
  Model model = make(std::get<0>(GetParam()), std::get<1>(GetParam()));
  State state = make_state(model);
  static constexpr double touching = 0.13;  // m: height of the ball's origin

  static Model make(double friction, int order) {
    static const Organ organs[] = {block_organ(10), block_organ(8, {.order = 2, .pinch = false})};
    Model model;
    model.organ = organs[order - 1];
    model.instruments.push_back({"tool", Sphere{0.03}, {}});
    model.settings.friction = friction;
    return model;
  }
  void press() {
    for (int k = 0; k <= 10; ++k) go(with_grip(Vec3(0.002, 0.001, touching - 8e-4 * k), k == 10));
    ASSERT_GT(state.grasps.size(), 3u);
  }
  void go(const Input& input, std::uint32_t allowed = strain_beyond_linear) {
    step(model, state, input);
    ASSERT_EQ(state.status & ~allowed, 0u);
  }
  // From where it was pressed, in ticks of 0.2 mm.
  void lift(double height) {
    const int ticks = static_cast<int>(std::ceil(height / 2e-4));
    for (int k = 1; k <= ticks; ++k) go(with_grip(lifted(height * k / ticks), closed));
  }
  static Vec3 lifted(double height) { return Vec3(0.002, 0.001, touching - 8e-3 + height); }
};
INSTANTIATE_TEST_SUITE_P(FrictionAndOrder, Grip,
                         ::testing::Values(std::tuple{0.0, 1}, std::tuple{0.0, 2}, std::tuple{0.4, 1},
                                           std::tuple{0.4, 2}));

Eigen::MatrixXd compliance_of(const Model& model, const std::vector<Index>& nodes) {
  std::vector<Index> rows;
  for (const Index node : nodes) rows.push_back(model.organ.row_of[static_cast<std::size_t>(node)]);
  const std::size_t n = 3 * rows.size();
  std::vector<float> c(n * n);
  model.organ.compliance.block(rows, c, n);
  return Eigen::Map<Eigen::MatrixXf>(c.data(), static_cast<int>(n), static_cast<int>(n)).cast<double>();
}

Vec3 wanted(const Model& model, const Grasp& g, const Input& input) {
  return input.organ.inverse() * (input.instruments[static_cast<std::size_t>(g.instrument)] * g.place) -
         model.organ.contact_points[static_cast<std::size_t>(g.node)];
}

TEST_P(Grip, ForcesAreThoseOfADenseSolve) {
  model.settings.tolerance = 1e-7;
  state = make_state(model);
  press();
  lift(0.012);
  const Input input = with_grip(lifted(0.012) + Vec3(0.001, 0, 0), closed,
                                Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Vec3(1, 2, 3).normalized())));
  for (int k = 0; k < 3; ++k) go(input);
  std::vector<Index> nodes;
  Eigen::VectorXd d(3 * state.grasps.size()), f(d.size());
  ASSERT_EQ(state.contacts.size(), state.grasps.size());  // nothing else touches any more
  for (std::size_t i = 0; i < state.grasps.size(); ++i) {
    ASSERT_TRUE(state.contacts[i].grasped);
    nodes.push_back(state.grasps[i].node);
    d.segment<3>(static_cast<int>(3 * i)) = wanted(model, state.grasps[i], input);
    f.segment<3>(static_cast<int>(3 * i)) = state.contacts[i].force_in_organ;
    ASSERT_EQ(state.contacts[i].node, nodes[i]);
    EXPECT_LT((contact_point(model, state, nodes[i]) - input.instruments[0] * state.grasps[i].place).norm(),
              1e-7 * organ_size(model));
  }
  const Eigen::VectorXd dense = compliance_of(model, nodes).llt().solve(d);
  EXPECT_LT((f - dense).norm(), 1e-6 * dense.norm());
  EXPECT_GT(dense.norm(), 0.1);
}

TEST_P(Grip, LiftingPullsAndIsLinear) {
  press();
  const std::vector<Grasp> held = state.grasps;
  std::vector<Vec3> forces;
  for (const double height : {0.010, 0.012, 0.014}) {
    lift(height);
    forces.push_back(state.wrenches[0].force);
    EXPECT_GE(state.loads.work(), 0);
    EXPECT_EQ(grasped_by(std::span(&state, 1), 0), held.size());
    ASSERT_EQ(state.contacts.size(), held.size());
  }
  EXPECT_LT(forces[2].z(), -0.1);  // on the instrument, down
  EXPECT_LT((forces[2] - 2 * forces[1] + forces[0]).norm(), 1e-5 * forces[2].norm());
  for (std::size_t i = 0; i < held.size(); ++i) EXPECT_EQ(held[i].place, state.grasps[i].place);
}

TEST_P(Grip, ReleasedItIsAsIfItHadNeverBeen) {
  press();
  const Vec3 pressed = state.wrenches[0].force;
  lift(0.003);
  lift(0);
  go(with_grip(lifted(0), open));  // the nodes are where they were
  EXPECT_TRUE(state.grasps.empty());
  for (const Contact& c : state.contacts) EXPECT_FALSE(c.grasped);
  EXPECT_LT((state.wrenches[0].force - pressed).norm(),
            (model.settings.friction > 0 ? 0.2 : 1e-3) * pressed.norm());
  go(with_grip(lifted(0), closed));
  ASSERT_FALSE(state.grasps.empty());
  lift(0.010);
  go(with_grip(lifted(0.010), open));
  EXPECT_EQ(state.wrenches[0].force, Vec3::Zero());
  EXPECT_EQ(state.loads.count, 0u);
  for (const Vec3f& u : state.surface.displacement) ASSERT_EQ(u, Vec3f::Zero());
}

TEST_P(Grip, MakesNoEnergy) {
  double work = 0, peak = 0, cycle = 0;  // J, of the hand
  Vec3 last = Vec3(0, 0, touching), force = Vec3::Zero();
  const auto move = [&](const Vec3& to, int ticks, std::uint8_t grip) {
    const Vec3 from = last;
    for (int k = 1; k <= ticks; ++k) {
      const Vec3 now = from + (to - from) * (static_cast<double>(k) / ticks);
      step(model, state, with_grip(now, grip));
      work -= 0.5 * (force + state.wrenches[0].force).dot(now - last);
      last = now, force = state.wrenches[0].force;
      peak = std::max(peak, work);
    }
  };
  move(Vec3(0, 0, touching - 0.008), 800, open);
  const double begun = work;
  move(last, 1, closed);
  for (const Vec3& way :
       {Vec3(0, 0, 0.012), Vec3(0.004, 0, 0), Vec3(0, 0.003, -0.004), Vec3(-0.004, -0.003, -0.008)})
    move(last + way, 200, closed);
  cycle = work - begun;
  EXPECT_GE(cycle, -1e-6);
  EXPECT_LT(cycle, 0.02 * peak);  // nor does it lose any while it holds
  move(last, 1, open);
  move(Vec3(0, 0, touching + 0.001), 900, open);
  EXPECT_EQ(force, Vec3::Zero());
  EXPECT_GE(work, -1e-6);
  EXPECT_GT(peak, 1e-4);
}

TEST_P(Grip, TurningTwistsTheTissue) {
  press();
  lift(0.008);
  const double before = state.wrenches[0].torque.z();
  const auto turn = [&](double angle) {
    go(with_grip(lifted(0.008), closed, Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vec3::UnitZ()))));
    return state.wrenches[0].torque.z() - before;
  };
  double torque = 0;
  for (int k = 1; k <= 20; ++k) torque = turn(0.01 * k);
  EXPECT_LT(torque, -1e-5);  // against the turn
  const double back = [&] {
    for (int k = 19; k >= -20; --k) turn(0.01 * k);
    return turn(-0.2);
  }();
  EXPECT_NEAR(back, -torque, 0.1 * std::abs(torque));
  for (int k = -19; k <= 0; ++k) turn(0.01 * k);
  EXPECT_NEAR(turn(0), 0, 1e-6 * std::abs(torque));
}

TEST_P(Grip, OldSurfacesGiveTheSameBits) {
  State late = make_state(model);
  Surface old = late.surface;
  Deformer deformer(model.organ);
  std::size_t held = 0;
  for (int k = 0; k < 200; ++k) {
    const double z = touching - (k < 40 ? 1.2e-4 * k : 4.8e-3 - 8e-5 * (k - 40));
    const Input input = with_grip(Vec3(1e-5 * k, 0, z), k >= 40 && k < 170);
    step(model, state, input);
    tick(model, late, input, old);
    if (k % 12 == 0) deformer(model.organ, late.loads, old);
    late.status |= state.status & strain_beyond_linear;
    ASSERT_EQ(state_hash(state), state_hash(late)) << k;
    ASSERT_EQ(state.status & ~strain_beyond_linear, 0u) << k;
    held += !state.grasps.empty();
  }
  EXPECT_EQ(held, 130u);
}

TEST_P(Grip, ASecondInstrumentThatPressesAgreesWithAMixedSolve) {
  model = block_model(5, Sphere{0.03}, Mode::unilateral, std::get<1>(GetParam()));
  model.instruments.push_back({"plate", HalfSpace{}, {}});
  model.settings.tolerance = 1e-7;  // frictionless: the normal is known
  state = make_state(model);
  const Eigen::Quaterniond sideways(Eigen::AngleAxisd(-M_PI / 2, Vec3::UnitY()));  // faces -x
  Input input = at(Vec3(0, 0, touching - 0.008));
  input.instruments.push_back({sideways, Vec3(0.06, 0, 0)});
  input.grips = {closed, open};
  go(input);
  ASSERT_GT(state.grasps.size(), 2u);
  for (int k = 1; k <= 20; ++k) {
    input.instruments[0].translation.z() += 1e-3;
    input.instruments[1].translation.x() = 0.06 - 7e-4 * k;
    go(input, strain_beyond_linear | anchor_touched);
  }
  const Vec3 n = sideways * Vec3::UnitZ();
  EXPECT_NEAR(n.x(), -1, 1e-12);

  // Every row of the organ: of grasped nodes three, w = 0; of all others the plate's normal, w >= 0, p >= 0.
  const auto nodes = static_cast<int>(model.organ.compliance.nodes());
  const Eigen::MatrixXd c = compliance_of(model, model.organ.node_of_row);
  std::vector<Vec3> axes;
  std::vector<int> row;
  std::vector<double> gap;
  std::vector<bool> held;
  for (int i = 0; i < nodes; ++i) {
    const Index node = model.organ.node_of_row[static_cast<std::size_t>(i)];
    const auto g = std::find_if(state.grasps.begin(), state.grasps.end(),
                                [&](const Grasp& a) { return a.node == node; });
    if (g == state.grasps.end()) {
      axes.push_back(n), row.push_back(i), held.push_back(false);
      gap.push_back(n.dot(model.organ.contact_points[static_cast<std::size_t>(node)] -
                          input.instruments[1].translation));
      continue;
    }
    for (int a = 0; a < 3; ++a) {
      axes.push_back(Vec3::Unit(a)), row.push_back(i), held.push_back(true);
      gap.push_back(-wanted(model, *g, input)[a]);
    }
  }
  const auto m = static_cast<int>(row.size());
  Eigen::MatrixXd a(m, m);
  Eigen::VectorXd p = Eigen::VectorXd::Zero(m);
  const auto s = [](int i) { return static_cast<std::size_t>(i); };
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < m; ++j)
      a(i, j) = axes[s(i)].dot(Mat3(c.block<3, 3>(3 * row[s(i)], 3 * row[s(j)])) * axes[s(j)]);
  for (int sweep = 0; sweep < 10000; ++sweep)
    for (int i = 0; i < m; ++i) {
      p[i] -= (a.row(i).dot(p) + gap[s(i)]) / a(i, i);
      if (!held[s(i)]) p[i] = std::max(0.0, p[i]);
    }
  std::vector<Vec3> forces(s(nodes), Vec3::Zero());
  for (int i = 0; i < m; ++i) forces[s(row[s(i)])] += p[i] * axes[s(i)];
  std::size_t pressed = 0;
  for (const Contact& contact : state.contacts) {
    Vec3& f = forces[s(model.organ.row_of[s(contact.node)])];
    EXPECT_LT((contact.force_in_organ - f).norm(), 1e-4 * p.cwiseAbs().maxCoeff());
    f.setZero();
    pressed += !contact.grasped;
    EXPECT_EQ(contact.grasped, contact.instrument == 0);
  }
  for (const Vec3& f : forces) EXPECT_LT(f.norm(), 1e-4 * p.cwiseAbs().maxCoeff());
  EXPECT_GT(pressed, 5u);
  EXPECT_LT(state.wrenches[0].force.z(), -0.1);
  EXPECT_GT(state.wrenches[1].force.x(), 0.1);
}

TEST_P(Grip, AJumpLetsGo) {
  press();
  lift(0.005);
  const std::vector<Grasp> held = state.grasps;
  const auto jump = [&](const Vec3& p) { step(model, state, with_grip(p, closed)); };
  jump(Vec3(0, 0, std::nan("")));
  EXPECT_EQ(state.status, bad_input);
  EXPECT_EQ(state.grasps.size(), held.size());
  Input wrong = with_grip(lifted(0.005), closed);
  wrong.grips.push_back(open);
  step(model, state, wrong);
  EXPECT_EQ(state.status, bad_input);
  go(with_grip(lifted(0.005), closed));
  EXPECT_EQ(state.contacts.size(), held.size());
  jump(Vec3(0, 0, 1.1));
  EXPECT_TRUE(state.grasps.empty());
  EXPECT_EQ(state.wrenches[0].force, Vec3::Zero());
  jump(lifted(0));  // put on the organ, it presses, and grasps anew
  EXPECT_FALSE(state.grasps.empty());
  for (int k = 0; k < 400; ++k) jump(lifted(0.005 * k));  // 2 m away in small steps
  EXPECT_TRUE(std::isfinite(state.wrenches[0].force.norm()));
  EXPECT_NE(state.status & strain_beyond_linear, 0u);
}

TEST_P(Grip, WhatHasNoRoomIsLeftOut) {
  const int room = std::get<1>(GetParam()) == 1 ? 10 : 5;  // fewer than it touches, more than a grip takes
  model.settings.max_contacts = room;
  state = make_state(model);
  std::uint32_t status = 0;
  for (int k = 0; k <= 60; ++k) {
    step(model, state, with_grip(Vec3(0, 0, touching - 1e-4 * k), k >= 50));
    status |= state.status;
    ASSERT_LE(state.contacts.size() + 2 * grasped_by(std::span(&state, 1), 0),
              static_cast<std::size_t>(room));
  }
  EXPECT_NE(status & too_many_contacts, 0u);
  EXPECT_FALSE(state.grasps.empty());
}

// What a caller has it hold leaves no room for the contacts that bore a force.
TEST_P(Grip, AContactWithoutRoomIsNotDroppedInSilence) {
  model.settings.max_contacts = 100;
  state = make_state(model);
  for (int k = 0; k <= 10; ++k) go(with_grip(Vec3(0.002, 0.001, touching - 8e-4 * k), open));
  ASSERT_GT(state.contacts.size(), 3u);
  for (const Index node : model.organ.node_of_row) {
    const Vec3 place = contact_point(model, state, node) - lifted(0);
    if (place.norm() > 0.05 && state.grasps.size() < 33) state.grasps.push_back({node, 0, place});
  }
  ASSERT_EQ(state.grasps.size(), 33u);
  step(model, state, with_grip(lifted(0.006), closed));  // away from what it pressed on
  EXPECT_NE(state.status & too_many_contacts, 0u);
}

// Grasps of no node, of no instrument, of an anchor, of the same node again: what cannot be held is let go.
TEST_P(Grip, BadGraspsAreLetGo) {
  model.instruments.push_back({"other", Sphere{0.01}, {}});
  state = make_state(model);
  Input input = at(lifted(0));
  input.instruments.push_back({Eigen::Quaterniond::Identity(), Vec3(0, 0, 0.5)});
  input.grips = {closed, closed};
  for (int k = 0; k < 3; ++k) step(model, state, input);
  const std::vector<Grasp> held = state.grasps;
  const Vec3 force = state.wrenches[0].force;
  ASSERT_GT(held.size(), 3u);
  const auto anchored = static_cast<Index>(
      std::find(model.organ.row_of.begin(), model.organ.row_of.end(), -1) - model.organ.row_of.begin());
  const auto nodes = static_cast<Index>(model.organ.surface_size());
  std::vector<Grasp> bad{held[0], held[1], held[0], {held[2].node, 1, held[2].place}};
  for (const Index node : {-1, nodes, 1 << 30, anchored}) bad.push_back({node, 0, Vec3::Zero()});
  for (const Index instrument : {-1, 2, 1 << 30}) bad.push_back({held[1].node, instrument, Vec3::Zero()});
  bad.push_back({held[3].node, 0, Vec3(0, std::nan(""), 0)});
  state.grasps.insert(state.grasps.end(), bad.begin(), bad.end());
  for (int k = 0; k < 2; ++k) {
    step(model, state, input);
    ASSERT_EQ(state.grasps.size(), held.size());
    for (std::size_t i = 0; i < held.size(); ++i) EXPECT_EQ(state.grasps[i].node, held[i].node);
    EXPECT_LT((state.wrenches[0].force - force).norm(), 1e-6 * force.norm());
    EXPECT_EQ(state.wrenches[1].force, Vec3::Zero());
  }
}

TEST_P(Grip, TwoInstrumentsHoldEachNodeOnce) {
  model.instruments.push_back({"other", Sphere{0.03}, {}});
  state = make_state(model);
  Input input = at(Vec3(-0.008, 0, touching - 0.006));
  input.instruments.push_back({Eigen::Quaterniond::Identity(), Vec3(0.008, 0, touching - 0.006)});
  input.grips = {closed, closed};
  go(input);
  std::set<Index> nodes;
  for (const Grasp& g : state.grasps) EXPECT_TRUE(nodes.insert(g.node).second);
  for (int k = 1; k <= 60; ++k) {
    input.instruments[0].translation.x() -= 5e-5, input.instruments[1].translation.x() += 5e-5;
    for (Pose& p : input.instruments) p.translation.z() += 2e-4;
    go(input);
  }
  EXPECT_EQ(grasped_by(std::span(&state, 1), 0) + grasped_by(std::span(&state, 1), 1), state.grasps.size());
  EXPECT_GT(state.wrenches[0].force.x(), 0.01);  // they stretch what is between them
  EXPECT_LT(state.wrenches[1].force.x(), -0.01);
  EXPECT_LT(state.wrenches[0].force.z(), 0);
}

TEST_P(Grip, OthersDoNotTouchWhatIsHeld) {
  model.instruments.push_back({"other", Sphere{0.01}, {}});
  state = make_state(model);
  Input input = at(lifted(0));
  input.instruments.push_back({Eigen::Quaterniond::Identity(), Vec3(0.03, 0, 0.13)});
  input.grips = {closed, open};
  go(input);
  std::size_t inside = 0;
  for (int k = 1; k <= 50; ++k) {
    input.instruments[1].translation = Vec3(0.03 - 4e-4 * k, 0, 0.13 - 6e-4 * k);
    go(input);
    std::set<Index> nodes;
    for (const Contact& c : state.contacts) {
      EXPECT_TRUE(nodes.insert(c.node).second);
      inside +=
          c.grasped && (contact_point(model, state, c.node) - input.instruments[1].translation).norm() < 0.01;
    }
  }
  EXPECT_GT(inside, 0u);
}

TEST(Grips, OfAHalfSpacePutElsewhereLetGo) {
  const Model model = block_model(6, HalfSpace{});
  State state = make_state(model);
  const Eigen::Quaterniond down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  for (int k = 0; k < 5; ++k) step(model, state, with_grip(Vec3(0, 0, 0.098), closed, down));
  EXPECT_EQ(grasped_by(std::span(&state, 1), 0), 49u);
  EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
  step(model, state, with_grip(Vec3(0, 0, 0.2), closed, down));
  EXPECT_TRUE(state.grasps.empty());
  EXPECT_EQ(state.loads.count, 0u);
}

// Two organs, one ball between them that holds both: recorded, replayed, in the loop.
TEST(Grips, OfSeveralOrgansAreRecordedAndReplayed) {
  std::vector<Model> models;
  models.push_back(block_model(8, Sphere{0.03}));
  models.push_back(block_model(6, Sphere{0.03}, Mode::unilateral, 2));
  models[1].settings.friction = models[0].settings.friction = 0.3;
  constexpr std::uint64_t ticks = 1200;
  const auto set = [](std::uint64_t k, std::span<Input> inputs) {
    inputs[0].organ.translation.x() = -0.073, inputs[1].organ.translation.x() = 0.073;
    const double t = static_cast<double>(k) / ticks;
    place(inputs, 0, {Eigen::Quaterniond::Identity(), Vec3(0.002, 0.01 * t, 0.08 + 0.02 * std::sin(6 * t))});
    grip(inputs, 0, k > 300 && k < 1100);
  };
  std::vector<State> states = make_states(models);
  std::vector<Input> inputs = make_inputs(models);
  Recording recording(models, ticks);
  double torn = 0;
  for (std::uint64_t k = 0; k < ticks; ++k) {
    set(k, inputs);
    step(models, states, inputs);
    recording.add(inputs, states);
    for (const State& s : states) EXPECT_TRUE(k != 500 || s.grasps.size() > 1u);
    torn = std::max(torn, wrench_of(states, 0).force.norm());
  }
  EXPECT_GT(torn, 0.5);
  const TempFolder temp;
  recording.write(temp / "grip.h5", "test");
  const Recording back = Recording::read(temp / "grip.h5");
  std::vector<State> again = make_states(models);
  std::uint64_t differing = 0;
  LoopSettings settings;
  settings.rate = 0, settings.ticks = ticks, settings.frame_rate = 300;
  OrgansHooks hooks;
  hooks.input = [&](std::uint64_t k, std::span<const State>, std::span<Input> in) {
    return back.set_inputs(k, in), true;
  };
  hooks.output = [&](std::uint64_t k, std::span<const Input> in, std::span<const State> s) {
    differing += !recording.agrees(k, s) || (k == 700) != (k == 700 && in[1].grips[0] == closed);
  };
  run_loop(models, again, settings, hooks);
  EXPECT_EQ(differing, 0u);
  EXPECT_EQ(state_hash(std::span<const State>(again)), state_hash(std::span<const State>(states)));
}

TEST(Grips, InMotionFiles) {
  const TempFolder temp;
  const auto put = [&](const std::string& text) {
    std::ofstream(temp / "m.csv") << text;
    return temp / "m.csv";
  };
  const MotionFile file = read_motion(put("time,a.x,b.grip\n0,1,0\n1,2,1\n2,3,0\n"), {"a", "b"});
  for (const auto& [time, grip] : {std::pair{-1.0, 0}, {0.99, 0}, {1.0, 1}, {1.99, 1}, {2.0, 0}, {9.0, 0}}) {
    const Input input = input_at(file, time);
    EXPECT_EQ(input.grips, (std::vector<std::uint8_t>{0, static_cast<std::uint8_t>(grip)})) << time;
  }
  write_motion(temp / "again.csv", file, {"a", "b"});
  EXPECT_EQ(read_motion(temp / "again.csv", {"a", "b"}).motion.grips, file.motion.grips);
  EXPECT_EQ(input_at(read_motion(put("time,a.x\n0,1\n"), {"a"}), 0).grips, std::vector<std::uint8_t>{0});
  const auto message = [&](const std::string& text) -> std::string {
    try {
      read_motion(put(text), {"a"});
    } catch (const Error& e) {
      return e.what();
    }
    return "none";
  };
  EXPECT_NE(message("time,a.grip\n0,0\n1,0.5\n").find("m.csv:3: a grip is 0.5; 1 is closed, 0 open"),
            std::string::npos);
  EXPECT_NE(message("time,organ.grip\n0,0\n").find("'organ.grip' is unknown"), std::string::npos);
  EXPECT_NE(message("time,a.grip\n0,x\n").find("'x' in column a.grip"), std::string::npos);
}

}  // namespace
}  // namespace palpate
