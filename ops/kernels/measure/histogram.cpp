#include "ops/kernels/measure/histogram.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

Histogram::Histogram(int bins, int minimum_exponent)
    : maximum_(bins), exponent_(minimum_exponent) {}

void Histogram::add(double value, std::uint64_t count) {
  if (!std::isfinite(value)) {
    not_finite_ += count;
    return;
  }
  const auto bin = [&] { return std::floor(std::ldexp(value, -exponent_)); };
  if (counts_.empty()) {
    while (std::abs(bin()) >= 0x1p52) ++exponent_;
    first_ = static_cast<std::int64_t>(bin());
    counts_ = {count};
    return;
  }
  const auto last = [&] { return static_cast<double>(first_ + std::ssize(counts_) - 1); };
  while (std::max(bin(), last()) - std::min(bin(), static_cast<double>(first_)) >= maximum_)
    widen();
  const auto place = static_cast<std::int64_t>(bin());
  if (place < first_) {
    counts_.insert(counts_.begin(), static_cast<std::size_t>(first_ - place), 0);
    first_ = place;
  }
  if (place >= first_ + std::ssize(counts_))
    counts_.resize(static_cast<std::size_t>(place - first_ + 1), 0);
  counts_[static_cast<std::size_t>(place - first_)] += count;
}

void Histogram::widen() {
  // The shift rounds down, also below zero.
  const std::int64_t first = first_ >> 1;
  std::vector<std::uint64_t> counts(
      static_cast<std::size_t>(((first_ + std::ssize(counts_) - 1) >> 1) - first + 1), 0);
  for (std::int64_t i = 0; i < std::ssize(counts_); ++i) {
    counts[static_cast<std::size_t>(((first_ + i) >> 1) - first)] +=
        counts_[static_cast<std::size_t>(i)];
  }
  first_ = first;
  counts_ = std::move(counts);
  ++exponent_;
}

std::vector<Histogram::Bin> Histogram::bins() const {
  std::vector<Bin> bins;
  for (std::int64_t i = 0; i < std::ssize(counts_); ++i) {
    const auto begin = static_cast<double>(first_ + i);
    bins.push_back({std::ldexp(begin, exponent_), std::ldexp(begin + 1, exponent_),
                    counts_[static_cast<std::size_t>(i)]});
  }
  return bins;
}

}  // namespace vdbdither
