#pragma once

#include <optional>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Whether the voxels beyond the band of a level set have the sign of their side.
enum class InsideSigns {
  given,    ///< they have
  filled,   ///< those inside were at +background, and were given their sign
  missing,  ///< those inside are at +background, and the surface is open: nothing says what they
            ///< are
};

/// A level set with the signs of its inside.
struct SignedLevelSet {
  openvdb::FloatGrid::ConstPtr grid;
  InsideSigns signs = InsideSigns::given;
  openvdb::Coord open_at;  ///< where signs are missing: a voxel at which the surface is open
};

/// Returns `grid`, or a copy of it whose signs were filled from its surface.
///
/// In a level set of OpenVDB the distances inside go on to −background. Some tools write
/// +background on both sides. Then a negative voxel of the band touches a positive one beyond it.
/// Level sets that were cut show the same where they were cut, but have negative voxels beyond
/// their band. They are returned as given.
SignedLevelSet withInsideSigns(const openvdb::FloatGrid::ConstPtr& grid);

}  // namespace vdbdither
