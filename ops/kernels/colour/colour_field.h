#pragma once

#include <memory>
#include <span>
#include <vector>

#include "ops/kernels/colour/solid_colours.h"
#include "ops/kernels/colour/voxel_groups.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/mesh/solid_mesh.h"
#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// `Cd` and `Alpha` over a range of layers.
struct ColourGrids {
  openvdb::Vec3SGrid::Ptr colour;
  openvdb::FloatGrid::Ptr opacity;  ///< null where all surfaces are opaque
};

/// The colour of the nearest point of the surface of solids, in the voxels near it.
///
/// A voxel has a colour if it is active in the distance band and at most a voxel diagonal outside,
/// or if it is inside and at most `depth_mm` below the surface. In the band the nearest point is
/// exact. Below it, one search serves a group of voxels: the colour is that of the point nearest to
/// the middle of the group. The result depends on neither the division of the
/// layers nor the number of threads.
class ColourField {
 public:
  /// @param colours   of the sources of all solids
  /// @param depth_mm  0 … 1000
  /// @param tie_mm    see MeshDistance
  ColourField(std::shared_ptr<const SurfaceColours> colours, const Lattice& lattice,
              double depth_mm, double tie_mm);

  /// Adds a solid, in mm: first the whole part, then the bodies that it consists of if there are
  /// several.
  void add(const SolidMesh& solid);

  /// Returns the colours of the layers `core`.
  /// @param bands  of every solid: `surface` and `closest` in these layers
  /// @param parts  the body of each voxel, counted from 1, whose surface gives the colour; null
  ///               where there is one
  [[nodiscard]] ColourGrids run(std::span<const DistanceGrids> bands,
                                const openvdb::Int32Grid* parts, ZRange core) const;

  /// The voxels below the band that share a search.
  [[nodiscard]] const VoxelGroups& groups() const { return groups_; }

  [[nodiscard]] double memoryBytes() const;

 private:
  class Painter;

  struct Solid {
    SolidColours colours;
    std::unique_ptr<MeshDistance> below;  ///< the search below the band; null if the depth is 0
  };

  std::shared_ptr<const SurfaceColours> colours_;
  Lattice lattice_;
  double depth_mm_;
  double tie_mm_;
  VoxelGroups groups_;
  Lattice middles_;  ///< of the groups
  std::vector<Solid> solids_;
};

}  // namespace vdbdither
