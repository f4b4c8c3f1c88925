#pragma once

#include <array>
#include <cstddef>
#include <numeric>
#include <optional>
#include <vector>

namespace vdbdither {

/// A matrix of at most four rows.
using Matrix = std::array<std::array<double, 4>, 4>;

/// Returns the inverse of the upper left corner of `size` rows (Gauss and Jordan). Nothing if a
/// pivot is below 1e-7 of the largest entry.
std::optional<Matrix> inverseOf(Matrix matrix, std::size_t size);

/// Calls `visit` with every choice of `size` of the numbers below `count`, in rising order.
template <typename Visit>
void forEachChoice(std::size_t count, std::size_t size, const Visit& visit) {
  std::vector<std::size_t> choice(size);
  std::iota(choice.begin(), choice.end(), std::size_t{0});
  while (true) {
    visit(choice);
    std::size_t place = size;
    while (place > 0 && choice[place - 1] == count - size + place - 1) --place;
    if (place == 0) return;
    ++choice[place - 1];
    for (std::size_t n = place; n < size; ++n) choice[n] = choice[n - 1] + 1;
  }
}

}  // namespace vdbdither
