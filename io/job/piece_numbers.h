#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace vdbdither {

/// Reads numbers of pieces such as `7`, `0-15` or `1,4-6`: rising, each once. Throws UsageError,
/// also for a number that is not below `count`.
std::vector<std::size_t> pieceNumbers(const std::string& text, std::size_t count);

/// The text that `pieceNumbers` reads as these rising numbers.
std::string numbersText(const std::vector<std::size_t>& numbers);

}  // namespace vdbdither
