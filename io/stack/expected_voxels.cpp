#include "io/stack/expected_voxels.h"

#include <algorithm>

#include "io/stack/checked_stack.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

ExpectedVoxels::ExpectedVoxels(const std::string& path) : reader_(path, {}) {
  if (reader_.isPipe()) throw UsageError("'" + path + "' is a pipe; give a file");
  const Schema& schema = reader_.schema();
  if (schema.grids.contains(material_grid)) {
    findGrid<openvdb::Int32Grid>(schema.grids, material_grid);
    material_ = openvdb::gridConstPtrCast<openvdb::Int32Grid>(reader_.held(material_grid));
    const auto table = schema.metadata.find(materials_key);
    if (table != schema.metadata.end()) materials_ = materialTableFromJson(table->second);
  } else if (schema.grids.contains(solid_grid)) {
    findGrid<openvdb::BoolGrid>(schema.grids, solid_grid);
    solid_ = openvdb::gridConstPtrCast<openvdb::BoolGrid>(reader_.held(solid_grid));
  } else {
    throw UsageError("'" + path + "' has no grid 'material' or 'solid'");
  }
  measure();
}

void ExpectedVoxels::measure() {
  const openvdb::CoordBBox active =
      material_ ? material_->evalActiveVoxelBoundingBox() : solid_->evalActiveVoxelBoundingBox();
  if (active.empty()) return;
  // Columns and rows rise with x and y.
  const SliceLayout layout{active, 0, false, true};
  openvdb::CoordBBox pixels;
  constexpr int together = 2 * leaf_layers;
  for (int z = active.min().z(); z <= active.max().z(); z += together) {
    throwIfInterrupted();
    int at = z;
    for (const SpanImage& image :
         layersOf(layout, {z, std::min(z + together, active.max().z() + 1)})) {
      expandByPrinted(pixels, image, at++);
      countVoxels(image, voxels_);
    }
  }
  if (pixels.empty()) return;
  const openvdb::Coord corner(active.min().x(), active.min().y(), 0);
  box_ = {pixels.min() + corner, pixels.max() + corner};
}

std::vector<SpanImage> ExpectedVoxels::layersOf(const SliceLayout& layout, ZRange layers) const {
  return material_ ? sliceSpans(*material_, layout, layers) : sliceSpans(*solid_, layout, layers);
}

void countVoxels(const SpanImage& image, std::map<std::uint32_t, std::uint64_t>& voxels) {
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint32_t begin = 0;
    for (const Span& span : image.row(y)) {
      if (span.value != 0) voxels[span.value] += span.end - begin;
      begin = span.end;
    }
  }
}

}  // namespace vdbdither
