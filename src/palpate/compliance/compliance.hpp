// C = (K^-1)_SS: displacement of surface nodes per force on surface nodes, m/N. One interface for all
// storages (storage.hpp, docs/compliance.md).
#pragma once

#include <memory>
#include <span>

#include "palpate/base/huge_array.hpp"
#include "palpate/base/progress.hpp"
#include "palpate/base/vec.hpp"

namespace palpate {

enum class Storage { dense, half, factored, hierarchical };
const char* storage_name(Storage storage);  // "dense float32", "dense float16", "factored", "hierarchical"

// What a storage needs to answer queries beside its numbers; of one thread at a time.
struct ComplianceWork {
  virtual ~ComplianceWork() = default;
};

// What a storage has to do. Const and thread-safe. work: from make_work, or null: then the thread's own is
// taken, which its first query allocates.
class ComplianceStorage {
 public:
  virtual ~ComplianceStorage() = default;
  virtual Storage kind() const noexcept = 0;
  virtual std::size_t nodes() const noexcept = 0;
  virtual std::size_t bytes() const noexcept = 0;
  virtual bool mirrors_bits() const noexcept { return false; }
  virtual std::unique_ptr<ComplianceWork> make_work() const { return nullptr; }
  virtual void apply(std::span<const Index> contacts, std::span<const float> forces, std::span<float> u,
                     ComplianceWork* work) const noexcept = 0;
  virtual void block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
                     std::size_t ld, ComplianceWork* work) const noexcept = 0;
};

// Symmetric positive definite. Const and thread-safe; copies share the numbers.
class Compliance {
 public:
  Compliance() = default;
  explicit Compliance(std::shared_ptr<const ComplianceStorage> storage) : storage_(std::move(storage)) {}
  // matrix: (3 nodes)^2, row-major, full.
  static Compliance dense(HugeArray<float> matrix, std::size_t nodes);

  std::size_t nodes() const noexcept { return storage_ ? storage_->nodes() : 0; }
  const char* storage() const noexcept { return storage_name(storage_ ? storage_->kind() : Storage::dense); }
  std::size_t bytes() const noexcept { return storage_ ? storage_->bytes() : 0; }
  // The storage itself, where it is a T; otherwise null.
  template <class T>
  const T* as() const noexcept {
    return dynamic_cast<const T*>(storage_.get());
  }
  // The same numbers, with work space of its own: not even the first query allocates. For one thread at a
  // time, copies included.
  Compliance with_work() const;
  bool same_numbers(const Compliance& other) const noexcept { return storage_ == other.storage_; }
  // Whether block() gives C_ij and C_ji the same bits. Of the hierarchical storage a far pair goes another
  // way from each side.
  bool mirrors_bits() const noexcept { return !storage_ || storage_->mirrors_bits(); }
  // All numbers of the dense float32 storage; empty in the others.
  std::span<const float> matrix() const noexcept;

  // u = C f for forces on a few nodes: u (3 nodes() floats, m) is overwritten; forces: 3 contacts.size()
  // floats, N. contacts: distinct, any order.
  void apply(std::span<const Index> contacts, std::span<const float> forces,
             std::span<float> u) const noexcept {
    storage_->apply(contacts, forces, u, work_.get());
  }
  // The 3 contacts x 3 contacts block, row-major with leading dimension `ld` (>= 3 contacts.size()).
  void block(std::span<const Index> contacts, std::span<float> out, std::size_t ld) const noexcept {
    storage_->block(contacts, contacts, out, ld, work_.get());
  }
  // A rectangular block: rows of `rows`, columns of `columns`, row-major, leading dimension ld. For adding
  // contacts a few at a time.
  void block(std::span<const Index> rows, std::span<const Index> columns, std::span<float> out,
             std::size_t ld) const noexcept {
    storage_->block(rows, columns, out, ld, work_.get());
  }
  // Row `row` (3 node + component) of the matrix: 3 nodes() floats.
  void row(std::size_t row, std::span<float> out) const noexcept;

 private:
  std::shared_ptr<const ComplianceStorage> storage_;
  std::shared_ptr<ComplianceWork> work_;
};

}  // namespace palpate
