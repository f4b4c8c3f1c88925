#include "io/image/row_inflater.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace vdbdither {

namespace {

constexpr std::size_t window = 32768;
constexpr std::size_t longest_match = 258;
/// What copies may write beyond their end.
constexpr std::size_t slack = 64;

// RFC 1951, 3.2.5.
constexpr std::array<std::uint16_t, 29> length_base{3,  4,  5,  6,   7,   8,   9,   10,  11, 13,
                                                    15, 17, 19, 23,  27,  31,  35,  43,  51, 59,
                                                    67, 83, 99, 115, 131, 163, 195, 227, 258};
constexpr std::array<std::uint8_t, 29> length_extra{0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2,
                                                    2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0};
constexpr std::array<std::uint16_t, 30> distance_base{
    1,   2,   3,   4,   5,   7,    9,    13,   17,   25,   33,   49,   65,    97,    129,
    193, 257, 385, 513, 769, 1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};
constexpr std::array<std::uint8_t, 30> distance_extra{0, 0, 0,  0,  1,  1,  2,  2,  3,  3,
                                                      4, 4, 5,  5,  6,  6,  7,  7,  8,  8,
                                                      9, 9, 10, 10, 11, 11, 12, 12, 13, 13};
// 3.2.7.
constexpr std::array<std::uint8_t, 19> length_order{16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                    11, 4,  12, 3, 13, 2, 14, 1, 15};

}  // namespace

RowInflater::RowInflater(std::size_t stride, std::size_t rows) : stride_(stride), rows_left_(rows) {
  constexpr std::size_t least = std::size_t{1} << 17;
  buffer_.resize(window + std::max(2 * stride, least) + longest_match + slack);
  next_ = buffer_.data();
  row_ = next_;
  full_ = buffer_.data() + buffer_.size() - longest_match - slack;
}

/// Bits behind the end are 0; whoever uses them meets a damaged stream.
void RowInflater::refill() {
  if (at_ + 8 <= stream_.size()) {
    std::uint64_t word = 0;
    std::memcpy(&word, stream_.data() + at_, sizeof word);
    bits_ |= word << bit_count_;
    at_ += static_cast<std::size_t>((63 - bit_count_) >> 3);
    bit_count_ |= 56;
    return;
  }
  while (bit_count_ <= 56) {
    if (at_ < stream_.size()) {
      bits_ |= std::uint64_t{stream_[at_++]} << bit_count_;
    } else {
      beyond_ += 8;
    }
    bit_count_ += 8;
  }
}

std::uint32_t RowInflater::take(int count) {
  const auto value = static_cast<std::uint32_t>(bits_ & ((std::uint64_t{1} << count) - 1));
  bits_ >>= count;
  bit_count_ -= count;
  return value;
}

inline RowInflater::Entry RowInflater::decode(const Table& table) {
  constexpr std::uint64_t first_mask = (1 << first_bits) - 1;
  Entry entry = table[bits_ & first_mask];
  if (entry.kind == link) [[unlikely]] {
    constexpr std::uint64_t rest_mask = (1 << (most_bits - first_bits)) - 1;
    entry = table[entry.value + (bits_ >> first_bits & rest_mask)];
  }
  bits_ >>= entry.bits;
  bit_count_ -= entry.bits;
  return entry;
}

