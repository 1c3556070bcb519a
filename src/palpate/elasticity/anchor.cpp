#include "palpate/elasticity/anchor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <string_view>
#include <tuple>
#include <utility>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {

[[noreturn]] void reject(const std::string& text, const std::string& why) {
  throw Error(ErrorKind::usage,
              "anchor '{}': {}; say one of: box x0 y0 z0 x1 y1 z1 | sphere x y z radius | "
              "half-space px py pz nx ny nz | region NAME | nodes 1,2,3",
              text.size() > 80 ? text.substr(0, 77) + "..." : text, why);
}

std::vector<std::string_view> split(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> words;
  for (std::size_t begin = 0; (begin = text.find_first_not_of(separators, begin)) != text.npos;) {
    const std::size_t end = std::min(text.find_first_of(separators, begin), text.size());
    words.push_back(text.substr(begin, end - begin));
    begin = end;
  }
  return words;
}

template <class Number>
Number number(std::string_view word, const std::string& text) {
  Number value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(static_cast<double>(value)))
    reject(text, fmt::format("'{}' is not a number", word));
  return value;
}

// Whether an anchor takes a node; lengths get a tolerance so that a plane through nodes takes them.
struct Takes {
  const TetMesh& mesh;
  double tolerance;  // m
  std::vector<std::uint8_t>& flags;

  template <class Inside>
  void mark(const Inside& inside) const {
    for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
      if (inside(mesh.nodes[i])) flags[i] = 1;
  }
  void operator()(const AnchorBox& a) const {
    const Box box = a.box.grown(tolerance);
    mark([&](const Vec3& p) { return box.contains(p); });
  }
  void operator()(const AnchorSphere& a) const {
    mark([&](const Vec3& p) { return (p - a.center).norm() <= a.radius + tolerance; });
  }
  void operator()(const AnchorHalfSpace& a) const {
    const Vec3 normal = a.normal.normalized();
    mark([&](const Vec3& p) { return (p - a.point).dot(normal) <= tolerance; });
  }
  void operator()(const AnchorRegion& a) const {
    const auto it = std::find(mesh.region_names.begin(), mesh.region_names.end(), a.name);
    if (it == mesh.region_names.end())
      throw Error(ErrorKind::usage, "anchor 'region {}': the mesh has no such region; it has: {}", a.name,
                  fmt::format("{}", fmt::join(mesh.region_names, ", ")));
    const auto region = static_cast<Index>(it - mesh.region_names.begin());
    for (std::size_t e = 0; e < mesh.tets.size(); ++e)
      if (mesh.regions[e] == region)
        for (const Index v : mesh.tets[e]) flags[static_cast<std::size_t>(v)] = 1;
  }
  void operator()(const AnchorNodes& a) const {
    for (const Index v : a.nodes) {
      if (v < 0 || static_cast<std::size_t>(v) >= flags.size())
        throw Error(ErrorKind::usage, "anchor node {}: the mesh has nodes 0 to {}", v,
                    static_cast<std::ptrdiff_t>(flags.size()) - 1);
      flags[static_cast<std::size_t>(v)] = 1;
    }
  }
};

// Parts of the mesh that can only move as a whole when rigid: tetrahedra joined by faces. Parts that share
// only a node or an edge can turn about it.
struct Parts {
  std::vector<std::vector<Index>> nodes;  // of each part, ascending
};

