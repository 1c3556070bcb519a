// fuzz_lattice CASES [SEED]: damages lattice files (HDF5 and text) so many times and reads them. Ends with 1,
// and leaves the file in the working folder, where the reader crashes, hangs, takes what it must not or
// answers with a lattice that is none. Not part of ./test; what it finds becomes a test.
#include <fmt/core.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>

#include "palpate/base/timer.hpp"
#include "palpate/geometry/shapes.hpp"
#include "palpate/io/atomic_file.hpp"
#include "palpate/lattice/band_lattice.hpp"
#include "palpate/lattice/lattice_file.hpp"
#include "unit/io/damage.hpp"
#include "unit/io/io_test.hpp"

using namespace palpate;

namespace {

std::string present, present_bytes;  // the case at hand

void keep() {
  std::ofstream("fuzz-" + present, std::ios::binary) << present_bytes;
  fmt::print(stderr, "kept as fuzz-{}\n", present);
}

void stopped(int signal) {  // the process is lost anyway
  fmt::print(stderr, "signal {} (SIGALRM: hangs)\n", signal);
  keep();
  _exit(1);
}

struct Seed {
  std::string name, bytes;
};

std::vector<Seed> corpus(const TempFolder& folder) {
  std::vector<Seed> all;
  for (const int n : {1, 3}) {
    const TriangleMesh mesh = make_box({Vec3::Zero(), Vec3(1, 1.5, 1.2)});
    const LatticeSamples s =
        sample_lattice(SignedDistanceField(mesh), make_grid(bounding_box(mesh.vertices), n), 1);
    write_lattice(folder / "a.h5", s, mesh, "a box");
    write_lattice_text(folder / "a.txt", s);
    const SignedDistanceField field(mesh);
    write_band(folder / "band.h5", sample_band(field, make_grid(bounding_box(mesh.vertices), 8 * n), 0.2, 1),
               mesh, "a box");
    for (const char* name : {"a.h5", "a.txt", "band.h5"}) all.push_back({name, read_file(folder / name)});
  }
  return all;
}

// What is wrong with what became of the file; empty: nothing.
std::string read(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
  try {
    if (path.filename() == "band.h5" && is_band_file(path)) {
      const BandLattice lattice(read_band(path).samples);
      if (std::isnan(lattice.distance(lattice.grid().box().center()))) return "a distance is no number";
      return "";
    }
    const LatticeFile file = read_lattice(path);
    const std::size_t n = file.samples.grid.size();
    if (file.samples.distance.size() != n || file.samples.closest.size() != n) return "sizes differ";
    const Lattice lattice(file.samples);
    if (std::isnan(lattice.distance(file.samples.grid.box().center()))) return "a distance is no number";
  } catch (const Error& error) {
    const std::string what = error.what();
    if (what.empty() || what.find('\n') != std::string::npos) return "no one-line message: " + what;
  }
  return "";
}

}  // namespace

int main(int argc, char** argv) {
  const long cases = argc > 1 ? std::atol(argv[1]) : 10000;
  const auto seed = static_cast<unsigned>(argc > 2 ? std::atoi(argv[2]) : 1);
  for (const int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGALRM}) std::signal(signal, stopped);
#ifndef __SANITIZE_ADDRESS__
  const rlimit memory{rlim_t{1} << 28, rlim_t{1} << 28};  // nothing here is bigger than a few kilobytes
  setrlimit(RLIMIT_DATA, &memory);
#endif
  const TempFolder folder;
  const std::vector<Seed> seeds = corpus(folder);
  const Timer timer = wall_timer();
  long bad = 0;
  for (long i = 0; i < cases && bad < 20; ++i) {
    const Seed& s = seeds[static_cast<std::size_t>(i) % seeds.size()];
    const auto number = seed + static_cast<unsigned>(i);
    present = fmt::format("{}-{}", number, s.name), present_bytes = damaged(s.bytes, number);
    alarm(20);
    const std::string complaint = read(folder / s.name, present_bytes);
    alarm(0);
    if (complaint.empty()) continue;
    fmt::print(stderr, "{}: {}\n", present, complaint);
    keep();
    ++bad;
  }
  fmt::print("{} files in {:.0f} s, {} bad; {} MB at most\n", cases, timer.seconds(), bad,
             peak_resident_bytes() >> 20);
  return bad > 0;
}
