#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace vdbdither {

/// The bytes of a text, which must outlive them.
inline std::span<const std::uint8_t> textBytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace vdbdither
