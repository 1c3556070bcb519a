// The text form of the thesis: T 5.1.1 (file), 5.2.3 (xbreak and ybreak).
#include <algorithm>
#include <cmath>

#include "palpate/io/atomic_file.hpp"
#include "palpate/io/scanner.hpp"
#include "palpate/lattice/lattice_file.hpp"

namespace palpate {

namespace {

using Row = std::array<double, 7>;  // x y z, closest point, distance positive inside

std::vector<Row> parse_rows(std::string_view text, const std::string& what) {
  std::vector<Row> rows;
  Scanner in(what, text);
  while (!in.at_end()) {
    in.at("lattice point", static_cast<std::int64_t>(rows.size() + 1));
    Row& row = rows.emplace_back();
    for (double& value : row) {
      value = in.number();
      if (!(std::abs(value) < 1e30)) in.fail("the number is out of any body's range");
      if ((&value == &row.back()) != in.line_ends())
        in.fail("not seven numbers on the line (x y z, closest point, distance)");
    }
  }
  if (rows.empty()) throw Error(ErrorKind::format, "{}: no lattice points", what);
  in.require_line_end();
  return rows;
}

Vec3 point_of(const Row& row) { return {row[0], row[1], row[2]}; }

// The regular grid whose points these are, to rounding of the text: z runs fastest, then y, then x.
Grid find_grid(const std::vector<Row>& rows, const std::string& what) {
  // xbreak, ybreak: index of the first point with another x, another y.
  const auto first_change = [&](std::size_t column) {
    const auto it =
        std::find_if(rows.begin(), rows.end(), [&](const Row& r) { return r[column] != rows[0][column]; });
    return static_cast<std::size_t>(it - rows.begin());
  };
  const std::size_t xbreak = first_change(0), ybreak = first_change(1);
  const bool whole = ybreak >= 2 && xbreak >= 2 * ybreak && rows.size() >= 2 * xbreak &&
                     xbreak % ybreak == 0 && rows.size() % xbreak == 0 && rows.size() < (1u << 31);
  if (!whole)
    throw Error(
        ErrorKind::format,
        "{}: {} points are not whole sheets and lines of a grid (x changes first after {}, y after {})", what,
        rows.size(), xbreak, ybreak);
  Grid grid;
  grid.n = {static_cast<std::int32_t>(rows.size() / xbreak), static_cast<std::int32_t>(xbreak / ybreak),
            static_cast<std::int32_t>(ybreak)};
  grid.origin = point_of(rows.front());
  const Vec3 last = point_of(rows.back());
  int longest = 0;
  const Vec3 size = last - grid.origin;
  size.maxCoeff(&longest);
  grid.h = size[longest] / (grid.n[static_cast<std::size_t>(longest)] - 1);
  const double digits = 1e-5 * std::max(grid.origin.cwiseAbs().maxCoeff(), last.cwiseAbs().maxCoeff());
  if (!(grid.h > 4 * digits))
    throw Error(ErrorKind::format, "{}: the points do not ascend, or have too few digits for their spacing",
                what);
  std::size_t number = 0;
  for (int i = 0; i < grid.n[0]; ++i)
    for (int j = 0; j < grid.n[1]; ++j)
      for (int k = 0; k < grid.n[2]; ++k, ++number)
        if (!((point_of(rows[number]) - grid.point(i, j, k)).cwiseAbs().maxCoeff() < 2 * digits))
          throw Error(ErrorKind::format,
                      "{}: point {} is not where a regular grid with spacing {:.6g} has it", what, number + 1,
                      grid.h);
  return grid;
}

}  // namespace

LatticeSamples parse_lattice_text(std::string_view text, const std::string& what) {
  const std::vector<Row> rows = parse_rows(text, what);
  LatticeSamples samples;
  samples.grid = find_grid(rows, what);
  samples.distance.reserve(rows.size());
  samples.closest.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& r = rows[i];
    const Vec3 closest(r[3], r[4], r[5]);
    const double size = std::max(point_of(r).cwiseAbs().maxCoeff(), closest.cwiseAbs().maxCoeff());
    if (std::abs((point_of(r) - closest).norm() - std::abs(r[6])) > 1e-4 * size)
      throw Error(ErrorKind::format, "{}: point {}: the distance is not the one to the closest point", what,
                  i + 1);
    samples.distance.push_back(-r[6]);
    samples.closest.push_back(closest);
  }
  return samples;
}

void write_lattice_text(const std::function<void(std::string_view)>& sink, const LatticeSamples& samples) {
  const Grid& grid = samples.grid;
  // Rounding noise (and minus zero) is written as 0.
  const auto clean = [&](double x) { return std::abs(x) < 1e-9 * grid.h ? 0.0 : x; };
  std::string text;
  std::size_t number = 0;
  for (int i = 0; i < grid.n[0]; ++i)
    for (int j = 0; j < grid.n[1]; ++j) {
      for (int k = 0; k < grid.n[2]; ++k, ++number) {
        const Vec3 p = grid.point(i, j, k), &q = samples.closest[number];
        fmt::format_to(std::back_inserter(text), "{:g} {:g} {:g} {:g} {:g} {:g} {:g}\n", clean(p.x()),
                       clean(p.y()), clean(p.z()), clean(q.x()), clean(q.y()), clean(q.z()),
                       clean(-samples.distance[number]));
      }
      if (text.size() > 1 << 16) sink(text), text.clear();
    }
  sink(text);
}

void write_lattice_text(const std::filesystem::path& path, const LatticeSamples& samples) {
  AtomicFile file(path);
  write_lattice_text([&](std::string_view text) { file.write(text); }, samples);
  file.commit();
}

}  // namespace palpate
