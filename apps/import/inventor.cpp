// Open Inventor and VRML through Coin.
#include <Inventor/SbMatrix.h>
#include <Inventor/SoDB.h>
#include <Inventor/SoInput.h>
#include <Inventor/SoInteraction.h>
#include <Inventor/SoPrimitiveVertex.h>
#include <Inventor/VRMLnodes/SoVRMLCoordinate.h>
#include <Inventor/VRMLnodes/SoVRMLElevationGrid.h>
#include <Inventor/VRMLnodes/SoVRMLIndexedFaceSet.h>
#include <Inventor/VRMLnodes/SoVRMLIndexedLineSet.h>
#include <Inventor/VRMLnodes/SoVRMLPointSet.h>
#include <Inventor/VRMLnodes/SoVRMLSphere.h>
#include <Inventor/VRMLnodes/SoVRMLText.h>
#include <Inventor/actions/SoCallbackAction.h>
#include <Inventor/actions/SoSearchAction.h>
#include <Inventor/draggers/SoDragger.h>
#include <Inventor/errors/SoDebugError.h>
#include <Inventor/errors/SoMemoryError.h>
#include <Inventor/errors/SoReadError.h>
#include <Inventor/fields/SoSFBool.h>
#include <Inventor/nodes/SoAsciiText.h>
#include <Inventor/nodes/SoFaceSet.h>
#include <Inventor/nodes/SoImage.h>
#include <Inventor/nodes/SoIndexedFaceSet.h>
#include <Inventor/nodes/SoIndexedLineSet.h>
#include <Inventor/nodes/SoIndexedNurbsCurve.h>
#include <Inventor/nodes/SoIndexedNurbsSurface.h>
#include <Inventor/nodes/SoIndexedPointSet.h>
#include <Inventor/nodes/SoIndexedTriangleStripSet.h>
#include <Inventor/nodes/SoLineSet.h>
#include <Inventor/nodes/SoNurbsCurve.h>
#include <Inventor/nodes/SoNurbsSurface.h>
#include <Inventor/nodes/SoPointSet.h>
#include <Inventor/nodes/SoQuadMesh.h>
#include <Inventor/nodes/SoSeparator.h>
#include <Inventor/nodes/SoShapeHints.h>
#include <Inventor/nodes/SoSphere.h>
#include <Inventor/nodes/SoText2.h>
#include <Inventor/nodes/SoText3.h>
#include <Inventor/nodes/SoTriangleStripSet.h>
#include <Inventor/nodes/SoVertexProperty.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "readers.hpp"

