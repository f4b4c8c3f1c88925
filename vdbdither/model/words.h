#pragma once

#include <span>
#include <string>

namespace vdbdither {

/// Returns `a`, `a or b`, `a, b or c`: what a refusal lists.
std::string alternatives(std::span<const std::string> words);

}  // namespace vdbdither
