// glTF through Assimp.
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>

#include "readers.hpp"

namespace palpate::import {
namespace {

using namespace import_protocol;

void add_mesh(const aiMesh& mesh, const aiMatrix4x4& m, Soup& soup) {
  const std::size_t offset = soup.vertices.size();
  if (offset + mesh.mNumVertices > 0xffffffffu) throw std::bad_alloc();
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const aiVector3D p = m * mesh.mVertices[i];
    soup.vertices.push_back({p.x, p.y, p.z});
  }
  const bool mirrored = m.Determinant() < 0;
  for (unsigned i = 0; i < mesh.mNumFaces; ++i) {
    const aiFace& face = mesh.mFaces[i];
    if (face.mNumIndices != 3) continue;  // points and lines
    std::array<std::uint32_t, 3> t{face.mIndices[0], face.mIndices[1], face.mIndices[2]};
    if (mirrored) std::swap(t[1], t[2]);
    for (std::uint32_t& v : t) {
      if (v >= mesh.mNumVertices)
        throw Failure(malformed, "polygon " + std::to_string(i + 1) + " of mesh \"" + mesh.mName.C_Str() +
                                     "\" uses vertex " + std::to_string(v) + ", which is not there");
      v += static_cast<std::uint32_t>(offset);
    }
    soup.triangles.push_back(t);
  }
}

void add_node(const aiScene& scene, const aiNode& node, const aiMatrix4x4& parent, Soup& soup) {
  const aiMatrix4x4 matrix = parent * node.mTransformation;
  for (unsigned i = 0; i < node.mNumMeshes; ++i) add_mesh(*scene.mMeshes[node.mMeshes[i]], matrix, soup);
  for (unsigned i = 0; i < node.mNumChildren; ++i) add_node(scene, *node.mChildren[i], matrix, soup);
}

}  // namespace

Soup read_gltf(const std::string& path) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(path, aiProcess_Triangulate);
  if (!scene) throw Failure(malformed, importer.GetErrorString());
  Soup soup;
  if (scene->mRootNode) add_node(*scene, *scene->mRootNode, aiMatrix4x4(), soup);
  return soup;
}

}  // namespace palpate::import
