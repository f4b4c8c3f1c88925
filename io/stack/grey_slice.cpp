#include "io/stack/grey_slice.h"

#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/half_space_share.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

constexpr std::uint32_t full = 255;

std::uint32_t levelOf(double share, std::optional<double> dose) {
  if (share <= 0) return 0;
  return static_cast<std::uint32_t>(
      std::lround(full * (dose ? std::pow(*dose, share - 1) : share)));
}

/// The pixels of a row: full where something is printed.
std::vector<std::uint32_t> pixelsOf(std::span<const Span> spans, std::uint32_t width) {
  std::vector<std::uint32_t> pixels(width, 0);
  std::uint32_t begin = 0;
  for (const Span& span : spans) {
    if (span.value != 0) std::fill(pixels.begin() + begin, pixels.begin() + span.end, full);
    begin = span.end;
  }
  return pixels;
}

}  // namespace

SpanImage greySlice(const SliceLayer& layer, const SliceLayout& layout,
                    const openvdb::Vec3d& pitch_mm, std::optional<double> dose) {
  const auto surface = findGrid<openvdb::FloatGrid>(layer.grids, surface_grid);
  const auto normals =
      findGrid<openvdb::Vec3SGrid>(layer.grids, normal_grid)->getConstUnsafeAccessor();
  const double farthest_mm = pitch_mm.length() / 2;
  std::map<std::uint32_t, std::vector<std::uint32_t>> rows;
  for (auto leaf = surface->tree().cbeginLeaf(); leaf; ++leaf) {
    if (leaf->origin().z() != (layer.z & ~(leaf_layers - 1))) continue;
    for (auto voxel = leaf->cbeginValueOn(); voxel; ++voxel) {
      const openvdb::Coord at = voxel.getCoord();
      if (at.z() != layer.z || std::abs(*voxel) >= farthest_mm || !layout.shows(at)) continue;
      const std::uint32_t row = layout.rowOf(at.y());
      auto pixels = rows.find(row);
      if (pixels == rows.end())
        pixels = rows.emplace(row, pixelsOf(layer.image.row(row), layout.width())).first;
      const double share =
          halfSpaceShare(double{*voxel}, openvdb::Vec3d(normals.getValue(at)), pitch_mm);
      pixels->second[layout.columnOf(at.x())] = levelOf(share, dose);
    }
  }
  SpansBuilder builder(layer.image.width);
  for (std::uint32_t y = 0; y < layer.image.height; ++y) {
    const auto pixels = rows.find(y);
    if (pixels != rows.end()) {
      for (std::uint32_t x = 0; x < layer.image.width; ++x) builder.pixel(x, pixels->second[x]);
    } else {
      std::uint32_t begin = 0;
      for (const Span& span : layer.image.row(y)) {
        builder.pixel(begin, span.value == 0 ? 0 : full);
        begin = span.end;
      }
    }
    builder.endRow();
  }
  return builder.finish();
}

}  // namespace vdbdither
