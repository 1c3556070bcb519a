// Which triangles an instrument may reach into between their nodes. Each belongs to the cluster of its first
// node that can move; a cluster's triangles lie within the ball about its own nodes that holds their other
// corners too, where these are now: however far something has stretched them.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

double middle_side(const Box& box) {
  Vec3 sides = box.size();
  std::sort(sides.begin(), sides.end());
  return sides[1];
}

namespace {

// The middle side of a solid's box, m. A lattice's own box has a margin: what is in it is looked for where
// the distance allows for a surface, to `fine` m, until it is thicker than `blunt`.
double thickness_of(const Instrument& instrument, double fine, double blunt) {
  const Shape& shape = instrument.shape;
  const Box whole = bounding_box(shape);
  const bool is_lattice = std::holds_alternative<std::shared_ptr<const Lattice>>(shape) ||
                          std::holds_alternative<std::shared_ptr<const BandLattice>>(shape);
  if (!is_lattice) return middle_side(whole);
  if (!instrument.surface.vertices.empty()) return middle_side(bounding_box(instrument.surface.vertices));
  Box found;
  bool any = false;
  std::vector<Box> open{whole};
  while (!open.empty() && !(any && middle_side(found) >= blunt)) {
    const Box box = open.back();
    open.pop_back();
    const Gap g = gap(shape, box.center());
    const Vec3 size = box.size();
    if (std::abs(g.distance) > 0.6 * size.norm()) continue;
    int axis = 0;
    if (size.maxCoeff(&axis) > fine) {
      Box low = box, high = box;
      low.max[axis] = high.min[axis] = box.center()[axis];
      open.push_back(low), open.push_back(high);
    } else {
      found.add(box.center() - g.distance / g.slope * g.normal);
      any = true;
    }
  }
  return middle_side(any ? found : whole);
}

// Lists of numbers, one after the other.
void append(std::vector<Index>& begin, std::vector<Index>& all, std::vector<Index>& some) {
  std::sort(some.begin(), some.end());
  some.erase(std::unique(some.begin(), some.end()), some.end());
  all.insert(all.end(), some.begin(), some.end());
  begin.push_back(static_cast<Index>(all.size()));
}

Face face_of(const Organ& organ, const Triangle& t) {
  const auto corner = [&](std::size_t k) -> const Vec3& { return organ.contact_points[at(t[k % 3])]; };
  Face face;
  for (std::size_t k = 0; k < 3; ++k) {
    face.squares[static_cast<int>(k)] = (corner(k + 1) - corner(k + 2)).squaredNorm();
    face.fixed[static_cast<int>(k)] = organ.row_of[at(t[k])] < 0;
  }
  face.normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
  face.longest = std::sqrt(face.squares.maxCoeff());
  return face;
}

// Finds the triangles across edges: every edge has two, in opposite directions.
void find_beside(const TriangleMesh& surface, std::vector<Face>& faces) {
  struct Edge {
    Index low, high;
    std::size_t triangle, corner;
  };
  std::vector<Edge> edges;
  for (std::size_t i = 0; i < faces.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = surface.triangles[i][(k + 1) % 3], b = surface.triangles[i][(k + 2) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), i, k});
    }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    const Edge &a = edges[i], &b = edges[i + 1];
    if (a.low != b.low || a.high != b.high) continue;
    faces[a.triangle].beside[a.corner] = static_cast<Index>(b.triangle);
    faces[b.triangle].beside[b.corner] = static_cast<Index>(a.triangle);
  }
}

}  // namespace

double longest_edge(const Organ& organ) {
  double longest = 0;
  for (const Triangle& t : organ.surface.triangles) longest = std::max(longest, face_of(organ, t).longest);
  return longest;
}

