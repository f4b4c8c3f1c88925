#include <algorithm>
#include <cmath>
#include <memory>
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

/// `surface` moved along its normal.
class Offset : public Filter {
 public:
  void declare(Options& options) override {
    options.length("by", by_mm_, "Offset everywhere; above zero the part grows, below it shrinks");
    options.text("map", map_, "FILE.png|exr",
                 "Adds a grey image of heights, projected along an axis and repeated: PNG as 0 to "
                 "1, EXR as its numbers are");
    options.length("height", height_mm_, "What 1 in the map stands for");
    options.choice("along", along_, {"x", "y", "z"},
                   "The axis along which the map is projected: it lies in the plane of the other "
                   "two, its columns along the later one");
    options.length("pixel", pixel_mm_,
                   "Edge of the map's pixels, its lower left corner in the origin; unless given "
                   "its width covers the part's box, once");
    options.text("grid", grid_, "NAME", "Adds the values of this grid of the chain, in mm");
    options.length("most", most_mm_, "No value of --grid lies farther from zero");
    options.choice("at", at_, {"closest", "foot"},
                   "Where map and grid are read: at the closest surface voxel or at the foot "
                   "point; this is faster where distances are deep");
  }

  Schema plan(const Schema& in) override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    if (by_mm_ == 0 && map_.empty() && grid_.empty())
      throw UsageError("give an offset: --by, --map or --grid");
    if (height_mm_ == 0 && !map_.empty()) throw UsageError("--map needs --height, in mm");
    if ((most_mm_ > 0) == grid_.empty())
      throw UsageError("--grid and --most go together; give both");
    if (pixel_mm_ < 0) throw UsageError("--pixel: is below zero");

    offset_ = SurfaceOffset();
    offset_.lattice = in.lattice;
    offset_.constant_mm = by_mm_;
    offset_.at = at_ == "foot" ? SurfaceOffset::At::foot : SurfaceOffset::At::closest;
    offset_.from_grid = !grid_.empty();
    offset_.grid_limit_mm = most_mm_;
    offset_.held_mm = heldBandMm(*surface);
    if (!map_.empty()) offset_.map = heightMap(in.lattice);
    if (!grid_.empty()) findGrid<FloatGrid>(in.grids, grid_);
    checkBand();

    Schema out = withoutSurfaceExtras(in);
    out.grids[surface_grid] = emptySurface(*surface, offset_.backgroundMm());
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    const SurfaceOffset::Layers reach = offset_.reach();
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
      for (float& value : image.values) value = static_cast<float>(double{value} * height_mm_);
      const int axis = along_ == "x" ? 0 : along_ == "y" ? 1 : 2;
      const int across = axis == 0 ? 1 : 0;
      const int up = axis == 2 ? 1 : 2;
      if (pixel_mm_ > 0)
        return {std::move(image.values), image.width, image.height, axis, pixel_mm_, {0, 0}};
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

  /// What is left of the band must do for the dither.
  void checkBand() const {
    const double needed_mm = offset_.greatestMm() + offset_.lattice.diagonalMm();
    if (offset_.held_mm * (1 + 1e-6) >= needed_mm) return;
    const double asked_mm = std::ceil(needed_mm * 1e3) / 1e3;
    throw DataError("grid 'surface' holds distances up to " +
                    shortestText(std::floor(offset_.held_mm * 1e4 + 0.01) / 1e4) +
                    " mm everywhere, and offsets up to " +
                    shortestText(std::round(offset_.greatestMm() * 1e4) / 1e4) + " mm need " +
                    shortestText(asked_mm) + " mm: mesh2sdf --band " + shortestText(asked_mm) +
                    "mm");
  }

  std::string map_;
  std::string grid_;
  std::string along_ = "z";
  std::string at_ = "closest";
  double by_mm_ = 0;
  double height_mm_ = 0;
  double pixel_mm_ = 0;
  double most_mm_ = 0;

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
