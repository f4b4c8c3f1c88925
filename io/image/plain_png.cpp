#include "io/image/plain_png.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <vector>
#include <zlib.h>

#include "io/image/png_spans.h"
#include "io/image/row_adler.h"
#include "io/image/row_inflater.h"

namespace vdbdither {

namespace {

std::uint32_t bigEndian(std::span<const std::uint8_t> bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} << 24 | std::uint32_t{bytes[at + 1]} << 16 |
         std::uint32_t{bytes[at + 2]} << 8 | bytes[at + 3];
}

/// What a file holds.
struct Contents {
  std::uint32_t width = 0, height = 0;
  int depth = 0, kind = 0;
  std::vector<std::span<const std::uint8_t>> data;  ///< pieces of the packed pixels
};

constexpr int grey_kind = 0;
constexpr int rgba_kind = 6;

/// The chunks (PNG, third edition, 5), or nothing where they are of another kind or damaged.
std::optional<Contents> contentsOf(std::span<const std::uint8_t> bytes) {
  static constexpr std::array<std::uint8_t, 8> signature = {0x89, 'P',  'N',  'G',
                                                            '\r', '\n', 0x1a, '\n'};
  constexpr std::size_t around = 12;
  if (bytes.size() < signature.size() ||
      !std::equal(signature.begin(), signature.end(), bytes.begin()))
    return std::nullopt;
  Contents contents;
  std::string_view last;
  for (std::size_t at = signature.size(); at + around <= bytes.size();) {
    const std::size_t size = bigEndian(bytes, at);
    if (size > bytes.size() - at - around) return std::nullopt;
    const std::string_view name(reinterpret_cast<const char*>(bytes.data() + at + 4), 4);
    const auto data = bytes.subspan(at + 8, size);
    if (crc32_z(0, bytes.data() + at + 4, size + 4) != bigEndian(bytes, at + 8 + size))
      return std::nullopt;
    if (name == "IHDR") {
      constexpr std::size_t header = 13;
      if (!last.empty() || size != header || data[10] != 0 || data[11] != 0 || data[12] != 0)
        return std::nullopt;
      contents.width = bigEndian(data, 0);
      contents.height = bigEndian(data, 4);
      contents.depth = data[8];
      contents.kind = data[9];
    } else if (name == "IDAT") {
      if (!contents.data.empty() && last != "IDAT") return std::nullopt;
      contents.data.push_back(data);
    } else if (name == "IEND") {
      if (contents.data.empty()) return std::nullopt;
      return contents;
    } else if (name != "pHYs" && name != "tEXt" && name != "tIME") {
      return std::nullopt;
    }
    if (last.empty() && name != "IHDR") return std::nullopt;
    last = name;
    at += around + size;
  }
  return std::nullopt;
}

/// The first unit from `x` on that is not `value`, or `units`.
std::uint32_t endOfRun(const std::uint8_t* row, std::uint32_t x, std::uint32_t units,
                       std::uint32_t value, std::uint32_t unit) {
#ifdef __SSE2__
  const std::uint32_t step = 16 / unit;
  const __m128i wanted =
      unit == 4 ? _mm_set1_epi32(static_cast<int>(value)) : _mm_set1_epi8(static_cast<char>(value));
  for (; x + 4 * step <= units; x += 4 * step) {
    const auto* at = reinterpret_cast<const __m128i*>(row + std::size_t{unit} * x);
    const auto equal = [&](int i) { return _mm_cmpeq_epi8(_mm_loadu_si128(at + i), wanted); };
    const __m128i all =
        _mm_and_si128(_mm_and_si128(equal(0), equal(1)), _mm_and_si128(equal(2), equal(3)));
    if (_mm_movemask_epi8(all) != 0xffff) break;
  }
  for (; x + step <= units; x += step) {
    const auto* at = reinterpret_cast<const __m128i*>(row + std::size_t{unit} * x);
    const auto mask =
        static_cast<unsigned>(_mm_movemask_epi8(_mm_cmpeq_epi8(_mm_loadu_si128(at), wanted)));
    if (mask != 0xffff) return x + static_cast<std::uint32_t>(std::countr_one(mask)) / unit;
  }
#endif
  for (; x < units; ++x) {
    std::uint32_t other = row[std::size_t{unit} * x];
    if (unit == 4) std::memcpy(&other, row + std::size_t{4} * x, 4);
    if (other != value) break;
  }
  return x;
}

/// Undoes the filter of a row (PNG, third edition, 9.2). Returns false for an unknown one.
bool unfilter(int filter, std::uint32_t unit, const std::vector<std::uint8_t>& above,
              std::vector<std::uint8_t>& row) {
  for (std::size_t i = 0; i < row.size(); ++i) {
    const int left = i >= unit ? row[i - unit] : 0;
    const int up = above[i];
    int add = 0;
    switch (filter) {
      case 1:
        add = left;
        break;
      case 2:
        add = up;
        break;
      case 3:
        add = (left + up) / 2;
        break;
      case 4: {
        const int corner = i >= unit ? above[i - unit] : 0;
        const int a = std::abs(up - corner);
        const int b = std::abs(left - corner);
        const int c = std::abs(left + up - 2 * corner);
        add = a <= b && a <= c ? left : b <= c ? up : corner;
        break;
      }
      default:
        return false;
    }
    row[i] = static_cast<std::uint8_t>(row[i] + add);
  }
  return true;
}

/// Makes spans of rows as they come.
class RowReader {
 public:
  explicit RowReader(const Contents& contents)
      : is_colour_(contents.kind == rgba_kind),
        is_bits_(contents.depth == 1),
        width_(contents.width),
        unit_(is_colour_ ? 4 : 1),
        units_(is_bits_ ? (contents.width + 7) / 8 : contents.width) {
    image_ = {width_, 0, {0}, {}};
    image_.row_begin.reserve(std::size_t{contents.height} + 1);
    plain_.resize(stride() - 1);
  }

