#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace vdbdither {

/// Unpacks a deflate stream (RFC 1951) in rows of one size, with long repetitions of few bytes in
/// mind, of which slices consist. Holds the rows of a window and not the whole stream.
class RowInflater {
 public:
  /// @param stride  bytes of a row, 1 or more
  /// @param rows    how many there are
  RowInflater(std::size_t stride, std::size_t rows);

  /// Unpacks all rows. Returns how many bytes of the stream were read, or 0 where it is damaged,
  /// has more or fewer rows, or `take` returns false.
  /// @param take  gets row after row, each valid until it returns
  using Take = std::function<bool(std::span<const std::uint8_t> row)>;
  std::size_t run(std::span<const std::uint8_t> stream, const Take& take);

 private:
  /// What a code stands for.
  struct Entry {
    std::uint16_t value = 0;  ///< literal, base of a length or distance, or index of a table
    std::uint8_t bits = 0;    ///< of the code
    std::uint8_t kind = 0;    ///< number of extra bits, or one of the kinds below
  };
  static constexpr std::uint8_t literal = 16;
  static constexpr std::uint8_t end_of_block = 32;
  static constexpr std::uint8_t link = 64;  ///< to a table for the bits after the first ones
  static constexpr std::uint8_t invalid = 128;
  static constexpr int first_bits = 10;
  static constexpr int most_bits = 15;
  using Table = std::vector<Entry>;

  [[nodiscard]] static bool makeTable(std::span<const std::uint8_t> lengths,
                                      const std::function<Entry(std::size_t symbol)>& entry_of,
                                      Table& table);

  void refill();
  std::uint32_t take(int count);
  [[nodiscard]] Entry decode(const Table& table);
  bool stored();
  bool fixedTables();
  bool dynamicTables();
  bool symbols(const Take& take);
  void copy(std::size_t length, std::size_t distance);
  bool flush(const Take& take);

  std::size_t stride_;
  std::size_t rows_left_;
  std::vector<std::uint8_t> buffer_;
  std::uint8_t* next_ = nullptr;        ///< where the next byte comes
  const std::uint8_t* row_ = nullptr;   ///< the first row that was not taken
  const std::uint8_t* full_ = nullptr;  ///< where rows are taken at the latest
  std::span<const std::uint8_t> stream_;
  std::size_t at_ = 0;      ///< the next byte of the stream
  std::uint64_t bits_ = 0;  ///< lowest first
  int bit_count_ = 0;
  int beyond_ = 0;  ///< bits that were made up behind the end
  Table lengths_, distances_;
};

}  // namespace vdbdither
