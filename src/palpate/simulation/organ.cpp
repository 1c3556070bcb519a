#include "palpate/simulation/organ.hpp"

#include <algorithm>

#include "palpate/base/hash.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/compliance/multifrontal.hpp"
#include "palpate/compliance/ordering.hpp"
#include "palpate/elasticity/stiffness.hpp"

namespace palpate {

std::uint64_t organ_hash(const TetMesh& mesh, const std::vector<Material>& materials,
                         const std::vector<Anchor>& anchors) {
  Hash hash;
  for (const Vec3& p : mesh.nodes) hash.add_bytes(p.data(), sizeof(double) * 3);
  hash.add(std::span<const Tetrahedron>(mesh.tets));
  hash.add(std::span<const Index>(mesh.regions));
  for (const Material& m : materials) {
    const std::array<double, 3> values{m.young, m.poisson, m.density};
    hash.add(std::span<const double>(values));
  }
  for (const Anchor& a : anchors) {
    const std::string text = to_string(a);
    hash.add_bytes(text.data(), text.size() + 1);
  }
  return hash.value();
}

namespace {

// Surface, areas and the numbering of the compliance's rows, from the mesh and the anchored flags.
void set_surface(Organ& organ, const std::vector<std::uint8_t>& anchored) {
  Boundary outer = boundary(organ.mesh);
  organ.surface = std::move(outer.surface);
  organ.surface_nodes = std::move(outer.nodes);
  organ.areas = vertex_areas(organ.surface);
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
}

void require_memory(std::size_t rows, std::size_t factor_entries) {
  const std::size_t need = 9 * rows * rows * sizeof(float) + factor_entries * sizeof(double) / 2;
  const std::size_t have = available_bytes();
  if (need > have)
    throw Error(ErrorKind::resource,
                "the dense compliance of {} free surface nodes needs {:.1f} GB, {:.1f} GB are free; use "
                "fewer surface nodes",
                rows, static_cast<double>(need) * 1e-9, static_cast<double>(have) * 1e-9);
}

// A part's share [from, to] of the whole bar.
Progress part(const Progress& whole, double from, double to) {
  Progress p = whole;
  if (whole.report)
    p.report = [report = whole.report, from, to](double f) { report(from + f * (to - from)); };
  return p;
}

}  // namespace

Organ bake(TetMesh mesh, std::vector<Material> materials, std::vector<Anchor> anchors, int threads,
           const Progress& progress, BakeReport* report) {
  BakeReport own;
  BakeReport& r = report ? *report : own;
  Organ organ;
  organ.mesh = std::move(mesh);
  organ.materials = std::move(materials);
  organ.anchors = std::move(anchors);
  require_valid(organ.mesh, "mesh");
  const std::vector<std::uint8_t> anchored = anchored_nodes(organ.mesh, organ.anchors);
  set_surface(organ, anchored);
  organ.hash = organ_hash(organ.mesh, organ.materials, organ.anchors);
  r.nodes = organ.mesh.nodes.size(), r.tets = organ.mesh.tets.size();
  r.surface_nodes = organ.surface_size(), r.free_surface_nodes = organ.node_of_row.size();
  require_memory(r.free_surface_nodes, 0);

  Timer timer = wall_timer();
  const FreeStiffness k = remove_anchored(assemble_stiffness(organ.mesh, organ.materials), anchored);
  r.assemble_seconds = timer.seconds();
  progress.at(0.02);

  timer = wall_timer();
  const std::vector<Index> order = nested_dissection(k.matrix);
  r.order_seconds = timer.seconds();
  progress.at(0.05);

  timer = wall_timer();
  const Cholesky factor(k.matrix, order, threads, part(progress, 0.05, 0.2));
  r.factor_seconds = timer.seconds();
  r.factor_entries = factor.stats().factor_entries;
  require_memory(r.free_surface_nodes, r.factor_entries);

  timer = wall_timer();
  std::vector<Index> nodes;
  for (const Index node : organ.node_of_row)
    nodes.push_back(k.free_of[static_cast<std::size_t>(organ.surface_nodes[static_cast<std::size_t>(node)])]);
  HugeArray<float> c(9 * nodes.size() * nodes.size());
  compliance_sweep<float>(factor, nodes, c, threads, part(progress, 0.2, 1.0));
  organ.compliance = Compliance::dense(std::move(c), nodes.size());
  r.sweep_seconds = timer.seconds();
  return organ;
}

}  // namespace palpate
