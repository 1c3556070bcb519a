// Counts the allocations of the whole program, of libraries too. Included by one file of a test program.
#pragma once

#include <atomic>
#include <cstdlib>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define PALPATE_COUNTS_ALLOCATIONS 0  // the sanitizers have their own malloc
#else
#define PALPATE_COUNTS_ALLOCATIONS 1
#endif

namespace {
[[maybe_unused]] std::atomic<std::size_t> allocations{0};          // of all threads
[[maybe_unused]] thread_local std::size_t thread_allocations = 0;  // of the one that asks
}  // namespace

#if PALPATE_COUNTS_ALLOCATIONS
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
// NOLINTBEGIN: glibc's names, so that libraries are counted, too
void* malloc(std::size_t n) {
  ++allocations, ++thread_allocations;
  return __libc_malloc(n);
}
void* calloc(std::size_t n, std::size_t size) {
  ++allocations, ++thread_allocations;
  return __libc_calloc(n, size);
}
void* realloc(void* p, std::size_t n) {
  ++allocations, ++thread_allocations;
  return __libc_realloc(p, n);
}
void* aligned_alloc(std::size_t a, std::size_t n) {
  ++allocations, ++thread_allocations;
  return __libc_memalign(a, n);
}
int posix_memalign(void** p, std::size_t a, std::size_t n) {
  ++allocations, ++thread_allocations;
  *p = __libc_memalign(a, n);
  return *p ? 0 : 12;
}
// NOLINTEND
}
#endif
