#include "palpate/base/huge_array.hpp"

#include <sys/mman.h>

#include <cstdint>

#include "palpate/base/error.hpp"

namespace palpate {

namespace {
constexpr std::size_t page = std::size_t{2} << 20;
std::size_t rounded(std::size_t bytes) { return (bytes + page - 1) / page * page; }
}  // namespace

void* huge_allocate(std::size_t bytes) {
  // One page more than needed, so that the part returned can start on a 2 MiB boundary; the rest goes back.
  const std::size_t want = rounded(bytes);
  void* raw = bytes > want
                  ? MAP_FAILED
                  : mmap(nullptr, want + page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (raw == MAP_FAILED)
    throw Error(ErrorKind::resource,
                "cannot get {:.1f} MB of memory; close other programs or use a smaller model",
                static_cast<double>(bytes) * 1e-6);
  const auto address = reinterpret_cast<std::uintptr_t>(raw);
  const std::size_t skip = (page - address % page) % page;
  auto* start = static_cast<char*>(raw) + skip;
  if (skip) munmap(raw, skip);
  if (skip < page) munmap(start + want, page - skip);
  madvise(start, want, MADV_HUGEPAGE);
  return start;
}

void huge_free(void* memory, std::size_t bytes) noexcept { munmap(memory, rounded(bytes)); }

}  // namespace palpate
