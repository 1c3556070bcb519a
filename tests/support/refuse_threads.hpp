// A system without threads to give. Included by one file of a test program.
#pragma once

#include <dlfcn.h>
#include <pthread.h>

#include <atomic>
#include <cerrno>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define PALPATE_REFUSES_THREADS 0  // the sanitizers have their own threads
#else
#define PALPATE_REFUSES_THREADS 1
#endif

namespace {
[[maybe_unused]] std::atomic<int> threads_left{-1};  // that may still be started; -1: as many as one likes
}

#if PALPATE_REFUSES_THREADS
// NOLINTNEXTLINE: the system's name
extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*run)(void*),
                              void* argument) {
  using Create = int (*)(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  if (threads_left == 0) return EAGAIN;
  if (threads_left > 0) --threads_left;
  static const auto create = reinterpret_cast<Create>(dlsym(RTLD_NEXT, "pthread_create"));
  return create(thread, attributes, run, argument);
}
#endif
