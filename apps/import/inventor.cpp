// Open Inventor and VRML through Coin.
#include <Inventor/SbMatrix.h>
#include <Inventor/SoDB.h>
#include <Inventor/SoInput.h>
#include <Inventor/SoInteraction.h>
#include <Inventor/SoPrimitiveVertex.h>
#include <Inventor/actions/SoCallbackAction.h>
#include <Inventor/actions/SoSearchAction.h>
#include <Inventor/draggers/SoDragger.h>
#include <Inventor/errors/SoDebugError.h>
#include <Inventor/errors/SoMemoryError.h>
#include <Inventor/errors/SoReadError.h>
#include <Inventor/fields/SoSFBool.h>
#include <Inventor/nodes/SoAsciiText.h>
#include <Inventor/nodes/SoIndexedNurbsSurface.h>
#include <Inventor/nodes/SoNurbsSurface.h>
#include <Inventor/nodes/SoSeparator.h>
#include <Inventor/nodes/SoShapeHints.h>
#include <Inventor/nodes/SoText2.h>
#include <Inventor/nodes/SoText3.h>

#include "readers.hpp"

namespace palpate::import {
namespace {

using namespace import_protocol;

// The first error that Coin posts while reading. Textures are not wanted, so a missing one is none.
void note_error(const SoError* error, void* data) {
  auto& first = *static_cast<std::string*>(data);
  const std::string text = error->getDebugString().getString();
  if (first.empty() && text.find("texture") == std::string::npos) first = text;
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

bool face_outwards(const SoCallbackAction& action, const SbMatrix& matrix) {
  return (action.getVertexOrdering() == SoShapeHints::CLOCKWISE) == (matrix.det3() < 0);
}

void add_triangle(void* data, SoCallbackAction* action, const SoPrimitiveVertex* a,
                  const SoPrimitiveVertex* b, const SoPrimitiveVertex* c) {
  auto& soup = *static_cast<Soup*>(data);
  const SbMatrix& matrix = action->getModelMatrix();
  if (soup.vertices.size() > 0xfffffff0u) throw std::bad_alloc();
  const auto n = static_cast<std::uint32_t>(soup.vertices.size());
  for (const SoPrimitiveVertex* v : {a, b, c}) {
    const SbVec3f& p = v->getPoint();
    std::array<float, 3> world;  // row vectors; sums in double, so that parts that meet still meet
    for (int i = 0; i < 3; ++i) {
      double sum = matrix[3][i];
      for (int j = 0; j < 3; ++j) sum += static_cast<double>(p[j]) * static_cast<double>(matrix[j][i]);
      world[static_cast<std::size_t>(i)] = static_cast<float>(sum);
    }
    soup.vertices.push_back(world);
  }
  if (face_outwards(*action, matrix))
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
  for (const SoType type : {SoNurbsSurface::getClassTypeId(), SoIndexedNurbsSurface::getClassTypeId()})
    if (contains(scene, type))
      throw Failure(malformed, "NURBS surfaces are not read; save it with polygons instead");
  Soup soup;
  SoCallbackAction action;
  action.addTriangleCallback(SoShape::getClassTypeId(), add_triangle, &soup);
  // Writing and handles are no part of a surface, and writing needs OpenGL.
  for (const SoType type : {SoText2::getClassTypeId(), SoText3::getClassTypeId(),
                            SoAsciiText::getClassTypeId(), SoDragger::getClassTypeId()})
    action.addPreCallback(type, skip, nullptr);
  action.apply(scene);
  return soup;
}

}  // namespace palpate::import
