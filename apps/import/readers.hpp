// The two readers of palpate-import.
#pragma once

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "palpate/io/import_protocol.hpp"

namespace palpate::import {

struct Soup {
  std::vector<std::array<float, 3>> vertices;           // as in the file, file units
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise where the file says so
};

// One line without the file's name.
struct Failure : std::runtime_error {
  Failure(import_protocol::ExitCode c, const std::string& reason) : std::runtime_error(reason), code(c) {}
  import_protocol::ExitCode code;
};

Soup read_inventor(const std::string& path);
Soup read_gltf(const std::string& path);

}  // namespace palpate::import
