#include "palpate/simulation/record.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "palpate/geometry/bvh.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/vtu.hpp"

namespace palpate {

namespace {

// The deformed organ and the instruments where they are, in the world; cell array "body": 0 the organ, then
// the instruments.
void write_frame(const std::filesystem::path& path, const Model& model, const Input& input,
                 const State& state, const std::vector<Index>& drawn_of) {
  const TriangleMesh& drawn = drawn_surface(model.organ);
  std::vector<Vec3> points = drawn_vertices(model, state);
  const std::size_t s = points.size();
  std::vector<Triangle> triangles = drawn.triangles;
  VtuField body{"body", 1, std::vector<float>(triangles.size(), 0.0f)};
  for (std::size_t i = 0; i < model.instruments.size(); ++i) {
    const auto offset = static_cast<Index>(points.size());
    for (const Vec3& v : model.instruments[i].surface.vertices) points.push_back(input.instruments[i] * v);
    for (const Triangle& t : model.instruments[i].surface.triangles)
      triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    body.values.resize(triangles.size(), static_cast<float>(i + 1));
  }
  VtuField displacement{"displacement_m", 3, std::vector<float>(3 * points.size(), 0.0f)};
  VtuField force{"force_N", 3, std::vector<float>(3 * points.size(), 0.0f)};
  for (std::size_t i = 0; i < s; ++i) {
    const Vec3 u = points[i] - state.organ * drawn.vertices[i];
    for (std::size_t a = 0; a < 3; ++a)
      displacement.values[3 * i + a] = static_cast<float>(u[static_cast<int>(a)]);
  }
  for (const Contact& c : state.contacts)
    for (std::size_t a = 0; a < 3; ++a)
      force.values[3 * static_cast<std::size_t>(drawn_of[static_cast<std::size_t>(c.node)]) + a] +=
          static_cast<float>(c.force[static_cast<int>(a)]);
  write_vtu(path, points, triangles, {displacement, force}, {body});
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

void write_text(const std::filesystem::path& path, const std::string& text) {
  AtomicFile out(path);
  out.write(text);
  out.commit();
}

}  // namespace

Recorder::Recorder(std::filesystem::path folder, const Model& model, std::size_t every)
    : folder_(std::move(folder)), model_(model), drawn_of_(nearest_drawn(model.organ)), every_(every) {
  std::error_code failure;
  std::filesystem::create_directories(every_ ? folder_ / "frames" : folder_, failure);
  if (failure)
    throw Error(ErrorKind::file, "{}: cannot create the folder: {}", folder_.string(), failure.message());
  forces_ = "step,time_s,contacts,deepest_before_m,deepest_after_m,relinearisations,status,step_ms";
  for (const Instrument& i : model.instruments)
    for (const char* c : {"fx_N", "fy_N", "fz_N", "tx_Nm", "ty_Nm", "tz_Nm"})
      forces_ += "," + i.name + "." + c;
  forces_ += "\n";
  summary_.surface_nodes = model.organ.surface_size();
}

void Recorder::add(std::size_t step, const Input& input, const State& state) {
  const double ms = 1e3 * state.times.total;
  step_ms_.push_back(ms);
  forces_ += fmt::format("{},{:.9g},{},{:.6g},{:.6g},{},{},{:.4g}", step, input.time, state.contacts.size(),
                         state.deepest_before, state.deepest_after, state.relinearisations, state.status, ms);
  for (const Wrench& w : state.wrenches) {
    forces_ += fmt::format(",{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{:.7g}", w.force.x(), w.force.y(),
                           w.force.z(), w.torque.x(), w.torque.y(), w.torque.z());
    if (w.force.norm() > summary_.peak_force) {
      summary_.peak_force = w.force.norm();
      summary_.peak_direction = w.force.normalized();
      summary_.peak_time = input.time;
    }
  }
  forces_ += "\n";
  ++summary_.steps;
  if (state.status & not_converged) ++summary_.not_converged;
  summary_.contacts_max = std::max(summary_.contacts_max, state.contacts.size());
  if (!state.contacts.empty()) {
    summary_.contacts_mean += static_cast<double>(state.contacts.size());
    ++contact_steps_;
  }
  summary_.deepest_before = std::max(summary_.deepest_before, state.deepest_before);
  summary_.deepest_after = std::max(summary_.deepest_after, state.deepest_after);
  if (every_ && step % every_ == 0) {
    const std::string name = fmt::format("frames/frame{:06}.vtu", step);
    write_frame(folder_ / name, model_, input, state, drawn_of_);
    frames_.push_back(name);
    frame_times_.push_back(input.time);
  }
}

RunSummary Recorder::finish() {
  if (contact_steps_ > 0) summary_.contacts_mean /= contact_steps_;
  summary_.step_ms_median = percentile(step_ms_, 0.5);
  summary_.step_ms_p99 = percentile(step_ms_, 0.99);
  summary_.step_ms_worst = percentile(step_ms_, 1.0);
  double sum = 0;
  for (const double ms : step_ms_) sum += ms;
  summary_.steps_per_second = sum > 0 ? 1e3 * static_cast<double>(step_ms_.size()) / sum : 0;
  std::vector<PvdEntry> entries;
  for (std::size_t i = 0; i < frames_.size(); ++i) entries.push_back({frame_times_[i], frames_[i]});
  if (every_) write_pvd(folder_ / "frames.pvd", entries);
  write_text(folder_ / "forces.csv", forces_);
  write_text(folder_ / "summary.json", summary_json(summary_) + "\n");
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
  row("deepest penetration before", fmt::format("{:.3f} mm", 1e3 * s.deepest_before));
  row("left over after the solve", fmt::format("{:.2g} mm", 1e3 * s.deepest_after));
  row("peak force",
      fmt::format("{:.3f} N along ({:+.2f} {:+.2f} {:+.2f}) at {:.3f} s", s.peak_force, s.peak_direction.x(),
                  s.peak_direction.y(), s.peak_direction.z(), s.peak_time));
  row("step, median / p99 / worst",
      fmt::format("{:.3f} / {:.3f} / {:.3f} ms", s.step_ms_median, s.step_ms_p99, s.step_ms_worst));
  row("steps a second", fmt::format("{:.0f}", s.steps_per_second));
  row("steps not converged", fmt::format("{}", s.not_converged));
  return out;
}

std::string summary_json(const RunSummary& s) {
  const nlohmann::ordered_json json{
      {"steps", s.steps},
      {"surface_nodes", s.surface_nodes},
      {"contacts_mean", s.contacts_mean},
      {"contacts_max", s.contacts_max},
      {"deepest_before_m", s.deepest_before},
      {"deepest_after_m", s.deepest_after},
      {"peak_force_N", s.peak_force},
      {"peak_force_direction", {s.peak_direction.x(), s.peak_direction.y(), s.peak_direction.z()}},
      {"peak_force_time_s", s.peak_time},
      {"step_ms_median", s.step_ms_median},
      {"step_ms_p99", s.step_ms_p99},
      {"step_ms_worst", s.step_ms_worst},
      {"steps_per_second", s.steps_per_second},
      {"not_converged", s.not_converged}};
  return json.dump(2);
}

}  // namespace palpate
