// Friction against a solve that knows nothing of candidates, blocks and turns: projected Gauss-Seidel over
// the whole compliance in float64, node by node, on the ball's exact geometry.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "fixtures.hpp"

namespace palpate {
namespace {

constexpr double radius = 0.025;

Model ball_on_block(double mu) {
  Model model = block_model(8, Sphere{radius});
  model.settings.friction = mu;
  return model;
}

struct Reference {
  explicit Reference(const Model& m)
      : model(m), nodes(static_cast<int>(m.organ.compliance.nodes())), c(3 * nodes, 3 * nodes) {
    const std::span<const float> matrix = m.organ.compliance.matrix();
    for (int i = 0; i < 3 * nodes; ++i)
      for (int j = 0; j < 3 * nodes; ++j)
        c(i, j) = static_cast<double>(matrix[static_cast<std::size_t>(i) * 3 * m.organ.compliance.nodes() +
                                             static_cast<std::size_t>(j)]);
  }

  // Forces under a ball at `center`. touched: of each row, where on the ball the node touched it at the end
  // of the last tick, if it did (known). Such a node has friction; its slip begins there.
  void solve(const Vec3& center, const std::vector<Vec3>& touched, const std::vector<bool>& known) {
    f = Eigen::VectorXd::Zero(3 * nodes), u = f;
    for (int sweep = 0; sweep < 20000; ++sweep) {
      double change = 0, most = 0;
      for (int i = 0; i < nodes; ++i) {
        const Vec3 old = f.segment<3>(3 * i);
        const Vec3 x = rest(i) + u.segment<3>(3 * i);
        const double gap = (x - center).norm() - radius;
        if (gap >= 0 && old == Vec3::Zero()) continue;
        const Vec3 n = (x - center).normalized();
        const Mat3 own = c.block<3, 3>(3 * i, 3 * i), along = Mat3::Identity() - n * n.transpose();
        const double p = std::max(0.0, old.dot(n) - gap / n.dot(own * n));
        Vec3 rub = Vec3::Zero();
        if (known[static_cast<std::size_t>(i)]) {
          const Vec3 slip = along * (x - center - touched[static_cast<std::size_t>(i)]);
          const double softest =
              Eigen::SelfAdjointEigenSolver<Mat3>(along * own * along, Eigen::EigenvaluesOnly)
                  .eigenvalues()[2];
          rub = along * old - slip / softest;
          if (rub.norm() > model.settings.friction * p) rub *= model.settings.friction * p / rub.norm();
        }
        const Vec3 now = p * n + rub;
        f.segment<3>(3 * i) = now;
        u += c.middleCols<3>(3 * i) * (now - old);
        change = std::max(change, (now - old).norm()), most = std::max(most, now.norm());
      }
      if (change <= 1e-7 * most) return;
    }
    ADD_FAILURE() << "the reference does not come to rest";
  }
  Vec3 rest(int i) const {
    return model.organ
        .contact_points[static_cast<std::size_t>(model.organ.node_of_row[static_cast<std::size_t>(i)])];
  }

