#pragma once

// The distance family: kernels that make signed distances in mm, from meshes and other surfaces,
// and that combine, offset and differentiate them.

#include <algorithm>
#include <memory>

#include "ops/kernels/distance/leaf_distances.h"
#include "ops/kernels/distance/mesh_features.h"
#include "vdbdither/model/lattice.h"
#include "vdbdither/model/mesh.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The band around the surface in which distances are held.
///
/// In diameters, it reaches `diameters` times the larger of two lengths, where n is the surface's
/// normal: the voxel's diameter along n (1 / ‖D n‖∞, twice k_D of eq. 6 in Morsy et al. 2022), and
/// the maximum change of the distance between neighbours (max |n_a|·pitch_a). A band of one
/// diameter holds every voxel that dithering decides and every surface voxel. A leaf holds the
/// widest band of the surface near it, so that this is also true beside sharp edges.
struct Band {
  double diameters = 1;
  double mm = 0;  ///< the same distance everywhere; replaces diameters if not zero
  /// Features are searched for voxels inside alone: outside, distances may be too large and
  /// `closest` wrong. Inside, `closest` is any of several triangles that are nearest.
  bool inside_only = false;

  /// Returns its maximum on a lattice of this pitch.
  [[nodiscard]] double maximumMm(const openvdb::Vec3d& pitch_mm) const {
    return mm > 0 ? mm : diameters * pitch_mm.length();
  }

  /// Returns its minimum: distances up to it are held everywhere.
  [[nodiscard]] double minimumMm(const openvdb::Vec3d& pitch_mm) const {
    return mm > 0 ? mm : diameters * std::min({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()});
  }
};

/// The grids to make besides the distance; none of them needs a second search.
struct DistanceExtras {
  bool normals = false;  ///< `N`: the unit outward normal, from the nearest point of the surface
  bool closest = false;  ///< the index of the nearest triangle, the lowest of several
};

/// The grids over a range of layers; those that were not requested are null.
struct DistanceGrids {
  openvdb::FloatGrid::Ptr surface;
  openvdb::Vec3SGrid::Ptr normals;
  openvdb::Int32Grid::Ptr closest;
};

/// Signed distance from a mesh, exact in millimetres on any lattice, made slab by slab.
///
/// Guarantees, for every voxel of the lattice's box:
/// - It is active in `surface` where its distance is below the band, and holds that distance to the
///   precision of a float, negative inside. Elsewhere it is inactive and holds ±background, which
///   is the band in mm.
/// - Where its distance is below tieMm() its centre counts as on the surface: it holds ±tied_mm,
/// and
///   is inside where the point shifted by (ε, ε³, ε²) is, however the surface is cut into
///   triangles.
/// - Inside is where the winding number along the row of voxels (x) is not zero. Neighbouring
///   triangles are counted by rules that agree to the bit, so that the sign is right for every
///   closed mesh, with cavities and parts in any orientation.
/// - The result depends on the mesh, the lattice and the band alone: not on how the layers are
///   divided into spans, on threads or on the instruction set. The tree is canonical: every leaf
///   has an active voxel or a change of sign, and the interior is tiles.
///
/// Memory beyond the mesh is bounded by the layers of one run, and by `chunk_layers` if the run is
/// higher.
class MeshDistance {
 public:
  static constexpr int chunk_layers = LeafDistances::depth * leaf_layers;

  /// `mesh` in mm, at positions of the lattice; it is not used after construction. No distance is
  /// measured to the triangles that `walls` hides. `tie_mm`: see tieMm().
  MeshDistance(const Mesh& mesh, const Lattice& lattice, Band band, DistanceExtras extras = {},
               const SwallowedWalls& walls = {}, double tie_mm = 0);

  /// Makes the layers of `core`, clipped to the lattice's box. Can be called in any order, and from
  /// many threads at once.
  ///
  /// `N` is the outward direction between the nearest point and the voxel's centre; within 1e-6 mm
  /// of the surface, where it is undefined, the normal of the nearest triangle (the lowest at the
  /// nearest edge or vertex).
  [[nodiscard]] DistanceGrids run(ZRange core) const;

  [[nodiscard]] double backgroundMm() const { return band_.maximumMm(lattice_.pitch_mm); }

  /// Centres nearer than this to the surface lie on it: the length asked for, but above the
  /// rounding of the mesh's own coordinates and at most a quarter of the smallest pitch.
  [[nodiscard]] double tieMm() const { return tie_mm_; }

  /// Returns the bytes held from construction on, including a copy of the mesh.
  [[nodiscard]] double memoryBytes() const;

 private:
  class Block;

  [[nodiscard]] double reachMm(int axis) const;
  /// Adds `voxels`, of at most `chunk_layers` layers.
  void append(const openvdb::CoordBBox& voxels, DistanceGrids& grids) const;

  Lattice lattice_;
  Band band_;
  double tie_mm_;
  DistanceExtras extras_;
  MeshFeatures features_;
  std::vector<float>
      triangle_band_mm_;  ///< by triangle: of the face and its edges; empty if the band is in mm
  double widest_mm_ = 0;  ///< the maximum of these
};

}  // namespace vdbdither
