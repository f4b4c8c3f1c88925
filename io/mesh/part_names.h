#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

namespace vdbdither {

/// Gives each part of a mesh a name of its own: "wheel", and "wheel 2" for the second.
class PartNames {
 public:
  std::string unique(const std::string& name) {
    std::string chosen = name;
    while (!taken_.try_emplace(chosen, 1).second)
      chosen = name + " " + std::to_string(++taken_[name]);
    return chosen;
  }

 private:
  std::unordered_map<std::string, std::uint64_t> taken_;  ///< and the last number behind it
};

}  // namespace vdbdither
