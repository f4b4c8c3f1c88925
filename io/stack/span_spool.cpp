#include "io/stack/span_spool.h"

#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <string>
#include <system_error>
#include <unistd.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// Seven bits a byte, the lowest first; the upper bit says that another byte follows.
void put(std::vector<std::uint8_t>& bytes, std::uint32_t value) {
  constexpr std::uint32_t more = 0x80;
  for (; value >= more; value >>= 7) bytes.push_back(static_cast<std::uint8_t>(value | more));
  bytes.push_back(static_cast<std::uint8_t>(value));
}

std::uint32_t take(const std::uint8_t*& at) {
  std::uint32_t value = 0;
  for (int shift = 0;; shift += 7) {
    value |= std::uint32_t{*at & 0x7fU} << shift;
    if ((*at++ & 0x80) == 0) return value;
  }
}

[[noreturn]] void fail(const std::filesystem::path& folder) {
  throw DataError("cannot keep slices in a temporary file in '" + folder.string() +
                  "': " + std::generic_category().message(errno));
}

}  // namespace

void SpanSpool::Closer::operator()(const int* descriptor) const {
  ::close(*descriptor);
  delete descriptor;
}

SpanSpool::SpanSpool(const std::filesystem::path& folder) : folder_(folder.empty() ? "." : folder) {
  std::string name = (folder_ / ".vdbdither-XXXXXX").string();
  const int descriptor = ::mkostemp(name.data(), O_CLOEXEC);
  if (descriptor < 0) fail(folder_);
  descriptor_.reset(new int(descriptor));
  // The file goes with the process, however it ends.
  ::unlink(name.c_str());
}

void SpanSpool::add(const SpanImage& image) {
  std::vector<std::uint8_t> bytes;
  put(bytes, image.width);
  put(bytes, image.height);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint32_t begin = 0;
    for (const Span& span : image.row(y)) {
      put(bytes, span.end - begin);
      put(bytes, span.value);
      begin = span.end;
    }
  }
  starts_.push_back(end_);
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count = ::pwrite(*descriptor_, bytes.data() + done, bytes.size() - done,
                                   static_cast<off_t>(end_ + done));
    if (count < 0 && errno != EINTR) fail(folder_);
    done += count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  end_ += bytes.size();
}

SpanImage SpanSpool::read(std::size_t index) const {
  const std::uint64_t begin = starts_.at(index);
  const std::uint64_t end = index + 1 < starts_.size() ? starts_[index + 1] : end_;
  std::vector<std::uint8_t> bytes(end - begin);
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count = ::pread(*descriptor_, bytes.data() + done, bytes.size() - done,
                                  static_cast<off_t>(begin + done));
    if (count == 0) errno = EIO;
    if (count == 0 || (count < 0 && errno != EINTR)) fail(folder_);
    done += count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  const std::uint8_t* at = bytes.data();
  SpanImage image{take(at), 0, {0}, {}};
  image.height = take(at);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    for (std::uint32_t x = 0; x < image.width;) {
      x += take(at);
      image.spans.push_back({x, take(at)});
    }
    image.row_begin.push_back(image.spans.size());
  }
  return image;
}

}  // namespace vdbdither
