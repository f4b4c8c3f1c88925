#pragma once

#include <functional>
#include <string_view>

#include <nlohmann/json.hpp>

namespace vdbdither {

/// Hands the canonical form of `json` to `take`, piece by piece: that of RFC 8785, which depends on
/// neither white space, nor the order of keys, nor how numbers are spelt. Strings must be UTF-8.
/// @param omitted  a key of the outermost object that is left out with its value
void writeCanonically(const nlohmann::ordered_json& json,
                      const std::function<void(std::string_view)>& take,
                      std::string_view omitted = {});

}  // namespace vdbdither
