#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>

#include <tbb/parallel_for.h>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

/// Reports the progress of a part of the work as fractions of the whole.
class ProgressPart {
 public:
  /// The whole. `progress` may be empty; it must outlive all parts.
  explicit ProgressPart(const std::function<void(double)>& progress) : progress_(progress) {}

  /// The part between two fractions of this one.
  [[nodiscard]] ProgressPart part(double from, double to) const {
    ProgressPart part = *this;
    part.from_ = from_ + (to_ - from_) * from;
    part.to_ = from_ + (to_ - from_) * to;
    return part;
  }

  void operator()(double fraction) const {
    if (progress_) progress_(from_ + (to_ - from_) * fraction);
  }

 private:
  const std::function<void(double)>& progress_;
  double from_ = 0, to_ = 1;
};

/// Calls work(i) for i below `count` on all threads. Throws Interrupted.
template <class Work>
void forAll(std::size_t count, const Work& work) {
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    throwIfInterrupted();
    work(i);
  });
}

/// The same, reporting progress between batches.
template <class Work>
void forAll(std::size_t count, const ProgressPart& progress, const Work& work) {
  constexpr std::size_t batch = 1 << 16;
  for (std::size_t begin = 0; begin < count; begin += batch) {
    progress(static_cast<double>(begin) / static_cast<double>(count));
    forAll(std::min(count - begin, batch), [&](std::size_t i) { work(begin + i); });
  }
}

}  // namespace vdbdither