  [[nodiscard]] std::size_t stride() const { return 1 + std::size_t{unit_} * units_; }
  [[nodiscard]] std::uint32_t adler() const { return adler_.value(); }
  [[nodiscard]] SpanImage finish() { return std::move(image_); }

  bool take(std::span<const std::uint8_t> row) {
    const std::span<const std::uint8_t> pixels = row.subspan(1);
    const int filter = row[0];
    if (filter == 0) {
      readUnits(pixels.data());
      adler_.addRow(units_of_row_, unit_, units_);
      // The next row may be filtered.
      if (is_filtered_) std::copy(pixels.begin(), pixels.end(), plain_.begin());
    } else {
      if (!is_filtered_ && image_.height > 0) restoreAbove();
      is_filtered_ = true;
      adler_.addBytes(row);
      std::vector<std::uint8_t> next(pixels.begin(), pixels.end());
      if (!unfilter(filter, unit_, plain_, next)) return false;
      plain_ = std::move(next);
      readUnits(plain_.data());
    }
    addRow();
    return true;
  }

 private:
  void readUnits(const std::uint8_t* row) {
    units_of_row_.clear();
    for (std::uint32_t x = 0; x < units_;) {
      std::uint32_t value = row[std::size_t{unit_} * x];
      if (unit_ == 4) std::memcpy(&value, row + std::size_t{4} * x, 4);
      x = endOfRun(row, x + 1, units_, value, unit_);
      units_of_row_.push_back({x, value});
    }
  }

  /// The bytes of the last row from its spans.
  void restoreAbove() {
    std::uint32_t begin = 0;
    for (const Span& span : units_of_row_) {
      for (std::uint32_t x = begin; x < span.end; ++x)
        std::memcpy(plain_.data() + std::size_t{unit_} * x, &span.value, unit_);
      begin = span.end;
    }
  }

  void addRow() {
    const auto add = [&](std::uint32_t end, std::uint32_t value) {
      if (image_.spans.size() > image_.row_begin.back() && image_.spans.back().value == value) {
        image_.spans.back().end = end;
      } else {
        image_.spans.push_back({end, value});
      }
    };
    const auto grey = [](std::uint32_t value) {
      const auto level = static_cast<std::uint8_t>(value);
      return rgba(level, level, level);
    };
    std::uint32_t begin = 0;
    for (const Span& span : units_of_row_) {
      if (is_colour_) {
        add(span.end, span.value);
      } else if (!is_bits_) {
        add(span.end, grey(span.value));
      } else if (span.value == 0 || span.value == 255) {
        add(std::min(8 * span.end, width_), grey(span.value));
      } else {
        for (std::uint32_t x = 8 * begin; x < std::min(8 * span.end, width_); ++x)
          add(x + 1, grey((span.value >> (7 - x % 8) & 1) != 0 ? 255 : 0));
      }
      begin = span.end;
    }
    image_.row_begin.push_back(image_.spans.size());
    ++image_.height;
  }

  bool is_colour_, is_bits_;
  std::uint32_t width_;
  std::uint32_t unit_;   ///< bytes that repeat in a span
  std::uint32_t units_;  ///< in a row
  SpanImage image_;
  std::vector<Span> units_of_row_;
  std::vector<std::uint8_t> plain_;  ///< the last row, where rows are filtered
  bool is_filtered_ = false;
  RowAdler adler_;
};

}  // namespace

std::optional<ColourImage> decodePlainPng(std::span<const std::uint8_t> bytes,
                                          const SizeCheck& check) {
  const std::optional<Contents> contents = contentsOf(bytes);
  constexpr std::uint32_t widest = 1 << 24;
  if (!contents || contents->width == 0 || contents->height == 0 || contents->width > widest ||
      contents->height > widest)
    return std::nullopt;
  const bool is_known =
      contents->kind == rgba_kind
          ? contents->depth == 8
          : contents->kind == grey_kind && (contents->depth == 8 || contents->depth == 1);
  if (!is_known) return std::nullopt;
  if (check) check(contents->width, contents->height);
  std::vector<std::uint8_t> joined;
  std::span<const std::uint8_t> stream = contents->data.front();
  if (contents->data.size() > 1) {
    for (const auto& piece : contents->data)
      joined.insert(joined.end(), piece.begin(), piece.end());
    stream = joined;
  }
  // Method, window and check bits of the header, without a dictionary (RFC 1950).
  constexpr std::size_t header = 2;
  constexpr std::size_t trailer = 4;
  if (stream.size() < header + trailer || (stream[0] & 15) != 8 || stream[0] >> 4 > 7 ||
      (stream[1] & 32) != 0 || (stream[0] << 8 | stream[1]) % 31 != 0)
    return std::nullopt;
  RowReader rows(*contents);
  RowInflater inflater(rows.stride(), contents->height);
  const std::size_t read = inflater.run(
      stream.subspan(header), [&](std::span<const std::uint8_t> row) { return rows.take(row); });
  if (read == 0 || header + read + trailer != stream.size() ||
      bigEndian(stream, header + read) != rows.adler())
    return std::nullopt;
  return ColourImage{.pixels = rows.finish(),
                     .is_grey = contents->kind == grey_kind,
                     .has_opacity = contents->kind == rgba_kind,
                     .is_rgba8 = contents->kind == rgba_kind};
}

}  // namespace vdbdither
