#include "ops/kernels/contour/voxel_faces.h"

#include <array>
#include <bit>
#include <limits>
#include <utility>

#include "vdbdither/model/errors.h"

namespace vdbdither {

using openvdb::Vec3d;

SurfacePiece VoxelFaces::add(BitLayer layer, int z) {
  SurfacePiece piece;
  if (here_.empty()) {
    below_ = layout_.emptyLayer();
  } else {
    emit(layer, piece);
    below_ = std::move(here_);
  }
  here_ = std::move(layer);
  z_ = z;
  piece.open_from = vertices_;
  return piece;
}

SurfacePiece VoxelFaces::finish() {
  SurfacePiece piece;
  if (!here_.empty()) emit(layout_.emptyLayer(), piece);
  piece.open_from = vertices_;
  return piece;
}

void VoxelFaces::emit(const BitLayer& above, SurfacePiece& piece) {
  // Adds the face whose normal is `sign` times `axis`; the other two axes are ordered so that it
  // faces outwards.
  const auto face = [&](int x, int y, int axis, int sign) {
    if (vertices_ > std::numeric_limits<std::uint32_t>::max() - 4)
      throw DataError("the voxels have more faces than 32 bits count; take fewer layers");
    const int u = (axis + (sign > 0 ? 1 : 2)) % 3;
    const int v = (axis + (sign > 0 ? 2 : 1)) % 3;
    constexpr std::array<std::array<double, 2>, 4> corners{
        {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}};
    for (const auto& [along_u, along_v] : corners) {
      Vec3d index(x, y, z_);
      index[axis] += 0.5 * sign;
      index[u] += along_u;
      index[v] += along_v;
      piece.vertices.push_back(index * lattice_.pitch_mm + lattice_.origin_mm);
    }
    piece.triangles.push_back({vertices_, vertices_ + 1, vertices_ + 2});
    piece.triangles.push_back({vertices_, vertices_ + 2, vertices_ + 3});
    vertices_ += 4;
  };
  const auto word = [&](const BitLayer& layer, int row, int column) {
    if (row < 0 || row >= layout_.rows() || column < 0 || column >= layout_.words())
      return std::uint64_t{0};
    return layer[layout_.row(row) + static_cast<std::size_t>(column)];
  };
  for (int row = 0; row < layout_.rows(); ++row) {
    for (int column = 0; column < layout_.words(); ++column) {
      const std::uint64_t here = word(here_, row, column);
      if (here == 0) continue;
      const std::uint64_t left = here << 1 | word(here_, row, column - 1) >> 63;
      const std::uint64_t right = here >> 1 | word(here_, row, column + 1) << 63;
      const std::array<std::uint64_t, 6> neighbours{left,
                                                    right,
                                                    word(here_, row - 1, column),
                                                    word(here_, row + 1, column),
                                                    word(below_, row, column),
                                                    word(above, row, column)};
      for (std::size_t side = 0; side < neighbours.size(); ++side) {
        for (std::uint64_t open = here & ~neighbours[side]; open != 0; open &= open - 1)
          face(layout_.xBegin() + 64 * column + std::countr_zero(open), layout_.yBegin() + row,
               static_cast<int>(side / 2), side % 2 == 0 ? -1 : 1);
      }
    }
  }
}

}  // namespace vdbdither
