#include "palpate/simulation/organ.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "palpate/base/hash.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/compliance/ordering.hpp"
#include "palpate/compliance/storage.hpp"
#include "palpate/simulation/discretisation.hpp"

namespace palpate {

std::uint64_t organ_hash(const Organ& organ) {
  const TetMesh& mesh = organ.mesh;
  Hash hash;
  for (const Vec3& p : mesh.nodes) hash.add_bytes(p.data(), sizeof(double) * 3);
  hash.add(std::span<const Tetrahedron>(mesh.tets));
  hash.add(std::span<const Index>(mesh.regions));
  for (const Material& m : organ.materials) {
    const std::array<double, 3> values{m.young, m.poisson, m.density};
    hash.add(std::span<const double>(values));
  }
  const auto add = [&](const std::string& text) { hash.add_bytes(text.data(), text.size() + 1); };
  for (const Anchor& a : organ.anchors) add(to_string(a));
  for (const Bedding& b : organ.beddings) add("bedding " + to_string(b));
  if (organ.order != 1) hash.add_bytes(&organ.order, sizeof organ.order);
  return hash.value();
}

void set_readings(Organ& organ) {
  organ.areas = vertex_areas(organ.surface);
  organ.contact_points = organ.order == 1 ? organ.surface.vertices : hat_centroids(organ.surface);
  if (organ.order == 2) organ.projection = HatProjection(organ.surface, organ.row_of);
}

namespace {

// Surface, areas and the numbering of the compliance's rows, from the mesh and the anchored flags.
void set_surface(Organ& organ, const std::vector<std::uint8_t>& anchored) {
  Boundary outer = boundary(organ.mesh);
  organ.surface = std::move(outer.surface);
  organ.surface_nodes = std::move(outer.nodes);
  organ.row_of.assign(organ.surface_size(), -1);
  organ.node_of_row.clear();
  for (std::size_t i = 0; i < organ.surface_size(); ++i) {
    if (anchored[static_cast<std::size_t>(organ.surface_nodes[i])]) continue;
    organ.row_of[i] = static_cast<Index>(organ.node_of_row.size());
    organ.node_of_row.push_back(static_cast<Index>(i));
  }
  if (organ.node_of_row.empty())
    throw Error(ErrorKind::physics,
                "every surface node is anchored; nothing can move: anchor a smaller part");
  set_readings(organ);
}

// Peak bytes of the process while it bakes to each storage and writes it, from the structure alone.
std::array<std::size_t, 4> bytes_needed(const Symbolic& symbolic, const Eigen::SparseMatrix<double>& loads,
                                        std::span<const Vec3> positions, double tolerance, int threads) {
  const auto n = static_cast<std::size_t>(loads.cols());
  Factored<float> outline = factored_outline(symbolic, loads);
  const std::size_t now = resident_bytes(), y = now + sizeof(float) * outline.arrange();
  const std::size_t factor = y + 3 * sizeof(double) * symbolic.panel_entries / 2;  // and what is in flight
  const std::size_t dense = y + sizeof(float) * n * n;
  const std::size_t packed = now + 3 * sizeof(float) * n * n / 2;  // its triangle is packed to be written
  return {std::max({factor, dense, packed}), std::max(factor, dense + 2 * n * n), factor,
          std::max(factor, y + compress_bytes(outline, positions, tolerance, threads))};
}

Storage choose_storage(const std::array<std::size_t, 4>& need, const BakeOptions& options, std::size_t rows) {
  const std::size_t free = available_bytes() + resident_bytes();
  const std::size_t have = options.memory ? std::min(options.memory, free) : free;
  const auto fits = [&](Storage s) { return need[static_cast<std::size_t>(s)] <= have; };
  // Dense up to 5,000 nodes: quickest to bake, and 0.9 GB in memory.
  const Storage wanted = options.storage                        ? *options.storage
                         : rows <= 5000 && fits(Storage::dense) ? Storage::dense
                                                                : Storage::hierarchical;
  if (fits(wanted)) return wanted;
  std::string others;
  for (const Storage s : {Storage::dense, Storage::half, Storage::hierarchical, Storage::factored})
    if (fits(s))
      others += fmt::format("{}{} ({:.2g} GB)", others.empty() ? "" : ", ", storage_name(s),
                            static_cast<double>(need[static_cast<std::size_t>(s)]) * 1e-9);
  throw Error(ErrorKind::resource,
              "the {} compliance of {} free surface nodes needs {:.2g} GB, {:.2g} GB are {}; {}",
              storage_name(wanted), rows, static_cast<double>(need[static_cast<std::size_t>(wanted)]) * 1e-9,
              static_cast<double>(have) * 1e-9, options.memory ? "allowed" : "free",
              others.empty() ? "use fewer surface nodes" : "these storages fit: " + others);
}

// The likely cause, from the tetrahedra at the node. Anchors and inverted tetrahedra were checked before.
[[noreturn]] void explain_pivot(const Organ& organ, const ElementNodes& nodes, Index node) {
  double poisson = -1, flattest = 1;  // 1: regular
  Index flat = -1;
  for (std::size_t t = 0; t < organ.mesh.tets.size(); ++t) {
    const Tetrahedron& tet = organ.mesh.tets[t];
    const auto of = nodes.of(t);
    if (std::find(of.begin(), of.end(), node) == of.end()) continue;
    poisson = std::max(poisson, material_of(organ.mesh, organ.materials, t).poisson);
    double edge = 0;
    std::array<Vec3, 4> x;
    for (std::size_t i = 0; i < 4; ++i) x[i] = organ.mesh.nodes[static_cast<std::size_t>(tet[i])];
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < i; ++j) edge = std::max(edge, (x[i] - x[j]).norm());
    const double shape =
        std::sqrt(2.0) * (x[1] - x[0]).cross(x[2] - x[0]).dot(x[3] - x[0]) / (edge * edge * edge);
    if (shape < flattest) flattest = shape, flat = static_cast<Index>(t);
  }
  const Vec3 at = nodes.positions[static_cast<std::size_t>(node)];
  const std::string where =
      fmt::format("the stiffness is not positive definite at node {} ({:.5g} {:.5g} {:.5g} m)", node, at.x(),
                  at.y(), at.z());
  if (flattest < 1e-6)
    throw Error(ErrorKind::physics, "{}: tetrahedron {} there is flat; mend the mesh", where, flat);
  if (poisson > 0.4999)
    throw Error(ErrorKind::physics, "{}: Poisson's ratio {} there is too near 0.5; use 0.499 or less", where,
                poisson);
  throw Error(
      ErrorKind::physics,
      "{}: the anchors hardly hold its part of the body, or materials differ too much; anchor more of it",
      where);
}

// A part's share [from, to] of the whole bar.
Progress part(const Progress& whole, double from, double to) {
  Progress p = whole;
  if (whole.report)
    p.report = [report = whole.report, from, to](double f) { report(from + f * (to - from)); };
  return p;
}

Compliance store(Factored<float> y, Storage storage, const std::vector<Vec3>& positions, double tolerance,
                 int threads, const Progress& progress) {
  const std::size_t n = y.size();
  if (storage == Storage::factored) return Compliance(std::make_shared<FactoredCompliance>(std::move(y)));
  if (storage == Storage::hierarchical)
    return Compliance(
        std::make_shared<HierarchicalCompliance>(compress(y, positions, tolerance, threads, progress)));
  HugeArray<float> c(n * n);
  multiply_out<float>(y, c, threads, progress);
  if (storage == Storage::half) return Compliance(std::make_shared<HalfCompliance>(c));
  return Compliance::dense(std::move(c), n / 3);
}

// A unit force on each row: on its node, or spread as its hat.
Eigen::SparseMatrix<double> loads_of(const Organ& organ, const ElementNodes& nodes, const FreeStiffness& k) {
  if (organ.order == 2)
    return hat_loads(organ.surface, organ.surface_nodes, nodes, k.free_of, organ.node_of_row);
  std::vector<Index> loaded;
  for (const Index node : organ.node_of_row)
    loaded.push_back(
        k.free_of[static_cast<std::size_t>(organ.surface_nodes[static_cast<std::size_t>(node)])]);
  return unit_loads(k.node_of.size(), loaded);
}

}  // namespace

