#include "bench.hpp"

#include <fmt/core.h>
#include <sched.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>

#include "palpate/base/error.hpp"
#include "palpate/base/huge_array.hpp"
#include "palpate/base/parallel_for.hpp"
#include "palpate/base/timer.hpp"
#include "palpate/io/atomic_file.hpp"
#if PALPATE_HAS_compliance
#include "palpate/compliance/blas.hpp"
#endif

namespace palpate {

namespace {

double cpu_seconds(const std::function<void()>& body) {
  const Timer timer = cpu_timer();
  body();
  return timer.seconds();
}

// Above 1: ours is better.
double ratio(const Row& row, const Value& value) {
  return row.rate ? value.value / value.peer_value : value.peer_value / value.value;
}

std::string number(double value) {
  if (!std::isfinite(value)) return "-";
  return std::abs(value) >= 1000 ? fmt::format("{:.0f}", value) : fmt::format("{:.3g}", value);
}

void print_row(const Row& row, const Value& value) {
  const bool peer = std::isfinite(value.peer_value);
  fmt::print("{:<36} {:>10} {:<10} {:>10} {:>8}  {}{}\n", row.name, number(value.value), row.unit,
             number(value.peer_value), peer ? fmt::format("{}x", number(ratio(row, value))) : "-", value.peer,
             value.note.empty() ? "" : "  (" + value.note + ")");
  std::fflush(stdout);
}

nlohmann::ordered_json to_json(const Row& row, const Value& value, const std::string& machine) {
  const bool peer = std::isfinite(value.peer_value);
  nlohmann::ordered_json out;
  out["name"] = row.name;
  out["value"] = value.value;
  out["unit"] = row.unit;
  out["peer"] = value.peer.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(value.peer);
  out["peer_value"] = peer ? nlohmann::ordered_json(value.peer_value) : nlohmann::ordered_json();
  out["ratio"] = peer ? nlohmann::ordered_json(ratio(row, value)) : nlohmann::ordered_json();
  out["machine"] = machine;
  return out;
}

std::string proc_value(const char* file, const std::string& key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);)
    if (line.rfind(key, 0) == 0) {
      const std::size_t colon = line.find(':');
      if (colon == std::string::npos) continue;
      const std::size_t begin = line.find_first_not_of(" \t", colon + 1);
      if (begin != std::string::npos) return line.substr(begin);
    }
  return "";
}

}  // namespace

double median(std::vector<double> values) {
  if (values.empty()) return no_peer;
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

Medians in_turn(const std::function<void()>& ours, const std::function<void()>& peer, const Runs& runs) {
  std::vector<double> a, b;
  double spent = 0;
  for (int i = 0; i < runs.most && (i < runs.least || spent < runs.seconds); ++i) {
    for (int w = 0; w < runs.warm; ++w) ours();
    a.push_back(cpu_seconds(ours));
    spent += a.back();
    if (!peer) continue;
    for (int w = 0; w < runs.warm; ++w) peer();
    b.push_back(cpu_seconds(peer));
    spent += b.back();
  }
  return {median(a), median(b)};
}

void warm_memory(std::size_t bytes) {
  HugeArray<char> memory(bytes);
  for (std::size_t i = 0; i < bytes; i += 4096) memory[i] = 1;
  keep(memory[0]);
}

std::string machine() {
  std::string model = proc_value("/proc/cpuinfo", "model name");
  if (model.empty()) model = "unknown CPU";
  const double kib = std::strtod(proc_value("/proc/meminfo", "MemTotal").c_str(), nullptr);
  return fmt::format("{}, {} processors, {:.0f} GB", model, default_threads(), kib * 1024e-9);
}

void Bench::add(std::vector<Row> rows, std::function<std::vector<Value>()> run, bool full) {
  cases_.push_back({std::move(rows), std::move(run), full});
}

int Bench::main(int argc, char** argv) {
  CLI::App app("Measures palpate, beside its peers where they are installed.", "palpate-bench");
  std::string json, filter;
  bool list = false;
  app.add_option("--json", json, "write a list of {name, value, unit, peer, peer_value, ratio, machine}");
  app.add_option("--filter", filter, "only rows whose name matches this regular expression");
  app.add_flag("--full", full_, "the long rows, too, and a million ticks of the force loop");
  app.add_flag("--list", list, "print the names and stop");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(ErrorKind::usage);
  }

  const std::regex pattern(filter.empty() ? ".*" : filter);
  const auto wanted = [&](const Row& row) { return std::regex_search(row.name, pattern); };
  const std::string here = machine();
  std::optional<AtomicFile> file;  // opened first: a wrong path is no news after ten minutes
  if (!json.empty() && !list) file.emplace(json);
  if (!list)
    fmt::print("{}\n{:<36} {:>10} {:<10} {:>10} {:>8}  peer\n", here, "", "ours", "", "peer", "ratio");
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  int failed = 0;
  for (const Case& c : cases_) {
    if ((c.full && !full_ && !list) || std::none_of(c.rows.begin(), c.rows.end(), wanted)) continue;
    if (list) {
      for (const Row& row : c.rows)
        if (wanted(row)) fmt::print("{}{}\n", row.name, c.full ? "  (--full)" : "");
      continue;
    }
    try {
      const std::vector<Value> values = c.run();
      if (values.size() != c.rows.size())
        throw Error(ErrorKind::internal, "{} values for {} rows", values.size(), c.rows.size());
      for (std::size_t i = 0; i < values.size(); ++i) {
        if (!wanted(c.rows[i])) continue;
        print_row(c.rows[i], values[i]);
        out.push_back(to_json(c.rows[i], values[i], here));
      }
    } catch (const std::exception& error) {
      ++failed;
      fmt::print("{:<36} failed: {}\n", c.rows[0].name, error.what());
    }
  }
  if (file) {
    file->write(out.dump(2) + "\n");
    file->commit();
  }
  return failed ? 1 : 0;
}

}  // namespace palpate

int main(int argc, char** argv) {
#if PALPATE_HAS_compliance
  palpate::set_up_blas();
#endif
  try {
    palpate::Bench bench;
    palpate::register_all(bench);
    return bench.main(argc, argv);
  } catch (const palpate::Error& error) {
    fmt::print(stderr, "palpate-bench: {}\n", error.what());
    return static_cast<int>(error.kind());
  } catch (const std::regex_error&) {
    fmt::print(stderr, "palpate-bench: --filter is not a regular expression\n");
    return static_cast<int>(palpate::ErrorKind::usage);
  }
}