Parts parts_of(const TetMesh& mesh) {
  struct Face {
    std::array<Index, 3> nodes;
    Index tet;
    bool operator<(const Face& o) const { return std::tie(nodes, tet) < std::tie(o.nodes, o.tet); }
  };
  std::vector<Face> faces;
  faces.reserve(4 * mesh.tets.size());
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (std::size_t skip = 0; skip < 4; ++skip) {
      Tetrahedron t = mesh.tets[e];
      std::swap(t[skip], t[3]);
      std::sort(t.begin(), t.begin() + 3);
      faces.push_back({{t[0], t[1], t[2]}, static_cast<Index>(e)});
    }
  std::sort(faces.begin(), faces.end());

  std::vector<Index> root(mesh.tets.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](Index e) {
    while (root[static_cast<std::size_t>(e)] != e)
      e = root[static_cast<std::size_t>(e)] =
          root[static_cast<std::size_t>(root[static_cast<std::size_t>(e)])];
    return e;
  };
  for (std::size_t i = 1; i < faces.size(); ++i)
    if (faces[i].nodes == faces[i - 1].nodes) {
      const Index a = find(faces[i].tet), b = find(faces[i - 1].tet);
      root[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }

  Parts parts;
  std::vector<Index> number(mesh.tets.size(), -1);
  for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
    Index& part = number[static_cast<std::size_t>(find(static_cast<Index>(e)))];
    if (part < 0) {
      part = static_cast<Index>(parts.nodes.size());
      parts.nodes.emplace_back();
    }
    for (const Index v : mesh.tets[e]) parts.nodes[static_cast<std::size_t>(part)].push_back(v);
  }
  for (std::vector<Index>& list : parts.nodes) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return parts;
}

// What holds a part: how many of its nodes, and whether three of them span a triangle, so that no rigid
// motion is left.
struct Hold {
  std::size_t count = 0;
  Vec3 first = Vec3::Zero(), second = Vec3::Zero();
  bool has_line = false, spans = false;

  void add(const Vec3& p) {
    const Vec3 line = second - first, to = p - first;
    if (count++ == 0)
      first = p;
    else if (!has_line)
      second = p, has_line = to.norm() > 0;
    else if (to.cross(line).norm() > 1e-6 * line.norm() * std::max(line.norm(), to.norm()))
      spans = true;
  }
};

// Spreads from the anchored nodes: a part is held by three nodes not on a line, each anchored or of a part
// already held. Every node and every part is taken up once.
std::vector<Hold> spread(const TetMesh& mesh, const Parts& parts, std::vector<std::uint8_t> held) {
  std::vector<Index> queue;
  for (std::size_t i = 0; i < held.size(); ++i)
    if (held[i]) queue.push_back(static_cast<Index>(i));
  std::vector<std::vector<Index>> parts_at(mesh.nodes.size());
  for (std::size_t p = 0; p < parts.nodes.size(); ++p)
    for (const Index v : parts.nodes[p])
      parts_at[static_cast<std::size_t>(v)].push_back(static_cast<Index>(p));

  std::vector<Hold> holds(parts.nodes.size());
  for (std::size_t next = 0; next < queue.size(); ++next) {
    const auto v = static_cast<std::size_t>(queue[next]);
    for (const Index p : parts_at[v]) {
      Hold& hold = holds[static_cast<std::size_t>(p)];
      const bool before = hold.spans;
      hold.add(mesh.nodes[v]);
      if (before || !hold.spans) continue;
      for (const Index w : parts.nodes[static_cast<std::size_t>(p)])
        if (!std::exchange(held[static_cast<std::size_t>(w)], std::uint8_t{1})) queue.push_back(w);
    }
  }
  return holds;
}

[[noreturn]] void reject_part(const TetMesh& mesh, const Parts& parts, std::size_t part, const Hold& hold) {
  Box box;
  for (const Index v : parts.nodes[part]) box.add(mesh.nodes[static_cast<std::size_t>(v)]);
  const std::string which = parts.nodes.size() == 1
                                ? fmt::format("the mesh ({} nodes", parts.nodes[part].size())
                                : fmt::format("part {} of {}, not joined to the others by faces ({} nodes",
                                              part + 1, parts.nodes.size(), parts.nodes[part].size());
  const char* why = hold.count == 0 ? "" : hold.count < 3 ? ", fewer than three" : ", all on one line";
  throw Error(
      ErrorKind::physics,
      "anchor: {}, from {:.4g} {:.4g} {:.4g} to {:.4g} {:.4g} {:.4g} m) can still move rigidly: {} of its "
      "nodes {} held{}; choose an anchor (or a bedding) that takes three or more of them not on a line{}",
      which, box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z(), hold.count,
      hold.count == 1 ? "is" : "are", why, parts.nodes.size() == 1 ? "" : ", or remove the part");
}

}  // namespace

