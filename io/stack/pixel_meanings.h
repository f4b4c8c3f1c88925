#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "io/stack/manifest.h"

namespace vdbdither {

/// Returns what the pixels of a stack's slices stand for: indices of materials, 0 for empty. Of
/// formats that do not tell materials apart in a file, 1 is printed.
/// @param clash  told of a material whose colour an earlier one has, or the background (0)
std::map<std::uint32_t, std::uint32_t> meaningsOfPixels(
    const Manifest& stack,
    const std::function<void(std::uint32_t material, std::uint32_t other)>& clash);

/// Returns "the material 'a' has the colour of 'b'", or of the background where `other` is 0.
std::string sameColourText(const Manifest& stack, std::uint32_t material, std::uint32_t other);

/// Returns the four channels of a colour, `166,33,98,255`.
std::string colourText(std::uint32_t colour);

}  // namespace vdbdither
