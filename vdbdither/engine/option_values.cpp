#include "vdbdither/engine/option_values.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/number_text.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

/// The whole of `text` as a finite number.
std::optional<double> numberIn(std::string_view text) {
  const std::string_view digits = text.starts_with('+') ? text.substr(1) : text;
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(value))
    return std::nullopt;
  return value + 0.0;  // without the sign of a negative zero
}

std::optional<double> lengthMmIn(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, double>, 7> units{{{"mm", 1.0},
                                                                      {"um", 1e-3},
                                                                      {"µm", 1e-3},
                                                                      {"nm", 1e-6},
                                                                      {"cm", 10.0},
                                                                      {"in", 25.4},
                                                                      {"m", 1000.0}}};
  if (text.ends_with("dpi")) {
    const auto dots = numberIn(text.substr(0, text.size() - 3));
    if (!dots || *dots <= 0) return std::nullopt;
    return 25.4 / *dots;
  }
  for (const auto& [unit, factor] : units) {
    if (!text.ends_with(unit)) continue;
    const auto number = numberIn(text.substr(0, text.size() - unit.size()));
    if (!number) return std::nullopt;
    // Dividing by a whole number rounds once: 42um is the double nearest to 0.042, as 0.042mm is.
    return factor < 1 ? *number / std::round(1 / factor) : *number * factor;
  }
  return numberIn(text);
}

std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, replaced}));
    }
  }
  return row.back();
}

/// Whole numbers up to a thousand millions without an exponent.
std::string boundText(double bound) {
  const bool is_short = std::abs(bound) <= 1e9 && bound == std::floor(bound);
  return is_short ? std::to_string(static_cast<long>(bound)) : shortestText(bound);
}

std::string escaped(std::string_view word) {
  std::string text;
  for (const char c : word) text.append(c == '\\' || c == '\'' ? "\\" : "").append(1, c);
  return "$'" + printable(text) + "'";
}

}  // namespace

bool Range::contains(double value) const {
  return std::isfinite(value) && (accepts_min ? value >= min : value > min) && value <= max;
}

std::string Range::text(std::string_view unit) const {
  const auto with_unit = [&](double bound) {
    return boundText(bound) + (unit.empty() ? "" : " ") + std::string(unit);
  };
  const bool has_min = std::isfinite(min);
  const bool has_max = std::isfinite(max);
  if (has_min && !accepts_min)
    return "greater than " + with_unit(min) + (has_max ? ", up to " + with_unit(max) : "");
  if (has_min && has_max) return "from " + with_unit(min) + " to " + with_unit(max);
  if (has_min) return with_unit(min) + " or greater";
  return has_max ? with_unit(max) + " or less" : "";
}

double parseNumber(std::string_view text, const Range& range, const std::string& what) {
  const auto value = numberIn(text);
  if (!value || !range.contains(*value))
    throw UsageError("'" + std::string(text) + "' is not accepted; the value must be " + what);
  return *value;
}

double parseLengthMm(std::string_view text, const Range& range) {
  const auto length_mm = lengthMmIn(text);
  const std::string refused = "'" + std::string(text) + "' is not accepted; ";
  if (!length_mm || !std::isfinite(*length_mm))
    throw UsageError(refused + "give a length such as 0.042mm, 42um or 600dpi");
  if (!range.contains(*length_mm))
    throw UsageError(refused + "the length must be " + range.text("mm"));
  return *length_mm;
}

std::string shortestText(double value) { return numberText(value); }

std::string quotedForShell(std::string_view word) {
  constexpr std::string_view plain_signs = "_-+=./,:@%";
  const auto isPlain = [&](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || plain_signs.find(c) != plain_signs.npos;
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), isPlain)) return std::string(word);
  if (!isPrintable(word)) return escaped(word);
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::string nearestWord(std::string_view word, std::span<const std::string> candidates) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = editDistance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

}  // namespace vdbdither
