// From the kidney's stiffness to its compliance in each storage, beside CHOLMOD with blocked solves and dense
// inversion; then what the storages take online. One thread.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "bench.hpp"
#include "palpate/base/error.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/compliance/ordering.hpp"
#include "palpate/compliance/storage.hpp"
#include "palpate/compliance/symbolic.hpp"
#include "palpate/elasticity/hats.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "peers.hpp"
#include "scenes.hpp"

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dpotri_(const char* uplo, const int* n, double* a, const int* lda, int* info);
}

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

// The free kidney and what its surface is loaded by: linear tetrahedra on the nodes, quadratic on hats.
struct Problem {
  std::size_t all_nodes = 0;
  FreeStiffness k;
  std::vector<Vec3> positions;  // of the loads
  Eigen::SparseMatrix<double> loads;

  std::size_t rows() const { return positions.size(); }
  Symbolic structure() const {
    const NodeGraph graph = node_graph(k.matrix, loads);
    return analyse(graph, nested_dissection(graph));
  }
};

Problem make_problem(int surface_nodes, int order = 1) {
  const scenes::Kidney kidney = scenes::pad_kidney(surface_nodes);
  const ElementNodes nodes = element_nodes(kidney.mesh, order);
  Problem p;
  p.all_nodes = nodes.size();
  p.k = remove_anchored(assemble_stiffness(kidney.mesh, nodes, kidney.materials),
                        with_middles(anchored_nodes(kidney.mesh, kidney.anchors), nodes));
  const Boundary outer = boundary(kidney.mesh);
  const std::vector<Vec3> centroids = hat_centroids(outer.surface);
  std::vector<Index> loaded, hats;  // in the numbering of the free nodes, and of the surface
  for (std::size_t i = 0; i < outer.nodes.size(); ++i)
    if (const Index free = p.k.free_of[static_cast<std::size_t>(outer.nodes[i])]; free >= 0) {
      loaded.push_back(free);
      hats.push_back(static_cast<Index>(i));
      p.positions.push_back(order == 1 ? outer.surface.vertices[i] : centroids[i]);
    }
  p.loads = order == 1 ? unit_loads(p.k.node_of.size(), loaded)
                       : hat_loads(outer.surface, outer.nodes, nodes, p.k.free_of, hats);
  return p;
}

void timed(std::vector<double>& out, const std::function<void()>& body) {
  const Timer timer = cpu_timer();
  body();
  out.push_back(timer.seconds());
}

// Rows: factor (ordering included), sweep, total.
std::vector<Value> compliance(int surface_nodes, int order) {
  const Problem p = make_problem(surface_nodes, order);
  const auto cholmod = peers::make_cholmod(p.k.matrix);
  const std::size_t size = 9 * p.rows() * p.rows();
  warm_memory(size * sizeof(float) * (cholmod ? 3 : 2));
  HugeArray<float> ours(size), theirs;
  if (cholmod) theirs = HugeArray<float>(size);

  // Two timings in one run: of the whole, and of its first part.
  std::vector<double> our_factor, our_sweep, peer_factor, peer_solve;
  const Timer spent = cpu_timer();
  for (int run = 0; run < 7 && (run < 1 || spent.seconds() < 12); ++run) {
    std::unique_ptr<Cholesky> factor;
    timed(our_factor, [&] { factor = std::make_unique<Cholesky>(p.k.matrix, p.structure(), 1); });
    timed(our_sweep, [&] { compliance_sweep<float>(*factor, p.loads, ours, 1); });
    if (!cholmod) continue;
    timed(peer_factor, [&] { cholmod->factor(); });
    timed(peer_solve, [&] { cholmod->inverse_block(p.loads, 64, theirs); });
  }
  if (cholmod) require_equal(ours, theirs);
  const std::string peer = cholmod ? "CHOLMOD, blocked solves" : "";
  const double f = median(our_factor), s = median(our_sweep), pf = median(peer_factor),
               ps = median(peer_solve);
  const std::string note = fmt::format("{} nodes, {} free on the surface", p.all_nodes, p.rows());
  return {{f, peer, pf, note}, {s, peer, ps}, {f + s, peer, pf + ps}};
}

