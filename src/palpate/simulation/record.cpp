#include "palpate/simulation/record.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "palpate/geometry/bvh.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/vtu.hpp"

namespace palpate {

namespace {

// The deformed organs and the instruments where they are, in the world; cell array "body": the organs from 0
// on, then the instruments.
void write_frame(const std::filesystem::path& path, std::span<const Model> models,
                 std::span<const Frame> frames, const std::vector<std::vector<Index>>& drawn_of) {
  std::vector<Vec3> points;
  std::vector<Triangle> triangles;
  VtuField body{"body", 1, {}}, displacement{"displacement_m", 3, {}}, force{"force_N", 3, {}};
  VtuField error{"force_error_N", 1, {}}, strain{"strain", 1, {}};
  float bodies = 0;
  const auto add = [&](const std::vector<Vec3>& vertices, const std::vector<Triangle>& faces) {
    const auto offset = static_cast<Index>(points.size());
    points.insert(points.end(), vertices.begin(), vertices.end());
    for (const Triangle& t : faces) triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    body.values.resize(triangles.size(), bodies++);
    displacement.values.resize(3 * points.size(), 0.0f);
    force.values.resize(3 * points.size(), 0.0f);
    error.values.resize(points.size(), 0.0f), strain.values.resize(points.size(), 0.0f);
  };
  for (std::size_t o = 0; o < models.size(); ++o) {
    const TriangleMesh& drawn = drawn_surface(models[o].organ);
    const std::size_t first = points.size();
    const Outcome& outcome = frames[o].outcome;
    const Surface& surface = frames[o].surface;
    add(drawn_vertices(models[o].organ, outcome.organ, surface), drawn.triangles);
    for (std::size_t i = 0; i < drawn.vertices.size(); ++i) {
      const Vec3 u = points[first + i] - outcome.organ * drawn.vertices[i];
      for (std::size_t a = 0; a < 3; ++a)
        displacement.values[3 * (first + i) + a] = static_cast<float>(u[static_cast<int>(a)]);
    }
    for (const Contact& c : outcome.contacts) {
      for (std::size_t k = 0; k < (c.triangle < 0 ? 1 : 3); ++k) {
        const auto node = static_cast<std::size_t>(
            c.triangle < 0 ? c.node
                           : models[o].organ.surface.triangles[static_cast<std::size_t>(c.triangle)][k]);
        const Index row = models[o].organ.row_of[node];
        if (row < 0) continue;  // what acts on an anchor does nothing
        const Vec3 share = c.triangle < 0 ? c.force : Vec3(c.weights[static_cast<int>(k)] * c.force);
        const std::size_t v = first + static_cast<std::size_t>(drawn_of[o][node]);
        for (std::size_t a = 0; a < 3; ++a)
          force.values[3 * v + a] += static_cast<float>(share[static_cast<int>(a)]);
        error.values[v] += static_cast<float>(share.norm() * error_bar(frames[o].bar, surface, row).total());
        for (std::size_t i = 0; i < surface.loads.count; ++i)
          if (surface.loads.rows[i] == row)
            strain.values[v] = std::max(strain.values[v], surface.strains.contacts[i].largest);
      }
    }
  }
  for (std::size_t i = 0; i < models[0].instruments.size(); ++i) {
    std::vector<Vec3> vertices = models[0].instruments[i].surface.vertices;
    for (Vec3& v : vertices) v = frames[0].outcome.instruments[i] * v;
    add(vertices, models[0].instruments[i].surface.triangles);
  }
  write_vtu(path, points, triangles, {displacement, force, error, strain}, {body});
}

// Nearest drawn vertex of each surface node; itself where the surface is drawn.
std::vector<Index> nearest_drawn(const Organ& organ) {
  std::vector<Index> out(organ.surface_size());
  std::iota(out.begin(), out.end(), 0);
  if (organ.drawing.empty()) return out;
  const TriangleMesh& drawn = organ.drawing.surface;
  const Bvh tree(drawn);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Vec3& p = organ.surface.vertices[i];
    const Triangle& t = drawn.triangles[static_cast<std::size_t>(tree.closest(p).triangle)];
    out[i] = *std::min_element(t.begin(), t.end(), [&](Index a, Index b) {
      return (drawn.vertices[static_cast<std::size_t>(a)] - p).squaredNorm() <
             (drawn.vertices[static_cast<std::size_t>(b)] - p).squaredNorm();
    });
  }
  return out;
}

double percentile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  const auto k = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<std::size_t>(k)];
}

}  // namespace

