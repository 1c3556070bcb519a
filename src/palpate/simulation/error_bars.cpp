#include "palpate/simulation/error_bars.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/compliance/storage.hpp"

namespace palpate {

namespace {

// Of an entry of C, relative to sqrt(C_ii C_jj).
double storage_error(const Compliance& compliance) noexcept {
  if (const auto* h = compliance.as<HierarchicalCompliance>()) return h->matrix().error;
  return compliance.as<HalfCompliance>() ? 5e-4 : 1e-6;
}

// Calibrated against CalculiX' large strains (docs/validation.md, LargeStrain.*): the smallest round factor
// that covers both of its materials.
constexpr double per_ratio = 1.25;

constexpr double per_node = 1.2;  // likewise, against fine elements

double linearity_of(const ContactStrain& strain) noexcept {
  return strain.linear > 0 ? per_ratio * static_cast<double>(strain.quadratic / strain.linear) : 0;
}

}  // namespace

ErrorBar error_bar(const Organ& organ, const Surface& surface) noexcept {
  const Loads& loads = surface.loads;
  ErrorBar bar;
  const Discretisation& pinch = organ.discretisation;
  bar.discretisation_known = pinch.against != 0;
  double force = 0, linearity = 0, work = 0, most = 0;
  for (std::size_t i = 0; i < loads.count; ++i) {
    const Index row = loads.rows[i];
    const auto node = static_cast<std::size_t>(organ.node_of_row[static_cast<std::size_t>(row)]);
    const double f = loads.forces[i].norm();
    std::array<float, 9> c;
    organ.compliance.block({&row, 1}, c, 3);
    force += f;
    linearity += f * linearity_of(surface.strains.contacts[i]);
    work += loads.forces[i].dot(surface.reading[node].cast<double>());
    most += f * std::sqrt(static_cast<double>(std::max(0.0f, c[0] + c[4] + c[8])));
  }
  if (!(force > 0)) return bar;
  bar.discretisation = std::abs(pinch.stiffness);
  bar.resolution = per_node / static_cast<double>(loads.count);
  // For a given depth the force falls by what the work f.Cf grows by.
  bar.compression = work > 0 ? storage_error(organ.compliance) * most * most / work : 0;
  bar.linearity = linearity / force;
  return bar;
}

ErrorBar error_bar(const ErrorBar& resultant, const Surface& surface, Index row) noexcept {
  ErrorBar bar = resultant;
  for (std::size_t i = 0; i < surface.loads.count; ++i)
    if (surface.loads.rows[i] == row) bar.linearity = linearity_of(surface.strains.contacts[i]);
  return bar;
}

}  // namespace palpate
