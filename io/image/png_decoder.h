#pragma once

#include <cstdint>
#include <span>

#include "io/image/size_check.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// The pixels of a PNG of any kind as colours of eight bits a channel (see rgba()), read row by
/// row. Throws DataError in words that go on from the file's name: for what is damaged, and for
/// interlaced files, which cannot be read by rows.
/// @param check  gets the size before the pixels are read
SpanImage decodePng(std::span<const std::uint8_t> bytes, const SizeCheck& check = {});

}  // namespace vdbdither
