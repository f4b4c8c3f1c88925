#include "io/vdb/byte_cursor.h"

#include <algorithm>
#include <ios>

namespace vdbdither {

ByteCursor::ByteCursor(std::istream& stream, std::uint64_t size)
    : stream_(stream), size_(size), buffer_begin_(static_cast<std::uint64_t>(stream.tellg())) {}

const char* ByteCursor::view(std::size_t count) {
  if (count > end_ - at_) fill(count);
  return buffer_.data() + at_;
}

void ByteCursor::skip(std::uint64_t count) {
  require(count);
  if (count <= end_ - at_) {
    at_ += count;
  } else {
    buffer_begin_ += at_ + count;
    at_ = end_ = 0;
  }
}

void ByteCursor::require(std::uint64_t count) const {
  if (count > left()) throw std::ios::failure("the bytes end too early");
}

void ByteCursor::fill(std::size_t count) {
  constexpr std::size_t chunk = 1 << 18;
  require(count);
  const std::size_t held = end_ - at_;
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(at_),
            buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
  buffer_begin_ += at_;
  at_ = 0;
  end_ = std::min<std::uint64_t>(std::max(chunk, count), size_ - buffer_begin_);
  if (buffer_.size() < end_) buffer_.resize(end_);
  stream_.seekg(static_cast<std::streamoff>(buffer_begin_ + held));
  stream_.read(buffer_.data() + held, static_cast<std::streamsize>(end_ - held));
}

}  // namespace vdbdither