void ContactSummary::add(std::span<const Frame> frames) {
  const ErrorBar bar = palpate::largest_bar(frames);
  std::size_t contacts = 0;
  std::uint32_t status = status_ok;
  for (const Frame& f : frames) {
    contacts += f.outcome.contacts.size(), status |= f.outcome.status;
    deepest_before = std::max(deepest_before, f.outcome.deepest_before);
    deepest_after = std::max(deepest_after, f.outcome.deepest_after);
    largest_strain = std::max(largest_strain, f.surface.strains.largest);
  }
  if (status & strain_beyond_linear) ++beyond_linear;
  if (bar.total() > largest_bar.total()) largest_bar = bar;
  if (status & palpate::not_converged) ++not_converged;
  contacts_max = std::max(contacts_max, contacts);
  const std::size_t instruments = frames[0].outcome.wrenches.size();
  std::size_t grasped = 0;
  for (std::size_t i = 0; i < instruments; ++i) grasped += grasped_by(frames, i);
  grasped_max = std::max(grasped_max, grasped);
  contacts_mean += static_cast<double>(contacts);  // a sum, until finish()
  if (contacts > 0) ++steps_in_contact;
  for (std::size_t i = 0; i < instruments; ++i) {
    const Vec3 force = wrench_of(frames, i).force;
    if (force.norm() > peak_force)
      peak_force = force.norm(), peak_direction = force.normalized(), peak_time = frames[0].outcome.time,
      peak_bar = bar;
  }
}

Recorder::Recorder(std::filesystem::path folder, std::span<const Model> models,
                   const std::vector<std::string>& names, std::size_t every)
    : folder_(std::move(folder)), models_(models), every_(every), forces_(models, names) {
  std::error_code failure;
  std::filesystem::create_directories(every_ ? folder_ / "frames" : folder_, failure);
  if (failure)
    throw Error(ErrorKind::file, "{}: cannot create the folder: {}", folder_.string(), failure.message());
  for (std::size_t o = 0; o < models.size(); ++o) {
    drawn_of_.push_back(nearest_drawn(models[o].organ));
    summary_.surface_nodes += models[o].organ.surface_size();
    if (models.size() == 1) break;
    summary_.organs.push_back({names[o], {}});
    summary_.organs.back().second.surface_nodes = models[o].organ.surface_size();
  }
}

void Recorder::add(std::size_t step, std::span<const State> states) {
  const std::vector<Frame> made = frames_of(models_, states);
  const std::span<const Frame> frames = made;
  double& ms = step_ms_.emplace_back(0);
  for (const State& s : states) ms += 1e3 * s.times.total;
  forces_.add(step, frames);
  ++summary_.steps;
  summary_.add(frames);
  for (std::size_t o = 0; o < summary_.organs.size(); ++o)
    summary_.organs[o].second.add(frames.subspan(o, 1));
  if (every_ && step % every_ == 0) {
    const std::string name = fmt::format("frames/frame{:06}.vtu", step);
    write_frame(folder_ / name, models_, frames, drawn_of_);
    frames_.push_back(name);
    frame_times_.push_back(states[0].time);
  }
}

RunSummary Recorder::finish() {
  const auto to_mean = [](ContactSummary& s) {
    if (s.steps_in_contact > 0) s.contacts_mean /= static_cast<double>(s.steps_in_contact);
  };
  to_mean(summary_);
  for (auto& [name, organ] : summary_.organs) to_mean(organ);
  summary_.step_ms_median = percentile(step_ms_, 0.5);
  summary_.step_ms_p99 = percentile(step_ms_, 0.99);
  summary_.step_ms_worst = percentile(step_ms_, 1.0);
  double sum = 0;
  for (const double ms : step_ms_) sum += ms;
  summary_.steps_per_second = sum > 0 ? 1e3 * static_cast<double>(step_ms_.size()) / sum : 0;
  std::vector<PvdEntry> entries;
  for (std::size_t i = 0; i < frames_.size(); ++i) entries.push_back({frame_times_[i], frames_[i]});
  if (every_) write_pvd(folder_ / "frames.pvd", entries);
  forces_.write(folder_ / "forces.csv");
  AtomicFile out(folder_ / "summary.json");
  out.write(summary_json(summary_) + "\n");
  out.commit();
  return summary_;
}

