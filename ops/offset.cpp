#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "io/image/grey_image.h"
#include "ops/kernels/distance/surface_offset.h"
#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/leaf/surface_leaves.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;

enum class Axis { x, y, z };
constexpr std::array<Choice<Axis>, 3> axes{{{Axis::x, "x", "The columns of the map lie along z"},
                                            {Axis::y, "y", "The columns of the map lie along z"},
                                            {Axis::z, "z", "The columns of the map lie along y"}}};

constexpr std::array<Choice<SurfaceOffset::At>, 2> places{
    {{SurfaceOffset::At::closest, "closest", "At the closest surface voxel"},
     {SurfaceOffset::At::foot, "foot",
      "At the closest point of the surface; faster where distances are deep"}}};

/// `surface` moved along its normal.
class Offset : public Filter {
 public:
  void declare(Options& options) override {
    options.length("by", by_mm_, {-1000, 1000},
                   "Offset everywhere: above zero the part grows, below it shrinks");
    options.file(
        "map", map_, "FILE.png|FILE.exr",
        "Adds a grey image of heights, projected along an axis and repeated: the values of "
        "a PNG are from 0 to 1, those of an EXR are taken as they are");
    options.length("height", height_mm_, {-1000, 1000}, "Height of the value 1 of the map");
    options.choice("along", along_, axes, "Axis along which the map is projected");
    options.length("pixel", pixel_mm_, Range::above(0, 1e6),
                   "Edge of the pixels of the map, whose lower left corner is then the origin; by "
                   "default its width covers the box of the part once");
    options.text("grid", grid_, "NAME", "Adds the values of this grid of the chain, in mm");
    options.length("most", most_mm_, Range::above(0, 1000),
                   "Maximum distance of the values of --grid from zero");
    options.choice("at", at_, places, "Where map and grid are read");
  }

  Schema plan(const Schema& in) override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    if (by_mm_.value_or(0) == 0 && map_.empty() && grid_.empty())
      throw UsageError("give an offset: --by, --map or --grid");
    if (height_mm_.value_or(0) == 0 && !map_.empty())
      throw UsageError("--map needs --height, which must not be 0 mm");
    if (most_mm_.has_value() == grid_.empty())
      throw UsageError("--grid and --most go together; give both");

    offset_ = SurfaceOffset();
    offset_.lattice = in.lattice;
    offset_.constant_mm = by_mm_.value_or(0);
    offset_.at = at_;
    offset_.from_grid = !grid_.empty();
    offset_.grid_limit_mm = most_mm_.value_or(0);
    offset_.held_mm = heldBandMm(*surface);
    if (!map_.empty()) offset_.map = heightMap(in.lattice);
    if (!grid_.empty()) findGrid<FloatGrid>(in.grids, grid_);
    // What is left of the band must do for the dither.
    checkHolds(
        offset_.held_mm, offset_.maximumMm() + offset_.lattice.diagonalMm(),
        "offsets up to " + shortestText(std::round(offset_.maximumMm() * 1e4) / 1e4) + " mm need");

    Schema out = withoutOutdated(in, surface_grid);
    out.grids[surface_grid] = emptySurface(*surface, offset_.backgroundMm());
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    const SurfaceOffset::Reach reach = offset_.reach();
    std::vector<Read> reads{{surface_grid, Reach::stencil(reach.surface)}};
    if (!grid_.empty()) reads.push_back({grid_, Reach::stencil(reach.heights)});
    return reads;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = cost::offset_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto heights = grid_.empty() ? nullptr : findGrid<FloatGrid>(in.grids, grid_);
    return {{surface_grid, offset_.run(*findGrid<FloatGrid>(in.grids, surface_grid), heights.get(),
                                       in.core, in.valid)}};
  }

 private:
  [[nodiscard]] HeightMap heightMap(const Lattice& lattice) const {
    try {
      GreyImage image = readGreyImage(map_);
      for (float& value : image.values) value = static_cast<float>(double{value} * *height_mm_);
      const int axis = static_cast<int>(along_);
      const int across = axis == 0 ? 1 : 0;
      const int up = axis == 2 ? 1 : 2;
      if (pixel_mm_)
        return {std::move(image.values), image.width, image.height, axis, *pixel_mm_, {0, 0}};
      const openvdb::Vec3d corner = lattice.position(lattice.box.min()) - 0.5 * lattice.pitch_mm;
      const double width_mm = lattice.box.dim()[across] * lattice.pitch_mm[across];
      return {std::move(image.values),     image.width, image.height, axis, width_mm / image.width,
              {corner[across], corner[up]}};
    } catch (const UsageError& error) {
      throw UsageError(std::string("--map: ") + error.what());
    } catch (const DataError& error) {
      throw DataError(std::string("--map: ") + error.what());
    }
  }

  std::string map_;
  std::string grid_;
  Axis along_ = Axis::z;
  SurfaceOffset::At at_ = SurfaceOffset::At::closest;
  std::optional<double> by_mm_;
  std::optional<double> height_mm_;
  std::optional<double> pixel_mm_;
  std::optional<double> most_mm_;

  SurfaceOffset offset_;
};

}  // namespace

extern const OperatorInfo offset;
const OperatorInfo offset{
    "offset", "The surface moved along its normal by a length, a height map or a grid",
    "mesh2sdf part.stl --printer mimaki-3duj-553 --band 0.3mm ! offset --by 0.1mm ! dither "
    "! slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Offset>(); }};

}  // namespace vdbdither
