#include "io/stack/image_order.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <utility>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr std::size_t most_digits = 18;

bool isDigit(char character) { return std::isdigit(static_cast<unsigned char>(character)) != 0; }

/// A name without its folder and ending, cut into text and numbers.
struct NumberedName {
  std::string name;
  std::string pattern;  ///< with '#' for each number
  std::vector<std::uint64_t> numbers;
};

NumberedName cut(const std::string& name) {
  NumberedName result{name, "", {}};
  const std::string stem = std::filesystem::path(name).stem().string();
  for (std::size_t at = 0; at < stem.size();) {
    if (!isDigit(stem[at])) {
      result.pattern += stem[at++];
      continue;
    }
    std::size_t end = at;
    while (end < stem.size() && isDigit(stem[end])) ++end;
    const std::size_t first = std::min(stem.find_first_not_of('0', at), end);
    if (end - first > most_digits) {
      throw DataError("the name of '" + name + "' has a number of more than " +
                      std::to_string(most_digits) + " digits; number the slices 1, 2, 3 …");
    }
    std::uint64_t number = 0;
    std::from_chars(stem.data() + first, stem.data() + end, number);
    result.numbers.push_back(number);
    result.pattern += '#';
    at = end;
  }
  return result;
}

using Names = std::vector<NumberedName>;

void sortBy(Names& names, std::size_t column) {
  std::sort(names.begin(), names.end(), [&](const NumberedName& a, const NumberedName& b) {
    return std::pair(a.numbers[column], a.name) < std::pair(b.numbers[column], b.name);
  });
}

/// Whether the second of two sorted names does not follow the first one by one.
auto isGap(std::size_t column) {
  return [column](const NumberedName& a, const NumberedName& b) {
    return b.numbers[column] != a.numbers[column] + 1;
  };
}

/// The first of sorted names that the next one does not follow.
Names::const_iterator firstGap(const Names& names, std::size_t column) {
  return std::adjacent_find(names.begin(), names.end(), isGap(column));
}

bool varies(const Names& names, std::size_t column) {
  return std::any_of(names.begin(), names.end(), [&](const NumberedName& name) {
    return name.numbers[column] != names.front().numbers[column];
  });
}

/// What is wrong between a name and the next one.
std::string gapText(Names::const_iterator gap, std::size_t column) {
  const std::uint64_t number = gap->numbers[column];
  const std::uint64_t next = std::next(gap)->numbers[column];
  const std::string both = "'" + gap->name + "' and '" + std::next(gap)->name + "'";
  if (next == number)
    return both + " have the same number " + std::to_string(number) + "; remove one of them";
  return "number " + std::to_string(number + 1) + " is missing between " + both +
         "; add the slice, or number them without a gap";
}

}  // namespace

std::vector<std::string> inOrderOfNumbers(const std::vector<std::string>& names,
                                          const std::string& shown,
                                          const std::function<void(const std::string&)>& faults) {
  if (names.size() < 2) return names;
  Names numbered;
  for (const std::string& name : names) {
    NumberedName one = cut(name);
    if (!one.numbers.empty()) numbered.push_back(std::move(one));
  }
  if (numbered.empty()) {
    throw DataError("'" + shown + "': the names of its images, such as '" + names.front() +
                    "', have no numbers; number the slices from bottom to top");
  }
  for (const NumberedName& one : numbered) {
    if (one.pattern != numbered.front().pattern) {
      throw DataError("'" + shown + "': '" + numbered.front().name + "' and '" + one.name +
                      "' are named by different patterns; give the one to read, with * for the "
                      "number and in quotes");
    }
  }
  std::optional<std::size_t> last_varying;
  for (std::size_t column = 0; column < numbered.front().numbers.size(); ++column) {
    if (numbered.size() > 1 && !varies(numbered, column)) continue;
    last_varying = column;
    sortBy(numbered, column);
    if (firstGap(numbered, column) == numbered.end()) break;
  }
  // Where no number varies, the names differ in zeros or in their endings.
  const std::size_t column = last_varying.value_or(numbered.front().numbers.size() - 1);
  sortBy(numbered, column);
  for (auto gap = firstGap(numbered, column); gap != numbered.end();) {
    if (!faults) throw DataError("'" + shown + "': " + gapText(gap, column));
    faults(gapText(gap, column));
    gap = std::adjacent_find(std::next(gap), numbered.cend(), isGap(column));
  }
  std::vector<std::string> ordered;
  for (const NumberedName& one : numbered) ordered.push_back(one.name);
  return ordered;
}

}  // namespace vdbdither
