// fuzz_io SECONDS [SEED]: damages small files of every format for so long and reads them. Ends with 1, and
// leaves the file in the working folder, where a reader crashes, hangs, or takes what it must not. Not part
// of ./test; what it finds becomes a test.
#include <fmt/core.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>

#include "palpate/base/timer.hpp"
#include "palpate/io/atomic_file.hpp"
#include "unit/io/damage.hpp"
#include "unit/io/surface_samples.hpp"
#include "unit/io/tet_test.hpp"

using namespace palpate;

namespace {

std::string present;  // the case at hand, and where it is kept when it ends badly
std::string present_bytes;

void keep() {
  std::ofstream("fuzz-" + present, std::ios::binary) << present_bytes;
  fmt::print(stderr, "kept as fuzz-{}\n", present);
}

void stopped(int signal) {  // the process is lost anyway
  fmt::print(stderr, "signal {} (SIGALRM: hangs)\n", signal);
  keep();
  _exit(1);
}

std::vector<SurfaceSample> own_samples() {
  std::vector<SurfaceSample> all = own_surface_samples();
  for (const bool swapped : {false, true})
    for (const int type : {2, 4, 8, 16, 64, 1024})
      all.push_back({"volume.nii", nifti1(swapped, type), 0, 0, 0});
  for (const Sample& s : samples()) all.push_back({s.name, s.bytes, 0, 0, 0});
  return all;
}

// Those that go through palpate-import, real ones among them.
std::vector<SurfaceSample> imported_samples() {
  std::vector<SurfaceSample> all;
  for (const SurfaceSample& s : surface_samples())
    if (s.name.ends_with(".iv") || s.name.ends_with(".wrl") || s.name.ends_with(".glb")) all.push_back(s);
  for (const char* name :
       {"torus.iv", "chess/bishop.iv", "heart.iv", "simple/star.iv", "simple/quadMesh.iv"}) {
    const std::string path = std::string("/usr/share/inventor/data/models/") + name;
    if (std::filesystem::exists(path)) all.push_back({"model.iv", read_file(path), 0, 0, 0});
  }
  return all;
}

bool sound(const TempFolder& folder, const SurfaceSample& sample, unsigned seed) {
  present = fmt::format("{}-{}", seed, sample.name), present_bytes = damaged(sample.bytes, seed);
  alarm(sample.name.ends_with(".iv") || sample.name.ends_with(".wrl") ? 200 : 20);
  const std::string complaint = read_damaged(folder / sample.name, present_bytes);
  alarm(0);
  if (complaint.empty()) return true;
  fmt::print(stderr, "{}: {}\n", present, complaint);
  keep();
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 60;
  unsigned seed = argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1;
  for (const int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGALRM}) std::signal(signal, stopped);
#ifndef __SANITIZE_ADDRESS__
  const rlimit memory{rlim_t{4} << 30, rlim_t{4} << 30};  // nothing here is bigger than a few kilobytes
  setrlimit(RLIMIT_DATA, &memory);
#endif
  const TempFolder folder;
  const std::vector<SurfaceSample> own = own_samples(), imported = imported_samples();
  const Timer timer = wall_timer();
  std::size_t cases = 0, bad = 0;
  for (; timer.seconds() < seconds && bad < 20; ++seed) {
    for (const SurfaceSample& s : own) bad += !sound(folder, s, seed), ++cases;
    if (seed % 8 == 0) bad += !sound(folder, imported[seed / 8 % imported.size()], seed), ++cases;
  }
  fmt::print("{} files to seed {}, {} bad; {} MB at most\n", cases, seed, bad, peak_resident_bytes() >> 20);
  return bad > 0;
}
