#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vdbdither {

/// What a check of a stack of slices found: one fault at one place.
struct Finding {
  enum class Severity { error, warning, note };

  std::string id;  ///< of its kind, in kebab-case; docs/verify.md explains each
  Severity severity = Severity::error;
  std::string text;               ///< what is wrong, and what to do; goes on from the place
  std::string file = {};          ///< as messages show it; empty: of the whole stack
  std::optional<int> layer = {};  ///< counted from the bottom of the job, from 0
  std::optional<std::array<std::uint32_t, 2>> pixel = {};  ///< column and row, from 0
  std::optional<std::uint64_t> count = {};                 ///< of pixels, voxels, regions
};

/// All that a check found. Of each kind no more than the first ones are kept.
class Findings {
 public:
  static constexpr std::size_t most_of_kind = 10;

  void add(Finding finding);
  void error(std::string_view id, std::string text, std::string file = {});
  void warning(std::string_view id, std::string text, std::string file = {});
  /// Counts more of a kind, which are not told one by one.
  void leaveOut(std::string_view id, Finding::Severity severity, std::uint64_t count);

  /// Those that are kept: kinds in the order in which they first came, each in the order of
  /// arrival.
  [[nodiscard]] std::vector<Finding> kept() const;
  /// How many of a kind were not kept.
  [[nodiscard]] std::uint64_t leftOut(std::string_view id) const;
  [[nodiscard]] std::uint64_t errors() const { return errors_; }
  [[nodiscard]] std::uint64_t warnings() const { return warnings_; }

 private:
  void count(Finding::Severity severity, std::uint64_t number);

  struct Kind {
    std::vector<Finding> kept;
    std::uint64_t all = 0;
  };
  std::vector<std::string> order_;
  std::map<std::string, Kind, std::less<>> kinds_;
  std::uint64_t errors_ = 0;
  std::uint64_t warnings_ = 0;
};

/// Returns `1,234,567`.
std::string grouped(std::uint64_t number);

/// Returns `1 slice`, `1,234 slices`.
std::string counted(std::uint64_t number, const std::string& one, const std::string& several = {});

/// Returns `error`, `warning` or `note`.
std::string_view nameOf(Finding::Severity severity);

/// Returns the finding in one line: severity, place, text and kind.
std::string textOf(const Finding& finding);

}  // namespace vdbdither