// As in the thesis: all of K is inverted as a dense matrix.
std::vector<Value> dense_inversion(int surface_nodes) {
  const Problem p = make_problem(surface_nodes);
  HugeArray<float> out(9 * p.rows() * p.rows());
  const int n = static_cast<int>(p.k.matrix.cols());
  const Medians m = in_turn(
      [&] {
        const Cholesky factor(p.k.matrix, p.structure(), 1);
        compliance_sweep<float>(factor, p.loads, out, 1);
      },
      [&] {
        Eigen::MatrixXd a(p.k.matrix);
        int info = 0;
        dpotrf_("L", &n, a.data(), &n, &info);
        dpotri_("L", &n, a.data(), &n, &info);
        keep(a(0, 0));
      });
  return {{m.ours, "dense inversion by LAPACK", m.peer, fmt::format("{} unknowns", n)}};
}

Factored<float> factor(const Problem& p) {
  const Cholesky cholesky(p.k.matrix, p.structure(), 1);
  return factor_compliance<float>(cholesky, p.loads, 1, {});
}

std::string megabytes(std::size_t bytes) {
  return fmt::format("{:.1f} MB", static_cast<double>(bytes) * 1e-6);
}

// 100 nodes around one of the surface, as in a contact.
std::vector<Index> patch(const Problem& p) {
  std::vector<Index> nodes(p.rows());
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i] = static_cast<Index>(i);
  const auto distance = [&](Index i) {
    return (p.positions[static_cast<std::size_t>(i)] - p.positions[7]).norm();
  };
  std::sort(nodes.begin(), nodes.end(), [&](Index a, Index b) { return distance(a) < distance(b); });
  nodes.resize(100);
  return nodes;
}

// ms of apply with 100 contacts; us of the block's rows of one new contact among them.
std::vector<Value> queries(const Problem& p, const Compliance& c) {
  const std::vector<Index> contacts = patch(p);
  std::vector<float> forces(300, 0.01f), u(3 * p.rows()), block(900);
  std::vector<double> apply, one;
  for (int i = 0; i < 60; ++i) {
    Timer timer = thread_timer();
    c.apply(contacts, forces, u);
    apply.push_back(1e3 * timer.seconds());
    timer = thread_timer();
    c.block({&contacts[static_cast<std::size_t>(i)], 1}, contacts, block, 300);
    one.push_back(1e6 * timer.seconds());
  }
  return {{median(apply), "", no_peer, megabytes(c.bytes())}, {median(one)}};
}

// Rows: dense and half, apply and block.
std::vector<Value> dense_online(int surface_nodes) {
  const Problem p = make_problem(surface_nodes);
  HugeArray<float> matrix(9 * p.rows() * p.rows());
  multiply_out<float>(factor(p), matrix, 1, {});
  std::vector<Value> out;
  const Compliance half(std::make_shared<HalfCompliance>(matrix));
  const Compliance dense = Compliance::dense(std::move(matrix), p.rows());
  for (const Compliance& c : {dense, half})
    for (const Value& v : queries(p, c)) out.push_back(v);
  return out;
}

