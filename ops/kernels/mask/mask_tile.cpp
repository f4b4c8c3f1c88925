#include "ops/kernels/mask/mask_tile.h"

#include <algorithm>

#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;

namespace {

constexpr const char* size_key = "mask:size";
constexpr int generation = 1;

std::string nameOf(MaskKernel::Shape shape) {
  switch (shape) {
    case MaskKernel::Shape::peters:
      return "peters";
    case MaskKernel::Shape::gauss:
      return "gauss";
    case MaskKernel::Shape::axis_mix:
      return "axis-mix";
    case MaskKernel::Shape::exponential:
      return "exponential";
  }
  return "";
}

}  // namespace

FloatGrid::Ptr emptyMask(const Coord& size, const std::string& kind) {
  FloatGrid::Ptr grid = FloatGrid::create(0.0f);
  grid->setName(mask_grid);
  grid->insertMeta(size_key, openvdb::Vec3IMetadata(size.asVec3i()));
  grid->insertMeta("mask:kind", openvdb::StringMetadata(kind));
  return grid;
}

FloatGrid::Ptr emptyMask(const VoidAndCluster& settings) {
  FloatGrid::Ptr grid = emptyMask(settings.size, "void-and-cluster");
  const MaskKernel& kernel = settings.kernel;
  grid->insertMeta("mask:generation", openvdb::Int32Metadata(generation));
  grid->insertMeta("mask:seed", openvdb::Int32Metadata(static_cast<int>(settings.seed)));
  grid->insertMeta("mask:kernel", openvdb::StringMetadata(nameOf(kernel.shape)));
  grid->insertMeta("mask:sigma", openvdb::Vec3DMetadata(kernel.sigma));
  const bool is_axis_mix = kernel.shape == MaskKernel::Shape::axis_mix;
  if (is_axis_mix)
    grid->insertMeta("mask:plane_sigma", openvdb::DoubleMetadata(kernel.plane_sigma));
  if (is_axis_mix || kernel.shape == MaskKernel::Shape::exponential)
    grid->insertMeta("mask:space_weight", openvdb::DoubleMetadata(kernel.space_weight));
  return grid;
}

void addThresholds(std::span<const std::uint32_t> ranks, int begin, int end, FloatGrid& mask) {
  const auto size = mask.metaValue<openvdb::Vec3i>(size_key);
  FloatGrid::Accessor voxels = mask.getAccessor();
  const auto count = static_cast<double>(ranks.size());
  auto rank = ranks.begin() + static_cast<std::ptrdiff_t>(begin) * size.y() * size.x();
  for (int z = begin; z < end; ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x)
        voxels.setValue(Coord(x, y, z), static_cast<float>((*rank++ + 0.5) / count));
    }
  }
}

FloatGrid::Ptr maskOf(const VoidAndCluster& settings,
                      const std::function<void(double fraction)>& progress) {
  FloatGrid::Ptr mask = emptyMask(settings);
  addThresholds(voidAndCluster(settings, progress), 0, settings.size.z(), *mask);
  return mask;
}

VoidAndCluster defaultMask() {
  VoidAndCluster settings;
  settings.size = Coord(64);
  settings.kernel.shape = MaskKernel::Shape::axis_mix;
  settings.kernel.sigma = openvdb::Vec3d(0.8);
  return settings;
}

VoidAndCluster halftoneMask(const openvdb::Vec3d& pitch_mm, int seed) {
  constexpr double decay_mm = 0.07;
  constexpr double least_tile_mm = 1.75;
  constexpr int least_size = 16;
  constexpr int greatest_size = 256;
  constexpr int most_voxels = 1 << 19;
  constexpr double most_pitches = 3.5;
  const double mean_mm = (pitch_mm.x() + pitch_mm.y() + pitch_mm.z()) / 3;
  constexpr std::uint64_t apart = std::uint64_t{1} << 30;
  VoidAndCluster settings;
  settings.seed = (static_cast<std::uint64_t>(seed) + apart) % (2 * apart);
  settings.kernel.shape = MaskKernel::Shape::exponential;
  settings.kernel.space_weight = 3;
  for (int axis = 0; axis < 3; ++axis) {
    settings.kernel.sigma[axis] =
        std::clamp(decay_mm, mean_mm, most_pitches * mean_mm) / pitch_mm[axis];
    int& size = settings.size[axis] = least_size;
    while (size < greatest_size && size * pitch_mm[axis] < least_tile_mm) size *= 2;
  }
  openvdb::Coord& size = settings.size;
  while (size.x() * size.y() * size.z() > most_voxels) {
    int longest = 0;
    for (int axis = 1; axis < 3; ++axis)
      if (size[axis] * pitch_mm[axis] > size[longest] * pitch_mm[longest]) longest = axis;
    size[longest] /= 2;
  }
  return settings;
}

VoidAndCluster paperMask() {
  VoidAndCluster settings;
  settings.size = Coord(128);
  return settings;
}

}  // namespace vdbdither
