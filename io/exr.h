#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace vdbdither {

struct ExrChannel {
  std::string name;
  bool half = true;  ///< 16 bits a value, else 32
};

/// Fills one row of one channel; rows come top first, each channel once a row.
using ExrRow = std::function<void(std::uint32_t row, std::size_t channel, std::span<float> values)>;

/// The bytes of an OpenEXR file, ZIP-compressed by rows. `pixel_aspect` is a pixel's width over its
/// height.
std::vector<std::uint8_t> encodeExr(std::uint32_t width, std::uint32_t height, double pixel_aspect,
                                    std::span<const ExrChannel> channels, const ExrRow& fill);

}  // namespace vdbdither
