#include "palpate/simulation/discretisation.hpp"

#include <fmt/core.h>

#include <cmath>

#include "palpate/elasticity/enrichment.hpp"

namespace palpate {

namespace {

constexpr double jaw_radius = 0.05;    // of the organ's size: standard deviation of a jaw's bell of pressure
constexpr double neighbourhood = 4.5;  // of the jaw's radius: how far the higher order reaches
constexpr double settled = 0.05;       // of the error: what two iterations may still add
constexpr int most_iterations = 60;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

struct Jaws {
  std::array<Vec3, 2> at;
  Vec3 closing;  // of the first jaw, unit; the second closes against it
  double radius = 0;
};

// Mean position of what holds the organ.
Vec3 centre_of_hold(const Organ& organ, const ElementNodes& nodes, const FreeStiffness& k) {
  const std::vector<std::uint8_t> bedded = bedded_nodes(organ.mesh, organ.beddings);
  Vec3 sum = Vec3::Zero();
  double count = 0;
  for (std::size_t i = 0; i < organ.mesh.nodes.size(); ++i)
    if (k.free_of[i] < 0 || bedded[i]) sum += nodes.positions[i], ++count;
  return sum / std::max(count, 1.0);
}

// Where a line from p along d leaves the body last; p where it does not.
Vec3 exit_of(const TriangleMesh& surface, const Vec3& p, const Vec3& d) {
  double farthest = 0;
  for (const Triangle& t : surface.triangles) {
    const Vec3& a = surface.vertices[at(t[0])];
    Mat3 m;
    m << surface.vertices[at(t[1])] - a, surface.vertices[at(t[2])] - a, -d;
    const Vec3 x = m.inverse() * (p - a);
    if (x.allFinite() && x[0] >= 0 && x[1] >= 0 && x[0] + x[1] <= 1) farthest = std::max(farthest, x[2]);
  }
  return p + farthest * d;
}

Jaws find_jaws(const Organ& organ, const Vec3& hold) {
  const std::vector<Vec3>& x = organ.surface.vertices;
  const Box box = bounding_box(x);
  double area = 0;
  for (const double a : organ.areas) area += a;
  const Vec3 across = (box.center() - hold).normalized();  // 0 where there is no such direction
  double best = -std::numeric_limits<double>::infinity();
  std::size_t first = at(organ.node_of_row[0]);
  for (const Index i : organ.node_of_row) {
    const Vec3 d = x[at(i)] - hold;
    const double along = d.dot(across), score = along - (d - along * across).norm();
    if (score > best) best = score, first = at(i);
  }
  Jaws jaws;
  jaws.closing = -vertex_normals(organ.surface)[first];
  jaws.at = {x[first], exit_of(organ.surface, x[first], jaws.closing)};
  jaws.radius = std::max(jaw_radius * box.diagonal(),
                         1.5 * std::sqrt(area / static_cast<double>(organ.surface_size())));
  return jaws;
}

// Pressure of both jaws on the surface nodes, N/m2, 1 N each.
std::vector<Vec3> pressures(const Organ& organ, const Jaws& jaws) {
  const std::vector<Vec3> normals = vertex_normals(organ.surface);
  std::vector<Vec3> out(organ.surface_size(), Vec3::Zero());
  for (std::size_t jaw = 0; jaw < 2; ++jaw) {
    const Vec3 direction = jaw == 0 ? jaws.closing : Vec3(-jaws.closing);
    std::vector<double> bell(out.size(), 0);
    double total = 0;
    for (std::size_t i = 0; i < out.size(); ++i)
      if (normals[i].dot(direction) < 0) {  // the far side of a thin part is the other jaw's
        bell[i] = std::exp(-0.5 * (organ.surface.vertices[i] - jaws.at[jaw]).squaredNorm() /
                           (jaws.radius * jaws.radius));
        total += bell[i] * organ.areas[i];
      }
    for (std::size_t i = 0; i < out.size() && total > 0; ++i) out[i] += bell[i] / total * direction;
  }
  return out;
}

std::vector<Index> tets_near(const TetMesh& mesh, const Jaws& jaws, double reach) {
  std::vector<Index> out;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : mesh.tets[t]) {
      const Vec3& p = mesh.nodes[at(n)];
      if (std::min((p - jaws.at[0]).norm(), (p - jaws.at[1]).norm()) > reach) continue;
      out.push_back(static_cast<Index>(t));
      break;
    }
  return out;
}

std::span<double> span_of(Eigen::VectorXd& v) { return {v.data(), static_cast<std::size_t>(v.size())}; }

// Of the system [K_uu K_uw; K_wu K_ww] (u, w) = (force, added), by conjugate gradients with K_uu's factor and
// K_ww's diagonal blocks. The work of the load grows from what the nodes' own functions give to what the
// space of higher order gives; returned are both.
struct Work {
  double own = 0, higher = 0;  // J
};
Work solve(const Enrichment& more, const FreeStiffness& k, const Cholesky& factor,
           const Eigen::VectorXd& force, const Eigen::VectorXd& added, Eigen::VectorXd& u,
           const Progress& progress) {
  Eigen::VectorXd w = Eigen::VectorXd::Zero(added.size()), of_w,
                  no_force = Eigen::VectorXd::Zero(force.size());
  u = force;
  factor.solve(span_of(u));
  more.multiply(u, w, no_force, of_w);
  Eigen::VectorXd r = Eigen::VectorXd::Zero(force.size()), s = added - of_w;  // residuals
  Eigen::VectorXd p, q, y, z;
  Work work{force.dot(u), force.dot(u)};
  std::array<double, 2> last{work.own, work.own};
  double rho = 0;
  for (int i = 0; i < most_iterations; ++i) {
    progress.at(static_cast<double>(i) / most_iterations);
    y = r, factor.solve(span_of(y)), z = more.precondition(s);
    const double next = r.dot(y) + s.dot(z);
    if (!(next > 0)) break;
    if (i == 0)
      p = y, q = z;
    else
      p = y + next / rho * p, q = z + next / rho * q;
    rho = next;
    Eigen::VectorXd kp = k.matrix * p, kq;
    more.multiply(p, q, kp, kq);
    const double step = rho / (p.dot(kp) + q.dot(kq));
    u += step * p, w += step * q, r -= step * kp, s -= step * kq;
    work.higher += step * rho;  // twice what the energy falls by
    if (work.higher - last[0] < settled * (work.higher - work.own)) break;
    last = {last[1], work.higher};
  }
  return work;
}

}  // namespace

