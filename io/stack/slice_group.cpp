#include "io/stack/slice_group.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>
#include <utility>
#include <zlib.h>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

constexpr std::size_t margin = 8;       ///< empty pixels around a plane
constexpr std::size_t contexts = 1024;  ///< patterns of ten neighbours
constexpr std::size_t candidates = 4;   ///< neighbours that can predict a pixel
constexpr std::size_t gap_classes = 3;  ///< classes of contexts whose misses are counted by gaps
constexpr std::size_t classes = 4;      ///< the last has a bit for each pixel
constexpr std::size_t header = contexts + 4 * (classes + 1);

/// The pixels of a crop of a slice, with a margin of 0.
class Plane {
 public:
  explicit Plane(const SliceGroup& crop)
      : crop_(&crop), stride_(crop.width + 2 * margin), pixels_(stride_ * (crop.height + 2)) {}

  void draw(const SpanImage& image) {
    for (std::uint32_t y = 0; y < crop_->height; ++y) {
      std::uint32_t begin = 0;
      std::uint8_t* to = row(y);
      for (const Span& span : image.row(crop_->top + y)) {
        const std::uint32_t from = std::max(begin, crop_->left);
        const std::uint32_t end = std::min(span.end, crop_->left + crop_->width);
        if (from < end)
          std::memset(to + (from - crop_->left), static_cast<int>(span.value), end - from);
        begin = span.end;
      }
    }
  }
  /// Column 0 of row `y`, from -1 to the height.
  [[nodiscard]] std::uint8_t* row(std::ptrdiff_t y) {
    return pixels_.data() + (y + 1) * static_cast<std::ptrdiff_t>(stride_) + margin;
  }

 private:
  const SliceGroup* crop_;
  std::size_t stride_;
  std::vector<std::uint8_t> pixels_;
};

/// What surrounds a pixel: the rows around it in the slice itself and in the one that predicts it.
struct Rows {
  const std::uint8_t* here;
  const std::uint8_t* above;  ///< of the same slice
  const std::uint8_t* base_above;
  const std::uint8_t* base;
  const std::uint8_t* base_below;

  [[nodiscard]] std::size_t context(std::ptrdiff_t x) const {
    const std::uint8_t b = base[x];
    return (here[x - 1] != b) | (above[x] != b) << 1 | (base[x + 1] != b) << 2 |
           (base_below[x] != b) << 3 | (above[x + 1] != b) << 4 | (above[x - 1] != b) << 5 |
           (base[x - 1] != b) << 6 | (base_above[x] != b) << 7 | (here[x - 2] != b) << 8 |
           (b != 0) << 9;
  }
  [[nodiscard]] std::array<std::uint8_t, candidates> predictions(std::ptrdiff_t x) const {
    return {base[x], here[x - 1], above[x], base[x + 1]};
  }
  /// Whether the eight pixels from `x` on, and all that predicts them, are alike.
  [[nodiscard]] bool isFlat(std::ptrdiff_t x) const {
    const std::uint64_t all = std::uint64_t{0x0101010101010101} * base[x];
    const auto differs = [&](const std::uint8_t* at) {
      std::uint64_t eight = 0;
      std::memcpy(&eight, at, 8);
      return eight ^ all;
    };
    return (differs(here + x) | differs(here + x - 2) | differs(base + x - 1) |
            differs(base + x + 1) | differs(above + x - 1) | differs(above + x + 1) |
            differs(base_above + x) | differs(base_below + x)) == 0;
  }
};

/// Walks over the pixels of all slices: calls `pixel(rows, x)`, or `flat(value)` for eight at once.
template <typename Flat, typename Pixel>
void scan(const SliceGroup& group, std::span<const SpanImage* const> slices,
          std::span<const SpanImage* const> base, const Flat& flat, const Pixel& pixel) {
  Plane here(group);
  Plane before(group);
  const auto width = static_cast<std::ptrdiff_t>(group.width);
  for (std::size_t z = 0; z < slices.size(); ++z) {
    throwIfInterrupted();
    std::swap(here, before);
    here.draw(*slices[z]);
    if (!base.empty()) before.draw(*base[z]);
    for (std::ptrdiff_t y = 0; y < static_cast<std::ptrdiff_t>(group.height); ++y) {
      const Rows rows{here.row(y), here.row(y - 1), before.row(y - 1), before.row(y),
                      before.row(y + 1)};
      for (std::ptrdiff_t x = 0; x < width;) {
        if (x + 8 <= width && rows.isFlat(x)) {
          flat(rows.base[x]);
          x += 8;
        } else {
          pixel(rows, x++);
        }
      }
    }
  }
}

