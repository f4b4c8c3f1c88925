#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <new>
#include <span>

#include <ImfHeader.h>
#include <ImfIO.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {

/// What OpenEXR reads a file from. Throws DataError at its end.
class ExrSource : public Imf::IStream {
 public:
  explicit ExrSource(std::span<const std::uint8_t> bytes) : IStream("memory"), bytes_(bytes) {}

  bool read(char data[], int size) override {
    if (size < 0 || position_ > bytes_.size() ||
        static_cast<std::size_t>(size) > bytes_.size() - position_)
      throw DataError("is cut short");
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(position_), size, data);
    position_ += static_cast<std::size_t>(size);
    return position_ < bytes_.size();
  }
  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t position) override { position_ = position; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t position_ = 0;
};

/// Limits what a header may make OpenEXR allocate before the size of the picture is known here.
inline void limitExrSizes() {
  static const bool once = [] {
    constexpr int widest = 1 << 24;
    constexpr int largest_tile = 4096;
    Imf::Header::setMaxImageSize(widest, widest);
    Imf::Header::setMaxTileSize(largest_tile, largest_tile);
    return true;
  }();
  static_cast<void>(once);
}

/// Returns what `read` returns. What OpenEXR throws becomes a DataError.
template <class Read>
auto readingExr(const Read& read) {
  limitExrSizes();
  try {
    return read();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
    throw DataError("is not a readable EXR: it is damaged or of a kind that is not read");
  }
}

}  // namespace vdbdither