  const Model& model;
  int nodes;
  Eigen::MatrixXd c;
  Eigen::VectorXd f, u;
};

// Pressed in, then dragged. Node by node, tick by tick; and what slides is rubbed against its slip.
TEST(FrictionReference, ADraggedBallNodeByNode) {
  for (const double mu : {0.2, 0.6}) {
    const Model model = ball_on_block(mu);
    State state = make_state(model);
    Reference reference(model);
    const auto rows = static_cast<std::size_t>(reference.nodes);
    double most = 0, against = 1, whole = 0;
    std::size_t slid = 0, stuck = 0;
    for (int k = 0; k < 50; ++k) {
      std::vector<Vec3> touched(rows, Vec3::Zero());
      std::vector<bool> known(rows, false);
      for (const Contact& c : state.contacts) {
        const auto row = static_cast<std::size_t>(model.organ.row_of[static_cast<std::size_t>(c.node)]);
        touched[row] = c.touched, known[row] = true;
      }
      const Vec3 center(-0.006 + 4e-4 * std::max(0, k - 20), 0.003,
                        0.1 + radius + 1e-3 - 5e-4 * std::min(k, 18));
      step(model, state, at(center));
      ASSERT_EQ(state.status & ~strain_beyond_linear, 0u) << k;
      reference.solve(center, touched, known);
      double peak = 0;
      for (int i = 0; i < reference.nodes; ++i) peak = std::max(peak, reference.f.segment<3>(3 * i).norm());
      Eigen::VectorXd off = reference.f;
      for (const Contact& c : state.contacts) {
        const int row = model.organ.row_of[static_cast<std::size_t>(c.node)];
        off.segment<3>(3 * row) -= c.force;
        const Vec3 x = contact_point(model, state, c.node) - center, n = x.normalized();
        const double p = c.force.dot(n);
        const Vec3 rub = c.force - p * n;
        const auto r = static_cast<std::size_t>(row);
        if (!known[r]) {
          EXPECT_LT(rub.norm(), 2e-3 * peak);
          continue;
        }
        const Vec3 way = x - touched[r], slip = way - way.dot(n) * n;
        (rub.norm() < 0.99 * mu * p ? stuck : slid) += 1;
        if (rub.norm() >= 0.99 * mu * p && slip.norm() > 2e-5 && p > 0.05 * peak)
          against = std::min(against, -rub.dot(slip) / (rub.norm() * slip.norm()));
      }
      for (int i = 0; i < reference.nodes; ++i)
        if (peak > 0) most = std::max(most, off.segment<3>(3 * i).norm() / peak);
      Vec3 sum = Vec3::Zero();
      for (int i = 0; i < reference.nodes; ++i) sum += reference.f.segment<3>(3 * i);
      if (peak > 0) whole = std::max(whole, (sum + state.wrenches[0].force).norm() / sum.norm());
    }
    EXPECT_LT(most, 0.004);  // a tick ends when friction changes by less than 1e-3 of the pressure
    EXPECT_LT(whole, 0.002);
    EXPECT_GT(slid, 50u);
    EXPECT_GT(stuck, 10u);
    EXPECT_GT(against, 0.985);
  }
}

// Torques are about each instrument's own origin, wherever organ and instruments are in the world. A ball's
// comes from friction alone: radius times its force along the surface.
TEST(FrictionReference, TorquesOfTwoInstruments) {
  for (const double mu : {0.0, 0.4}) {
    Model model = ball_on_block(mu);
    model.instruments[0].shape = Sphere{0.015};
    model.instruments.push_back({"other", Sphere{0.012}, {}});
    const double radii[] = {0.015, 0.012};
    State state = make_state(model);
    Input input;
    input.organ = {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized())),
                   Vec3(0.3, -0.2, 0.5)};
    input.instruments.resize(2);
    for (int k = 0; k <= 40; ++k) {
      const double depth = 0.006 * std::min(1.0, k / 15.0), moved = 2e-4 * std::max(0, k - 15);
      input.instruments[0] =
          input.organ * Pose{Eigen::Quaterniond::Identity(), Vec3(-0.025 + moved, 0.002, 0.115 - depth)};
      input.instruments[1] =
          input.organ * Pose{Eigen::Quaterniond::Identity(), Vec3(0.025, 0.003 - moved, 0.112 - depth)};
      step(model, state, input);
      ASSERT_EQ(state.status & ~strain_beyond_linear, 0u) << k;
    }
    for (std::size_t i = 0; i < 2; ++i) {
      Vec3 force = Vec3::Zero(), torque = Vec3::Zero(), rubbed = Vec3::Zero();
      double peak = 0;
      for (const Contact& c : state.contacts) {
        if (c.instrument != static_cast<Index>(i)) continue;
        const Vec3 arm = contact_point(model, state, c.node) - input.instruments[i].translation;
        EXPECT_NEAR(arm.norm(), radii[i], 1e-6);
        force -= c.force, torque -= arm.cross(c.force);
        rubbed -= c.force - c.force.dot(arm) / arm.squaredNorm() * arm;
        peak = std::max(peak, c.force.norm());
      }
      const Wrench& w = state.wrenches[i];
      EXPECT_GT(peak, 0.02);
      EXPECT_LT((w.force - force).norm(), 1e-6 * peak);
      EXPECT_LT((w.torque - torque).norm(), 1e-5 * peak * radii[i]);
      const Vec3 turned = input.organ.rotation.conjugate() * w.torque;
      if (mu == 0) {
        EXPECT_LT(turned.norm(), 3e-3 * peak * radii[i]);
        continue;
      }
      // Dragged along x: friction holds its underside back, and would turn it about y; along -y, about x.
      const Vec3 axis = i == 0 ? Vec3::UnitY() : Vec3::UnitX();
      EXPECT_GT(turned.dot(axis), 0.9 * turned.norm());
      EXPECT_GT(turned.norm(), 0.5 * radii[i] * rubbed.norm());
      EXPECT_LT(turned.norm(), 1.2 * radii[i] * rubbed.norm());
      EXPECT_GT(turned.norm(), 0.2 * mu * radii[i] * w.force.norm());
    }
  }
}

}  // namespace
}  // namespace palpate
