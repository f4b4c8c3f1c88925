#pragma once

#include <cstdint>
#include <vector>

namespace vdbdither {

/// Counts values whose range nobody knows beforehand. The edges of the bins are whole multiples of
/// a power of two, which doubles when the values no longer fit: so the outcome depends on the
/// values alone, not on their order.
class Histogram {
 public:
  /// At most so many bins. None is narrower than 2^`least_exponent`.
  Histogram(int bins, int least_exponent);

  /// Values that are not finite are counted apart.
  void add(double value, std::uint64_t count);

  struct Bin {
    double from = 0;  ///< inclusive
    double to = 0;    ///< exclusive
    std::uint64_t count = 0;
  };
  /// From the least value's to the greatest's.
  [[nodiscard]] std::vector<Bin> bins() const;
  [[nodiscard]] std::uint64_t notFinite() const { return not_finite_; }

 private:
  void widen();

  int most_;
  int exponent_;
  std::int64_t first_ = 0;  ///< which multiple the first bin begins at
  std::vector<std::uint64_t> counts_;
  std::uint64_t not_finite_ = 0;
};

}  // namespace vdbdither
