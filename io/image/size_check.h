#pragma once

#include <cstdint>
#include <functional>

namespace vdbdither {

/// Throws DataError where a picture of this width and height is not wanted. A decoder calls it
/// before it takes time and memory for the pixels.
using SizeCheck = std::function<void(std::uint32_t width, std::uint32_t height)>;

}  // namespace vdbdither
