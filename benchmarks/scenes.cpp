#include "scenes.hpp"

#include <algorithm>
#include <numbers>

#include "palpate/geometry/shapes.hpp"
#include "palpate/io/surface_file.hpp"

namespace palpate::scenes {

Kidney pad_kidney(int surface_nodes) {
  Kidney kidney;
  kidney.mesh = pad_delaunay(make_kidney(surface_nodes), {{"stone", make_stone(150)}}).mesh;
  for (const std::string& region : kidney.mesh.region_names)
    kidney.materials.push_back(region == "stone" ? Material{1e9, 0.3} : Material{10e3, 0.45});
  kidney.anchors = {AnchorHalfSpace{{0, 0, -0.016}, {0, 0, 1}}};
  return kidney;
}

Organ bake_kidney(int surface_nodes, int order, int threads) {
  Kidney kidney = pad_kidney(surface_nodes);
  return bake(std::move(kidney.mesh), std::move(kidney.materials), std::move(kidney.anchors), threads, {},
              nullptr, {.order = order, .pinch = false});
}

TriangleMesh bishop() {
  TriangleMesh mesh = read_surface("/usr/share/inventor/data/models/chess/bishop.iv", 1.5).mesh;
  const Box box = bounding_box(mesh.vertices);
  for (Vec3& v : mesh.vertices) v -= box.center();
  return mesh;
}

Grid bishop_grid(const TriangleMesh& bishop, std::size_t least_points) {
  Grid grid;
  for (int subdivisions = 1; grid.size() < least_points; ++subdivisions)
    grid = make_grid(bounding_box(bishop.vertices), subdivisions);
  return grid;
}

namespace {

Press press(Organ organ, Instrument instrument, const Eigen::Quaterniond& turn) {
  Press press;
  press.turn = turn;
  const Box kidney = bounding_box(organ.surface.vertices);
  press.front = Vec3(kidney.center().x(), kidney.center().y(), kidney.max.z());
  for (const Vec3& v : instrument.surface.vertices) press.lowest = std::min(press.lowest, (turn * v).z());
  press.model.organ = std::move(organ);
  press.model.instruments.push_back(std::move(instrument));
  return press;
}

std::shared_ptr<const Lattice> make_lattice(const TriangleMesh& mesh, const Grid& grid) {
  return std::make_shared<const Lattice>(sample_lattice(SignedDistanceField(mesh), grid));
}

}  // namespace

Press press_bishop(Organ organ, std::size_t lattice_points, Mode mode) {
  TriangleMesh mesh = bishop();
  auto lattice = make_lattice(mesh, bishop_grid(mesh, lattice_points));
  const double upright = 0.5 * std::numbers::pi;  // its axis is y
  Press out = press(std::move(organ), {"bishop", std::move(lattice), std::move(mesh)},
                    Eigen::Quaterniond(Eigen::AngleAxisd(upright + 0.2, Vec3::UnitX())));
  out.model.settings.mode = mode;
  return out;
}

Press press_ball(Organ organ) {
  TriangleMesh mesh = make_sphere(Vec3::Zero(), 0.03, 96, 192);
  auto lattice = make_lattice(mesh, make_grid_spaced(bounding_box(mesh.vertices), 0.00125, 0.0025));
  return press(std::move(organ), {"ball", std::move(lattice), std::move(mesh)},
               Eigen::Quaterniond::Identity());
}

}  // namespace palpate::scenes
