// A rigid sphere pressed into a layer bonded to a rigid base, through contact detection and step(): Hertz
// with the correction for finite thickness of Dimitriadis et al., Biophys. J. 82 (2002) 2798-2810.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numbers>

#include "palpate/compliance/blas.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/simulation/model.hpp"
#include "support/validation_table.hpp"

namespace palpate::test {
namespace {

const bool blas_is_set_up = (set_up_blas(), true);
constexpr double height = 0.010, half_width = 0.030;  // m, of the block
constexpr double contact_radius = 0.002;              // m, largest; what the mesh is made for

// Bonded layer of any Poisson's ratio, chi = sqrt(R depth) / height. The last term has the other sign in the
// formula printed for nu = 0.5; here it is below 2e-4 of the force.
double dimitriadis(const Material& m, double radius, double depth) {
  const double nu = m.poisson, pi = std::numbers::pi, chi = std::sqrt(radius * depth) / height;
  const double a = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1 - nu);
  const double b = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1 - nu);
  return 4.0 / 3 * m.young / (1 - nu * nu) * std::sqrt(radius) * std::pow(depth, 1.5) *
         (1 - 2 * a / pi * chi + 4 * a * a / (pi * pi) * chi * chi -
          8 / std::pow(pi, 3) * (a * a * a + 4 * pi * pi / 15 * b) * std::pow(chi, 3) +
          16 * a / std::pow(pi, 4) * (a * a * a + 3 * pi * pi / 5 * b) * std::pow(chi, 4));
}

TEST(Hertz, CorrectionIsThePrintedOneWhereIncompressible) {
  const double chi = 0.2, radius = 0.04, depth = chi * chi * height * height / radius;
  const double hertz = 16.0 / 9 * std::sqrt(radius) * std::pow(depth, 1.5);
  EXPECT_NEAR(dimitriadis({1, 0.5}, radius, depth) / hertz,
              1 + 1.133 * chi + 1.283 * chi * chi + 0.769 * std::pow(chi, 3), 3e-4);
}

// From 0: `fine` even steps to fine_end, then `coarse` to end that grow by one factor.
std::vector<double> graded(double fine_end, int fine, double end, int coarse) {
  std::vector<double> x;
  for (int i = 0; i <= fine; ++i) x.push_back(fine_end * i / fine);
  const double h = fine_end / fine;
  double low = 1, high = 10;  // sum of h q^k, k = 1..coarse, is end - fine_end
  for (int i = 0; i < 60; ++i) {
    const double q = 0.5 * (low + high);
    (h * q * (std::pow(q, coarse) - 1) / (q - 1) < end - fine_end ? low : high) = q;
  }
  for (int k = 1; k <= coarse; ++k) x.push_back(x.back() + h * std::pow(low, k));
  return x;
}

// Top in z = 0, graded towards the contact: eight elements a contact radius.
TetMesh graded_block() {
  const auto across = graded(contact_radius, 8, half_width, 6);
  const auto down = graded(contact_radius / 2, 2, height, 4);
  const int n = static_cast<int>(across.size()) - 1, m = static_cast<int>(down.size()) - 1;
  TetMesh mesh = make_block({Vec3(-n, -n, -m), Vec3(n, n, 0)}, {2 * n, 2 * n, m});
  const auto at = [](const std::vector<double>& x, double i) {
    return std::copysign(x[static_cast<std::size_t>(std::lround(std::abs(i)))], i);
  };
  for (Vec3& p : mesh.nodes) p = Vec3(at(across, p.x()), at(across, p.y()), at(down, p.z()));
  return mesh;
}

struct Range {
  double low, high;
};

// Of force / exact - 1, over contact radii sqrt(R depth) of 4 to 8 elements.
Range press(Model& model, double radius) {
  const Material& material = model.organ.materials[0];
  model.instruments = {{"sphere", Sphere{radius}, {}}};
  State state = make_state(model);
  Input input;
  input.instruments.resize(1);
  Range error{1, -1};
  double last = 0;
  for (const int elements : {4, 5, 6, 7, 8}) {
    const double depth = std::pow(elements / 8.0 * contact_radius, 2) / radius;
    input.instruments[0].translation = Vec3(0, 0, radius - depth);
    step(model, state, input);
    EXPECT_EQ(state.status & ~strain_beyond_linear, 0u);
    const double force = state.wrenches[0].force.z(), exact = dimitriadis(material, radius, depth);
    std::printf(
        "nu %.2f, R %.0f mm, depth %.4f mm, %zu contacts: %.6f N, %+.2f %% of Hertz' and Dimitriadis'\n",
        material.poisson, 1e3 * radius, 1e3 * depth, state.contacts.size(), force, 100 * (force / exact - 1));
    validation_row(
        "hertz", "poisson,radius_mm,depth_mm,elements_per_contact_radius,contacts,force_N,exact_N,error",
        fmt::format("{},{},{:.5f},{},{},{:.6g},{:.6g},{:.4g}", material.poisson, 1e3 * radius, 1e3 * depth,
                    elements, state.contacts.size(), force, exact, force / exact - 1));
    EXPECT_GT(force, last);
    error = {std::min(error.low, force / exact - 1), std::max(error.high, force / exact - 1)};
    last = force;
  }
  return error;
}

TEST(Hertz, SphereOnABondedLayer) {
  for (const double poisson : {0.3, 0.45}) {
    Model model;
    model.organ =
        bake(graded_block(), {{10e3, poisson}}, {AnchorHalfSpace{Vec3(0, 0, -height), Vec3::UnitZ()}}, 0, {},
             nullptr, {.pinch = false});
    // Elements are too stiff, and hats spread the force over an edge of the contact: never below.
    const Range flat = press(model, 0.04);
    EXPECT_GT(flat.low, 0.01) << poisson;
    EXPECT_LT(flat.high, 0.025) << poisson;
    // Hertz leaves out that the surface also moves inwards, in proportion to (1 - 2 nu) a / R
    // (docs/validation.md).
    EXPECT_LT(press(model, 0.02).high, 0.03) << poisson;
    EXPECT_LT(press(model, 0.01).high, poisson < 0.4 ? 0.045 : 0.03) << poisson;
  }
}

}  // namespace
}  // namespace palpate::test
