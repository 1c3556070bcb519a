// Counts what may make a thread wait for another: mutexes, read-write locks, conditions, semaphores,
// barriers. Included by one file of a test program.
#pragma once

#include <dlfcn.h>
#include <pthread.h>
#include <semaphore.h>

#include <cstddef>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define PALPATE_COUNTS_LOCKS 0  // the sanitizers have their own
#else
#define PALPATE_COUNTS_LOCKS 1
#endif

namespace {
[[maybe_unused]] thread_local std::size_t thread_locks = 0;  // of the one that asks
}

#if PALPATE_COUNTS_LOCKS
namespace {
// The system's function; of conditions there are two, the older of which an unversioned look-up finds.
template <class Function>
Function* system_function(const char* name, const char* version = nullptr) {
  void* found = version ? dlvsym(RTLD_NEXT, name, version) : nullptr;
  return reinterpret_cast<Function*>(found ? found : dlsym(RTLD_NEXT, name));
}
}  // namespace
extern "C" {
// NOLINTBEGIN: the system's names, so that libraries are counted, too
#define PALPATE_COUNTED(name, version, parameters, ...)                       \
  int name parameters {                                                       \
    static auto* const own = system_function<int parameters>(#name, version); \
    ++thread_locks;                                                           \
    return own(__VA_ARGS__);                                                  \
  }
PALPATE_COUNTED(pthread_mutex_lock, nullptr, (pthread_mutex_t * m), m)
PALPATE_COUNTED(pthread_mutex_trylock, nullptr, (pthread_mutex_t * m), m)
PALPATE_COUNTED(pthread_mutex_timedlock, nullptr, (pthread_mutex_t * m, const timespec* t), m, t)
PALPATE_COUNTED(pthread_rwlock_rdlock, nullptr, (pthread_rwlock_t * l), l)
PALPATE_COUNTED(pthread_rwlock_wrlock, nullptr, (pthread_rwlock_t * l), l)
PALPATE_COUNTED(pthread_rwlock_tryrdlock, nullptr, (pthread_rwlock_t * l), l)
PALPATE_COUNTED(pthread_rwlock_trywrlock, nullptr, (pthread_rwlock_t * l), l)
PALPATE_COUNTED(pthread_cond_wait, "GLIBC_2.3.2", (pthread_cond_t * c, pthread_mutex_t* m), c, m)
PALPATE_COUNTED(pthread_cond_timedwait, "GLIBC_2.3.2",
                (pthread_cond_t * c, pthread_mutex_t* m, const timespec* t), c, m, t)
PALPATE_COUNTED(pthread_cond_clockwait, nullptr,
                (pthread_cond_t * c, pthread_mutex_t* m, clockid_t k, const timespec* t), c, m, k, t)
PALPATE_COUNTED(pthread_cond_signal, "GLIBC_2.3.2", (pthread_cond_t * c), c)
PALPATE_COUNTED(pthread_cond_broadcast, "GLIBC_2.3.2", (pthread_cond_t * c), c)
PALPATE_COUNTED(pthread_spin_lock, nullptr, (pthread_spinlock_t * l), l)
PALPATE_COUNTED(pthread_barrier_wait, nullptr, (pthread_barrier_t * b), b)
PALPATE_COUNTED(sem_wait, nullptr, (sem_t * s), s)
PALPATE_COUNTED(sem_timedwait, nullptr, (sem_t * s, const timespec* t), s, t)
#undef PALPATE_COUNTED
// NOLINTEND
}
#endif
