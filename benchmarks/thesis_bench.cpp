// The headline figures of the thesis (1.8 GHz Athlon, 1 GB; T 5.1.1, 5.1.3, 6.2, 6.3), the same sizes on the
// kidney and the bishop. Its frames a second include drawing, ours the computed part of a frame only; where
// it gives a range the better end is the peer.
#include <fmt/core.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "bench.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/compliance/multifrontal.hpp"
#include "palpate/compliance/ordering.hpp"
#include "palpate/elasticity/stiffness.hpp"
#include "palpate/lattice/lattice_file.hpp"
#include "scenes.hpp"

namespace palpate {

namespace {

const char* const thesis = "thesis 2004";

// "Creating this file for an object with 20,000 grid points": search structure, distances, text file.
std::vector<Value> make_lattice_file() {
  const TriangleMesh bishop = scenes::bishop();
  const Grid grid = scenes::bishop_grid(bishop, 20000);
  const std::filesystem::path file = std::filesystem::temp_directory_path() / "palpate-bench-lattice.txt";
  const Medians m =
      in_turn([&] { write_lattice_text(file, sample_lattice(SignedDistanceField(bishop), grid, 1)); });
  std::filesystem::remove(file);
  return {{m.ours, thesis, 1, fmt::format("{} points, text file included", grid.size())}};
}

// Distance and closest point of a million random points within the box.
std::vector<Value> interpolate() {
  const TriangleMesh bishop = scenes::bishop();
  const Lattice lattice(sample_lattice(SignedDistanceField(bishop), scenes::bishop_grid(bishop, 20000)));
  const Box box = lattice.grid().box();
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Vec3> points(1000000);
  for (Vec3& p : points)
    p = box.min + Vec3(unit(random), unit(random), unit(random)).cwiseProduct(box.size());
  std::vector<double> distance(points.size());
  const Medians m = in_turn([&] {
    lattice.distance(points, distance);
    for (const Vec3& p : points) keep(lattice.closest(p));
  });
  return {{m.ours, thesis, 0.97}};
}

// From the stiffness matrix to the compliance of the surface. The thesis counts all nodes, we the surface's
// alone: ours is the bigger problem.
std::vector<Value> invert(int nodes, double peer_seconds) {
  const scenes::Kidney kidney = scenes::pad_kidney(nodes);
  const FreeStiffness stiffness = remove_anchored(assemble_stiffness(kidney.mesh, kidney.materials),
                                                  anchored_nodes(kidney.mesh, kidney.anchors));
  std::vector<Index> surface;
  for (const Index node : boundary(kidney.mesh).nodes)
    if (stiffness.free_of[node] >= 0) surface.push_back(stiffness.free_of[node]);
  HugeArray<float> out(9 * surface.size() * surface.size());
  const Medians m = in_turn([&] {
    const Cholesky factor(stiffness.matrix, nested_dissection(stiffness.matrix), 1);
    compliance_sweep<float>(factor, surface, out, 1);
  });
  return {{m.ours, thesis, peer_seconds,
           fmt::format("{} nodes, {} free on the surface", kidney.mesh.nodes.size(), surface.size())}};
}

// Steps a second, the median over the steps in which something was touched, while the bishop's base is
// pressed 10 mm in. T fig. 6.3: a bell of force moves along the kidney instead.
std::vector<Value> frames(int nodes, std::size_t lattice_points, Mode mode) {
  const scenes::Press press = scenes::press_bishop(scenes::bake_kidney(nodes), lattice_points, mode);
  State state = make_state(press.model);
  std::vector<double> seconds;
  std::size_t contacts = 0;
  for (int i = 0; i <= 400; ++i) {
    Input input{1e-3 * i, {}, {press.at(0.01 * i / 400)}};
    if (mode == Mode::gaussian) input.instruments = {Pose{press.turn, press.front + Vec3(0, 5e-5 * i, 0)}};
    const Timer timer = thread_timer();
    step(press.model, state, input);
    const double t = timer.seconds();
    if (mode == Mode::gaussian || !state.contacts.empty()) seconds.push_back(t);
    contacts = std::max(contacts, state.contacts.size());
  }
  return {{1 / median(seconds), thesis, 75,
           fmt::format("{} surface nodes, up to {} contacts", press.model.organ.surface_size(), contacts)}};
}

}  // namespace

void register_thesis(Bench& bench) {
  bench.add({{"thesis.lattice.20000", "s"}}, make_lattice_file);
  bench.add({{"thesis.interpolate.1000000", "s"}}, interpolate);
  bench.add({{"thesis.invert.600", "s"}}, [] { return invert(600, 900); });
  bench.add({{"thesis.invert.3000", "s"}}, [] { return invert(3000, 18000); });
  bench.add({{"thesis.gauss.2743", "1/s", true}}, [] { return frames(2743, 8064, Mode::gaussian); });
  bench.add({{"thesis.contact.2800", "1/s", true}}, [] { return frames(2800, 8064, Mode::prescribed); });
  bench.add({{"thesis.contact.324.8064", "1/s", true}}, [] { return frames(324, 8064, Mode::prescribed); });
}

}  // namespace palpate
