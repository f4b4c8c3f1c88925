#pragma once

#include <cstdint>
#include <span>

#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// The Adler-32 (RFC 1950) of the rows of a PNG, from their spans.
class RowAdler {
 public:
  /// Adds a row of a filter byte 0 and `units` values of `unit` bytes each, lowest byte first.
  ///
  /// In closed form: a span of n units with byte sum S and Σ j·byte_j = J, r bytes before the row's
  /// end, adds n·S to the one sum and S·(n·r − unit·n(n−1)/2) − n·J to the other.
  void addRow(std::span<const Span> spans, std::uint64_t unit, std::uint64_t units) {
    std::uint64_t row_sum = 0;
    std::uint64_t row_weighted = 0;
    std::uint64_t begin = 0;
    for (const Span& span : spans) {
      const std::uint64_t count = span.end - begin;
      const std::uint64_t rest = unit * (units - begin);
      std::uint64_t sum = span.value & 255;
      std::uint64_t moment = 0;
      for (unsigned j = 1; j < unit; ++j) {
        const std::uint64_t byte = span.value >> (8 * j) & 255;
        sum += byte;
        moment += j * byte;
      }
      row_sum += count * sum;
      row_weighted += sum * (count * rest - unit * (count * (count - 1) / 2)) - count * moment;
      begin = span.end;
    }
    add(1 + unit * units, row_sum, row_weighted);
  }

  /// Adds bytes as they are.
  void addBytes(std::span<const std::uint8_t> bytes) {
    std::uint64_t sum = 0;
    std::uint64_t weighted = 0;
    std::uint64_t rest = bytes.size();
    for (const std::uint8_t byte : bytes) {
      sum += byte;
      weighted += byte * rest--;
    }
    add(bytes.size(), sum, weighted);
  }

  [[nodiscard]] std::uint32_t value() const {
    return static_cast<std::uint32_t>(sum_ | weighted_sum_ << 16);
  }

 private:
  static constexpr std::uint64_t modulus = 65521;

  void add(std::uint64_t size, std::uint64_t sum, std::uint64_t weighted) {
    weighted_sum_ = (weighted_sum_ + size % modulus * sum_ + weighted) % modulus;
    sum_ = (sum_ + sum) % modulus;
  }

  std::uint64_t sum_ = 1;
  std::uint64_t weighted_sum_ = 0;
};

}  // namespace vdbdither
