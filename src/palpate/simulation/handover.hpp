// The thesis' hand-over file (T 5.1.3 "Uebergabeformat"): surface points and triangles, matrix, interaction
// flags, strips, colours, as text. Grammar in docs/formats.md. It holds the surface alone: 9 s^2 numbers for
// s surface nodes, about 1 GB for 3,000.
#pragma once

#include <filesystem>
#include <vector>

#include "palpate/simulation/organ.hpp"

namespace palpate {

void write_handover(const std::filesystem::path& path, const Organ& organ, const Progress& progress = {});
// An organ without tetrahedra (mesh.tets and surface_nodes empty): surface, anchors and compliance are enough
// to simulate. Throws Error(file | format | resource).
Organ read_handover(const std::filesystem::path& path, const Progress& progress = {});

// Triangles as strips: triangle i of a strip is (v[i], v[i+1], v[i+2]), with the first two exchanged where i
// is odd. Greedy: each strip begins with the first triangle left, turned so that it gets longest.
std::vector<std::vector<Index>> make_strips(const std::vector<Triangle>& triangles);
std::vector<Triangle> strip_triangles(const std::vector<Index>& strip);

}  // namespace palpate
