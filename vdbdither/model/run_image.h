#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace vdbdither {

/// A stretch of equal pixels: from the end of the run before it to the column `end`, exclusive.
struct Run {
  std::uint32_t end = 0;
  std::uint32_t value = 0;

  friend bool operator==(const Run&, const Run&) = default;
};

/// An image as rows of runs, top row first. The ends rise within a row, and the last one is the
/// width.
struct RunImage {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::size_t> row_begin;  ///< height + 1 indices into `runs`
  std::vector<Run> runs;

  [[nodiscard]] std::span<const Run> row(std::size_t y) const {
    return std::span(runs).subspan(row_begin[y], row_begin[y + 1] - row_begin[y]);
  }
  friend bool operator==(const RunImage&, const RunImage&) = default;
};

/// Makes runs of pixels that come from left to right, row by row.
class RunsBuilder {
 public:
  explicit RunsBuilder(std::uint32_t width) { image_.width = width; }

  /// The pixel in column `x` of the present row has this value, and those after it until the next
  /// call.
  void pixel(std::uint32_t x, std::uint32_t value) {
    if (x > 0 && value == value_) return;
    if (x > 0) image_.runs.push_back({x, value_});
    value_ = value;
  }
  void endRow() {
    image_.runs.push_back({image_.width, value_});
    image_.row_begin.push_back(image_.runs.size());
    ++image_.height;
  }
  [[nodiscard]] RunImage finish() { return std::move(image_); }

 private:
  RunImage image_{0, 0, {0}, {}};
  std::uint32_t value_ = 0;
};

}  // namespace vdbdither
