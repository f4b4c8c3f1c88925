#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace vdbdither {

/// Writes a deflate stream (RFC 1951) from literals and matches that the caller has found itself.
/// Blocks are cut by a fixed number of tokens, each with Huffman codes of its own: same tokens,
/// same bytes.
class DeflateWriter {
 public:
  static constexpr std::uint32_t window = 32768;
  static constexpr std::uint32_t min_match = 3;
  static constexpr std::uint32_t max_match = 258;

  /// Appends to `out`, which must outlive the writer.
  explicit DeflateWriter(std::vector<std::uint8_t>& out);

  void literal(std::uint8_t byte) {
    push({1, 0, byte});
    ++symbol_count_[byte];
  }

  /// `times` matches in a row, each of `length` bytes (3 … 258) at `distance` (1 … 32768).
  void match(std::uint32_t length, std::uint32_t distance, std::uint32_t times = 1);

  /// Ends the stream on a byte boundary.
  void finish();

 private:
  struct Token {
    std::uint32_t times;
    std::uint16_t length;  ///< 0: a literal
    std::uint16_t data;    ///< the literal, or distance − 1
  };

  void push(Token token) {
    if (tokens_.size() == tokens_per_block) writeBlock(false);
    tokens_.push_back(token);
  }
  void writeBlock(bool last);
  void put(std::uint64_t bits, int count);

  static constexpr std::size_t tokens_per_block = std::size_t{1} << 15;

  std::vector<std::uint8_t>& out_;
  std::vector<Token> tokens_;
  std::array<std::uint32_t, 286> symbol_count_{};
  std::array<std::uint32_t, 30> distance_count_{};
  std::uint8_t* cursor_ = nullptr;  ///< next byte to write while a block is written
  std::uint64_t pending_ = 0;       ///< bits not yet in a whole byte, lowest first
  int pending_count_ = 0;
};

}  // namespace vdbdither
