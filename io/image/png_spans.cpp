// PNG (third edition) with a deflate stream made from spans. A row is a filter byte (none) and
// spans of units (a pixel, or a byte of pixels). Long spans are matches at the distance of a unit,
// which cost two bits for 258 bytes; what agrees with the row above is a match at the distance of a
// row; what starts a span otherwise is looked up among the spans before it, by the next six, three
// and one of them.

#include "io/image/png_spans.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>
#include <string_view>
#include <zlib.h>

#include "io/image/deflate_writer.h"
#include "io/image/row_adler.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

class SpanDeflater {
 public:
  SpanDeflater(const SpanImage& image, const PngFormat& format, std::vector<std::uint8_t>& out)
      : image_(image),
        format_(format),
        unit_(format.pixels == PngPixels::rgba8 ? 4 : 1),
        units_(format.pixels == PngPixels::grey1 ? (std::uint64_t{image.width} + 7) / 8
                                                 : image.width),
        stride_(1 + unit_ * units_),
        deflate_(out) {
    for (auto& table : seen_) table.assign(table_size, {});
    spans_.reserve(image.spans.size());
  }

  /// Writes every row and returns the Adler-32 of their bytes.
  std::uint32_t run() {
    for (std::uint32_t y = 0; y < image_.height; ++y) {
      row_begin_ = spans_.size();
      loadRow(y);
      adler_.addRow(std::span(spans_).subspan(row_begin_), unit_, units_);
      encodeRow(y);
      above_begin_ = row_begin_;
    }
    closeMatch();
    deflate_.finish();
    return adler_.value();
  }

 private:
  /// Where a span began that started with the same spans.
  struct Seen {
    std::uint64_t position = 0;  ///< in the stream, bytes; 0: none (a filter byte)
    std::uint32_t index = 0;     ///< in spans_
  };
  static constexpr int orders = 3;
  static constexpr std::size_t table_size = 4096;

  [[nodiscard]] std::uint32_t begin(std::size_t span) const {
    return span == 0 || spans_[span - 1].end == units_ ? 0 : spans_[span - 1].end;
  }
  [[nodiscard]] std::uint32_t lengthOf(std::size_t span) const {
    return spans_[span].end - begin(span);
  }
  [[nodiscard]] std::uint64_t beginByte(std::size_t span) const { return 1 + unit_ * begin(span); }
  [[nodiscard]] std::uint64_t endByte(std::size_t span) const {
    return 1 + unit_ * spans_[span].end;
  }

  void append(std::uint32_t end, std::uint32_t value) {
    if (spans_.size() > row_begin_ && spans_.back().value == value) {
      spans_.back().end = end;
    } else {
      spans_.push_back({end, value});
    }
  }

  void loadRow(std::uint32_t y) {
    const auto pixel = [&](std::uint32_t value) {
      return format_.palette.empty() ? value : format_.palette[value];
    };
    if (format_.pixels != PngPixels::grey1) {
      for (const Span& span : image_.row(y)) append(span.end, pixel(span.value));
    } else {
      packRow(y, pixel);
    }
  }

  /// Eight pixels a byte, the first one highest.
  template <typename Pixel>
  void packRow(std::uint32_t y, const Pixel& pixel) {
    std::uint32_t x = 0;
    std::uint32_t byte = 0;
    for (const Span& span : image_.row(y)) {
      const std::uint32_t ones = pixel(span.value) ? 255 : 0;
      const auto bits = [ones](std::uint32_t from, std::uint32_t to) {
        return ones & (255U >> from) & ~(255U >> to);
      };
      if (x % 8) {
        const std::uint32_t end = std::min(span.end, (x | 7) + 1);
        byte |= bits(x % 8, end - x / 8 * 8);
        x = end;
        if (x % 8) continue;
        append(x / 8, byte);
      }
      if (span.end / 8 > x / 8) append(span.end / 8, ones);
      byte = bits(0, span.end % 8);
      x = span.end;
    }
    if (x % 8) append(x / 8 + 1, byte);
  }

  /// Hashes of the spans that start at each span of the row.
  void hashRow() {
    const std::size_t size = spans_.size() - row_begin_;
    for (auto& hash : hash_) hash.resize(size);
    std::array<std::uint64_t, 6> ahead{};
    for (std::size_t i = size; i-- > 0;) {
      const Span& span = spans_[row_begin_ + i];
      const std::uint32_t length = lengthOf(row_begin_ + i);
      std::copy_backward(ahead.begin(), ahead.end() - 1, ahead.end());
      ahead[0] = (span.value + 0x9e3779b97f4a7c15U * length) * 0xbf58476d1ce4e5b9U;
      std::uint64_t hash = span.value * 0x94d049bb133111ebU;
      hash_[2][i] = slot(hash);
      for (int j = 0; j < 3; ++j) hash = std::rotl(hash, 23) + ahead[j];
      hash_[1][i] = slot(hash * 0x9e3779b97f4a7c15U);
      for (int j = 3; j < 6; ++j) hash = std::rotl(hash, 23) + ahead[j];
      hash_[0][i] = slot(hash * 0x9e3779b97f4a7c15U);
    }
  }
  static std::uint16_t slot(std::uint64_t hash) { return static_cast<std::uint16_t>(hash >> 52); }

