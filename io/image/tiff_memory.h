#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <tiffio.h>
#include <vector>

namespace vdbdither {

/// What libtiff takes for a file.
struct TiffMemory {
  std::span<const std::uint8_t> read;  ///< what is read
  std::vector<std::uint8_t> written;   ///< what is written; only one of the two is used
  std::size_t position = 0;
  std::string error;  ///< what libtiff last complained of; not for users
};

using TiffHandle = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

/// Opens `memory`, which must outlive the handle. Returns null for what is no TIFF.
/// @param mode  of TIFFOpen; 'w' writes
TiffHandle openTiff(TiffMemory& memory, const char* mode);

}  // namespace vdbdither
