#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include <png.h>

namespace vdbdither {

/// The structures of libpng that read a PNG from memory. What libpng finds wrong is thrown as
/// DataError, in words that go on from the file's name.
///
/// Errors leave libpng as exceptions, thrown by its error callback. This is safe because the stack
/// frames of libpng own nothing: its structures do.
class PngSource {
 public:
  explicit PngSource(std::span<const std::uint8_t> bytes);
  PngSource(const PngSource&) = delete;
  PngSource& operator=(const PngSource&) = delete;
  ~PngSource() { png_destroy_read_struct(&png_, &info_, nullptr); }

  [[nodiscard]] png_structp png() const { return png_; }
  [[nodiscard]] png_infop info() const { return info_; }

  /// Limits what libpng may read of the file. With the last row it inflates all that follows, which
  /// may be a thousand times what is read.
  void allowLastRow(std::size_t row_bytes) { allowance_ = 2 * row_bytes + 16384; }
  void allowAll() { allowance_ = unlimited; }

 private:
  static void read(png_structp png, png_bytep data, std::size_t size);

  static constexpr std::size_t unlimited = std::numeric_limits<std::size_t>::max();

  std::span<const std::uint8_t> bytes_;
  std::size_t allowance_ = unlimited;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace vdbdither
