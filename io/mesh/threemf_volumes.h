#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/mesh/mesh_file.h"
#include "io/mesh/threemf_model.h"
#include "io/mesh/threemf_package.h"

namespace vdbdither {

/// What a slicer says of a volume within an object, beside the model: PrusaSlicer names its
/// triangles, Bambu Studio and OrcaSlicer its component.
struct ThreemfVolume {
  enum class Kind { part, negative, helper };

  std::uint32_t object = 0;
  Kind kind = Kind::part;
  std::string name;  ///< printable; may be empty
  std::uint32_t first_triangle = 0;
  std::optional<std::uint32_t> last_triangle;
  std::optional<std::uint32_t> component;
};

/// Returns the volumes that slicers describe in a project; none in other files. Throws DataError.
std::vector<ThreemfVolume> readThreemfVolumes(ThreemfPackage& package);

/// Takes out of a model the volumes that are not printed, such as modifiers and support blockers,
/// and warns of them. Refuses volumes that are cut out of others.
void leaveOutHelpers(const std::vector<ThreemfVolume>& volumes, ThreemfPart& root,
                     const MeshFile& file);

}  // namespace vdbdither
