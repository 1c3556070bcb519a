// Splits [0, n) into fixed chunks and runs them on a few threads. Which thread takes which chunk varies;
// the chunks do not, so a body that writes only to its own range gives the same bits for any number of
// threads.
#pragma once

#include <cstddef>
#include <functional>

namespace palpate {

// Number of threads used where a caller passes 0: the processors this process may run on.
int default_threads();

// Calls body(begin, end) for chunks of `chunk` items (the last may be shorter) on `threads` threads (0:
// default). The first exception thrown by a body is rethrown here after all threads have stopped; the rest of
// the work is dropped.
void parallel_for(std::size_t n, std::size_t chunk, int threads,
                  const std::function<void(std::size_t begin, std::size_t end)>& body);

}  // namespace palpate
