// glTF through Assimp.
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <fstream>
#include <iterator>
#include <string_view>

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

// Assimp drops polygons with a vertex that is not there, and only its log says so.
struct Warnings : Assimp::LogStream {
  static inline bool dropped = false;
  void write(const char* message) override {
    dropped = dropped || std::string_view(message).find("out-of-range") != std::string_view::npos;
  }
};

// Assimp takes such positions for float32.
void refuse_packed(const std::string& bytes) {
  for (const char* extension : {"KHR_mesh_quantization", "EXT_meshopt_compression"})
    if (bytes.find(extension) != std::string::npos)
      throw Failure(malformed, std::string(extension) + " is not read; save it with plain positions");
}

}  // namespace

Soup read_gltf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  refuse_packed(bytes);
  Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
  Assimp::DefaultLogger::get()->attachStream(new Warnings, Assimp::Logger::Warn | Assimp::Logger::Err);
  Assimp::Importer importer;
  // Text may name further files beside it; a binary file may have any name, but Assimp goes by the extension.
  const aiScene* scene =
      bytes.compare(0, 4, "glTF") == 0
          ? importer.ReadFileFromMemory(bytes.data(), bytes.size(), aiProcess_Triangulate, "glb")
          : importer.ReadFile(path, aiProcess_Triangulate);
  if (!scene) {
    const std::string reason = importer.GetErrorString();
    throw Failure(malformed,
                  reason.compare(0, 18, "No suitable reader") == 0 ? "no glTF 2 file, or truncated" : reason);
  }
  if (Warnings::dropped) throw Failure(malformed, "a polygon uses a vertex that is not there");
  Soup soup;
  if (scene->mRootNode) add_node(*scene, *scene->mRootNode, aiMatrix4x4(), soup);
  return soup;
}

}  // namespace palpate::import
