#include "ops/kernels/leaf/copies.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "ops/kernels/leaf/floor_divided.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using openvdb::Coord;

/// Copies of the part beside each other, in columns along x and rows along y. Leaves are copied
/// whole, so the distance from copy to copy is a multiple of their edge.
class Copies : public Filter {
 public:
  void declare(Options& options) override {
    options.integer("columns", counts_[0], {1, most_copies}, "Number of copies along x");
    options.integer("rows", counts_[1], {1, most_copies}, "Number of copies along y");
    options.length("gap", gap_mm_, {0, 1000},
                   "Distance between the boxes of copies, at least; up to 14 voxels more are left, "
                   "because copies are moved by whole leaf nodes");
  }

  Schema plan(const Schema& in) override {
    if (in.lattice.box.empty())
      throw DataError("there is nothing to copy: the lattice has no voxels");
    Schema out = in;
    std::array<int, 2> strides{};
    for (int axis = 0; axis < 2; ++axis) {
      const auto index = static_cast<std::size_t>(axis);
      const std::int64_t begin = floorDivided(in.lattice.box.min()[axis], leaf_layers);
      const std::int64_t end = floorDivided(in.lattice.box.max()[axis], leaf_layers) + 1;
      const std::int64_t width = in.lattice.box.dim()[axis];
      const auto gap = static_cast<std::int64_t>(std::ceil(gap_mm_ / in.lattice.pitch_mm[axis]));
      const std::int64_t stride = std::max(
          (end - begin) * leaf_layers, (width + gap + leaf_layers - 1) / leaf_layers * leaf_layers);
      const std::int64_t last = in.lattice.box.max()[axis] + (counts_[index] - 1) * stride;
      constexpr std::int64_t farthest = 1 << 29;
      if (last > farthest) {
        throw UsageError("--" + std::string(axis == 0 ? "columns" : "rows") + ": " +
                         std::to_string(counts_[index]) +
                         " copies reach beyond the lattice; make fewer");
      }
      strides[index] = static_cast<int>(stride);
      out.lattice.box.max()[axis] = static_cast<int>(last);
    }
    offsets_.clear();
    for (int row = 0; row < counts_[1]; ++row) {
      for (int column = 0; column < counts_[0]; ++column)
        offsets_.emplace_back(column * strides[0], row * strides[1], 0);
    }
    out.footprint = in.footprint.scaled(static_cast<double>(offsets_.size()));
    names_.clear();
    for (const auto& [name, grid] : in.grids) names_.push_back(name);
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    std::vector<Read> reads;
    for (const std::string& name : names_) reads.push_back({name, Reach::point(), true});
    return reads;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = cost::copies_us * static_cast<double>(names_.size()) *
                                    static_cast<double>(offsets_.size())};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    Grids made;
    for (const auto& [name, grid] : in.grids) {
      // A range of leaves never equals that of a whole grid, so the join cuts what is outside.
      const GridLayers piece{grid, {in.core.begin - leaf_layers, in.core.end + leaf_layers}};
      made[name] = copiesAt(joinLayers({&piece, 1}, in.core), offsets_);
    }
    return made;
  }

 private:
  static constexpr int most_copies = 10000;

  std::array<int, 2> counts_{1, 1};
  double gap_mm_ = 2;
  std::vector<Coord> offsets_;
  std::vector<std::string> names_;
};

}  // namespace

extern const OperatorInfo copies;
const OperatorInfo copies{
    "copies", "Copies of the part beside each other, to fill a tray",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! copies --columns 3 --rows 2 ! "
    "slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Copies>(); }};

}  // namespace vdbdither
