#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace vdbdither {

/// Disjoint sets of numbers (union-find).
class DisjointSets {
 public:
  /// The numbers below `count`, each a set of its own.
  explicit DisjointSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }
  /// The least number of the set.
  std::uint32_t find(std::uint32_t n) {
    while (parent_[n] != n) n = parent_[n] = parent_[parent_[n]];
    return n;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    if (a != b) parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// Calls join(i, j) for the touching spans of two rows, where spans have a `begin` and an exclusive
/// `end`.
/// @param aside  1 if corners touch, else 0
template <typename Span, typename Join>
void forEachTouching(std::span<const Span> a, std::span<const Span> b, int aside,
                     const Join& join) {
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i].begin < b[j].end + aside && b[j].begin < a[i].end + aside) join(i, j);
    if (a[i].end < b[j].end) {
      ++i;
    } else {
      ++j;
    }
  }
}

}  // namespace vdbdither
