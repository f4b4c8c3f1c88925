#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "io/image/size_check.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

struct ExrChannel {
  std::string name;
  bool half = true;  ///< 16 bits a value, else 32
};

/// Fills one row of one channel; rows come top first, each channel once a row.
using ExrRow = std::function<void(std::uint32_t row, std::size_t channel, std::span<float> values)>;

enum class ExrPacking { none, rle, zips, zip, piz };

struct ExrFormat {
  double pixel_aspect = 1;  ///< a pixel's width over its height
  ExrPacking packing = ExrPacking::zips;
  int tile = 0;  ///< edge of the tiles, pixels; 0: rows in place of tiles
};

/// The bytes of an OpenEXR file. All packings are without loss. The rows of a row of tiles are held
/// at a time, or a single row.
std::vector<std::uint8_t> encodeExr(std::uint32_t width, std::uint32_t height,
                                    const ExrFormat& format, std::span<const ExrChannel> channels,
                                    const ExrRow& fill);

/// A channel of whole numbers from 0, as spans of them. Throws DataError in words that go on from
/// the file's name.
/// @param check  gets the size before the pixels are read
SpanImage decodeExr(std::span<const std::uint8_t> bytes, const std::string& channel,
                    const SizeCheck& check = {});

}  // namespace vdbdither