  /// How many bytes from `byte` of the row agree with the row above, looking no further than a
  /// match reaches. `span` and `above` are the spans at that byte.
  [[nodiscard]] std::uint64_t agreement(std::uint64_t byte, std::size_t span,
                                        std::size_t above) const {
    const std::uint64_t enough = byte + DeflateWriter::max_match;
    std::uint64_t end = byte ? byte : 1;
    while (end < stride_ && end < enough && spans_[span].value == spans_[above].value) {
      const std::uint32_t span_end = spans_[span].end;
      const std::uint32_t above_end = spans_[above].end;
      end = 1 + unit_ * std::uint64_t{std::min(span_end, above_end)};
      span += span_end <= above_end;
      above += above_end <= span_end;
    }
    return std::min(end, enough) - byte;
  }

  /// The same for the spans that start at `from`, anywhere above, and at `to` in this row.
  [[nodiscard]] std::uint64_t agreementOfSpans(std::size_t from, std::size_t to) const {
    std::uint64_t bytes = 0;
    for (; spans_[from].value == spans_[to].value; ++from, ++to) {
      const std::uint32_t from_length = lengthOf(from);
      const std::uint32_t to_length = lengthOf(to);
      bytes += unit_ * std::uint64_t{std::min(from_length, to_length)};
      const bool row_ends = spans_[from].end == units_ || spans_[to].end == units_;
      if (from_length != to_length || row_ends || bytes >= DeflateWriter::max_match) break;
    }
    return std::min<std::uint64_t>(bytes, DeflateWriter::max_match);
  }

  void insertUpTo(std::size_t span, std::uint64_t row_position) {
    for (; inserted_ < span; ++inserted_) {
      const Seen here{row_position + beginByte(inserted_), static_cast<std::uint32_t>(inserted_)};
      for (int order = 0; order < orders; ++order) {
        seen_[order][hash_[order][inserted_ - row_begin_]] = here;
      }
    }
  }

  void encodeRow(std::uint32_t y);
  void closeMatch();

  const SpanImage& image_;
  const PngFormat& format_;
  const std::uint64_t unit_;    ///< bytes that repeat in a span
  const std::uint64_t units_;   ///< in a row
  const std::uint64_t stride_;  ///< bytes of a row
  DeflateWriter deflate_;

  std::vector<Span> spans_;  ///< of all rows so far, in units
  std::size_t row_begin_ = 0;
  std::size_t above_begin_ = 0;
  std::size_t inserted_ = 0;                             ///< spans before this one are in seen_
  std::array<std::vector<std::uint16_t>, orders> hash_;  ///< per order and span of the row
  std::array<std::vector<Seen>, orders> seen_;           ///< per order, by hash
  std::uint32_t open_match_ =
      0;  ///< bytes so far of a match with the row above that goes on in the next row
  RowAdler adler_;
};

void SpanDeflater::closeMatch() {
  if (open_match_) deflate_.match(open_match_, static_cast<std::uint32_t>(stride_));
  open_match_ = 0;
}

