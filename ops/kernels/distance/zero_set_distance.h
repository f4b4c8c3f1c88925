#pragma once

#include <memory>
#include <mutex>

#include "ops/kernels/contour/zero_set.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Signed distance in mm from a zero set, on any lattice, made slab by slab. The distance from a
/// mesh of the zero set gives the approximate nearest point; steps on the interpolant refine it.
/// The mesh also decides the sign, except of voxels on its surface. The result does not depend on
/// how the layers are divided into runs.
class ZeroSetDistance {
 public:
  /// `band` is that of mesh2sdf; the band held is wider by `slack_mm`, the maximum error of the
  /// mesh.
  ZeroSetDistance(std::shared_ptr<const ZeroSet> surface, const Lattice& lattice, const Band& band,
                  double slack_mm);

  /// Returns the grid `surface` over the layers of `core`. Can be called in any order, but is
  /// fastest upwards.
  [[nodiscard]] openvdb::FloatGrid::Ptr run(ZRange core) const;

  [[nodiscard]] double backgroundMm() const { return wide_.maximumMm(lattice_.pitch_mm); }

 private:
  /// A mesh is always made for this many layers at once, so that its bits depend on the chunk
  /// alone.
  static constexpr int chunk_layers = 64;

  [[nodiscard]] std::shared_ptr<const MeshDistance> chunk(int index) const;
  void correct(openvdb::FloatGrid& surface, const openvdb::Vec3SGrid& normals) const;

  std::shared_ptr<const ZeroSet> surface_;
  Lattice lattice_;
  Band wide_;
  double tie_mm_;  ///< centres nearer than this to the surface lie on it
  mutable std::mutex mutex_;
  mutable int last_index_ = 0;
  mutable std::shared_ptr<const MeshDistance> last_;
};

}  // namespace vdbdither
