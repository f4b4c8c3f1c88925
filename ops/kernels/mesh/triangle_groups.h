#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

namespace vdbdither {

/// Disjoint groups of triangles, each known by its lowest.
class TriangleGroups {
 public:
  explicit TriangleGroups(std::uint32_t triangles) : lower_(triangles) {
    std::iota(lower_.begin(), lower_.end(), 0U);
  }

  void join(std::uint32_t one, std::uint32_t other) {
    const std::uint32_t a = of(one);
    const std::uint32_t b = of(other);
    lower_[std::max(a, b)] = std::min(a, b);
  }

  /// Returns the lowest triangle of a triangle's group.
  [[nodiscard]] std::uint32_t of(std::uint32_t triangle) {
    while (lower_[triangle] != triangle) triangle = lower_[triangle] = lower_[lower_[triangle]];
    return triangle;
  }

 private:
  std::vector<std::uint32_t> lower_;
};

}  // namespace vdbdither