bool RowInflater::makeTable(std::span<const std::uint8_t> lengths,
                            const std::function<Entry(std::size_t symbol)>& entry_of,
                            Table& table) {
  std::array<std::uint32_t, most_bits + 2> count{};
  for (const std::uint8_t length : lengths) ++count[length];
  count[0] = 0;
  std::uint32_t used = 0;
  std::uint32_t codes = 0;
  std::array<std::uint32_t, most_bits + 2> next{};
  for (int bits = 1; bits <= most_bits; ++bits) {
    next[bits] = (next[bits - 1] + count[bits - 1]) << 1;
    used += count[bits] << (most_bits - bits);
    codes += count[bits];
  }
  constexpr std::uint32_t all = 1 << most_bits;
  // Only a single code may leave others unused.
  if (used > all || (used < all && codes > 1)) return false;
  constexpr std::size_t rest_size = 1 << (most_bits - first_bits);
  table.assign(std::size_t{1} << first_bits, {0, 1, invalid});
  for (std::size_t symbol = 0; symbol < lengths.size(); ++symbol) {
    const int bits = lengths[symbol];
    if (bits == 0) continue;
    std::uint32_t code = 0;
    for (std::uint32_t forward = next[bits]++, i = 0; i < static_cast<std::uint32_t>(bits); ++i)
      code |= (forward >> i & 1) << (bits - 1 - static_cast<int>(i));
    Entry entry = entry_of(symbol);
    entry.bits = static_cast<std::uint8_t>(bits);
    if (bits <= first_bits) {
      for (std::size_t i = code; i < std::size_t{1} << first_bits; i += std::size_t{1} << bits)
        table[i] = entry;
      continue;
    }
    const std::size_t first = code & ((1 << first_bits) - 1);
    if (table[first].kind != link) {
      table[first] = {static_cast<std::uint16_t>(table.size()), 0, link};
      table.resize(table.size() + rest_size, {0, 1, invalid});
    }
    const std::size_t rest = table[first].value;
    for (std::size_t i = code >> first_bits; i < rest_size;
         i += std::size_t{1} << (bits - first_bits))
      table[rest + i] = entry;
  }
  return true;
}

bool RowInflater::fixedTables() {
  std::array<std::uint8_t, 288> lengths{};
  for (std::size_t i = 0; i < lengths.size(); ++i)
    lengths[i] = static_cast<std::uint8_t>(i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : 8);
  std::array<std::uint8_t, 32> distances{};
  distances.fill(5);
  const auto lengthEntry = [](std::size_t symbol) -> Entry {
    if (symbol < 256) return {static_cast<std::uint16_t>(symbol), 0, literal};
    if (symbol == 256) return {0, 0, end_of_block};
    if (symbol - 257 >= length_base.size()) return {0, 0, invalid};
    return {length_base[symbol - 257], 0, length_extra[symbol - 257]};
  };
  const auto distanceEntry = [](std::size_t symbol) -> Entry {
    if (symbol >= distance_base.size()) return {0, 0, invalid};
    return {distance_base[symbol], 0, distance_extra[symbol]};
  };
  return makeTable(lengths, lengthEntry, lengths_) &&
         makeTable(distances, distanceEntry, distances_);
}

bool RowInflater::dynamicTables() {
  refill();
  const std::size_t length_count = 257 + take(5);
  const std::size_t distance_count = 1 + take(5);
  const std::size_t code_count = 4 + take(4);
  if (length_count > 286 || distance_count > 30) return false;
  std::array<std::uint8_t, 19> code_lengths{};
  for (std::size_t i = 0; i < code_count; ++i) {
    refill();
    code_lengths[length_order[i]] = static_cast<std::uint8_t>(take(3));
  }
  Table codes;
  if (!makeTable(
          code_lengths,
          [](std::size_t symbol) {
            return Entry{static_cast<std::uint16_t>(symbol), 0, literal};
          },
          codes))
    return false;
  std::array<std::uint8_t, 286 + 30> lengths{};
  for (std::size_t i = 0; i < length_count + distance_count;) {
    refill();
    const Entry entry = decode(codes);
    if (entry.kind != literal) return false;
    if (entry.value < 16) {
      lengths[i++] = static_cast<std::uint8_t>(entry.value);
      continue;
    }
    if (entry.value == 16 && i == 0) return false;
    const std::uint8_t repeated = entry.value == 16 ? lengths[i - 1] : 0;
    const std::size_t times = entry.value == 16   ? 3 + take(2)
                              : entry.value == 17 ? 3 + take(3)
                                                  : 11 + take(7);
    if (i + times > length_count + distance_count) return false;
    for (std::size_t k = 0; k < times; ++k) lengths[i++] = repeated;
  }
  if (lengths[256] == 0) return false;
  const auto lengthEntry = [](std::size_t symbol) -> Entry {
    if (symbol < 256) return {static_cast<std::uint16_t>(symbol), 0, literal};
    if (symbol == 256) return {0, 0, end_of_block};
    return {length_base[symbol - 257], 0, length_extra[symbol - 257]};
  };
  const auto distanceEntry = [](std::size_t symbol) -> Entry {
    return {distance_base[symbol], 0, distance_extra[symbol]};
  };
  const std::span all(lengths);
  return makeTable(all.first(length_count), lengthEntry, lengths_) &&
         makeTable(all.subspan(length_count, distance_count), distanceEntry, distances_);
}

