#include "ops/kernels/gradient.h"

#include <cmath>
#include <limits>

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3s;

namespace {

constexpr float no_sample = std::numeric_limits<float>::infinity();

inline float slope(float below, float centre, float above, float per_pitch) {
  const bool has_below = below != no_sample;
  const bool has_above = above != no_sample;
  const float rise = (has_above ? above : centre) - (has_below ? below : centre);
  return rise * (has_above && has_below ? 0.5F * per_pitch : per_pitch);
}

/// The normal at `centre`, which points into a tile of the given strides.
inline Vec3s unitGradient(const float* centre, int stride_x, int stride_y,
                          const openvdb::Vec3f& per_pitch) {
  const float x = slope(centre[-stride_x], *centre, centre[stride_x], per_pitch[0]);
  const float y = slope(centre[-stride_y], *centre, centre[stride_y], per_pitch[1]);
  const float z = slope(centre[-1], *centre, centre[1], per_pitch[2]);
  const float length = std::sqrt(x * x + y * y + z * z);
  const float divisor = length > 0.0F ? length : std::numeric_limits<float>::infinity();
  return {x / divisor, y / divisor, z / divisor};
}

}  // namespace

LeafNormals::LeafNormals(const openvdb::FloatTree& surface, const openvdb::Vec3d& pitch_mm,
                         ZRange valid)
    : surface_(surface), per_pitch_(openvdb::Vec3d(1.0) / pitch_mm), valid_(valid) {}

void LeafNormals::setRow(int tile_offset, const float* values, std::uint8_t active) {
  for (unsigned z = 0; z < 8; ++z) {
    tile_[static_cast<unsigned>(tile_offset) + z] = (active >> z) & 1U ? values[z] : no_sample;
  }
}

void LeafNormals::visit(const FloatLeaf& leaf) {
  const Coord origin = leaf.origin();
  const auto active_row = [](const FloatLeaf& from, int x, int y) {
    return static_cast<std::uint8_t>(from.getValueMask().getWord<std::uint64_t>(x) >> (8 * y));
  };

  const std::uint8_t within = rowWithin(origin.z(), valid_);
  for (int x = 0; x < 8; ++x) {
    for (int y = 0; y < 8; ++y) {
      setRow(tileOffset(x, y, 0), leaf.buffer().data() + 64 * x + 8 * y,
             active_row(leaf, x, y) & within);
    }
  }

  static constexpr std::array<float, 8> nothing{};
  for (const bool above : {false, true}) {
    const int step = above ? 8 : -8;
    const int near = above ? 0 : 7;  // the neighbour's layer that touches this leaf
    const int rim = above ? 8 : -1;

    const FloatLeaf* in_x = surface_.probeConstLeaf(origin.offsetBy(step, 0, 0));
    const FloatLeaf* in_y = surface_.probeConstLeaf(origin.offsetBy(0, step, 0));
    const FloatLeaf* in_z = surface_.probeConstLeaf(origin.offsetBy(0, 0, step));
    if (!valid_.contains(origin.z() + (above ? 8 : -1))) in_z = nullptr;
    for (int n = 0; n < 8; ++n) {
      setRow(tileOffset(rim, n, 0),
             in_x ? in_x->buffer().data() + 64 * near + 8 * n : nothing.data(),
             in_x ? active_row(*in_x, near, n) & within : 0);
      setRow(tileOffset(n, rim, 0),
             in_y ? in_y->buffer().data() + 64 * n + 8 * near : nothing.data(),
             in_y ? active_row(*in_y, n, near) & within : 0);
      for (int y = 0; y < 8; ++y) {
        const int offset = 64 * n + 8 * y + near;
        tile_[tileOffset(n, y, rim)] =
            in_z && in_z->isValueOn(offset) ? in_z->buffer().data()[offset] : no_sample;
      }
    }
  }
}

Vec3s LeafNormals::normal(unsigned offset) const {
  return unitGradient(&tile_[tileOffset(offset)], edge * edge, edge, per_pitch_);
}

LeafNormals::Row LeafNormals::row(unsigned offset) const {
  const float* centre = &tile_[tileOffset(offset)];
  Row normals;
  for (unsigned z = 0; z < 8; ++z) {
    const Vec3s normal = unitGradient(centre + z, edge * edge, edge, per_pitch_);
    for (unsigned axis = 0; axis < 3; ++axis) normals[axis][z] = normal[axis];
  }
  return normals;
}

openvdb::Vec3SGrid::Ptr makeNormalGrid(const openvdb::math::Transform& transform) {
  auto grid = openvdb::Vec3SGrid::create(Vec3s(0.0F));
  grid->setName("N");
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
      const std::uint8_t within = rowWithin(leaf.origin().z(), core);
      openvdb::util::NodeMask<3> active = leaf.getValueMask();
      for (unsigned x = 0; x < 8; ++x) active.getWord<std::uint64_t>(x) &= everyRow(within);
      if (active.isOff()) return std::unique_ptr<NormalLeaf>();

      normals.visit(leaf);
      auto made = std::make_unique<NormalLeaf>(leaf.origin(), Vec3s(0.0F));
      made->setValueMask(active);
      Vec3s* out = made->buffer().data();
      for (unsigned offset = 0; offset < 512; offset += 8) {
        const auto row =
            static_cast<std::uint8_t>(active.getWord<std::uint64_t>(offset / 64) >> (offset % 64));
        if (row == 0) continue;
        const LeafNormals::Row normal = normals.row(offset);
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
