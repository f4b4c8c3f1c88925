#pragma once

#include <cstdint>

#include "ops/kernels/contour/iso_surface.h"
#include "ops/kernels/leaf/bit_layers.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The faces between voxels of a set and what is not of it, layer by layer: the set as a heap of
/// blocks. Two triangles a face, which face outwards; faces share no vertices, but what meets has
/// equal coordinates. Above the last layer and below the first all counts as empty.
class VoxelFaces {
 public:
  explicit VoxelFaces(const Lattice& lattice) : lattice_(lattice), frame_(lattice.box) {}

  [[nodiscard]] const BitFrame& frame() const { return frame_; }

  /// Takes layer `z`, the next one above that before: gives the faces of the one before.
  SurfacePiece add(BitLayer layer, int z);
  /// The faces of the last layer.
  SurfacePiece finish();

 private:
  void emit(const BitLayer& above, SurfacePiece& piece);

  Lattice lattice_;
  BitFrame frame_;
  BitLayer below_, here_;
  int z_ = 0;
  std::uint32_t vertices_ = 0;
};

}  // namespace vdbdither