/// How the pixels of a context are predicted.
struct Rule {
  std::uint8_t candidate = 0;
  std::uint8_t group = 0;  ///< 0: the prediction is always right; else the number of its class
};
using Rules = std::array<Rule, contexts>;

constexpr std::size_t flatContext(std::uint8_t value) { return value ? contexts / 2 : 0; }

Rules rulesFor(const SliceGroup& group, std::span<const SpanImage* const> slices,
               std::span<const SpanImage* const> base) {
  struct Count {
    std::uint64_t pixels = 0;
    std::array<std::uint64_t, candidates> hits{};
  };
  std::vector<Count> counts(contexts);
  std::array<std::uint64_t, 2> flats{};
  scan(
      group, slices, base, [&](std::uint8_t value) { flats[value ? 1 : 0] += 8; },
      [&](const Rows& rows, std::ptrdiff_t x) {
        Count& count = counts[rows.context(x)];
        ++count.pixels;
        const auto predictions = rows.predictions(x);
        for (std::size_t i = 0; i < candidates; ++i)
          count.hits[i] += predictions[i] == rows.here[x];
      });
  for (std::size_t i = 0; i < flats.size(); ++i) {
    Count& count = counts[flatContext(static_cast<std::uint8_t>(i))];
    count.pixels += flats[i];
    for (std::uint64_t& hits : count.hits) hits += flats[i];
  }
  Rules rules;
  for (std::size_t context = 0; context < contexts; ++context) {
    const Count& count = counts[context];
    const auto* best = std::max_element(count.hits.begin(), count.hits.end());
    const std::uint64_t misses = count.pixels - *best;
    // Misses that are rare are cheap as gaps; the classes keep gaps of one size together.
    rules[context] = {static_cast<std::uint8_t>(best - count.hits.begin()),
                      static_cast<std::uint8_t>(misses == 0                        ? 0
                                                : misses * 100 < count.pixels      ? 1
                                                : misses * 100 < count.pixels * 5  ? 2
                                                : misses * 100 < count.pixels * 15 ? 3
                                                                                   : 4)};
  }
  return rules;
}

void putGap(std::vector<std::uint8_t>& out, std::uint64_t gap) {
  for (; gap >= 128; gap >>= 7) out.push_back(static_cast<std::uint8_t>((gap & 127) | 128));
  out.push_back(static_cast<std::uint8_t>(gap));
}

void putNumber(std::vector<std::uint8_t>& out, std::uint64_t number) {
  for (int shift = 0; shift < 32; shift += 8)
    out.push_back(static_cast<std::uint8_t>(number >> shift));
}

/// Where the predictions miss, and what is there instead.
struct Misses {
  std::array<std::vector<std::uint8_t>, gap_classes> gaps;
  std::array<std::uint64_t, gap_classes> hits{};  ///< since the last miss
  std::vector<std::uint8_t> bits;
  std::size_t bit_count = 0;
  std::vector<std::uint8_t> values;

  void note(std::uint8_t group, bool miss) {
    if (group == classes) {
      if (bit_count % 8 == 0) bits.push_back(0);
      if (miss) bits.back() |= static_cast<std::uint8_t>(1U << bit_count % 8);
      ++bit_count;
    } else if (miss) {
      putGap(gaps[group - 1], std::exchange(hits[group - 1], 0));
    } else {
      ++hits[group - 1];
    }
  }
};

