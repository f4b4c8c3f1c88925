#pragma once

#include <memory>
#include <mutex>

#include "ops/kernels/contour/zero_set.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Signed distance in mm from a zero set, on any lattice, made slab by slab: that from the mesh
/// which it is turned into says where the nearest point is about, and steps on the interpolant the
/// rest. What is inside, the mesh decides, but for voxels that are on its surface. The bits do not
/// depend on how the layers are cut into runs.
class ZeroSetDistance {
 public:
  /// `band`: as mesh2sdf's; what is held is wider by `slack_mm`, by which the mesh may be off.
  ZeroSetDistance(std::shared_ptr<const ZeroSet> surface, const Lattice& lattice, const Band& band,
                  double slack_mm);

  /// The grid `surface` over the layers of `core`. Const, in any order; cheapest upwards.
  [[nodiscard]] openvdb::FloatGrid::Ptr run(ZRange core) const;

  [[nodiscard]] double backgroundMm() const { return wide_.greatestMm(lattice_.pitch_mm); }

 private:
  /// A mesh is made for so many layers at once, whatever is asked for: its bits are those of the
  /// chunk alone.
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
