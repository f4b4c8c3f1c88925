#include "ops/kernels/distance/gradient.h"

#include "ops/kernels/leaf/floats.h"
#include "vdbdither/model/known_grids.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <cmath>
#include <limits>

namespace vdbdither {

using openvdb::Vec3s;

namespace {

constexpr float no_sample = std::numeric_limits<float>::infinity();

inline FloatBits isSample(Floats values) { return (values < no_sample) & (values > -no_sample); }

inline Floats slope(const float* at, int stride, float per_pitch) {
  const Floats below = loadFloats(at - stride);
  const Floats centre = loadFloats(at);
  const Floats above = loadFloats(at + stride);
  const FloatBits has_below = isSample(below);
  const FloatBits has_above = isSample(above);
  const Floats rise = (has_above ? above : centre) - (has_below ? below : centre);
  const Floats whole = Floats{} + per_pitch;
  return rise * ((has_above & has_below) ? 0.5F * whole : whole);
}

inline Floats root(Floats values) {
#ifdef __SSE2__
  return _mm_sqrt_ps(values);
#else
  for (int lane = 0; lane < 4; ++lane) values[lane] = std::sqrt(values[lane]);
  return values;
#endif
}

/// By component, the normals of four voxels, the first at `at`.
inline std::array<Floats, 3> unitGradients(const float* at, const openvdb::Vec3f& per_pitch) {
  const Floats x = slope(at, LeafSurroundings::stride_x, per_pitch[0]);
  const Floats y = slope(at, LeafSurroundings::stride_y, per_pitch[1]);
  const Floats z = slope(at, LeafSurroundings::stride_z, per_pitch[2]);
  const Floats length = root(x * x + y * y + z * z);
  const Floats divisor = length > 0.0F ? length : Floats{} + no_sample;
  return {x / divisor, y / divisor, z / divisor};
}

}  // namespace

LeafNormals::LeafNormals(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm,
                         ZRange valid)
    : around_(surface, valid), per_pitch_(openvdb::Vec3d(1.0) / pitch_mm) {}

Vec3s LeafNormals::normal(unsigned offset) const {
  const std::array<Floats, 3> normals = unitGradients(around_.at(offset), per_pitch_);
  return {normals[0][0], normals[1][0], normals[2][0]};
}

void LeafNormals::makeRow(unsigned offset, Row& row) const {
  for (std::size_t z = 0; z < 8; z += 4) {
    const std::array<Floats, 3> normals = unitGradients(around_.at(offset) + z, per_pitch_);
    for (std::size_t axis = 0; axis < 3; ++axis) storeFloats(&row[axis][z], normals[axis]);
  }
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
      for (unsigned offset = 0; offset < 512; offset += 8) {
        const auto row = static_cast<std::uint8_t>(bits[offset / 64] >> (offset % 64));
        if (row == 0) continue;
        LeafNormals::Row normal;
        normals.makeRow(offset, normal);
        for (unsigned z = 0; z < 8; ++z) {
          if ((row >> z) & 1U) out[offset + z] = {normal[0][z], normal[1][z], normal[2][z]};
        }
      }
      return made;
    };
  });
  return grid;
}

}  // namespace vdbdither
