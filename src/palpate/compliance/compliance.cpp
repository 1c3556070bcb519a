#include "palpate/compliance/compliance.hpp"

#include "palpate/compliance/storage.hpp"

namespace palpate {

const char* storage_name(Storage storage) {
  switch (storage) {
    case Storage::dense:
      return "dense float32";
    case Storage::half:
      return "dense float16";
    case Storage::factored:
      return "factored";
    case Storage::hierarchical:
      return "hierarchical";
  }
  return "";
}

Compliance Compliance::dense(HugeArray<float> matrix, std::size_t nodes) {
  return Compliance(std::make_shared<DenseCompliance>(std::move(matrix), nodes));
}

std::span<const float> Compliance::matrix() const noexcept {
  const auto* dense = as<DenseCompliance>();
  return dense ? dense->matrix() : std::span<const float>();
}

Compliance Compliance::with_work() const {
  Compliance out = *this;
  if (storage_) out.work_ = storage_->make_work();
  return out;
}

void Compliance::row(std::size_t row, std::span<float> out) const noexcept {
  const auto node = static_cast<Index>(row / 3);
  float unit[3] = {};
  unit[row % 3] = 1;
  apply({&node, 1}, unit, out);  // symmetric
}

}  // namespace palpate