Anchor parse_anchor(const std::string& text, double unit) {
  const std::vector<std::string_view> words = split(text, " \t\r\n");
  if (words.empty()) reject(text, "it is empty");
  const std::string_view kind = words[0];
  if (kind == "region" || kind == "nodes") {
    if (words.size() < 2) reject(text, fmt::format("nothing follows '{}'", kind));
    const std::string_view rest(
        words[1].data(),
        static_cast<std::size_t>(words.back().data() + words.back().size() - words[1].data()));
    if (kind == "region") return AnchorRegion{std::string(rest)};
    AnchorNodes nodes;
    for (const std::string_view word : split(rest, ", \t\r\n"))
      nodes.nodes.push_back(number<Index>(word, text));
    if (nodes.nodes.empty()) reject(text, "no node is named");
    return nodes;
  }
  const std::size_t wanted = kind == "box" || kind == "half-space" ? 6 : kind == "sphere" ? 4 : 0;
  if (wanted == 0) reject(text, fmt::format("'{}' is no kind of anchor", kind));
  if (words.size() != wanted + 1)
    reject(text, fmt::format("{} needs {} numbers, not {}", kind, wanted, words.size() - 1));
  std::array<double, 6> x{};
  for (std::size_t i = 0; i < wanted; ++i) x[i] = number<double>(words[i + 1], text);
  const Vec3 first = unit * Vec3(x[0], x[1], x[2]), second(x[3], x[4], x[5]);
  if (!first.allFinite() || !(unit * second).allFinite()) reject(text, "a length is out of range");
  if (kind == "box") return AnchorBox{{first.cwiseMin(unit * second), first.cwiseMax(unit * second)}};
  if (kind == "sphere") {
    if (!(x[3] > 0)) reject(text, "the radius must be positive");
    return AnchorSphere{first, unit * x[3]};
  }
  if (!(second.norm() > 0) || !std::isfinite(second.norm())) reject(text, "the normal has no direction");
  return AnchorHalfSpace{first, second};
}

std::string to_string(const Anchor& anchor) {
  const auto text = [](const Vec3& v) { return fmt::format("{} {} {}", v.x(), v.y(), v.z()); };
  if (const auto* box = std::get_if<AnchorBox>(&anchor))
    return "box " + text(box->box.min) + " " + text(box->box.max);
  if (const auto* sphere = std::get_if<AnchorSphere>(&anchor))
    return fmt::format("sphere {} {}", text(sphere->center), sphere->radius);
  if (const auto* half = std::get_if<AnchorHalfSpace>(&anchor))
    return "half-space " + text(half->point) + " " + text(half->normal);
  if (const auto* region = std::get_if<AnchorRegion>(&anchor)) return "region " + region->name;
  return fmt::format("nodes {}", fmt::join(std::get<AnchorNodes>(anchor).nodes, ","));
}

std::vector<std::uint8_t> nodes_taken(const TetMesh& mesh, const std::vector<Anchor>& anchors) {
  std::vector<std::uint8_t> flags(mesh.nodes.size(), 0);
  const Takes takes{mesh, 1e-9 * bounding_box(mesh.nodes).diagonal(), flags};
  for (const Anchor& anchor : anchors) std::visit(takes, anchor);
  return flags;
}

std::vector<std::uint8_t> anchored_nodes(const TetMesh& mesh, const std::vector<Anchor>& anchors,
                                         const std::vector<std::uint8_t>& sprung) {
  require_valid(mesh, "anchor");
  std::vector<std::uint8_t> flags = nodes_taken(mesh, anchors), held = flags;
  for (std::size_t i = 0; i < sprung.size(); ++i)
    if (sprung[i]) held[i] = 1;

  const Parts parts = parts_of(mesh);
  const std::vector<Hold> holds = spread(mesh, parts, std::move(held));
  for (std::size_t p = 0; p < parts.nodes.size(); ++p)
    if (!holds[p].spans) reject_part(mesh, parts, p, holds[p]);

  std::vector<std::uint8_t> used(mesh.nodes.size(), 0);
  for (const Tetrahedron& t : mesh.tets)
    for (const Index v : t) used[static_cast<std::size_t>(v)] = 1;
  for (std::size_t i = 0; i < used.size(); ++i)
    if (!used[i]) flags[i] = 1;
  return flags;
}

}  // namespace palpate
