#pragma once

#include <cstdint>

#include "ops/kernels/contour/iso_surface.h"
#include "ops/kernels/leaf/bit_layers.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Makes the faces between voxels of a set and voxels outside it, layer by layer: the set drawn as
/// blocks. Each face is two triangles that face outwards. Faces do not share vertices, but their
/// common corners have equal coordinates. Everything above the last layer and below the first
/// counts as empty.
class VoxelFaces {
 public:
  explicit VoxelFaces(const Lattice& lattice) : lattice_(lattice), layout_(lattice.box) {}

  [[nodiscard]] const BitLayout& layout() const { return layout_; }

  /// Takes layer `z`, the one above the last. Returns the faces of the layer below it.
  SurfacePiece add(BitLayer layer, int z);
  /// Returns the faces of the last layer.
  SurfacePiece finish();

 private:
  void emit(const BitLayer& above, SurfacePiece& piece);

  Lattice lattice_;
  BitLayout layout_;
  BitLayer below_, here_;
  int z_ = 0;
  std::uint32_t vertices_ = 0;
};

}  // namespace vdbdither
