#include "vdbdither/engine/command.h"

#include <array>

namespace vdbdither {

extern const CommandInfo docs;
extern const CommandInfo printers;
extern const CommandInfo ssim;

std::span<const CommandInfo* const> commands() {
  static constexpr std::array<const CommandInfo*, 3> entries{&docs, &printers, &ssim};
  return entries;
}

const CommandInfo* findCommand(std::string_view name) {
  for (const CommandInfo* info : commands()) {
    if (info->name == name) return info;
  }
  return nullptr;
}

}  // namespace vdbdither
