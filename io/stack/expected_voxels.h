#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "io/profile/material_table.h"
#include "io/stack/slice_spans.h"
#include "io/vdb/slab_reader.h"

namespace vdbdither {

/// The voxels of a .vdb that a stack of slices should show.
class ExpectedVoxels {
 public:
  /// Reads the grid `material`, or `solid` where there is none. Throws DataError where the file
  /// cannot be read, and UsageError where it has none of them or is a pipe.
  explicit ExpectedVoxels(const std::string& path);

  [[nodiscard]] const Lattice& lattice() const { return reader_.schema().lattice; }
  [[nodiscard]] bool tellsMaterials() const { return material_ != nullptr; }
  [[nodiscard]] const MaterialTable& materials() const { return materials_; }
  /// Around the printed voxels.
  [[nodiscard]] const openvdb::CoordBBox& box() const { return box_; }
  /// How many voxels have each value besides 0.
  [[nodiscard]] const std::map<std::uint32_t, std::uint64_t>& voxels() const { return voxels_; }

  /// The layers as slices: indices of materials, or 1 where printed.
  [[nodiscard]] std::vector<SpanImage> layersOf(const SliceLayout& layout, ZRange layers) const;

 private:
  void measure();

  SlabReader reader_;
  openvdb::Int32Grid::ConstPtr material_;
  openvdb::BoolGrid::ConstPtr solid_;
  MaterialTable materials_;
  openvdb::CoordBBox box_;
  std::map<std::uint32_t, std::uint64_t> voxels_;
};

/// Adds the pixels of a slice that are not 0, by value.
void countVoxels(const SpanImage& image, std::map<std::uint32_t, std::uint64_t>& voxels);

}  // namespace vdbdither
