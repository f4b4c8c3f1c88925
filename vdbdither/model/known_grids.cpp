#include "vdbdither/model/known_grids.h"

#include <array>

#include "vdbdither/model/schema.h"

namespace vdbdither {

namespace {

/// A grid that describes another one and is wrong once that one has changed.
struct Described {
  std::string_view name;
  std::string_view of;          ///< the grid that it describes
  bool is_found_again = false;  ///< by every operator that needs it
};

/// `Cd`, `Alpha`, `part` and coverages are not here: they are properties of the part, not of its
/// surface.
constexpr std::array<Described, 6> described_grids{{{normal_grid, surface_grid, true},
                                                    {closest_grid, surface_grid, true},
                                                    {displaced_grid, surface_grid},
                                                    {solid_grid, surface_grid},
                                                    {material_grid, solid_grid},
                                                    {printed_grid, solid_grid}}};

/// What the table says of the grid `name`; of others, that it describes none.
Described descriptionOf(std::string_view name) {
  for (const Described& entry : described_grids)
    if (name == entry.name) return entry;
  return {};
}

/// Whether a grid that `name` describes, directly or not, is one for which `holds` is true.
template <typename Predicate>
bool describesAny(std::string_view name, const Predicate& holds) {
  for (name = descriptionOf(name).of; !name.empty(); name = descriptionOf(name).of)
    if (holds(name)) return true;
  return false;
}

}  // namespace

Schema withoutOutdated(Schema schema, std::string_view changed) {
  std::erase_if(schema.grids, [&](const auto& grid) {
    return describesAny(grid.first, [&](std::string_view name) { return name == changed; });
  });
  return schema;
}

std::vector<std::string> outdatedGrids(const Schema& before, const Schema& after) {
  const auto changed = [&](std::string_view name) {
    const auto now = after.grids.find(name);
    if (now == after.grids.end()) return false;
    const auto then = before.grids.find(name);
    return then == before.grids.end() || then->second != now->second;
  };
  std::vector<std::string> names;
  for (const auto& [name, grid] : before.grids) {
    if (descriptionOf(name).is_found_again) continue;
    if (!after.grids.contains(name) && describesAny(name, changed)) names.push_back(name);
  }
  return names;
}

}  // namespace vdbdither
