// Deflate: RFC 1951. Code lengths: A. Moffat, J. Katajainen, "In-place calculation of
// minimum-redundancy codes", WADS 1995, cut to the greatest length by shifting weight between the
// lengths.

#include "io/image/deflate_writer.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>

namespace vdbdither {

namespace {

constexpr int end_of_block = 256;

/// The symbol of a length or a distance, and the bits that follow it.
struct Bucket {
  std::uint16_t symbol;
  std::uint8_t extra_count;
  std::uint16_t extra;
};

Bucket lengthBucket(std::uint32_t length) {
  if (length == DeflateWriter::max_match) return {285, 0, 0};
  const std::uint32_t offset = length - DeflateWriter::min_match;
  if (offset < 8) return {static_cast<std::uint16_t>(257 + offset), 0, 0};
  const int extra = std::bit_width(offset) - 3;
  return {static_cast<std::uint16_t>(257 + 4 * extra + (offset >> extra)),
          static_cast<std::uint8_t>(extra),
          static_cast<std::uint16_t>(offset & ((1U << extra) - 1))};
}

Bucket distanceBucket(std::uint32_t distance) {
  const std::uint32_t offset = distance - 1;
  if (offset < 4) return {static_cast<std::uint16_t>(offset), 0, 0};
  const int extra = std::bit_width(offset) - 2;
  return {static_cast<std::uint16_t>(2 * extra + (offset >> extra)),
          static_cast<std::uint8_t>(extra),
          static_cast<std::uint16_t>(offset & ((1U << extra) - 1))};
}

/// A prefix code: per symbol its bits, first bit lowest, and their number (0: unused).
template <std::size_t Size>
struct PrefixCode {
  std::array<std::uint16_t, Size> bits{};
  std::array<std::uint8_t, Size> length{};
};

/// Depths of the leaves of a Huffman tree over `weights`, which rise; in place, deepest
/// last-to-first.
void huffmanDepths(std::span<std::uint32_t> weights) {
  const int n = static_cast<int>(weights.size());
  weights[0] += weights[1];
  int root = 0;
  int leaf = 2;
  for (int next = 1; next < n - 1; ++next) {
    const auto take = [&]() -> std::uint32_t {
      if (leaf >= n || (root < next && weights[root] < weights[leaf])) {
        const std::uint32_t weight = weights[root];
        weights[root++] = next;
        return weight;
      }
      return weights[leaf++];
    };
    const std::uint32_t first = take();
    weights[next] = first + take();
  }
  weights[n - 2] = 0;
  for (int next = n - 3; next >= 0; --next) weights[next] = weights[weights[next]] + 1;
  int available = 1;
  int used = 0;
  int inner = n - 2;
  int next = n - 1;
  for (std::uint32_t depth = 0; available > 0; ++depth) {
    while (inner >= 0 && weights[inner] == depth) {
      ++used;
      --inner;
    }
    while (available > used) {
      weights[next--] = depth;
      --available;
    }
    available = 2 * used;
    used = 0;
  }
}

/// A code no longer than `limit` bits for symbols that occur `counts` times. Never fewer than two
/// symbols get a code, as some decoders refuse an incomplete one.
template <std::size_t Size>
PrefixCode<Size> prefixCode(const std::array<std::uint32_t, Size>& counts, int limit) {
  struct Entry {
    std::uint32_t count;
    std::uint16_t symbol;
  };
  std::array<Entry, Size> entries;
  std::size_t size = 0;
  for (std::size_t symbol = 0; symbol < Size; ++symbol) {
    if (counts[symbol]) entries[size++] = {counts[symbol], static_cast<std::uint16_t>(symbol)};
  }
  for (std::uint16_t symbol = 0; size < 2; ++symbol) {
    if (!counts[symbol]) entries[size++] = {1, symbol};
  }
  std::sort(entries.begin(), entries.begin() + size, [](const Entry& a, const Entry& b) {
    return a.count != b.count ? a.count < b.count : a.symbol < b.symbol;
  });
  std::array<std::uint32_t, Size> depths;
  for (std::size_t i = 0; i < size; ++i) depths[i] = entries[i].count;
  huffmanDepths(std::span(depths).first(size));

  std::array<int, 16> of_length{};
  for (std::size_t i = 0; i < size; ++i) ++of_length[std::min<int>(depths[i], limit)];
  std::int64_t excess = -(std::int64_t{1} << limit);
  for (int length = 1; length <= limit; ++length)
    excess += std::int64_t{of_length[length]} << (limit - length);
  for (; excess > 0; --excess) {
    int length = limit - 1;
    while (!of_length[length]) --length;
    --of_length[length];
    of_length[length + 1] += 2;
    --of_length[limit];
  }

  PrefixCode<Size> code;
  std::size_t rarest = 0;
  for (int length = limit; length > 0; --length) {
    for (int i = 0; i < of_length[length]; ++i) {
      code.length[entries[rarest++].symbol] = static_cast<std::uint8_t>(length);
    }
  }
  std::array<std::uint32_t, 17> next{};
  for (int length = 1; length <= limit; ++length) {
    next[length + 1] = (next[length] + of_length[length]) << 1;
  }
  for (std::size_t symbol = 0; symbol < Size; ++symbol) {
    const int length = code.length[symbol];
    if (!length) continue;
    std::uint32_t bits = next[length]++;
    for (int i = 0; i < length; ++i, bits >>= 1) {
      code.bits[symbol] = static_cast<std::uint16_t>(code.bits[symbol] << 1 | (bits & 1));
    }
  }
  return code;
}

/// A code length, or a repetition of the one before (16) or of zero (17, 18).
struct LengthToken {
  std::uint8_t symbol;
  std::uint8_t extra;
};

std::vector<LengthToken> runLengths(std::span<const std::uint8_t> lengths) {
  std::vector<LengthToken> tokens;
  for (std::size_t i = 0; i < lengths.size();) {
    const std::uint8_t length = lengths[i];
    std::size_t run = 1;
    while (i + run < lengths.size() && lengths[i + run] == length) ++run;
    i += run;
    if (length) {
      tokens.push_back({length, 0});
      --run;
    }
    while (run >= 3) {
      const std::size_t part = std::min<std::size_t>(run, length ? 6 : 138);
      const bool far = part > 10;
      tokens.push_back({static_cast<std::uint8_t>(length ? 16
                                                  : far  ? 18
                                                         : 17),
                        static_cast<std::uint8_t>(part - (far ? 11 : 3))});
      run -= part;
    }
    for (; run > 0; --run) tokens.push_back({length, 0});
  }
  return tokens;
}

int extraBitsOfLength(int symbol) {
  return symbol == 16 ? 2 : symbol == 17 ? 3 : symbol == 18 ? 7 : 0;
}

}  // namespace

DeflateWriter::DeflateWriter(std::vector<std::uint8_t>& out) : out_(out) { tokens_.reserve(1024); }

void DeflateWriter::match(std::uint32_t length, std::uint32_t distance, std::uint32_t times) {
  push({times, static_cast<std::uint16_t>(length), static_cast<std::uint16_t>(distance - 1)});
  symbol_count_[lengthBucket(length).symbol] += times;
  distance_count_[distanceBucket(distance).symbol] += times;
}

inline void DeflateWriter::put(std::uint64_t bits, int count) {
  pending_ |= bits << pending_count_;
  pending_count_ += count;
  std::uint64_t whole = pending_;
  if constexpr (std::endian::native == std::endian::big) whole = __builtin_bswap64(whole);
  std::memcpy(cursor_, &whole, sizeof whole);
  cursor_ += pending_count_ >> 3;
  pending_ >>= pending_count_ & ~7;
  pending_count_ &= 7;
}

void DeflateWriter::writeBlock(bool last) {
  symbol_count_[end_of_block] = 1;
  const auto symbols = prefixCode(symbol_count_, 15);
  const auto distances = prefixCode(distance_count_, 15);

  const auto used = [](std::span<const std::uint8_t> lengths, std::size_t least) {
    while (lengths.size() > least && !lengths.back()) lengths = lengths.first(lengths.size() - 1);
    return lengths.size();
  };
  const std::size_t symbols_used = used(symbols.length, 257);
  const std::size_t distances_used = used(distances.length, 1);
  std::vector<std::uint8_t> lengths(symbols.length.begin(), symbols.length.begin() + symbols_used);
  lengths.insert(lengths.end(), distances.length.begin(),
                 distances.length.begin() + distances_used);
  const std::vector<LengthToken> length_tokens = runLengths(lengths);
  std::array<std::uint32_t, 19> length_count{};
  for (const LengthToken& token : length_tokens) ++length_count[token.symbol];
  const auto length_code = prefixCode(length_count, 7);

  std::uint64_t bits = 3 + 14 + 19 * 3 + length_tokens.size() * 14 + symbols.length[end_of_block];
  for (std::size_t symbol = 0; symbol < symbol_count_.size(); ++symbol) {
    bits += std::uint64_t{symbol_count_[symbol]} *
            (symbols.length[symbol] + (symbol > end_of_block ? 5 : 0));
  }
  for (std::size_t symbol = 0; symbol < distance_count_.size(); ++symbol) {
    bits += std::uint64_t{distance_count_[symbol]} * (distances.length[symbol] + symbol / 2);
  }
  const std::size_t begin = out_.size();
  out_.resize(begin + bits / 8 + 16);
  cursor_ = out_.data() + begin;

  static constexpr std::array<int, 19> length_order = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                       11, 4,  12, 3, 13, 2, 14, 1, 15};
  std::size_t length_codes = length_order.size();
  while (length_codes > 4 && !length_code.length[length_order[length_codes - 1]]) --length_codes;
  put(last ? 1 : 0, 1);
  put(2, 2);
  put(symbols_used - 257, 5);
  put(distances_used - 1, 5);
  put(length_codes - 4, 4);
  for (std::size_t i = 0; i < length_codes; ++i) put(length_code.length[length_order[i]], 3);
  for (const auto& [symbol, extra] : length_tokens) {
    put(length_code.bits[symbol], length_code.length[symbol]);
    put(extra, extraBitsOfLength(symbol));
  }

