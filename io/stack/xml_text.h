#pragma once

#include <string>
#include <string_view>

namespace vdbdither {

/// Returns `text` for XML: what is not printable is written as `printable` writes it, and `&`, `<`,
/// `>` and `"` as entities.
std::string xmlText(std::string_view text);

}  // namespace vdbdither
