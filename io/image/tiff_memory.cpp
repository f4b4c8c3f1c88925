#include "io/image/tiff_memory.h"

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>

namespace vdbdither {

namespace {

TiffMemory& memoryOf(thandle_t handle) { return *static_cast<TiffMemory*>(handle); }

std::span<const std::uint8_t> bytesOf(const TiffMemory& memory) {
  return memory.written.empty() ? memory.read : std::span<const std::uint8_t>(memory.written);
}

tmsize_t readMemory(thandle_t handle, void* data, tmsize_t size) {
  TiffMemory& memory = memoryOf(handle);
  const std::span<const std::uint8_t> bytes = bytesOf(memory);
  const std::size_t begin = std::min(memory.position, bytes.size());
  const std::size_t count = std::min<std::size_t>(size, bytes.size() - begin);
  std::copy_n(bytes.data() + begin, count, static_cast<std::uint8_t*>(data));
  memory.position = begin + count;
  return static_cast<tmsize_t>(count);
}

tmsize_t writeMemory(thandle_t handle, void* data, tmsize_t size) {
  TiffMemory& memory = memoryOf(handle);
  const auto end = memory.position + static_cast<std::size_t>(size);
  if (end > memory.written.size()) memory.written.resize(end);
  std::copy_n(static_cast<const std::uint8_t*>(data), size,
              memory.written.data() + memory.position);
  memory.position = end;
  return size;
}

toff_t seekMemory(thandle_t handle, toff_t offset, int whence) {
  TiffMemory& memory = memoryOf(handle);
  const std::size_t from = whence == SEEK_SET   ? 0
                           : whence == SEEK_CUR ? memory.position
                                                : bytesOf(memory).size();
  memory.position = from + offset;
  return memory.position;
}

int closeMemory(thandle_t) { return 0; }
toff_t sizeOfMemory(thandle_t handle) { return bytesOf(memoryOf(handle)).size(); }

int noteTiffError(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  std::array<char, 256> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  static_cast<TiffMemory*>(user)->error = text.data();
  return 1;
}

int ignoreTiffWarning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

/// What a header may make libtiff allocate, in bytes.
constexpr tmsize_t most_at_once = tmsize_t{1} << 28;

}  // namespace

TiffHandle openTiff(TiffMemory& memory, const char* mode) {
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(
      TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), noteTiffError, &memory);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignoreTiffWarning, nullptr);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), most_at_once);
  return {TIFFClientOpenExt("memory", mode, &memory, readMemory, writeMemory, seekMemory,
                            closeMemory, sizeOfMemory, nullptr, nullptr, options.get()),
          TIFFClose};
}

}  // namespace vdbdither
