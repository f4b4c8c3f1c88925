#include "ops/kernels/dither/voxel_normals.h"

#include <bit>
#include <cstring>

#include "ops/kernels/leaf/floats.h"

namespace vdbdither {

/// The distances in k_D, compiled for each instruction set.
struct VoxelNormals::Loops {
  template <typename Lanes>
  [[gnu::always_inline]] static LeafBits within(const VoxelNormals& normals,
                                                const LeafBits& undecided, float limit) {
    constexpr std::size_t lanes = sizeof(Lanes) / sizeof(float);
    const auto load = [](const float* from, Lanes& values) __attribute__((always_inline)) {
      std::memcpy(&values, from, sizeof values);
    };
    LeafBits near = no_bits;
    for (std::uint64_t rows = rowsOf(undecided); rows != 0; rows &= rows - 1) {
      const auto row = static_cast<unsigned>(std::countr_zero(rows));
      const float* d = normals.leaf_->buffer().data() + std::size_t{8} * row;
      std::array<float, 8> diameters;  // |d| / k_D
      for (unsigned z = 0; z < 8; z += lanes) {
        Lanes steepest{};  // 1 / (2·k_D)
        for (unsigned axis = 0; axis < 3; ++axis) {
          Lanes steep;
          load(&normals.rows_[row][axis][z], steep);
          steep = (steep < 0.0F ? -steep : steep) * normals.per_pitch_[axis];
          steepest = steep > steepest ? steep : steepest;
        }
        Lanes distance;
        load(d + z, distance);
        distance = 2.0F * (distance < 0.0F ? -distance : distance) * steepest;
        std::memcpy(&diameters[z], &distance, sizeof distance);
      }
      const auto bits = static_cast<std::uint8_t>(undecided[row / 8] >> (row % 8 * 8));
      near[row / 8] |=
          std::uint64_t{static_cast<std::uint8_t>(bits & rowBelow(diameters.data(), limit))}
          << (row % 8 * 8);
    }
    return near;
  }

  static LeafBits withinBaseline(const VoxelNormals& normals, const LeafBits& undecided,
                                 float limit) {
    return within<Floats>(normals, undecided, limit);
  }

#if defined(__x86_64__)
  [[gnu::target("avx2")]] static LeafBits withinAvx2(const VoxelNormals& normals,
                                                     const LeafBits& undecided, float limit) {
    return within<EightFloats>(normals, undecided, limit);
  }
#endif
};

VoxelNormals::VoxelNormals(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm,
                           const openvdb::Vec3STree* given, ZRange valid,
                           InstructionSet instructions)
    : gradient_(surface, pitch_mm, valid, instructions),
      per_pitch_(openvdb::Vec3d(1.0) / pitch_mm),
      within_(&Loops::withinBaseline) {
#if defined(__x86_64__)
  if (instructions == InstructionSet::avx2) within_ = &Loops::withinAvx2;
#endif
  if (given) given_.emplace(*given);
}

void VoxelNormals::visit(const FloatLeaf& leaf, const LeafBits& wanted) {
  leaf_ = &leaf;
  wanted_ = wanted;
  visited_ = false;
  rows_made_ = 0;
}

const LeafSurroundings& VoxelNormals::around() {
  if (!visited_) gradient_.visit(*leaf_, wanted_);
  visited_ = true;
  return gradient_.around();
}

LeafBits VoxelNormals::within(const LeafBits& undecided, double reach) {
  if (given_) return undecided;
  makeRows(rowsOf(undecided));
  return within_(*this, undecided, static_cast<float>(reach * (1 + 1e-5)));
}

void VoxelNormals::makeRows(std::uint64_t rows) {
  rows &= ~rows_made_;
  if (rows == 0) return;
  rows_made_ |= rows;
  around();
  gradient_.makeRows(rows, rows_.data());
}

}  // namespace vdbdither
