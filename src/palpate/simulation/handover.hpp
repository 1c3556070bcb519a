// The thesis' hand-over file (T 5.1.3 "Uebergabeformat"): surface points and triangles, matrix, interaction
// flags, strips, colours, as text.
#pragma once

#include <filesystem>

#include "palpate/simulation/organ.hpp"

namespace palpate {

void write_handover(const std::filesystem::path& path, const Organ& organ);
// An organ without tetrahedra (mesh empty): surface, anchors and compliance are enough to simulate.
Organ read_handover(const std::filesystem::path& path);

}  // namespace palpate
