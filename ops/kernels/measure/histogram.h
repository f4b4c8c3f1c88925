#pragma once

#include <cstdint>
#include <vector>

namespace vdbdither {

/// Counts values whose range is not known in advance. The edges of the bins are whole multiples of
/// a power of two, which doubles when the values no longer fit. The result therefore depends on the
/// values alone, not on their order.
class Histogram {
 public:
  /// A histogram of at most `bins` bins, none of which is narrower than 2^`minimum_exponent`.
  Histogram(int bins, int minimum_exponent);

  /// Adds values; those that are not finite are counted separately.
  void add(double value, std::uint64_t count);

  struct Bin {
    double from = 0;  ///< inclusive
    double to = 0;    ///< exclusive
    std::uint64_t count = 0;
  };
  /// The bins from that of the minimum to that of the maximum.
  [[nodiscard]] std::vector<Bin> bins() const;
  [[nodiscard]] std::uint64_t notFinite() const { return not_finite_; }

 private:
  void widen();

  int maximum_;
  int exponent_;
  std::int64_t first_ = 0;  ///< the multiple at which the first bin begins
  std::vector<std::uint64_t> counts_;
  std::uint64_t not_finite_ = 0;
};

}  // namespace vdbdither
