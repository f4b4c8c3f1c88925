#include "ops/kernels/colour/small_matrix.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vdbdither {

std::optional<Matrix> inverseOf(Matrix matrix, std::size_t size) {
  double largest = 0;
  for (std::size_t row = 0; row < size; ++row)
    for (std::size_t n = 0; n < size; ++n) largest = std::max(largest, std::abs(matrix[row][n]));
  const double least_pivot = 1e-7 * largest;
  Matrix inverse{};
  for (std::size_t n = 0; n < size; ++n) inverse[n][n] = 1;
  for (std::size_t column = 0; column < size; ++column) {
    std::size_t pivot = column;
    for (std::size_t row = column + 1; row < size; ++row)
      if (std::abs(matrix[row][column]) > std::abs(matrix[pivot][column])) pivot = row;
    if (std::abs(matrix[pivot][column]) <= least_pivot) return std::nullopt;
    std::swap(matrix[pivot], matrix[column]);
    std::swap(inverse[pivot], inverse[column]);
    const double scale = 1 / matrix[column][column];
    for (std::size_t n = 0; n < size; ++n) {
      matrix[column][n] *= scale;
      inverse[column][n] *= scale;
    }
    for (std::size_t row = 0; row < size; ++row) {
      if (row == column) continue;
      const double factor = matrix[row][column];
      for (std::size_t n = 0; n < size; ++n) {
        matrix[row][n] -= factor * matrix[column][n];
        inverse[row][n] -= factor * inverse[column][n];
      }
    }
  }
  return inverse;
}

}  // namespace vdbdither
