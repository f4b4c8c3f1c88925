#pragma once

#include <cstddef>
#include <span>

namespace vdbdither {

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
