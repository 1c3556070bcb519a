// Contact points between nodes, on demand. Nodes alone do not see a needle in the middle of a triangle or a
// blade's edge across it. After a solve the deepest point of every triangle near an instrument is looked for,
// by halving the triangle where the distance allows for a violation and climbing from the best sample; where
// it is deeper than what the triangle's corners can see, it becomes a contact point, a *place*, that rides on
// the three nodes by its barycentric coordinates, and the tick is solved again: the exchange method of semi-
// infinite programming (Hettich, Kortanek, "Semi-infinite programming: theory, methods, and applications",
// 1993). A place stays what it is while it bears a force; beside it new ones take over as the instrument
// slides on. What was passed through wholly within a tick is found by the samples' paths.
#include "palpate/simulation/places.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "palpate/simulation/tick_work.hpp"

namespace palpate {

namespace {

// What is thicker than this share of a triangle's longest edge meets its nodes.
constexpr double fine_enough = 0.4;

}  // namespace

Faces::Faces(const Organ& organ, std::span<const Instrument> instruments) {
  const TriangleMesh& surface = organ.surface;
  double longest = 0;
  for (const Triangle& t : surface.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      longest = std::max(longest,
                         (organ.contact_points[at(t[k])] - organ.contact_points[at(t[(k + 1) % 3])]).norm());
  for (const Instrument& i : instruments) {
    Vec3 sides = bounding_box(i.shape).max - bounding_box(i.shape).min;
    std::sort(sides.begin(), sides.end());
    const double half = 0.5 * (i.tip > 0 ? i.tip : sides[1]);
    thickness.push_back(half < fine_enough * longest ? half : 0);
  }
  if (std::all_of(thickness.begin(), thickness.end(), [](double t) { return t == 0; })) return;
  begin.assign(organ.surface_size() + 1, 0), reach.assign(organ.surface_size(), 0.0f);
  for (const Triangle& t : surface.triangles) {
    Face face;
    const auto corner = [&](std::size_t k) -> const Vec3& { return organ.contact_points[at(t[k % 3])]; };
    for (std::size_t k = 0; k < 3; ++k) {
      face.squares[static_cast<int>(k)] = (corner(k + 1) - corner(k + 2)).squaredNorm();
      ++begin[at(t[k]) + 1];
    }
    face.normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
    face.longest = std::sqrt(face.squares.maxCoeff());
    const double far = face.longest * (1 / std::sqrt(3.0) + felt_from);
    for (const Index v : t) reach[at(v)] = std::max(reach[at(v)], static_cast<float>(far * (1 + 1e-6)));
    most_reach = std::max(most_reach, far * (1 + 1e-5));
    faces.push_back(face);
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  triangles_of.resize(3 * surface.triangles.size());
  std::vector<Index> next(begin.begin(), begin.end() - 1);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    for (const Index v : surface.triangles[i]) triangles_of[at(next[at(v)]++)] = static_cast<Index>(i);
}

namespace {

// Cosine between a shape's normal and the way into a triangle it touches.
constexpr double least_facing = 0.3;
constexpr double turned = 0.01;  // of a triangle's normal in a solve, beyond which it is done again
constexpr double fine = 1e-4;    // of a triangle: how exactly the deepest point is found

// A triangle as an instrument sees it.
struct View {
  const Faces& faces;
  const PlacedShape& shape;
  const Sweep& sweep;
  std::size_t triangle, instrument;
  std::array<Vec3, 3> now = {}, before = {};  // of the corners, organ frame, m

  // Of a place there.
  Vec3 point(const std::array<Vec3, 3>& corners, const Vec3& w) const noexcept {
    return w[0] * corners[0] + w[1] * corners[1] + w[2] * corners[2] -
           faces.allowance(triangle, instrument, w) * faces.faces[triangle].normal;
  }
  Path path(const Vec3& w) const noexcept {
    return sweep.known ? path_from(shape, sweep.last * point(before, w)) : Path{};
  }
  Gap gap(const Vec3& w) const noexcept { return shape.gap(point(now, w)); }
  // Change of the depth with each of the weights, m.
  Vec3 rise(const Vec3& w, const Gap& g) const noexcept {
    const Vec3 normal = g.slope * g.normal;
    const Vec3 sink =
        faces.allowance_gradient(triangle, instrument, w) * normal.dot(faces.faces[triangle].normal);
    return sink - Vec3(normal.dot(now[0]), normal.dot(now[1]), normal.dot(now[2]));
  }
};

struct Deepest {
  Vec3 weights = Vec3::Zero();
  double depth = -std::numeric_limits<double>::infinity();
  double size = 0;  // of the sample it came from, share of the triangle
};

using Cell = std::array<Vec3, 3>;  // barycentric coordinates of its corners

// Calls at(middle, share) for parts of the triangle of size `leaf`, a share of it, that may hold what is
// looked for: may(middle, share) says of larger ones.
template <class May, class At>
void divide(const Cell& cell, double share, double leaf, const May& may, const At& at) noexcept {
  const Vec3 middle = (cell[0] + cell[1] + cell[2]) / 3;
  if (!may(middle, share)) return;
  if (share <= leaf) return at(middle, share);
  const Cell halves{(cell[1] + cell[2]) / 2, (cell[2] + cell[0]) / 2, (cell[0] + cell[1]) / 2};
  divide(halves, share / 2, leaf, may, at);
  for (std::size_t k = 0; k < 3; ++k)
    divide({cell[k], halves[(k + 1) % 3], halves[(k + 2) % 3]}, share / 2, leaf, may, at);
}
Cell whole() { return {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}; }

// Of the ball about the middle of a triangle that holds what is between the triangle and its places, m.
double radius_of(const std::array<Vec3, 3>& corners) noexcept {
  const Vec3 middle = (corners[0] + corners[1] + corners[2]) / 3;
  double radius = 0;
  for (const Vec3& corner : corners) radius = std::max(radius, 1.1 * (corner - middle).norm());
  return radius;
}

// The deepest of samples, but for where nothing is deeper than `more`.
Deepest sample(const View& view, double leaf, double more) noexcept {
  Deepest best;
  double depth = 0;
  const double radius = radius_of(view.now);
  divide(
      whole(), 1, leaf,
      [&](const Vec3& w, double share) {
        depth = -view.shape.distance(view.point(view.now, w));
        return depth + share * radius > std::max(more, best.depth);
      },
      [&](const Vec3& w, double share) {
        if (depth > best.depth) best = {w, depth, share};
      });
  return best;
}

// The same of what the instrument has passed through in this tick, by the samples' paths.
Deepest sample_swept(const View& view, double leaf, double more) noexcept {
  Deepest best;
  const double radius = std::max(radius_of(view.now), radius_of(view.before));
  divide(
      whole(), 1, leaf,
      [&](const Vec3& w, double share) {
        return passes(*view.shape.shape, view.sweep.last * view.point(view.before, w),
                      view.shape.own(view.point(view.now, w)), share * radius);
      },
      [&](const Vec3& w, double share) {
        const double depth = -gap_by_path(view.shape, view.path(w), view.point(view.now, w)).distance;
        if (depth > std::max(more, best.depth)) best = {w, depth, share};
      });
  return best;
}

constexpr double at_node = 0.95;  // beyond this weight of a corner the corner itself does

Vec3 within_triangle(Vec3 w) noexcept {
  w = w.cwiseMax(0.0) / w.cwiseMax(0.0).sum();
  int k = 0;
  if (w.maxCoeff(&k) <= at_node) return w;
  const double others = 1 - w[k];
  for (int l = 0; l < 3; ++l)
    if (l != k) w[l] = (1 - at_node) * (others > 1e-9 ? w[l] / others : 0.5);
  w[k] = at_node;
  return w;
}

// Compass search (Kolda, Lewis, Torczon 2003) from the best sample, along edges that rise, to steps of
// `fine`; it ends where `more` is out of reach.
void climb(const View& view, double more, Deepest& best) noexcept {
  const double longest = view.faces.faces[view.triangle].longest;
  best.weights = within_triangle(best.weights);
  Gap gap = view.gap(best.weights);
  Vec3 rise = view.rise(best.weights, gap);
  best.depth = -gap.distance;
  double step = 0.5 * best.size;
  for (int k = 0; k < 100 && step > fine && best.depth + 3 * step * longest > more; ++k) {
    Deepest next = best;
    Gap next_gap;
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3;
      const double sign = rise[a] > rise[b] ? 1 : -1;
      Vec3 w = best.weights;
      w[a] += sign * step, w[b] -= sign * step;
      w = within_triangle(w);
      if (w == best.weights) continue;
      gap = view.gap(w);
      if (-gap.distance > next.depth) next = {w, -gap.distance, step}, next_gap = gap;
    }
    if (next.depth > best.depth)
      best = next, rise = view.rise(best.weights, next_gap);
    else
      step *= 0.3;
  }
}

}  // namespace

void find_faces(const Model& model, State& state, const Surface& surface, std::size_t instrument,
                double drifted) {
  StepScratch& w = *state.scratch;
  if (w.faces.empty() || w.faces.thickness[instrument] == 0) return;
  std::vector<Index>& found = w.near_faces[instrument];
  found.clear();
  ++w.faces_number;
  const double slack = w.reach + w.tolerance, swept = w.sweeps[instrument].reach;
  near_nodes(*surface.clusters, surface.bounds, surface.positions, w.shapes[instrument],
             w.faces.most_reach + slack + swept, drifted, [&](Index node, double d) {
               const double near = static_cast<double>(w.faces.reach[at(node)]) + slack;
               if (!may_meet(w, surface, instrument, node, d, near, drifted)) return;
               for (Index k = w.faces.begin[at(node)]; k < w.faces.begin[at(node) + 1]; ++k) {
                 const Index triangle = w.faces.triangles_of[at(k)];
                 if (std::exchange(w.face_number[at(triangle)], w.faces_number) == w.faces_number) continue;
                 found.push_back(triangle);
                 for (const Index corner : model.organ.surface.triangles[at(triangle)])
                   if (model.organ.row_of[at(corner)] >= 0) add_near(w, corner);
               }
             });
  std::sort(found.begin(), found.end());  // as its order decides bits
}

namespace {

std::array<Vec3, 3> corners_at(const Model& model, std::size_t triangle, auto&& u_of) {
  std::array<Vec3, 3> out;
  for (std::size_t k = 0; k < 3; ++k) {
    const Index node = model.organ.surface.triangles[triangle][k];
    out[k] = model.organ.contact_points[at(node)];
    if (model.organ.row_of[at(node)] >= 0) out[k] += u_of(node);
  }
  return out;
}

// Beside an anchor a place could hardly give way.
bool is_free(const Model& model, const StepScratch& w, std::size_t triangle) {
  const Triangle& nodes = model.organ.surface.triangles[triangle];
  return std::none_of(nodes.begin(), nodes.end(),
                      [&](Index node) { return w.grasped[at(node)] || model.organ.row_of[at(node)] < 0; });
}

// What counts as reaching into a triangle, m: a hundredth of the tick's motion. The more often it was looked
// for in this tick, the more is left to the next.
double least_depth(const StepScratch& w, std::size_t triangle, std::size_t instrument) {
  return w.tolerance + (2 * fine * w.faces.faces[triangle].longest + 0.01 * w.sweeps[instrument].way) *
                           static_cast<double>(1 << std::min(w.round, 4));
}

Vec3 inwards(const std::array<Vec3, 3>& corners) {
  return (corners[2] - corners[0]).cross(corners[1] - corners[0]).normalized();
}

Vec3 inwards_now(const Model& model, State& state, const ContactPoint& c) {
  return inwards(
      corners_at(model, at(c.triangle), [&](Index node) { return displacement(model, state, node); }));
}

// How far a point in the solid is from being out of it along a way, m; infinite: farther than `most`.
double way_out(const PlacedShape& shape, const Vec3& p, const Vec3& along, double most) noexcept {
  double in = 0, out = 0;
  for (int k = 0; k < 40 && out <= most; ++k) {
    const double d = shape.distance(p + out * along);
    if (d >= 0) {
      for (int i = 0; i < 20; ++i) {
        const double middle = (in + out) / 2;
        (shape.distance(p + middle * along) < 0 ? in : out) = middle;
      }
      return out;
    }
    in = out, out += std::max(-d, 0.02 * most);
  }
  return std::numeric_limits<double>::infinity();
}

// The plane that stands for an instrument at a place: what touches a triangle is on the side it faces. False
// where it has come round an edge of the instrument. What the instrument cuts after a fast motion, or has
// pierced, is let out along its normal.
bool take_plane(const StepScratch& w, const Vec3& facing, ContactPoint& c) noexcept {
  const PlacedShape& shape = w.shapes[at(c.instrument)];
  if (!(facing.squaredNorm() > 0.5)) return false;  // the triangle has shrunk to nothing
  const Vec3 p = c.rest + c.u;
  Gap g = gap_by_path(shape, c.path, p);
  double along = g.normal.dot(facing);
  if (along < least_facing && g.distance < 0) {
    const bool pierced = shape.distance(p) < -0.5 * w.faces.thickness[at(c.instrument)];
    const double most =
        2 * w.sweeps[at(c.instrument)].way + (pierced ? w.faces.faces[at(c.triangle)].longest : 0);
    if (const double depth = way_out(shape, p, facing, most); depth <= most)
      g = {-depth, facing, 1}, along = 1;
  }
  if (along < least_facing) return false;
  c.facing = facing, c.tilt = along * g.slope, c.offset = g.distance - c.tilt * facing.dot(c.u);
  return true;
}

// Where an instrument reaches deepest into a triangle, if it does.
bool find_place(const Model& model, State& state, View& view, ContactPoint& c) {
  StepScratch& w = *state.scratch;
  const Face& face = w.faces.faces[view.triangle];
  const double more = least_depth(w, view.triangle, view.instrument);
  const double leaf = std::clamp(2 * w.faces.thickness[view.instrument] / face.longest, 1.0 / 32, 0.5);
  view.now = corners_at(model, view.triangle, [&](Index node) { return displacement(model, state, node); });
  const auto look_back = [&] {
    view.before =
        corners_at(model, view.triangle, [&](Index node) { return displacement_before(model, state, node); });
  };
  Deepest best = sample(view, leaf, more);
  if (best.size > 0) climb(view, more, best);
  const bool swept = best.depth <= more && view.sweep.reach > 0;
  if (swept) look_back(), best = sample_swept(view, leaf, more);
  if (best.depth <= more) return false;
  if (!swept) look_back();
  c = place_at(model, w, view.triangle, view.instrument, best.weights);
  c.u = view.point(view.now, best.weights) - c.rest;
  c.path = view.path(best.weights);
  const Vec3 facing = inwards(view.now);
  if (facing.dot(face.normal) > -least_facing || !take_plane(w, facing, c)) return false;
  if (view.sweep.known && model.settings.friction > 0) {  // it slips from where it was on the instrument
    c.held = true;
    c.reference = view.shape.to_organ * (view.sweep.last * view.point(view.before, best.weights)) - c.rest;
  }
  return std::none_of(w.points.begin(), w.points.end(), [&](const ContactPoint& other) {
    return other.triangle >= 0 && other.instrument == c.instrument &&
           (other.rest - c.rest).norm() <= (swept ? leaf : 2 * fine) * face.longest;
  });
}

}  // namespace

ContactPoint place_at(const Model& model, const StepScratch& w, std::size_t triangle, std::size_t instrument,
                      const Vec3& weights) {
  ContactPoint c;
  c.triangle = static_cast<Index>(triangle), c.instrument = static_cast<Index>(instrument);
  c.weights = weights;
  double most = -1;
  for (std::size_t k = 0; k < 3; ++k) {
    const Index node = model.organ.surface.triangles[triangle][k];
    c.rest += weights[static_cast<int>(k)] * model.organ.contact_points[at(node)];
    if (model.organ.row_of[at(node)] >= 0 && weights[static_cast<int>(k)] > most)
      c.node = node, most = weights[static_cast<int>(k)];
  }
  c.row = model.organ.row_of[at(c.node)];
  c.rest -= w.faces.allowance(triangle, instrument, weights) * w.faces.faces[triangle].normal;
  return c;
}

// Whether all nodes of a triangle bear the instrument.
bool lies_on(const Model& model, const StepScratch& w, std::size_t instrument, std::size_t triangle) {
  const Triangle& nodes = model.organ.surface.triangles[triangle];
  return std::all_of(nodes.begin(), nodes.end(), [&](Index node) {
    const Index point = w.point_of[instrument * model.organ.surface_size() + at(node)];
    return point >= 0 && w.points[at(point)].force != Vec3::Zero();
  });
}

void face_places(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  for (ContactPoint& c : w.points)
    if (c.triangle >= 0 && !take_plane(w, inwards_now(model, state, c), c) &&
        c.tilt == 0)  // else it keeps what it had
      c.facing = Vec3::UnitZ(), c.tilt = 1, c.offset = w.size - c.u.z();
}

bool places_are_off(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  for (const ContactPoint& c : w.points) {
    if (c.triangle < 0 || c.force == Vec3::Zero()) continue;
    ContactPoint now = c;
    if (!take_plane(w, inwards_now(model, state, c), now)) continue;
    const double off = now.offset + now.tilt * now.facing.dot(c.u) - c.gap;
    if (std::abs(off) > least_depth(w, at(c.triangle), at(c.instrument)) ||
        (now.facing - c.facing).norm() > turned * (1 << std::min(w.round, 4)))
      return true;
  }
  return false;
}

void drop_idle_places(const Model& model, State& state) {
  StepScratch& w = *state.scratch;
  if (w.places <= most_places / 2) return;
  w.places -= std::erase_if(w.points,
                            [](const ContactPoint& c) { return c.triangle >= 0 && c.force == Vec3::Zero(); });
  for (std::size_t k = w.points.size(); k-- > 0;)
    if (const ContactPoint& c = w.points[k]; c.triangle < 0)
      w.point_of[at(c.instrument) * model.organ.surface_size() + at(c.node)] = static_cast<Index>(k);
}

bool add_places(const Model& model, State& state, const Surface& surface, bool early) {
  StepScratch& w = *state.scratch;
  if (w.faces.empty() || model.settings.mode != Mode::unilateral) return false;
  const double drifted = drift(model, state, surface);
  const bool found = (drifted - w.drifted_before) * w.softest <= w.reach;  // all, by detect()
  bool added = false;
  for (std::size_t i = 0; i < w.shapes.size(); ++i) {
    if (w.faces.thickness[i] == 0) continue;
    if (!found) {
      find_faces(model, state, surface, i, drifted);
      hold(model, state, For::loads);
    }
    for (const Index triangle : w.near_faces[i]) {
      View view{w.faces, w.shapes[i], w.sweeps[i], at(triangle), i};
      ContactPoint c;
      if (w.faces.thickness[i] >= fine_enough * w.faces.faces[view.triangle].longest) continue;
      if (early && lies_on(model, w, i, view.triangle)) continue;
      if (!is_free(model, w, view.triangle) || !find_place(model, state, view, c)) continue;
      if (w.places == most_places || !has_room(w, 3)) {
        state.status |= too_many_contacts;
        continue;
      }
      w.points.push_back(c);
      ++w.places;
      added = true;
    }
  }
  return added;
}

}  // namespace palpate
