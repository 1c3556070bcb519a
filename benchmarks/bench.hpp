// A small harness of our own. Google Benchmark times one function after the other, so on a shared machine
// ours and the peer see different weather; here they are run in turn (ours, peer, ours, peer, ...) within one
// process, by CPU time, and their medians are compared. Set-up is outside the clock.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace palpate {

constexpr double no_peer = std::numeric_limits<double>::quiet_NaN();

// What a row is called and measured in. Names are dotted, stage first; they are kept, so that results of
// different versions can be compared.
struct Row {
  std::string name, unit;
  bool rate = false;  // true: more is better (1/s)
};

// What came out of it, in the row's unit. A peer that was not run here but taken from a publication or an
// earlier measurement says so in its name ("thesis 2004", "..., recorded").
struct Value {
  double value = 0;
  std::string peer = {};        // empty: none
  double peer_value = no_peer;  // NaN: none
  std::string note = {};        // printed beside the row, not stored
};

struct Runs {
  int least = 3, most = 15;  // of each side
  double seconds = 3;        // no new run is begun once so much CPU time is spent
  int warm = 0;              // runs before each timed one, for caches that hold what they can of its own data
};
// Medians of the CPU seconds of a call. `peer` may be empty: its median is then NaN.
struct Medians {
  double ours = 0, peer = no_peer;
};
Medians in_turn(const std::function<void()>& ours, const std::function<void()>& peer = {},
                const Runs& runs = {});
double median(std::vector<double> values);

// Touches this much memory and gives it back. A virtual machine's first touch of a page is paid to its host,
// ten times the price of any later one, and neither side's fault.
void warm_memory(std::size_t bytes);

// Keeps the compiler from dropping a result that nobody reads.
template <class T>
void keep(const T& value) {
  asm volatile("" : : "g"(&value) : "memory");
}

class Bench {
 public:
  // A case sets up once and returns a value for each of its rows, in their order. `full`: only with --full.
  void add(std::vector<Row> rows, std::function<std::vector<Value>()> run, bool full = false);
  // The program: --json FILE, --full, --filter REGEX, --list.
  int main(int argc, char** argv);
  bool full() const { return full_; }  // for cases that run longer then

 private:
  struct Case {
    std::vector<Row> rows;
    std::function<std::vector<Value>()> run;
    bool full;
  };
  std::vector<Case> cases_;
  bool full_ = false;
};

std::string machine();  // CPU model, processors, memory

// One a file: X_bench.cpp defines void register_X(Bench&), and register_all calls it (written by CMake).
void register_all(Bench& bench);

}  // namespace palpate
