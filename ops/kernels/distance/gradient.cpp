#include "ops/kernels/distance/gradient.h"

#include "ops/kernels/leaf/floats.h"
#include "vdbdither/model/known_grids.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace vdbdither {

using openvdb::Vec3s;

namespace {

constexpr float no_sample = std::numeric_limits<float>::infinity();

template <typename Lanes>
[[gnu::always_inline]] inline void findSlope(const float* at, int stride, float per_pitch,
                                             Lanes& slope) {
  Lanes below, centre, above;
  loadLanes(at - stride, below);
  loadLanes(at, centre);
  loadLanes(at + stride, above);
  const auto has_below = (below < no_sample) & (below > -no_sample);
  const auto has_above = (above < no_sample) & (above > -no_sample);
  const Lanes rise = (has_above ? above : centre) - (has_below ? below : centre);
  const Lanes whole = Lanes{} + per_pitch;
  slope = rise * ((has_above & has_below) ? 0.5F * whole : whole);
}

[[gnu::always_inline]] inline void takeRoot(Floats& values) {
#ifdef __SSE2__
  values = _mm_sqrt_ps(values);
#else
  for (int lane = 0; lane < 4; ++lane) values[lane] = std::sqrt(values[lane]);
#endif
}

[[gnu::always_inline]] inline void takeRoot(EightFloats& values) {
  Floats low = __builtin_shufflevector(values, values, 0, 1, 2, 3);
  Floats high = __builtin_shufflevector(values, values, 4, 5, 6, 7);
  takeRoot(low);
  takeRoot(high);
  values = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
}

/// By component, the normals of as many voxels as there are lanes, the first at `at`.
template <typename Lanes>
[[gnu::always_inline]] inline void findUnitGradients(const float* at,
                                                     const openvdb::Vec3f& per_pitch,
                                                     std::array<Lanes, 3>& normals) {
  findSlope(at, LeafSurroundings::stride_x, per_pitch[0], normals[0]);
  findSlope(at, LeafSurroundings::stride_y, per_pitch[1], normals[1]);
  findSlope(at, LeafSurroundings::stride_z, per_pitch[2], normals[2]);
  Lanes length = normals[0] * normals[0] + normals[1] * normals[1] + normals[2] * normals[2];
  takeRoot(length);
  const Lanes divisor = length > 0.0F ? length : Lanes{} + no_sample;
  for (Lanes& component : normals) component /= divisor;
}

}  // namespace

/// The rows, compiled for each instruction set.
struct LeafNormals::Loops {
  template <typename Lanes>
  [[gnu::always_inline]] static void makeRows(const LeafNormals& leaf, std::uint64_t rows,
                                              Row* out) {
    constexpr std::size_t lanes = sizeof(Lanes) / sizeof(float);
    for (; rows != 0; rows &= rows - 1) {
      const auto row = static_cast<unsigned>(std::countr_zero(rows));
      for (std::size_t z = 0; z < 8; z += lanes) {
        std::array<Lanes, 3> normals;
        findUnitGradients(leaf.around_.at(8 * row) + z, leaf.per_pitch_, normals);
        for (std::size_t axis = 0; axis < 3; ++axis)
          std::memcpy(&out[row][axis][z], &normals[axis], sizeof normals[axis]);
      }
    }
  }

  static void makeRowsBaseline(const LeafNormals& leaf, std::uint64_t rows, Row* out) {
    makeRows<Floats>(leaf, rows, out);
  }

#if defined(__x86_64__)
  [[gnu::target("avx2")]] static void makeRowsAvx2(const LeafNormals& leaf, std::uint64_t rows,
                                                   Row* out) {
    makeRows<EightFloats>(leaf, rows, out);
  }
#endif
};

LeafNormals::LeafNormals(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm,
                         ZRange valid, [[maybe_unused]] InstructionSet instructions)
    : around_(surface, valid),
      per_pitch_(openvdb::Vec3d(1.0) / pitch_mm),
      make_rows_(&Loops::makeRowsBaseline) {
#if defined(__x86_64__)
  if (instructions == InstructionSet::avx2) make_rows_ = &Loops::makeRowsAvx2;
#endif
}

Vec3s LeafNormals::normal(unsigned offset) const {
  std::array<Floats, 3> normals;
  findUnitGradients(around_.at(offset), per_pitch_, normals);
  return {normals[0][0], normals[1][0], normals[2][0]};
}

openvdb::Vec3SGrid::Ptr makeNormalGrid(const openvdb::math::Transform& transform) {
  auto grid = openvdb::Vec3SGrid::create(Vec3s(0.0F));
  grid->setName(normal_grid);
  grid->setVectorType(openvdb::VEC_COVARIANT_NORMALIZE);
  grid->setTransform(transform.copy());
  return grid;
}

openvdb::Vec3SGrid::Ptr outwardNormals(const openvdb::FloatGrid& surface,
                                       const openvdb::Vec3d& pitch_mm, ZRange core, ZRange valid) {
  using NormalLeaf = openvdb::Vec3STree::LeafNodeType;
  auto grid = makeNormalGrid(surface.transform());
  addLeaves(grid->tree(), leavesIn(surface.tree(), core), [&] {
    return [core,
            normals = LeafNormals(surface.tree(), pitch_mm, valid)](const FloatLeaf& leaf) mutable {
      const LeafBits bits = activeBits(leaf, rowWithin(leaf.origin().z(), core));
      if (bits == no_bits) return std::unique_ptr<NormalLeaf>();

      normals.visit(leaf, bits);
      openvdb::util::NodeMask<3> active;
      for (unsigned x = 0; x < 8; ++x) active.getWord<std::uint64_t>(x) = bits[x];
      auto made = std::make_unique<NormalLeaf>(leaf.origin(), Vec3s(0.0F));
      made->setValueMask(active);
      Vec3s* out = made->buffer().data();
      std::array<LeafNormals::Row, 64> rows;
      normals.makeRows(rowsOf(bits), rows.data());
      forEachBit(bits, [&](unsigned offset) {
        const LeafNormals::Row& normal = rows[offset / 8];
        const unsigned z = offset % 8;
        out[offset] = {normal[0][z], normal[1][z], normal[2][z]};
      });
      return made;
    };
  });
  return grid;
}

}  // namespace vdbdither
