#include "io/image/png_source.h"

#include <algorithm>
#include <new>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

[[noreturn]] void refusePng(png_structp, png_const_charp) {
  throw DataError("is not a readable PNG: it is damaged");
}

void ignorePngWarning(png_structp, png_const_charp) {}

}  // namespace

PngSource::PngSource(std::span<const std::uint8_t> bytes) : bytes_(bytes) {
  png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, refusePng, ignorePngWarning);
  info_ = png_ ? png_create_info_struct(png_) : nullptr;
  if (!info_) {
    png_destroy_read_struct(&png_, &info_, nullptr);
    throw std::bad_alloc();
  }
  png_set_read_fn(png_, this, read);
  png_set_user_limits(png_, 1 << 24, 1 << 24);
  // Text and profiles may inflate to any size; who wants one asks for it.
  png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
}

void PngSource::read(png_structp png, png_bytep data, std::size_t size) {
  auto& self = *static_cast<PngSource*>(png_get_io_ptr(png));
  if (size > self.bytes_.size()) throw DataError("is not a readable PNG: it is cut short");
  if (size > self.allowance_)
    throw DataError("is not a readable PNG: it holds more than its pixels");
  if (self.allowance_ != unlimited) self.allowance_ -= size;
  std::copy_n(self.bytes_.begin(), size, data);
  self.bytes_ = self.bytes_.subspan(size);
}

}  // namespace vdbdither