  for (const Token& token : tokens_) {
    if (!token.length) {
      put(symbols.bits[token.data], symbols.length[token.data]);
      continue;
    }
    const Bucket length = lengthBucket(token.length);
    const Bucket distance = distanceBucket(token.data + 1U);
    std::uint64_t word = symbols.bits[length.symbol];
    int count = symbols.length[length.symbol];
    word |= std::uint64_t{length.extra} << count;
    count += length.extra_count;
    word |= std::uint64_t{distances.bits[distance.symbol]} << count;
    count += distances.length[distance.symbol];
    word |= std::uint64_t{distance.extra} << count;
    count += distance.extra_count;

    const int together = std::min<std::uint32_t>(token.times, 56 / count);
    std::uint64_t repeated = word;
    for (int i = 1; i < together; ++i) repeated = repeated << count | word;
    std::uint32_t left = token.times;
    for (; left > static_cast<std::uint32_t>(together); left -= together) {
      put(repeated, together * count);
    }
    const int rest = static_cast<int>(left) * count;
    put(repeated & ((std::uint64_t{1} << rest) - 1), rest);
  }
  put(symbols.bits[end_of_block], symbols.length[end_of_block]);
  if (last && pending_count_) put(0, 8 - pending_count_);
  out_.resize(static_cast<std::size_t>(cursor_ - out_.data()));

  tokens_.clear();
  symbol_count_.fill(0);
  distance_count_.fill(0);
}

void DeflateWriter::finish() { writeBlock(true); }

}  // namespace vdbdither