std::string to_string(const Discretisation& d) {
  if (d.against == 0) return "not known";
  return fmt::format(
      "{:.2g} % too stiff, displacement {:.2g} % off (pinched by jaws of {:.2g} mm, against {} tetrahedra)",
      100 * d.stiffness, 100 * d.displacement, 1e3 * d.radius, d.against == 2 ? "quadratic" : "cubic");
}

PinchResult pinch(const Organ& organ, const ElementNodes& nodes, const FreeStiffness& k,
                  const Cholesky& factor, const Progress& progress, bool everywhere) {
  const Jaws jaws = find_jaws(organ, centre_of_hold(organ, nodes, k));
  const std::vector<Vec3> pressure = pressures(organ, jaws);
  const Enrichment more(
      organ.mesh, nodes, organ.materials, k.free_of,
      tets_near(organ.mesh, jaws,
                everywhere ? std::numeric_limits<double>::infinity() : neighbourhood * jaws.radius));
  Eigen::VectorXd force = Eigen::VectorXd::Zero(k.matrix.rows()),
                  added = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(more.size()));
  for (const Triangle& t : organ.surface.triangles) {
    const Triangle corners{organ.surface_nodes[at(t[0])], organ.surface_nodes[at(t[1])],
                           organ.surface_nodes[at(t[2])]};
    more.add_traction(nodes, k.free_of, corners, area_vector(organ.surface, t).norm(),
                      {pressure[at(t[0])], pressure[at(t[1])], pressure[at(t[2])]}, force, added);
  }

  PinchResult out;
  out.u = force;
  factor.solve(span_of(out.u));
  Eigen::VectorXd better;
  const Work work = solve(more, k, factor, force, added, better, progress);
  out.work = work.own;
  Discretisation& figures = out.figures;
  figures.at = jaws.at[0], figures.radius = jaws.radius, figures.against = organ.order + 1;
  figures.stiffness = work.higher / work.own - 1;
  double largest = 0, off = 0;
  for (const Index i : organ.node_of_row) {
    const auto row = 3 * static_cast<Eigen::Index>(k.free_of[at(organ.surface_nodes[at(i)])]);
    largest = std::max(largest, better.segment<3>(row).norm());
    off = std::max(off, (better - out.u).segment<3>(row).norm());
  }
  figures.displacement = largest > 0 ? off / largest : 0;
  return out;
}

