// Meshes and helpers of the lattice's tests.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "palpate/io/surface_file.hpp"
#include "palpate/lattice/lattice.hpp"
#include "unit/geometry/meshes.hpp"

namespace palpate::test {

inline const std::filesystem::path inventor = "/usr/share/inventor/data/models";

inline Box box_of(const TriangleMesh& mesh) { return bounding_box(mesh.vertices); }

inline LatticeSamples sampled(const TriangleMesh& mesh, int subdivisions, double margin = 0) {
  return sample_lattice(SignedDistanceField(mesh), make_grid(box_of(mesh), subdivisions, margin), 1);
}

inline Vec3 random_in(const Box& box, std::mt19937_64& random) {
  std::uniform_real_distribution<double> u(0, 1);
  const double x = u(random), y = u(random), z = u(random);
  return box.min + box.size().cwiseProduct(Vec3(x, y, z));
}

}  // namespace palpate::test
