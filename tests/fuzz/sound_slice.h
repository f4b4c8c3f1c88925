#pragma once

#include <cstdint>
#include <exception>
#include <optional>
#include <utility>

#include "io/image/size_check.h"
#include "tests/fuzz/require.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

inline void requireSound(const SpanImage& image) {
  require(image.width > 0 && image.height > 0);
  require(image.row_begin.size() == std::size_t{image.height} + 1);
  require(image.row_begin.front() == 0 && image.row_begin.back() == image.spans.size());
  for (std::uint32_t y = 0; y < image.height; ++y) {
    require(image.row_begin[y] < image.row_begin[y + 1]);
    std::uint32_t begin = 0;
    for (const Span& span : image.row(y)) {
      require(span.end > begin);
      begin = span.end;
    }
    require(begin == image.width);
  }
}

/// Refuses what is too large for a fuzzer. A stack knows the size of its slices as well.
inline void checkFuzzedSize(std::uint32_t width, std::uint32_t height) {
  constexpr std::uint32_t widest = 1 << 12;
  constexpr std::uint64_t most = 1 << 18;
  if (width > widest || height > widest || std::uint64_t{width} * height > most)
    throw DataError("is too large");
}

/// Returns what `decode(check)` returns, or nothing where it refuses in one line.
template <class Decode>
auto decodedOrRefused(const Decode& decode) -> std::optional<decltype(decode(SizeCheck()))> {
  try {
    return decode(checkFuzzedSize);
  } catch (const DataError& error) {
    require(isOneLine(error.what()));
    return std::nullopt;
  }
}

}  // namespace vdbdither
