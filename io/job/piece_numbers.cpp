#include "io/job/piece_numbers.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "vdbdither/engine/comma_list.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

std::vector<std::size_t> pieceNumbers(const std::string& text, std::size_t count) {
  const auto refuse = [&] {
    throw UsageError("'" + text + "' is not accepted; give numbers of pieces from 0 to " +
                     std::to_string(count - 1) + ", such as 7, 0-15 or 1,4-6");
  };
  const auto number = [&](std::string_view digits) {
    std::size_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size() || value >= count) refuse();
    return value;
  };
  std::vector<std::size_t> numbers;
  for (const std::string& part : commaList(text)) {
    const std::size_t dash = part.find('-');
    const std::size_t first = number(std::string_view(part).substr(0, dash));
    const std::size_t last =
        dash == std::string::npos ? first : number(std::string_view(part).substr(dash + 1));
    if (last < first || (!numbers.empty() && first <= numbers.back())) refuse();
    for (std::size_t value = first; value <= last; ++value) numbers.push_back(value);
  }
  if (numbers.empty()) refuse();
  return numbers;
}

std::string numbersText(const std::vector<std::size_t>& numbers) {
  std::string text;
  for (std::size_t i = 0; i < numbers.size();) {
    std::size_t end = i + 1;
    while (end < numbers.size() && numbers[end] == numbers[end - 1] + 1) ++end;
    text += (text.empty() ? "" : ",") + std::to_string(numbers[i]);
    if (end - i > 1) text += "-" + std::to_string(numbers[end - 1]);
    i = end;
  }
  return text;
}

}  // namespace vdbdither
