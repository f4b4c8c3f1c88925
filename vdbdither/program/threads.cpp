#include "vdbdither/program/threads.h"

#include <algorithm>
#include <semaphore>
#include <thread>
#include <vector>

#include <tbb/task_arena.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {

std::string refusedThread(const std::error_code& reason) {
  return "cannot start a thread: " + reason.message() +
         "; allow more processes (ulimit -u) or more memory (ulimit -v)";
}

void startThread(void (*function)()) {
  try {
    std::thread(function).detach();
  } catch (const std::system_error& error) {
    throw DataError(refusedThread(error.code()));
  }
}

GrantedThreads::GrantedThreads() {
  const int wanted = std::max(tbb::this_task_arena::max_concurrency() - 1, 1);
  std::vector<std::thread> threads;
  threads.reserve(static_cast<std::size_t>(wanted));
  std::counting_semaphore<> end(0);
  std::error_code reason;
  try {
    for (int n = 0; n < wanted; ++n) threads.emplace_back([&] { end.acquire(); });
  } catch (const std::system_error& error) {
    reason = error.code();
  }
  const int granted = static_cast<int>(threads.size());
  end.release(granted);
  for (std::thread& thread : threads) thread.join();
  if (granted == 0) throw DataError(refusedThread(reason));
  if (granted < wanted) limit_.emplace(tbb::global_control::max_allowed_parallelism, granted + 1);
}

}  // namespace vdbdither