// Rows: to factored, from there to hierarchical, apply, block.
std::vector<Value> compressed(int surface_nodes, int order) {
  const Problem p = make_problem(surface_nodes, order);
  std::vector<double> to_factored, to_hierarchical;
  {  // as bake() asks: rather no row than a machine out of memory
    Factored<float> outline = factored_outline(p.structure(), p.loads);
    const std::size_t need = 4 * outline.arrange() + compress_bytes(outline, p.positions, 1e-3, 1);
    if (need > available_bytes())
      throw Error(ErrorKind::resource, "needs {}, {} are free", megabytes(need),
                  megabytes(available_bytes()));
  }
  Factored<float> y;
  Hierarchical h;
  timed(to_factored, [&] { y = factor(p); });
  timed(to_hierarchical, [&] { h = compress(y, p.positions, 1e-3, 1); });
  const std::string note =
      fmt::format("certified {:.1e}, peak {}", h.error, megabytes(peak_resident_bytes()));
  std::vector<Value> out{
      {median(to_factored), "", no_peer,
       fmt::format("{} nodes, {} free on the surface, {}", p.all_nodes, p.rows(), megabytes(4 * y.y.size()))},
      {median(to_hierarchical), "", no_peer, note}};
  y = {};
  const Compliance c(std::make_shared<HierarchicalCompliance>(std::move(h)));
  for (const Value& v : queries(p, c)) out.push_back(v);
  return out;
}

// A model's file, opened, and with its checksums compared; from the page cache.
std::vector<Value> open_model(int surface_nodes, Storage storage) {
  scenes::Kidney kidney = scenes::pad_kidney(surface_nodes);
  const std::filesystem::path file = std::filesystem::temp_directory_path() / "palpate-bench-model.h5";
  write_organ(file,
              bake(std::move(kidney.mesh), std::move(kidney.materials), std::move(kidney.anchors), 1, {},
                   nullptr, {1, storage, 1e-3, 0}),
              "benchmark");
  const auto bytes = std::filesystem::file_size(file);
  const Medians opened = in_turn([&] { keep(read_organ(file, false)); });
  const Medians verified = in_turn([&] { keep(read_organ(file, true)); });
  std::filesystem::remove(file);
  return {{opened.ours, "", no_peer, fmt::format("{}, verified {:.3g} s", megabytes(bytes), verified.ours)}};
}

}  // namespace

void register_compliance(Bench& bench) {
  bench.add({{"compliance.inversion.600", "s"}}, [] { return dense_inversion(600); });
  for (const int order : {1, 2}) {
    const char* of = order == 1 ? "" : ".p2";
    for (const int n : {600, 3000, 10000})
      bench.add(
          {{fmt::format("compliance.factor.{}{}", n, of), "s"},
           {fmt::format("compliance.sweep.{}{}", n, of), "s"},
           {fmt::format("compliance.total.{}{}", n, of), "s"}},
          [n, order] { return compliance(n, order); }, n > (order == 1 ? 3000 : 600));
    for (const int n : {3000, 10000, 30000, 100000})
      bench.add(
          {{fmt::format("compliance.factored.{}{}", n, of), "s"},
           {fmt::format("compliance.hierarchical.{}{}", n, of), "s"},
           {fmt::format("compliance.apply.hierarchical.{}{}", n, of), "ms"},
           {fmt::format("compliance.block.hierarchical.{}{}", n, of), "us"}},
          [n, order] { return compressed(n, order); }, n > 3000);
  }
  for (const int n : {3000, 10000})
    bench.add(
        {{fmt::format("compliance.apply.dense.{}", n), "ms"},
         {fmt::format("compliance.block.dense.{}", n), "us"},
         {fmt::format("compliance.apply.half.{}", n), "ms"},
         {fmt::format("compliance.block.half.{}", n), "us"}},
        [n] { return dense_online(n); }, n > 3000);
  for (const int n : {3000, 10000})
    bench.add(
        {{fmt::format("compliance.open.{}", n), "s"}}, [n] { return open_model(n, Storage::hierarchical); },
        n > 3000);
  for (const auto& [word, storage] : {std::pair("dense", Storage::dense), std::pair("half", Storage::half)})
    bench.add(
        {{fmt::format("compliance.open.{}.10000", word), "s"}},
        [storage = storage] { return open_model(10000, storage); }, true);
}

}  // namespace palpate
