#include "io/file/buffered_file.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <fcntl.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "vdbdither/model/errors.h"

namespace vdbdither {

BufferedFile::BufferedFile(const std::filesystem::path& path, std::filesystem::path shown)
    : shown_(std::move(shown)),
      file_(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
  if (file_ < 0) fail();
  buffer_.reserve(buffer_bytes);
}

BufferedFile::~BufferedFile() {
  if (file_ >= 0) ::close(file_);
}

void BufferedFile::appendNumber(float value) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.begin(), digits.end(), value).ptr;
  append(digits.data(), static_cast<std::size_t>(end - digits.begin()));
}

void BufferedFile::appendAllOf(BufferedFile& other) {
  other.flush();
  off_t at = 0;
  std::vector<char> block(buffer_bytes);
  for (;;) {
    const ssize_t got = ::pread(other.file_, block.data(), block.size(), at);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail();
    if (got == 0) return;
    append(block.data(), static_cast<std::size_t>(got));
    at += got;
  }
}

void BufferedFile::patch(off_t offset, const void* data, std::size_t size) {
  flush();
  const char* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t written = ::pwrite(file_, at, size, offset);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail();
    at += written;
    offset += written;
    size -= static_cast<std::size_t>(written);
  }
}

void BufferedFile::close() {
  flush();
  const int file = std::exchange(file_, -1);
  if (::close(file) != 0) fail();
}

void BufferedFile::flush() {
  const char* at = buffer_.data();
  std::size_t left = buffer_.size();
  while (left > 0) {
    const ssize_t written = ::write(file_, at, left);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail();
    at += written;
    left -= static_cast<std::size_t>(written);
  }
  buffer_.clear();
}

void BufferedFile::fail() const {
  throw DataError("cannot write '" + shown_.string() +
                  "': " + std::generic_category().message(errno));
}

}  // namespace vdbdither
