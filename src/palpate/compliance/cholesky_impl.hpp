// What the stages of one factorisation share with each other, and nobody else.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "palpate/base/huge_array.hpp"
#include "palpate/base/progress.hpp"
#include "palpate/compliance/dense.hpp"
#include "palpate/compliance/multifrontal.hpp"
#include "palpate/compliance/symbolic.hpp"

namespace palpate {

struct Cholesky::Impl {
  Symbolic symbolic;
  HugeArray<double> l;        // panels of the fronts; above the diagonal of a panel: anything
  HugeArray<double> inverse;  // of the blocks on the diagonal (dense::invert_blocks)
  const double* inverse_of(const Front& f) const {
    return inverse.data() + dense::inverse_block * 3 * static_cast<std::size_t>(f.first);
  }
  SymbolicStats stats;
};

// Progress from several threads: work done of work in all.
class SharedProgress {
 public:
  SharedProgress(const Progress& progress, double total) : progress_(progress), total_(total) {}
  void add(double work) {
    const std::lock_guard lock(mutex_);
    done_ += work;
    progress_.at(total_ > 0 && done_ < total_ ? done_ / total_ : 1.0);
  }

 private:
  const Progress& progress_;
  double total_, done_ = 0;
  std::mutex mutex_;
};

// Memory for blocks that come and go with a walk through a tree in postorder: a vertex takes its own block
// before it gives back its children's. Blocks of odd and even depth grow from different ends, so both ends
// are stacks.
template <class T>
class TreeStack {
 public:
  explicit TreeStack(std::size_t size) : memory_(size), high_(size) {}
  T* push(bool odd, std::size_t size) {
    if (odd) return memory_.data() + (high_ -= size);
    return memory_.data() + std::exchange(low_, low_ + size);
  }
  void pop(bool odd, std::size_t size) { odd ? high_ += size : low_ -= size; }

 private:
  HugeArray<T> memory_;
  std::size_t low_ = 0, high_;
};

// The size such a walk needs: the same calls, without memory.
class StackNeed {
 public:
  void push(std::size_t size) { most_ = std::max(most_, now_ += size); }
  void pop(std::size_t size) { now_ -= size; }
  std::size_t most() const { return most_; }

 private:
  std::size_t now_ = 0, most_ = 0;
};

// Things that threads borrow for a while, made when all are lent.
template <class T>
class Pool {
 public:
  template <class Make>
  std::unique_ptr<T> take(Make make) {
    {
      const std::lock_guard lock(mutex_);
      if (!idle_.empty()) {
        std::unique_ptr<T> thing = std::move(idle_.back());
        idle_.pop_back();
        return thing;
      }
    }
    return make();
  }
  void give(std::unique_ptr<T> thing) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(thing));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> idle_;
};

}  // namespace palpate
