#pragma once

#include <algorithm>
#include <memory>

#include "ops/kernels/distance/leaf_distances.h"
#include "ops/kernels/distance/mesh_features.h"
#include "vdbdither/model/lattice.h"
#include "vdbdither/model/mesh.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// How far from the surface distances are kept.
///
/// In diameters: where the surface has the normal n, `diameters` times the larger of the voxel's
/// diameter along n (1 / ‖D n‖∞, twice k_D of eq. 6 in Morsy et al. 2022) and the most that the
/// distance changes between neighbours (max |n_a|·pitch_a). One of them holds every voxel that
/// dithering decides and every surface voxel: a leaf keeps the largest band of the surface near it,
/// so that this is also so beside sharp edges.
struct Band {
  double diameters = 1;
  double mm = 0;  ///< the same distance everywhere, in place of diameters, where it is not zero

  /// The largest that it comes to on a lattice of this pitch.
  [[nodiscard]] double greatestMm(const openvdb::Vec3d& pitch_mm) const {
    return mm > 0 ? mm : diameters * pitch_mm.length();
  }

  /// The smallest: distances up to it are kept everywhere.
  [[nodiscard]] double leastMm(const openvdb::Vec3d& pitch_mm) const {
    return mm > 0 ? mm : diameters * std::min({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()});
  }
};

/// What is kept besides the distance; none of it costs a second search.
struct DistanceExtras {
  bool normals = false;  ///< `N`: the unit outward normal, from the nearest point of the surface
  bool closest = false;  ///< the index of the nearest triangle; the lowest that shares the
                         ///< nearest edge or vertex
};

/// The grids over a range of layers; those that were not asked for are null.
struct DistanceGrids {
  openvdb::FloatGrid::Ptr surface;
  openvdb::Vec3SGrid::Ptr normals;
  openvdb::Int32Grid::Ptr closest;
};

/// Signed distance from a mesh, exact in millimetres on any lattice, made slab by slab.
///
/// Guarantees, for every voxel of the lattice's box:
/// - it is active in `surface` where its distance is below the band, and holds that distance to the
/// precision of a
///   float, negative inside; elsewhere it is inactive and holds ±background, which is the band in
///   mm;
/// - where its distance is below tieMm() its centre lies on the surface: it holds ±tied_mm, and is
///   inside where the point shifted by (ε, ε³, ε²) is, however the surface is cut into triangles;
/// - inside is where the winding number along the row of voxels (x) is not zero, counted by rules
/// that agree to the bit
///   between neighbouring triangles: right on every closed mesh, with cavities and parts in any
///   orientation;
/// - the bits depend on the mesh, the lattice and the band alone: not on how the layers are cut
/// into spans, on threads
///   or on the instruction set. The tree is in canonical form: no leaf without an active voxel or a
///   change of sign, the interior as tiles.
///
/// Memory beyond the mesh is bounded by the layers of one run, and by `chunk_layers` where the run
/// is higher.
class MeshDistance {
 public:
  static constexpr int chunk_layers = LeafDistances::depth * leaf_layers;

  /// `mesh` in mm, not used after this; no distance is measured to what `walls` hides of it.
  /// Positions are those of the lattice. `tie_mm`: see tieMm().
  MeshDistance(const Mesh& mesh, const Lattice& lattice, Band band, DistanceExtras extras = {},
               const SwallowedWalls& walls = {}, double tie_mm = 0);

  /// The layers of `core`, clipped to the lattice's box. Const, in any order, from many threads at
  /// once.
  ///
  /// `N` is the direction from the nearest point to the voxel's centre, outwards; closer than 1e-6
  /// mm to the surface, where that says nothing, the normal of the nearest triangle (the lowest
  /// where an edge or a vertex is nearest).
  [[nodiscard]] DistanceGrids run(ZRange core) const;

  [[nodiscard]] double backgroundMm() const { return band_.greatestMm(lattice_.pitch_mm); }

  /// Centres nearer than this to the surface lie on it: the length asked for, but above the
  /// rounding of the mesh's own coordinates and at most a quarter of the smallest pitch.
  [[nodiscard]] double tieMm() const { return tie_mm_; }

  /// Bytes held from construction on, a copy of the mesh included.
  [[nodiscard]] double memoryBytes() const;

 private:
  class Block;

  [[nodiscard]] double reachMm(int axis) const;
  /// Makes `voxels`, of at most `chunk_layers` layers.
  void append(const openvdb::CoordBBox& voxels, DistanceGrids& grids) const;

  Lattice lattice_;
  Band band_;
  double tie_mm_;
  DistanceExtras extras_;
  MeshFeatures features_;
  std::vector<float>
      triangle_band_mm_;  ///< of the face and its edges; empty where the band is in mm
  double widest_mm_ = 0;  ///< of these
};

}  // namespace vdbdither