Misses missesOf(const SliceGroup& group, std::span<const SpanImage* const> slices,
                std::span<const SpanImage* const> base, const Rules& rules, std::uint32_t values) {
  Misses misses;
  scan(
      group, slices, base,
      [&](std::uint8_t value) {
        const Rule& rule = rules[flatContext(value)];
        for (int i = 0; rule.group && i < 8; ++i) misses.note(rule.group, false);
      },
      [&](const Rows& rows, std::ptrdiff_t x) {
        const Rule& rule = rules[rows.context(x)];
        if (rule.group == 0) return;
        const std::uint8_t expected = rows.predictions(x)[rule.candidate];
        const std::uint8_t value = rows.here[x];
        misses.note(rule.group, value != expected);
        if (value != expected && values > 1)
          misses.values.push_back(value < expected ? value : value - 1);
      });
  return misses;
}

std::vector<std::uint8_t> inflated(std::span<const std::uint8_t> bytes) {
  z_stream stream{};
  if (inflateInit2(&stream, -15) != Z_OK) throw std::bad_alloc();
  stream.next_in = const_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::vector<std::uint8_t> out;
  std::array<std::uint8_t, 1 << 16> buffer;
  int state = Z_OK;
  while (state == Z_OK) {
    stream.next_out = buffer.data();
    stream.avail_out = buffer.size();
    state = inflate(&stream, Z_NO_FLUSH);
    out.insert(out.end(), buffer.data(), stream.next_out);
  }
  inflateEnd(&stream);
  if (state != Z_STREAM_END) throw std::logic_error("a group of slices is not whole");
  return out;
}

SliceGroup cropOf(std::span<const SpanImage* const> slices) {
  std::uint32_t left = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t top = left;
  std::uint32_t right = 0;
  std::uint32_t bottom = 0;
  for (const SpanImage* slice : slices) {
    for (std::uint32_t y = 0; y < slice->height; ++y) {
      std::uint32_t begin = 0;
      for (const Span& span : slice->row(y)) {
        if (span.value) {
          left = std::min(left, begin), right = std::max(right, span.end);
          top = std::min(top, y), bottom = std::max(bottom, y + 1);
        }
        begin = span.end;
      }
    }
  }
  SliceGroup group;
  group.slices = static_cast<std::uint32_t>(slices.size());
  if (right > 0)
    group.left = left, group.top = top, group.width = right - left, group.height = bottom - top;
  return group;
}

/// Reads what `Misses` noted.
class MissReader {
 public:
  explicit MissReader(std::vector<std::uint8_t> bytes) : bytes_(std::move(bytes)) {
    std::size_t at = header;
    for (std::size_t i = 0; i <= classes; ++i) {
      std::uint32_t size = 0;
      for (int byte = 0; byte < 4; ++byte)
        size |= static_cast<std::uint32_t>(bytes_[contexts + 4 * i + byte]) << 8 * byte;
      next_[i] = at;
      at += size;
      end_[i] = at;
    }
    for (std::size_t i = 0; i < gap_classes; ++i) readGap(i);
  }

  [[nodiscard]] std::uint8_t rule(std::size_t context) const { return bytes_[context]; }
  bool isMiss(std::size_t group) {
    if (group == classes) {
      const bool miss = bytes_[next_[classes - 1]] >> bit_ & 1;
      if (++bit_ == 8) bit_ = 0, ++next_[classes - 1];
      return miss;
    }
    if (hits_[group - 1]-- > 0) return false;
    readGap(group - 1);
    return true;
  }
  std::uint8_t value() { return bytes_[next_[classes]++]; }

 private:
  void readGap(std::size_t i) {
    hits_[i] = std::numeric_limits<std::int64_t>::max();
    if (next_[i] == end_[i]) return;
    hits_[i] = 0;
    for (int shift = 0;; shift += 7) {
      const std::uint8_t byte = bytes_[next_[i]++];
      hits_[i] |= static_cast<std::int64_t>(byte & 127) << shift;
      if (byte < 128) return;
    }
  }

  std::vector<std::uint8_t> bytes_;
  std::array<std::size_t, classes + 1> next_{}, end_{};
  std::array<std::int64_t, gap_classes> hits_{};
  int bit_ = 0;
};

