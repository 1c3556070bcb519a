// Meshes and files that the tests of tetrahedral formats share.
#pragma once

#include <string>
#include <vector>

#include "io_test.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/io/tet_file.hpp"

namespace palpate {

// Two tetrahedra on a face, in two regions.
inline TetMesh two_tets() {
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
  mesh.tets = {{0, 1, 2, 3}, {1, 2, 3, 4}};
  mesh.regions = {0, 1};
  mesh.region_names = {"kidney", "stone of 3 mm"};
  return mesh;
}

inline bool operator==(const TetMesh& a, const TetMesh& b) {
  return a.nodes == b.nodes && a.tets == b.tets && a.regions == b.regions && a.region_names == b.region_names;
}

// Bytes of numbers, as they lie in memory or turned over.
class Bytes {
 public:
  explicit Bytes(bool swapped = false) : swapped_(swapped) {}
  Bytes& operator<<(const std::string& text) {
    bytes += text;
    return *this;
  }
  template <class T>
  Bytes& add(std::initializer_list<double> values) {
    for (const double v : values) {
      const T value = static_cast<T>(v);
      std::string b(reinterpret_cast<const char*>(&value), sizeof value);
      if (swapped_) std::reverse(b.begin(), b.end());
      bytes += b;
    }
    return *this;
  }
  template <class T>
  Bytes& nodes(const TetMesh& mesh) {
    for (const Vec3& p : mesh.nodes) add<T>({p.x(), p.y(), p.z()});
    return *this;
  }
  std::string bytes;

 private:
  bool swapped_;
};

// Every format of two_tets() as (file name, bytes), text and binary; written here, not by the writers.
struct Sample {
  std::string name, bytes;
};
std::vector<Sample> samples();

}  // namespace palpate
