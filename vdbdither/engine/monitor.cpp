#include "vdbdither/engine/monitor.h"

#include <sys/resource.h>

namespace vdbdither {

double peakMemoryBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024;
}

void Monitor::count(const std::string& name, double value) {
  const std::lock_guard lock(count_mutex_);
  report_.counts.emplace_back(name, value);
}

void Monitor::progress(double fraction) {
  throwIfInterrupted();
  watcher_->progress(report_.name, done_layers_, total_layers_, fraction);
}

Monitor::Timer::~Timer() {
  report_.seconds +=
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  report_.cpu_seconds += static_cast<double>(std::clock() - cpu_start_) / CLOCKS_PER_SEC;
  report_.peak_memory_bytes = peakMemoryBytes();
}

}  // namespace vdbdither