Faces::Faces(const Organ& organ, std::span<const Instrument> instruments, const Clusters& clusters) {
  const TriangleMesh& surface = organ.surface;
  const double longest = longest_edge(organ);
  for (const Instrument& i : instruments) {
    const double blunt = 2 * fine_enough * longest, fine = std::max(0.5 * finest(i.shape), 0.02 * longest);
    const double thick = i.tip > 0 ? i.tip : thickness_of(i, fine, blunt);
    thickness.push_back(thick < blunt ? 0.5 * thick : 0);
  }
  if (std::all_of(thickness.begin(), thickness.end(), [](double t) { return t == 0; })) return;
  for (const Triangle& t : surface.triangles) faces.push_back(face_of(organ, t));
  find_beside(surface, faces);
  std::vector<Index> cluster_of(organ.surface_size(), -1);
  std::vector<float> softness_of(organ.surface_size(), 0.0f);
  for (std::size_t c = 0; c < clusters.size(); ++c)
    for (std::size_t i = at(clusters.begin[c]); i < at(clusters.begin[c + 1]); ++i) {
      cluster_of[at(clusters.nodes[i])] = static_cast<Index>(c);
      softness_of[at(clusters.nodes[i])] = clusters.softness[i];
    }
  std::vector<std::vector<Index>> triangles_in(clusters.size());
  for (std::size_t i = 0; i < faces.size(); ++i)
    for (const Index v : surface.triangles[i])
      if (cluster_of[at(v)] >= 0) {
        triangles_in[at(cluster_of[at(v)])].push_back(static_cast<Index>(i));
        break;
      }
  softness.assign(clusters.size(), 0.0f), holds_anchored.assign(clusters.size(), 0);
  triangles_begin = corners_begin = beside_begin = {0};
  std::vector<Index> nodes, clusters_beside;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    nodes.clear(), clusters_beside.clear();
    for (const Index triangle : triangles_in[c])
      for (const Index v : surface.triangles[at(triangle)]) {
        nodes.push_back(v);
        softness[c] = std::max(softness[c], softness_of[at(v)]);
        if (cluster_of[at(v)] >= 0)
          clusters_beside.push_back(cluster_of[at(v)]);
        else
          holds_anchored[c] = 1;
      }
    append(triangles_begin, triangles, triangles_in[c]);
    append(corners_begin, corners, nodes);
    append(beside_begin, beside, clusters_beside);
  }
}

namespace {

// The ball about a triangle, with the places in it.
Ball ball_of(const std::array<Vec3, 3>& corners) noexcept {
  Ball ball{(corners[0] + corners[1] + corners[2]) / 3, 0};
  for (const Vec3& corner : corners) ball.radius = std::max(ball.radius, (corner - ball.center).norm());
  return ball;
}

// Whether anything of a ball, grown, may be near a shape.
bool may_reach(const PlacedShape& shape, const Vec3& center, double radius) noexcept {
  return shape.box.grown(radius).contains(center) && shape.may_be_nearer(center, radius);
}

}  // namespace

void find_faces(const Model& model, State& state, const Surface& surface, std::size_t instrument,
                double drifted) {
  StepScratch& w = *state.scratch;
  const Faces& f = w.faces;
  if (f.empty() || f.thickness[instrument] == 0) return;
  std::vector<Index>& found = w.near_faces[instrument];
  found.clear();
  const PlacedShape& shape = w.shapes[instrument];
  const Sweep& sweep = w.sweeps[instrument];
  const double moved = std::max(drifted, w.lag_before.drifted), swept = way_between(w, instrument);
  for (std::size_t c = 0; c + 1 < f.triangles_begin.size(); ++c) {
    const Vec3& center = surface.bounds.clusters[c].center;
    const double near = w.reach + w.tolerance + felt_from * f.thickness[instrument] +
                        moved * static_cast<double>(f.softness[c]);
    double radius = 0;
    for (Index k = f.beside_begin[c]; k < f.beside_begin[c + 1]; ++k) {
      const Ball& other = surface.bounds.clusters[at(f.beside[at(k)])];
      radius = std::max(radius, (other.center - center).norm() + other.radius);
    }
    if (!f.holds_anchored[c] && !may_reach(shape, center, radius + near + swept)) continue;
    double squared = 0;
    for (Index k = f.corners_begin[c]; k < f.corners_begin[c + 1]; ++k)
      squared = std::max(squared, (surface.positions[at(f.corners[at(k)])] - center).squaredNorm());
    if (!may_reach(shape, center, std::sqrt(squared) + near + swept)) continue;
    for (Index k = f.triangles_begin[c]; k < f.triangles_begin[c + 1]; ++k) {
      const Index triangle = f.triangles[at(k)];
      if (!f.needs_places(at(triangle), instrument)) continue;
      const Triangle& nodes = model.organ.surface.triangles[at(triangle)];
      const Ball ball = ball_of({surface.positions[at(nodes[0])], surface.positions[at(nodes[1])],
                                 surface.positions[at(nodes[2])]});
      const double clearance = ball.radius + near;
      if (!may_reach(shape, ball.center, clearance + swept)) continue;
      if (!(shape.distance(ball.center) <= clearance) &&
          (swept == 0 || !passes(*shape.shape, sweep.last * ball.center, shape.own(ball.center), clearance)))
        continue;
      found.push_back(triangle);
      for (const Index corner : nodes)
        if (model.organ.row_of[at(corner)] >= 0) add_near(w, corner);
    }
  }
  std::sort(found.begin(), found.end());  // as its order decides bits
}

}  // namespace palpate
