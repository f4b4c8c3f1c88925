#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace vdbdither {

/// A stretch of equal pixels: from the end of the span before it to the column `end`, exclusive.
struct Span {
  std::uint32_t end = 0;
  std::uint32_t value = 0;

  friend bool operator==(const Span&, const Span&) = default;
};

/// An image as rows of spans, top row first. The ends rise within a row, and the last one is the
/// width.
struct SpanImage {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::size_t> row_begin;  ///< height + 1 indices into `spans`
  std::vector<Span> spans;

  [[nodiscard]] std::span<const Span> row(std::size_t y) const {
    return std::span(spans).subspan(row_begin[y], row_begin[y + 1] - row_begin[y]);
  }
  friend bool operator==(const SpanImage&, const SpanImage&) = default;
};

/// Makes spans of pixels that come from left to right, row by row.
class SpansBuilder {
 public:
  explicit SpansBuilder(std::uint32_t width) { image_.width = width; }

  /// The pixel in column `x` of the present row has this value, and those after it until the next
  /// call.
  void pixel(std::uint32_t x, std::uint32_t value) {
    if (x > 0 && value == value_) return;
    if (x > 0) image_.spans.push_back({x, value_});
    value_ = value;
  }
  void endRow() {
    image_.spans.push_back({image_.width, value_});
    image_.row_begin.push_back(image_.spans.size());
    ++image_.height;
  }
  [[nodiscard]] SpanImage finish() { return std::move(image_); }

 private:
  SpanImage image_{0, 0, {0}, {}};
  std::uint32_t value_ = 0;
};

}  // namespace vdbdither