namespace palpate::import {
namespace {

using namespace import_protocol;

struct Traversal {
  Soup soup;
  bool clockwise = false;  // the present shape says so itself (VRML 2)
  std::size_t first = 0;   // vertex of the present shape
};

// The first error that Coin posts while reading. Textures are not wanted, so a missing one is none.
void note_error(const SoError* error, void* data) {
  auto& first = *static_cast<std::string*>(data);
  std::string text = error->getDebugString().getString();
  for (const char* prefix : {"Coin read error: ", "Inventor read error: "})
    if (text.compare(0, std::string(prefix).size(), prefix) == 0) text.erase(0, std::string(prefix).size());
  if (first.empty() && text.compare(0, 27, "Could not read texture file") != 0) first = text;
}

SoSeparator* read_scene(const std::string& path) {
  std::string trouble;
  SoReadError::setHandlerCallback(note_error, &trouble);
  SoSeparator* scene = nullptr;
  {
    SoInput in;
    if (!in.openFile(path.c_str(), TRUE)) throw Failure(unreadable, "cannot be opened");
    if (!in.isValidFile())
      throw Failure(malformed, "does not begin with #Inventor or #VRML and a known version");
    scene = SoDB::readAll(&in);
  }
  if (!trouble.empty() || !scene)
    throw Failure(malformed, trouble.empty() ? "nothing can be read from it" : trouble);
  scene->ref();
  return scene;
}

bool contains(SoNode* scene, SoType type) {
  SoSearchAction search;
  search.setType(type);
  search.setInterest(SoSearchAction::FIRST);
  search.setSearchingAll(TRUE);
  search.apply(scene);
  return search.getPath() != nullptr;
}

[[noreturn]] void refuse(const SoNode& shape, const std::string& what) {
  throw Failure(malformed, std::string(shape.getTypeId().getName().getString()) + ": " + what);
}

// Coin reads past the end of the points for an index that is too big, and drops the rest of a shape after a
// polygon with fewer than three corners.
void check_indices(const SoNode& shape, const SoMFInt32& index, std::int64_t points) {
  if (index.isDefault()) return;
  int corners = 0, polygon = 0;
  for (int i = 0; i <= index.getNum(); ++i) {
    const std::int32_t v = i < index.getNum() ? index[i] : -1;
    if (v >= points)
      refuse(shape, "polygon " + std::to_string(polygon) + " uses point " + std::to_string(v) + " of " +
                        std::to_string(points));
    if (v >= 0) {
      ++corners;
    } else if (i < index.getNum() || corners > 0) {
      if (corners < 3)
        refuse(shape, "polygon " + std::to_string(polygon) + " has " + std::to_string(corners) + " corners");
      corners = 0, ++polygon;
    }
  }
}

void check_numbers(const SoNode& shape, const SoMFInt32& numbers, std::int64_t start, std::int64_t points) {
  if (numbers.getNum() == 1 && numbers[0] == 0) return;
  std::int64_t used = start;
  for (int i = 0; i < numbers.getNum(); ++i) {
    const std::int64_t n = numbers[i] == -1 && numbers.getNum() == 1 ? points - start : numbers[i];
    if (n < 3) refuse(shape, "polygon " + std::to_string(i) + " has " + std::to_string(n) + " corners");
    used += n;
  }
  if (start < 0 || used > points)
    refuse(shape, "uses " + std::to_string(used) + " points of " + std::to_string(points));
}

void check_grid(const SoNode& shape, std::int64_t rows, std::int64_t columns, std::int64_t start,
                std::int64_t points) {
  if (rows < 0 || columns < 0 || start < 0 || start + rows * columns > points)
    refuse(shape, std::to_string(rows) + " x " + std::to_string(columns) + " points, but there are " +
                      std::to_string(points));
}

std::int64_t points_of(const SoCallbackAction& action, const SoVertexShape& shape) {
  const SoNode* own = shape.vertexProperty.getValue();
  if (own && own->isOfType(SoVertexProperty::getClassTypeId())) {
    const int n = static_cast<const SoVertexProperty*>(own)->vertex.getNum();
    if (n > 0) return n;
  }
  return action.getNumCoordinates();
}

template <class Shape>
const Shape* as(const SoNode* node) {
  return node->isOfType(Shape::getClassTypeId()) ? static_cast<const Shape*>(node) : nullptr;
}

SoCallbackAction::Response begin_shape(void* data, SoCallbackAction* action, const SoNode* node) {
  auto& traversal = *static_cast<Traversal*>(data);
  traversal.first = traversal.soup.vertices.size();
  const SoField* ccw = node->getField("ccw");
  traversal.clockwise =
      ccw && ccw->isOfType(SoSFBool::getClassTypeId()) && !static_cast<const SoSFBool*>(ccw)->getValue();
  if (node->isOfType(SoIndexedFaceSet::getClassTypeId()) ||
      node->isOfType(SoIndexedTriangleStripSet::getClassTypeId())) {
    const auto* s = static_cast<const SoIndexedShape*>(node);
    check_indices(*s, s->coordIndex, points_of(*action, *s));
  }
  if (const auto* s = as<SoFaceSet>(node))
    check_numbers(*s, s->numVertices, s->startIndex.getValue(), points_of(*action, *s));
  if (const auto* s = as<SoTriangleStripSet>(node))
    check_numbers(*s, s->numVertices, s->startIndex.getValue(), points_of(*action, *s));
  if (const auto* s = as<SoQuadMesh>(node))
    check_grid(*s, s->verticesPerColumn.getValue(), s->verticesPerRow.getValue(), s->startIndex.getValue(),
               points_of(*action, *s));
  if (const auto* s = as<SoVRMLElevationGrid>(node))
    check_grid(*s, s->zDimension.getValue(), s->xDimension.getValue(), 0, s->height.getNum());
  if (const auto* s = as<SoVRMLIndexedFaceSet>(node)) {
    const SoNode* coord = s->coord.getValue();
    const auto* points = coord ? as<SoVRMLCoordinate>(coord) : nullptr;
    check_indices(*s, s->coordIndex, points ? points->point.getNum() : 0);
  }
  return SoCallbackAction::CONTINUE;
}

// Coin's spheres are open along a seam by rounding errors.
SoCallbackAction::Response close_seams(void* data, SoCallbackAction*, const SoNode*) {
  auto& traversal = *static_cast<Traversal*>(data);
  using Point = std::array<float, 3>;
  auto& vertices = traversal.soup.vertices;
  float size = 0;
  for (std::size_t i = traversal.first; i < vertices.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      size = std::max(size, std::abs(vertices[i][k] - vertices[traversal.first][k]));
  std::map<Point, Point> merged;
  std::vector<Point> kept;
  for (std::size_t i = traversal.first; i < vertices.size(); ++i) {
    Point& p = vertices[i];
    const auto [entry, added] = merged.try_emplace(p, p);
    if (added) {
      const auto near = std::find_if(kept.begin(), kept.end(), [&](const Point& q) {
        return std::abs(p[0] - q[0]) + std::abs(p[1] - q[1]) + std::abs(p[2] - q[2]) < 1e-5f * size;
      });
      if (near == kept.end())
        kept.push_back(p);
      else
        entry->second = *near;
    }
    p = entry->second;
  }
  return SoCallbackAction::CONTINUE;
}

void add_triangle(void* data, SoCallbackAction* action, const SoPrimitiveVertex* a,
                  const SoPrimitiveVertex* b, const SoPrimitiveVertex* c) {
  auto& traversal = *static_cast<Traversal*>(data);
  Soup& soup = traversal.soup;
  const SbMatrix& m = action->getModelMatrix();
  if (soup.vertices.size() > 0xfffffff0u) throw std::bad_alloc();
  const auto n = static_cast<std::uint32_t>(soup.vertices.size());
  for (const SoPrimitiveVertex* v : {a, b, c}) {
    const SbVec3f& p = v->getPoint();
    std::array<double, 4> sum;  // row vectors; in double, so that parts that meet still meet
    for (int i = 0; i < 4; ++i) {
      sum[static_cast<std::size_t>(i)] = m[3][i];
      for (int j = 0; j < 3; ++j)
        sum[static_cast<std::size_t>(i)] += static_cast<double>(p[j]) * static_cast<double>(m[j][i]);
    }
    soup.vertices.push_back({static_cast<float>(sum[0] / sum[3]), static_cast<float>(sum[1] / sum[3]),
                             static_cast<float>(sum[2] / sum[3])});
  }
  const bool clockwise = traversal.clockwise != (action->getVertexOrdering() == SoShapeHints::CLOCKWISE);
  if (clockwise == (m.det3() < 0))
    soup.triangles.push_back({n, n + 1, n + 2});
  else
    soup.triangles.push_back({n, n + 2, n + 1});
}

SoCallbackAction::Response skip(void*, SoCallbackAction*, const SoNode*) { return SoCallbackAction::PRUNE; }

}  // namespace

Soup read_inventor(const std::string& path) {
  SoDB::init();
  SoInteraction::init();
  SoDebugError::setHandlerCallback([](const SoError*, void*) {}, nullptr);
  SoMemoryError::setHandlerCallback([](const SoError*, void*) { throw std::bad_alloc(); }, nullptr);
  SoSeparator* scene = read_scene(path);
  // Coin tessellates them through OpenGL, and crashes without a display.
  for (const SoType type : {SoNurbsSurface::getClassTypeId(), SoIndexedNurbsSurface::getClassTypeId()})
    if (contains(scene, type))
      throw Failure(malformed, "NURBS surfaces are not read; save it with polygons instead");
  Traversal traversal;
  SoCallbackAction action;
  action.addPreCallback(SoShape::getClassTypeId(), begin_shape, &traversal);
  action.addTriangleCallback(SoShape::getClassTypeId(), add_triangle, &traversal);
  for (const SoType type : {SoSphere::getClassTypeId(), SoVRMLSphere::getClassTypeId()})
    action.addPostCallback(type, close_seams, &traversal);
  // Lines, points, writing and handles are no part of a surface.
  for (const SoType type :
       {SoLineSet::getClassTypeId(), SoIndexedLineSet::getClassTypeId(), SoPointSet::getClassTypeId(),
        SoIndexedPointSet::getClassTypeId(), SoNurbsCurve::getClassTypeId(),
        SoIndexedNurbsCurve::getClassTypeId(), SoVRMLIndexedLineSet::getClassTypeId(),
        SoVRMLPointSet::getClassTypeId(), SoText2::getClassTypeId(), SoText3::getClassTypeId(),
        SoAsciiText::getClassTypeId(), SoVRMLText::getClassTypeId(), SoImage::getClassTypeId(),
        SoDragger::getClassTypeId()})
    action.addPreCallback(type, skip, nullptr);
  action.apply(scene);
  return std::move(traversal.soup);
}

}  // namespace palpate::import
