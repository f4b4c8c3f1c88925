#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// Where layers differ from what they should be.
class SpanDifference {
 public:
  /// Pixels that differ, by value.
  struct Tally {
    std::uint64_t missing = 0;  ///< that should have the value and have another
    std::uint64_t extra = 0;    ///< that have it and should have another
  };
  struct DifferingLayer {
    int z = 0;
    std::uint64_t pixels = 0;
    std::array<std::uint32_t, 2> first{};  ///< column and row
  };

  /// Compares two images of one size as the next layer.
  void add(int z, const SpanImage& image, const SpanImage& expected);
  /// Adds what another one found in layers above.
  void add(const SpanDifference& above);

  [[nodiscard]] std::uint64_t pixels() const { return pixels_; }
  [[nodiscard]] std::uint64_t layers() const { return layers_; }
  [[nodiscard]] const std::map<std::uint32_t, Tally>& tallies() const { return tallies_; }
  /// The first layers that differ, at most `listed`.
  [[nodiscard]] const std::vector<DifferingLayer>& first() const { return first_; }

  static constexpr std::size_t listed = 10;

 private:
  std::uint64_t pixels_ = 0;
  std::uint64_t layers_ = 0;
  std::map<std::uint32_t, Tally> tallies_;
  std::vector<DifferingLayer> first_;
};

}  // namespace vdbdither
