// The subcommands: plain options in, work done, lines or one JSON object out. main.cpp alone knows the
// command line (CLI11 takes seconds to compile); each run_* lives in its own file and throws Error.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "console.hpp"

namespace palpate {

struct LatticeOptions {
  std::filesystem::path input, output;
  std::string unit = "m";
  int subdivisions = 40;
  double spacing = 0;           // file units; 0: from subdivisions
  double margin = 0;            // file units
  double band = 0;              // in units of the cell size; 0: the whole grid
  std::string sign = "auto";    // auto | pseudonormal | winding
  std::string format = "auto";  // auto (by extension) | h5 | text | vti
};
void run_lattice(const LatticeOptions& options, const Console& console);

struct PadCommandOptions {
  std::filesystem::path input, output;
  std::string unit = "m", name = "tissue";
  std::string method = "stuffing";   // stuffing | delaunay
  std::vector<std::string> regions;  // NAME=FILE
  std::vector<std::string> labels;   // NAME=1,2 of a label volume; the first is what surrounds the others
  int surface_nodes = 3000;          // stuffing
  double spacing = 0;                // file units; 0: by surface nodes (stuffing), 1.4 mean edges (delaunay)
  bool grade = true, repair = false;
};
void run_pad(const PadCommandOptions& options, const Console& console);

struct PrecomputeOptions {
  std::filesystem::path input, output;
  std::string unit = "m";
  std::vector<std::string> materials;  // REGION=E,nu[,density] or REGION=TISSUE
  std::vector<std::string> anchors;    // grammar of parse_anchor, lengths in file units
  std::vector<std::string> beddings;   // grammar of parse_bedding
  std::filesystem::path drawing;       // finer surface to draw; empty: none
  bool pinch = true;                   // estimate the discretisation error
  int order = 2;                       // of the tetrahedra: 1 or 2
  std::string storage = "auto";        // auto | dense | half | factored | hierarchical
  double tolerance = 1e-3;             // of the hierarchical storage
  std::string memory;                  // limit, "4G"; empty: what is free
};
void run_precompute(const PrecomputeOptions& options, const Console& console);

struct SimulateOptions {
  std::filesystem::path scene, output;
  bool loop = false;                     // in real time instead of step by step
  double rate = 1000;                    // of the loop, ticks a second
  bool awake = false;                    // LoopSettings::awake
  double frame_rate = 120;               // of its surfaces, a second
  std::uint64_t ticks = 0;               // 0: as long as the motion
  std::string device;                    // haptic device that leads the first instrument; empty: the motion
  std::vector<double> device_at;         // where its frame stands in the world, m
  std::filesystem::path record, replay;  // recordings to write, to run and compare
  std::size_t steps = 0;                 // 0: as the scene says
  std::size_t every = 25;                // steps between frames
  bool pictures = true;
};
void run_simulate(const SimulateOptions& options, const Console& console);

struct InfoOptions {
  std::filesystem::path input;
  std::string unit = "m";
  bool verify = false;
};
void run_info(const InfoOptions& options, const Console& console);

struct ConvertOptions {
  std::filesystem::path input, output;
  std::string unit = "m", to_unit = "m";
  std::vector<std::string> materials, anchors;  // tetrahedra to .inp: as of precompute
  int order = 2;
};
void run_convert(const ConvertOptions& options, const Console& console);

void run_tissues(const Console& console);

struct DemoOptions {
  std::filesystem::path output = "out/demo";
  std::filesystem::path instrument;  // empty: bishop.iv of Debian's inventor-data
  int nodes = 3000;
  std::size_t steps = 2400;
  bool pictures = true;
};
void run_demo(const DemoOptions& options, const Console& console);

}  // namespace palpate
