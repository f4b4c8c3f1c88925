#pragma once

#include <cstddef>
#include <vector>

namespace vdbdither {

/// One number for each pixel of a picture, top row first.
struct Channel {
  Channel() = default;
  Channel(int columns, int rows, double value = 0)
      : width(columns),
        height(rows),
        values(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), value) {}

  [[nodiscard]] double& at(int x, int y) {
    return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
  [[nodiscard]] double at(int x, int y) const {
    return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }

  int width = 0;
  int height = 0;
  std::vector<double> values;
};

}  // namespace vdbdither