SpanImage spansOf(Plane& plane, const SliceGroup& crop, std::uint32_t width, std::uint32_t height) {
  SpansBuilder spans(width);
  for (std::uint32_t y = 0; y < height; ++y) {
    spans.pixel(0, 0);
    if (y >= crop.top && y < crop.top + crop.height) {
      const std::uint8_t* row = plane.row(y - crop.top);
      for (std::uint32_t x = 0; x < crop.width; ++x) spans.pixel(crop.left + x, row[x]);
      if (crop.left + crop.width < width) spans.pixel(crop.left + crop.width, 0);
    }
    spans.endRow();
  }
  return spans.finish();
}

}  // namespace

std::vector<std::uint8_t> deflated(std::span<const std::span<const std::uint8_t>> pieces) {
  z_stream stream{};
  if (deflateInit2(&stream, 6, Z_DEFLATED, -15, 9, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::bad_alloc();
  std::vector<std::uint8_t> out;
  std::array<std::uint8_t, 1 << 14> buffer;
  const auto run = [&](int flush) {
    do {
      stream.next_out = buffer.data();
      stream.avail_out = buffer.size();
      deflate(&stream, flush);
      out.insert(out.end(), buffer.data(), stream.next_out);
    } while (stream.avail_out == 0);
  };
  for (const std::span<const std::uint8_t> piece : pieces) {
    if (piece.empty()) continue;
    stream.next_in = const_cast<Bytef*>(piece.data());
    stream.avail_in = static_cast<uInt>(piece.size());
    run(Z_BLOCK);
  }
  run(Z_FINISH);
  deflateEnd(&stream);
  return out;
}

SliceGroup packSlices(std::span<const SpanImage* const> slices, std::uint32_t values,
                      std::span<const SpanImage* const> base) {
  SliceGroup group = cropOf(slices);
  if (group.width == 0) return group;
  const Rules rules = rulesFor(group, slices, base);
  const Misses misses = missesOf(group, slices, base, rules, values);
  std::vector<std::uint8_t> head;
  for (const Rule& rule : rules)
    head.push_back(static_cast<std::uint8_t>(rule.candidate | rule.group << 2));
  std::vector<std::span<const std::uint8_t>> pieces{{}};
  for (const std::vector<std::uint8_t>& gaps : misses.gaps) pieces.emplace_back(gaps);
  pieces.emplace_back(misses.bits);
  pieces.emplace_back(misses.values);
  for (std::size_t i = 1; i < pieces.size(); ++i) {
    if (pieces[i].size() > std::numeric_limits<std::int32_t>::max())
      throw DataError("slices of this size are too large for a page");
    putNumber(head, pieces[i].size());
  }
  pieces[0] = head;
  group.bytes = deflated(pieces);
  return group;
}

std::vector<SpanImage> unpackSlices(const SliceGroup& group, std::uint32_t width,
                                    std::uint32_t height, std::uint32_t values,
                                    std::span<const SpanImage* const> base) {
  std::vector<SpanImage> slices;
  Plane here(group);
  Plane before(group);
  if (group.width == 0) {
    slices.assign(group.slices, spansOf(here, group, width, height));
    return slices;
  }
  MissReader misses(inflated(group.bytes));
  for (std::size_t z = 0; z < group.slices; ++z) {
    throwIfInterrupted();
    std::swap(here, before);
    if (!base.empty()) before.draw(*base[z]);
    for (std::ptrdiff_t y = 0; y < static_cast<std::ptrdiff_t>(group.height); ++y) {
      std::uint8_t* row = here.row(y);
      const Rows rows{row, here.row(y - 1), before.row(y - 1), before.row(y), before.row(y + 1)};
      for (std::ptrdiff_t x = 0; x < static_cast<std::ptrdiff_t>(group.width); ++x) {
        const std::uint8_t rule = misses.rule(rows.context(x));
        std::uint8_t value = rows.predictions(x)[rule & 3];
        if (rule >> 2 && misses.isMiss(rule >> 2)) {
          const std::uint8_t other = values > 1 ? misses.value() : 0;
          value = static_cast<std::uint8_t>(other < value ? other : other + 1);
        }
        row[x] = value;
      }
    }
    slices.push_back(spansOf(here, group, width, height));
  }
  return slices;
}

}  // namespace vdbdither