void SpanDeflater::encodeRow(std::uint32_t y) {
  constexpr std::uint64_t max_match = DeflateWriter::max_match;
  const bool comparable = y > 0 && stride_ <= DeflateWriter::window;
  const std::uint64_t row_position = y * stride_;
  hashRow();
  std::size_t span = row_begin_;
  std::size_t above = above_begin_;
  std::uint64_t byte = 0;
  const auto match_above = [&](std::uint64_t length) {
    open_match_ += static_cast<std::uint32_t>(length);
    byte += length;
    if (byte < stride_ || open_match_ == max_match) closeMatch();
  };
  while (byte < stride_) {
    while (endByte(span) <= byte) ++span;
    while (comparable && endByte(above) <= byte) ++above;
    const std::uint64_t begin_byte = beginByte(span);
    const std::uint64_t first_end = begin_byte + unit_;
    const std::uint64_t rest = byte >= first_end ? endByte(span) - byte : 0;
    if (rest >= max_match && !open_match_) {
      const auto times = static_cast<std::uint32_t>(rest / max_match);
      deflate_.match(DeflateWriter::max_match, static_cast<std::uint32_t>(unit_), times);
      byte += times * max_match;
      continue;
    }
    const std::uint64_t agreeing = comparable ? agreement(byte, span, above) : 0;
    if (open_match_) {
      match_above(std::min(agreeing, max_match - open_match_));
      continue;
    }
    if (byte == 0) {
      if (agreeing >= DeflateWriter::min_match) {
        match_above(agreeing);
      } else {
        deflate_.literal(0);
        ++byte;
      }
      continue;
    }
    if (rest >= DeflateWriter::min_match && rest >= agreeing) {
      deflate_.match(static_cast<std::uint32_t>(rest), static_cast<std::uint32_t>(unit_));
      byte += rest;
      continue;
    }
    std::uint64_t best = std::max<std::uint64_t>(agreeing, DeflateWriter::min_match - 1);
    std::uint64_t distance = 0;
    if (byte == begin_byte && agreeing < max_match) {
      insertUpTo(span, row_position);
      for (int order = 0; order < orders; ++order) {
        const Seen& seen = seen_[order][hash_[order][span - row_begin_]];
        const std::uint64_t seen_distance = row_position + byte - seen.position;
        if (!seen.position || seen_distance > DeflateWriter::window) continue;
        if (const std::uint64_t length = agreementOfSpans(seen.index, span); length > best) {
          best = length;
          distance = seen_distance;
        }
      }
    }
    if (distance) {
      deflate_.match(static_cast<std::uint32_t>(best), static_cast<std::uint32_t>(distance));
      byte += best;
    } else if (agreeing >= DeflateWriter::min_match) {
      match_above(agreeing);
    } else {
      const std::uint64_t end = byte < first_end ? first_end : endByte(span);
      for (; byte < end; ++byte) {
        deflate_.literal(
            static_cast<std::uint8_t>(spans_[span].value >> (8 * ((byte - 1) % unit_))));
      }
    }
  }
  insertUpTo(spans_.size(), row_position);
}

void putBigEndian(std::vector<std::uint8_t>& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out.push_back(static_cast<std::uint8_t>(value >> shift));
}

/// Opens a chunk; `endChunk` with what it returned fills in the length and adds the CRC.
std::size_t beginChunk(std::vector<std::uint8_t>& out, std::string_view name) {
  putBigEndian(out, 0);
  out.insert(out.end(), name.begin(), name.end());
  return out.size();
}

void endChunk(std::vector<std::uint8_t>& out, std::size_t begin) {
  const auto size = static_cast<std::uint32_t>(out.size() - begin);
  for (int i = 0; i < 4; ++i) out[begin - 8 + i] = static_cast<std::uint8_t>(size >> (24 - 8 * i));
  putBigEndian(out, static_cast<std::uint32_t>(crc32_z(0, out.data() + begin - 4, size + 4)));
}

}  // namespace

std::vector<std::uint8_t> encodePng(const SpanImage& image, const PngFormat& format) {
  constexpr std::uint32_t largest = 1 << 24;
  if (image.width == 0 || image.height == 0 || image.width > largest || image.height > largest) {
    throw DataError("an image of " + std::to_string(image.width) + " x " +
                    std::to_string(image.height) +
                    " pixels cannot be a PNG; each side must have 1 to " + std::to_string(largest));
  }
  static constexpr std::array<std::uint8_t, 8> signature = {0x89, 'P',  'N',  'G',
                                                            '\r', '\n', 0x1a, '\n'};
  std::vector<std::uint8_t> out(signature.begin(), signature.end());

  std::size_t chunk = beginChunk(out, "IHDR");
  putBigEndian(out, image.width);
  putBigEndian(out, image.height);
  out.push_back(format.pixels == PngPixels::grey1 ? 1 : 8);
  out.push_back(format.pixels == PngPixels::rgba8 ? 6 : 0);
  out.insert(out.end(), {0, 0, 0});
  endChunk(out, chunk);

  if (format.pixel_width_mm > 0 && format.pixel_height_mm > 0) {
    chunk = beginChunk(out, "pHYs");
    putBigEndian(out, static_cast<std::uint32_t>(std::lround(1000 / format.pixel_width_mm)));
    putBigEndian(out, static_cast<std::uint32_t>(std::lround(1000 / format.pixel_height_mm)));
    out.push_back(1);
    endChunk(out, chunk);
  }

  chunk = beginChunk(out, "IDAT");
  out.insert(out.end(), {0x78, 0xda});
  const std::uint32_t adler = SpanDeflater(image, format, out).run();
  putBigEndian(out, adler);
  if (out.size() - chunk >= std::size_t{1} << 31)
    throw DataError("an image is too large for one PNG chunk");
  endChunk(out, chunk);

  endChunk(out, beginChunk(out, "IEND"));
  return out;
}

}  // namespace vdbdither