void compare_drawing(Organ& organ, const ElementNodes& nodes, const FreeStiffness& k,
                     const Eigen::SparseMatrix<double>& loads, const Eigen::VectorXd& u) {
  if (organ.drawing.empty()) return;
  const Vec3 zero = Vec3::Zero();
  const auto of_node = [&](Index n) {
    const Index free = k.free_of[at(n)];
    return free < 0 ? zero : Vec3(u.segment<3>(3 * static_cast<Eigen::Index>(free)));
  };
  // Small, so that the heights turn as they do in small strains.
  const double largest = u.size() ? u.cwiseAbs().maxCoeff() : 0;
  if (!(largest > 0)) return;
  const double scale = 1e-4 * bounding_box(organ.surface.vertices).diagonal() / largest;
  const Eigen::VectorXd read = loads.transpose() * u;
  const std::size_t rows = organ.node_of_row.size();
  std::vector<Eigen::Vector4f> means(rows, Eigen::Vector4f::Zero()), drawn(rows), work(2 * rows);
  for (std::size_t r = 0; r < rows; ++r)
    means[r].head<3>() = (scale * read.segment<3>(3 * static_cast<Eigen::Index>(r))).cast<float>();
  if (organ.order == 2)
    organ.projection(means, drawn, work);
  else
    drawn = means;
  std::vector<Vec3> moved = organ.surface.vertices, shown(organ.drawing.surface.vertices.size());
  for (std::size_t r = 0; r < rows; ++r) moved[at(organ.node_of_row[r])] += drawn[r].head<3>().cast<double>();
  draw(organ.drawing, organ.surface, moved, shown);

  double sum = 0, most = 0, size = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const Triangle& t = organ.surface.triangles[at(organ.drawing.triangle[i])];
    Vec3 l = organ.drawing.ride[i].head<3>().cast<double>().cwiseMax(0.0);
    l /= l.sum();
    Vec3 exact = zero;
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3;
      const Index p = organ.surface_nodes[at(t[static_cast<std::size_t>(a)])],
                  q = organ.surface_nodes[at(t[static_cast<std::size_t>(b)])];
      if (organ.order == 1)
        exact += l[a] * of_node(p);
      else
        exact += l[a] * (2 * l[a] - 1) * of_node(p) + 4 * l[a] * l[b] * of_node(nodes.middle(p, q));
    }
    const double off = ((shown[i] - organ.drawing.surface.vertices[i]) / scale - exact).norm();
    sum += off * off, most = std::max(most, off), size = std::max(size, exact.norm());
  }
  organ.drawing.error_rms = std::sqrt(sum / static_cast<double>(shown.size())) / size;
  organ.drawing.error_max = most / size;
}

}  // namespace palpate