Organ bake(TetMesh mesh, std::vector<Material> materials, std::vector<Anchor> anchors, int threads,
           const Progress& progress, BakeReport* report, const BakeOptions& options) {
  BakeReport own;
  BakeReport& r = report ? *report : own;
  Organ organ;
  organ.mesh = std::move(mesh);
  organ.materials = std::move(materials);
  organ.anchors = std::move(anchors);
  organ.beddings = options.beddings;
  organ.order = options.order;
  const ElementNodes nodes = element_nodes(organ.mesh, organ.order);
  const std::vector<std::uint8_t> anchored =
      anchored_nodes(organ.mesh, organ.anchors, bedded_nodes(organ.mesh, organ.beddings));
  set_surface(organ, anchored);
  organ.hash = organ_hash(organ);
  if (!options.drawing.triangles.empty()) organ.drawing = embed(options.drawing, organ.surface);
  r.nodes = nodes.size(), r.tets = organ.mesh.tets.size();
  r.surface_nodes = organ.surface_size(), r.free_surface_nodes = organ.node_of_row.size();

  Timer timer = wall_timer();
  Eigen::SparseMatrix<double> stiffness = assemble_stiffness(organ.mesh, nodes, organ.materials, threads);
  add_bedding(organ.mesh, nodes, organ.beddings, stiffness);
  const FreeStiffness k = remove_anchored(stiffness, with_middles(anchored, nodes));
  stiffness = {};
  r.assemble_seconds = timer.seconds();
  progress.at(0.02);

  std::vector<Vec3> positions;
  for (const Index node : organ.node_of_row)
    positions.push_back(organ.contact_points[static_cast<std::size_t>(node)]);
  const Eigen::SparseMatrix<double> loads = loads_of(organ, nodes, k);

  timer = wall_timer();
  const NodeGraph graph = node_graph(k.matrix, loads);
  Symbolic symbolic = analyse(graph, nested_dissection(graph));
  const Storage storage = choose_storage(bytes_needed(symbolic, loads, positions, options.tolerance, threads),
                                         options, positions.size());
  r.order_seconds = timer.seconds();
  progress.at(0.05);

  // Where the bar stands after the factor and after the sweep, about.
  const double factored = organ.order == 1 ? 0.2 : 0.4, pinched = organ.order == 1 ? 0.3 : 0.55,
               swept = organ.order == 1 ? 0.5 : 0.75;
  timer = wall_timer();
  Factored<float> y;
  try {
    const Cholesky factor(k.matrix, std::move(symbolic), threads, part(progress, 0.05, factored));
    r.factor_seconds = timer.seconds();
    r.factor_entries = factor.stats().factor_entries;
    timer = wall_timer();
    if (options.pinch) {
      const PinchResult tried = pinch(organ, nodes, k, factor, part(progress, factored, pinched));
      organ.discretisation = tried.figures;
      compare_drawing(organ, nodes, k, loads, tried.u);
    }
    r.pinch_seconds = timer.seconds();
    timer = wall_timer();
    y = factor_compliance<float>(factor, loads, threads, part(progress, pinched, swept));
  } catch (const NotPositiveDefinite& e) {
    explain_pivot(organ, nodes, k.node_of[static_cast<std::size_t>(e.node())]);
  }
  organ.compliance =
      store(std::move(y), storage, positions, options.tolerance, threads, part(progress, swept, 1));
  r.sweep_seconds = timer.seconds();
  return organ;
}

}  // namespace palpate
