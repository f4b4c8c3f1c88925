#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
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

}  // namespace vdbdither