std::string summary_table(const RunSummary& s) {
  std::string out;
  const auto row = [&](const char* label, const std::string& value) {
    out += fmt::format("  {:<28} {}\n", label, value);
  };
  row("steps", fmt::format("{}", s.steps));
  row("surface nodes", fmt::format("{}", s.surface_nodes));
  row("contacts, mean / most", fmt::format("{:.0f} / {}", s.contacts_mean, s.contacts_max));
  if (s.grasped_max > 0) row("nodes in a grip, most", fmt::format("{}", s.grasped_max));
  row("deepest penetration before", fmt::format("{:.3f} mm", 1e3 * s.deepest_before));
  row("left over after the solve", fmt::format("{:.2g} mm", 1e3 * s.deepest_after));
  row("peak force",
      fmt::format("{:.3f} N along ({:+.2f} {:+.2f} {:+.2f}) at {:.3f} s", s.peak_force, s.peak_direction.x(),
                  s.peak_direction.y(), s.peak_direction.z(), s.peak_time));
  const ErrorBar& bar = s.peak_bar;
  row("its error bar",
      fmt::format("{:.2g} %: elements {}, few nodes {:.2g} %, compression {:.2g} %, linearity {:.2g} %",
                  100 * bar.total(),
                  bar.discretisation_known ? fmt::format("{:.2g} %", 100 * bar.discretisation) : "not known",
                  100 * bar.resolution, 100 * bar.compression, 100 * bar.linearity));
  row("largest strain", fmt::format("{:.2g} %; above {:.0f} %, where it is no longer linear, in {} steps",
                                    100 * s.largest_strain, 100 * linear_strain, s.beyond_linear));
  row("step, median / p99 / worst",
      fmt::format("{:.3f} / {:.3f} / {:.3f} ms", s.step_ms_median, s.step_ms_p99, s.step_ms_worst));
  row("steps a second", fmt::format("{:.0f}", s.steps_per_second));
  row("steps not converged", fmt::format("{}", s.not_converged));
  for (const auto& [name, o] : s.organs)
    row(name.c_str(),
        fmt::format("{} nodes, contacts {:.0f} / {}, {:.3f} mm before, {:.2g} mm left, {:.3f} N",
                    o.surface_nodes, o.contacts_mean, o.contacts_max, 1e3 * o.deepest_before,
                    1e3 * o.deepest_after, o.peak_force));
  return out;
}

std::string summary_json(const RunSummary& s) {
  using json = nlohmann::ordered_json;
  const auto of_bar = [](const ErrorBar& b) {
    return json{{"discretisation", b.discretisation_known ? json(b.discretisation) : json(nullptr)},
                {"resolution", b.resolution},
                {"compression", b.compression},
                {"linearity", b.linearity},
                {"total", b.total()}};
  };
  const auto of_contacts = [&](const ContactSummary& c) {
    return json{{"surface_nodes", c.surface_nodes},
                {"contacts_mean", c.contacts_mean},
                {"contacts_max", c.contacts_max},
                {"grasped_max", c.grasped_max},
                {"deepest_before_m", c.deepest_before},
                {"deepest_after_m", c.deepest_after},
                {"peak_force_N", c.peak_force},
                {"peak_force_direction", {c.peak_direction.x(), c.peak_direction.y(), c.peak_direction.z()}},
                {"peak_force_time_s", c.peak_time},
                {"peak_force_error", of_bar(c.peak_bar)},
                {"peak_force_error_N", c.peak_bar.total() * c.peak_force},
                {"largest_error", of_bar(c.largest_bar)},
                {"largest_strain", c.largest_strain},
                {"strain_beyond_linear", c.beyond_linear}};
  };
  json out{{"steps", s.steps}};
  out.update(of_contacts(s));
  out.update({{"step_ms_median", s.step_ms_median},
              {"step_ms_p99", s.step_ms_p99},
              {"step_ms_worst", s.step_ms_worst},
              {"steps_per_second", s.steps_per_second},
              {"not_converged", s.not_converged}});
  for (const auto& [name, organ] : s.organs) {
    json entry{{"name", name}};
    entry.update(of_contacts(organ));
    entry["not_converged"] = organ.not_converged;
    out["organs"].push_back(entry);
  }
  return out.dump(2);
}

}  // namespace palpate
