#include "io/image/png_decoder.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <png.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// Errors leave libpng as exceptions, thrown by its error callback. This is safe because the stack
/// frames of libpng own nothing: its structures do.
class Decoder {
 public:
  explicit Decoder(std::span<const std::uint8_t> bytes) : bytes_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, refuse, ignore);
    info_ = png_ ? png_create_info_struct(png_) : nullptr;
    if (!info_) throw std::bad_alloc();
    png_set_read_fn(png_, this, read);
    png_set_user_limits(png_, 1 << 24, 1 << 24);
    // Text and profiles may inflate to any size, and none of them is wanted.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;
  ~Decoder() { png_destroy_read_struct(&png_, &info_, nullptr); }

  SpanImage run(const SizeCheck& check) {
    png_read_info(png_, info_);
    const std::uint32_t width = png_get_image_width(png_, info_);
    const std::uint32_t height = png_get_image_height(png_, info_);
    if (check) check(width, height);
    if (png_get_interlace_type(png_, info_) != PNG_INTERLACE_NONE)
      throw DataError("is interlaced; save it without");
    png_set_expand(png_);
    png_set_strip_16(png_);
    png_set_gray_to_rgb(png_);
    png_set_add_alpha(png_, 255, PNG_FILLER_AFTER);
    png_read_update_info(png_, info_);
    SpansBuilder spans(width);
    std::vector<std::uint8_t> row(png_get_rowbytes(png_, info_));
    for (std::uint32_t y = 0; y < height; ++y) {
      if (y + 1 == height) allowance_ = 2 * row.size() + 16384;
      png_read_row(png_, row.data(), nullptr);
      for (std::uint32_t x = 0; x < width; ++x) {
        std::uint32_t colour = 0;
        std::memcpy(&colour, row.data() + std::size_t{4} * x, sizeof colour);
        spans.pixel(x, colour);
      }
      spans.endRow();
    }
    allowance_ = unlimited;
    png_read_end(png_, nullptr);
    return spans.finish();
  }

 private:
  [[noreturn]] static void refuse(png_structp, png_const_charp) {
    throw DataError("is no readable PNG: it is damaged");
  }
  static void ignore(png_structp, png_const_charp) {}
  static void read(png_structp png, png_bytep data, std::size_t size) {
    auto& self = *static_cast<Decoder*>(png_get_io_ptr(png));
    if (size > self.bytes_.size()) throw DataError("is no readable PNG: it is cut short");
    if (size > self.allowance_)
      throw DataError("is no readable PNG: it holds more than its pixels");
    if (self.allowance_ != unlimited) self.allowance_ -= size;
    std::copy_n(self.bytes_.begin(), size, data);
    self.bytes_ = self.bytes_.subspan(size);
  }

  static constexpr std::size_t unlimited = std::numeric_limits<std::size_t>::max();

  std::span<const std::uint8_t> bytes_;
  /// Bytes that may still be read. With the last row libpng inflates all that follows, which may be
  /// a thousand times what is read.
  std::size_t allowance_ = unlimited;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

}  // namespace

SpanImage decodePng(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  return Decoder(bytes).run(check);
}

}  // namespace vdbdither
