#include "palpate/simulation/model.hpp"

#include "palpate/base/error.hpp"

namespace palpate {

namespace {
constexpr std::array<const char*, 4> mode_names{"unilateral", "prescribed", "gaussian", "imprint"};
}  // namespace

const char* name(Mode mode) { return mode_names[static_cast<std::size_t>(mode)]; }

Mode parse_mode(const std::string& text) {
  for (std::size_t i = 0; i < mode_names.size(); ++i)
    if (text == mode_names[i]) return static_cast<Mode>(i);
  throw Error(ErrorKind::usage, "'{}' is no mode; use unilateral, prescribed, gaussian or imprint", text);
}

const TriangleMesh& drawn_surface(const Organ& organ) {
  return organ.drawing.empty() ? organ.surface : organ.drawing.surface;
}

std::vector<Vec3> drawn_vertices(const Organ& organ, const Pose& pose, const Surface& surface) {
  std::vector<Vec3> nodes(organ.surface_size());
  for (std::size_t i = 0; i < nodes.size(); ++i)
    nodes[i] = pose * (organ.surface.vertices[i] + surface.displacement[i].cast<double>());
  if (organ.drawing.empty()) return nodes;
  std::vector<Vec3> out(organ.drawing.surface.vertices.size());
  draw(organ.drawing, organ.surface, nodes, out);
  return out;
}

}  // namespace palpate
