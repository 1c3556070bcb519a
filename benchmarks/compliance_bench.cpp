// From the kidney's stiffness to its compliance, beside CHOLMOD with blocked solves. One thread.
#include <fmt/core.h>

#include <cmath>
#include <memory>

#include "bench.hpp"
#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/compliance/multifrontal.hpp"
#include "palpate/compliance/ordering.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "peers.hpp"
#include "scenes.hpp"

namespace palpate {

namespace {

// Both give the full inverse between the free surface nodes; entry by entry the same to float32.
void require_equal(std::span<const float> a, std::span<const float> b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference = std::max(difference, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
    size = std::max(size, std::abs(static_cast<double>(b[i])));
  }
  if (!(difference <= 1e-5 * size))
    throw Error(ErrorKind::internal, "compliance differs from CHOLMOD's by {} of {}", difference, size);
}

// Rows: factor (ordering included), sweep, total.
std::vector<Value> compliance(int surface_nodes) {
  const scenes::Kidney kidney = scenes::pad_kidney(surface_nodes);
  const FreeStiffness k = remove_anchored(assemble_stiffness(kidney.mesh, kidney.materials),
                                          anchored_nodes(kidney.mesh, kidney.anchors));
  std::vector<Index> nodes, unknowns;
  for (const Index node : boundary(kidney.mesh).nodes)
    if (const Index free = k.free_of[static_cast<std::size_t>(node)]; free >= 0) {
      nodes.push_back(free);
      for (Index a = 0; a < 3; ++a) unknowns.push_back(3 * free + a);
    }
  const auto cholmod = peers::make_cholmod(k.matrix);
  const std::size_t size = unknowns.size() * unknowns.size();
  warm_memory(size * sizeof(float) * (cholmod ? 3 : 2));
  HugeArray<float> ours(size), theirs;
  if (cholmod) theirs = HugeArray<float>(size);

  // Two timings in one run: of the whole, and of its first part.
  std::vector<double> our_factor, our_sweep, peer_factor, peer_solve;
  const auto timed = [](std::vector<double>& out, const auto& body) {
    const Timer timer = cpu_timer();
    body();
    out.push_back(timer.seconds());
  };
  const Timer spent = cpu_timer();
  for (int run = 0; run < 7 && (run < 1 || spent.seconds() < 12); ++run) {
    std::unique_ptr<Cholesky> factor;
    timed(our_factor, [&] { factor = std::make_unique<Cholesky>(k.matrix, nested_dissection(k.matrix), 1); });
    timed(our_sweep, [&] { compliance_sweep<float>(*factor, nodes, ours, 1); });
    if (!cholmod) continue;
    timed(peer_factor, [&] { cholmod->factor(); });
    timed(peer_solve, [&] { cholmod->inverse_block(unknowns, 64, theirs); });
  }
  if (cholmod) require_equal(ours, theirs);
  const std::string peer = cholmod ? "CHOLMOD, blocked solves" : "";
  const double f = median(our_factor), s = median(our_sweep), pf = median(peer_factor),
               ps = median(peer_solve);
  const std::string note =
      fmt::format("{} nodes, {} free on the surface", kidney.mesh.nodes.size(), nodes.size());
  return {{f, peer, pf, note}, {s, peer, ps}, {f + s, peer, pf + ps}};
}

}  // namespace

void register_compliance(Bench& bench) {
  for (const int n : {600, 3000, 10000})
    bench.add(
        {{fmt::format("compliance.factor.{}", n), "s"},
         {fmt::format("compliance.sweep.{}", n), "s"},
         {fmt::format("compliance.total.{}", n), "s"}},
        [n] { return compliance(n); }, n > 3000);
}

}  // namespace palpate