/// Copies a match, up to 16 bytes beyond its end.
inline void RowInflater::copy(std::size_t length, std::size_t distance) {
  std::uint8_t* const end = next_ + length;
  const std::uint8_t* from = next_ - distance;
  if (distance >= 16) {
    for (; next_ < end; next_ += 16, from += 16) std::memcpy(next_, from, 16);
  } else if (std::has_single_bit(distance)) {
    // Few bytes again and again: a pattern of 16 bytes.
    std::array<std::uint8_t, 16> pattern{};
    std::memcpy(pattern.data(), from, distance);
    for (std::size_t size = distance; size < 16; size *= 2)
      std::memcpy(pattern.data() + size, pattern.data(), size);
    for (; next_ < end; next_ += 16) std::memcpy(next_, pattern.data(), 16);
  } else {
    while (next_ < end) *next_++ = *from++;
  }
  next_ = end;
}

/// Passes on the rows that are complete, and moves the window to the front.
bool RowInflater::flush(const Take& take) {
  while (next_ - row_ >= static_cast<std::ptrdiff_t>(stride_)) {
    if (rows_left_ == 0 || !take({row_, stride_})) return false;
    --rows_left_;
    row_ += stride_;
  }
  const std::size_t held = static_cast<std::size_t>(next_ - buffer_.data());
  const std::size_t kept = std::min(held, std::max(window, static_cast<std::size_t>(next_ - row_)));
  if (kept < held) {
    std::memmove(buffer_.data(), next_ - kept, kept);
    row_ -= held - kept;
    next_ -= held - kept;
  }
  return true;
}

bool RowInflater::symbols(const Take& take_rows) {
  for (;;) {
    if (next_ > full_ && !flush(take_rows)) return false;
    refill();
    const Entry entry = decode(lengths_);
    if (entry.kind == literal) {
      *next_++ = static_cast<std::uint8_t>(entry.value);
      continue;
    }
    if (entry.kind >= end_of_block) return entry.kind == end_of_block && beyond_ <= bit_count_;
    const std::size_t length = entry.value + take(entry.kind);
    const Entry far = decode(distances_);
    if (far.kind >= literal) return false;
    const std::size_t distance = far.value + take(far.kind);
    if (distance > static_cast<std::size_t>(next_ - buffer_.data()) || beyond_ > bit_count_)
      return false;
    copy(length, distance);
  }
}

bool RowInflater::stored() {
  // Whole bytes that were read ahead go back.
  take(bit_count_ % 8);
  if (beyond_ > bit_count_) return false;
  at_ -= static_cast<std::size_t>((bit_count_ - beyond_) / 8);
  bits_ = 0;
  bit_count_ = 0;
  beyond_ = 0;
  return true;
}

std::size_t RowInflater::run(std::span<const std::uint8_t> stream, const Take& take_rows) {
  stream_ = stream;
  for (bool is_last = false; !is_last;) {
    refill();
    is_last = take(1) != 0;
    const std::uint32_t kind = take(2);
    if (kind == 0) {
      if (!stored() || at_ + 4 > stream_.size()) return 0;
      const std::size_t size = stream_[at_] | stream_[at_ + 1] << 8;
      const std::size_t inverted = stream_[at_ + 2] | stream_[at_ + 3] << 8;
      at_ += 4;
      if ((size ^ inverted) != 0xffff || size > stream_.size() - at_) return 0;
      for (std::size_t i = 0; i < size; ++i) {
        if (next_ > full_ && !flush(take_rows)) return 0;
        *next_++ = stream_[at_++];
      }
    } else if (kind == 3 || !(kind == 1 ? fixedTables() : dynamicTables()) || !symbols(take_rows)) {
      return 0;
    }
  }
  if (!stored() || !flush(take_rows) || rows_left_ > 0 || row_ != next_) return 0;
  return at_;
}

}  // namespace vdbdither
