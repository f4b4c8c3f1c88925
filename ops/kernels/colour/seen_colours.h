#pragma once

#include <array>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The colours that printed voxels show: light wanders through several of them before it leaves, so
/// the eye sees a mean of their colours. Here it is the mean of the printed voxels around, weighted
/// by a Gaussian, by the mixing law of InkMixture.
class SeenColours {
 public:
  /// @param weights       along each axis, of the voxels from −reach to +reach (GaussianSpread)
  /// @param linear_rgb    of every material, 0 … 1
  /// @param is_seen       of every material: whether it has a colour; what is clear has none
  /// @param yule_nielsen  factor n of red, green and blue
  SeenColours(std::array<std::vector<float>, 3> weights, std::vector<openvdb::Vec3d> linear_rgb,
              std::vector<bool> is_seen, const openvdb::Vec3d& yule_nielsen);

  /// Bytes that a thread of `run` holds.
  [[nodiscard]] double memoryBytes() const;

  /// Returns linear red, green and blue at the voxels of the leaves of `where` in the layers `core`
  /// that have printed voxels around them, printed or not.
  /// @param material  counted from 1; 0 is empty. Voxels of other numbers count as empty
  /// @param valid     the layers of `material` that count
  [[nodiscard]] openvdb::Vec3SGrid::Ptr run(const openvdb::Int32Grid& material,
                                            const openvdb::FloatGrid& where, ZRange core,
                                            ZRange valid) const;

 private:
  class Painter;

  std::array<std::vector<float>, 3> weights_;
  std::vector<openvdb::Vec3f> roots_;  ///< by number; the first is of empty voxels
  std::vector<bool> is_seen_;          ///< by number
  openvdb::Vec3d yule_nielsen_;
};

}  // namespace vdbdither
