// Pressed to 30 % of the organ, slowly and in big steps: a tick meets the tolerances or says not_converged,
// and held still it comes to rest.
#include <gtest/gtest.h>

#include "fixtures.hpp"

namespace palpate {
namespace {

// What a converged tick promises: gaps of 1e-6 of the size, forces along the normals within 1e-3.
void expect_tolerances(const Model& model, const State& state, const Input& input, const char* what) {
  const double tolerance = 1e-6 * organ_size(model);
  double peak = 0;
  for (const Contact& c : state.contacts) peak = std::max(peak, c.force.norm());
  double turned = 0, total = 0;
  for (const Contact& c : state.contacts) {
    const auto i = static_cast<std::size_t>(c.instrument);
    const Gap g =
        gap(model.instruments[i].shape, input.instruments[i].inverse() * contact_point(model, state, c.node));
    if (c.force.norm() > 1e-3 * peak) {
      EXPECT_LE(std::abs(g.distance), 1.1 * tolerance) << what;
    }
    turned += c.force.cross(input.instruments[i].rotation * g.normal).norm();
    total += c.force.norm();
  }
  EXPECT_LE(turned, 1.1e-3 * total) << what;
  for (const Index node : model.organ.node_of_row)
    ASSERT_GE(distance(model.instruments[0].shape,
                       input.instruments[0].inverse() * contact_point(model, state, node)),
              -1.1 * tolerance)
        << what;
}

// Ticks until one converges, at most `most`; the pose stays.
int ticks_to_rest(const Model& model, State& state, const Input& input, int most) {
  for (int k = 0; k < most; ++k) {
    step(model, state, input);
    if (!(state.status & not_converged)) return k + 1;
  }
  return most + 1;
}

void press(const char* what, const Shape& shape, const Eigen::Quaterniond& turn, double reach, int order) {
  const Model model = block_model(order == 1 ? 14 : 10, shape, Mode::unilateral, order);
  constexpr double deepest = 0.03;  // of the cube's 0.1 m
  for (const int ticks : {600, 12, 1}) {
    State state = make_state(model);
    Input input;
    int missed = 0;
    for (int k = 1; k <= ticks; ++k) {
      input = at(Vec3(0.003, 0.002, 0.1 + reach - deepest * k / ticks), turn);
      step(model, state, input);
      if (state.status & not_converged)
        ++missed;
      else
        expect_tolerances(model, state, input, what);
      ASSERT_FALSE(testing::Test::HasFailure()) << what << ", tick " << k << " of " << ticks;
    }
    const int rest = ticks_to_rest(model, state, input, 5);
    std::printf(
        "%s, order %d, %d ticks: %d not converged, at rest after %d more; %zu contacts, %.2f N, strain "
        "%.2f\n",
        what, order, ticks, missed, rest, state.contacts.size(), state.wrenches[0].force.norm(),
        state.surface.strains.largest);
    EXPECT_LE(missed, ticks == 1) << what;  // but for the tick that goes 30 mm deep at once
    EXPECT_LE(rest, 1) << what;
    for (int k = 0; k < 20; ++k) {
      step(model, state, input);
      EXPECT_FALSE(state.status & not_converged) << what << ", held still";
    }
    expect_tolerances(model, state, input, what);
  }
}

const Eigen::Quaterniond upright = Eigen::Quaterniond::Identity();
// An edge along y, downwards.
const Eigen::Quaterniond on_edge(Eigen::AngleAxisd(M_PI / 4, Vec3::UnitY()));
// Head, neck and collar, like the demo's bishop lying on its side: concave.
Shape bishop() {
  return lattice_of(make_star_shaped(Vec3::Zero(), 16,
                                     [](const Vec3& d) {
                                       const double z = d.z();
                                       return 0.02 * (1 - 0.35 * std::cos(6 * std::acos(z)) * (1 - z * z));
                                     }),
                    0.8e-3);
}

TEST(Deep, Ball) {
  for (const int order : {1, 2}) press("ball", Sphere{0.03}, upright, 0.03, order);
}
TEST(Deep, Edge) {
  for (const int order : {1, 2})
    press("edge", Cuboid{Vec3(0.02, 0.03, 0.02)}, on_edge, 0.02 * std::sqrt(2.0), order);
}
TEST(Deep, Concave) {
  const Eigen::Quaterniond lying(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitX()));
  for (const int order : {1, 2}) press("concave", bishop(), lying, 0.026, order);
}

}  // namespace
}  // namespace palpate
