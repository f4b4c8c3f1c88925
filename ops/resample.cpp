#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <unistd.h>

#include <tbb/parallel_reduce.h>

#include "io/profile/target_lattice.h"
#include "io/vdb/frames.h"
#include "io/vdb/vdb.h"
#include "ops/kernels/distance/zero_set_distance.h"
#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;
using openvdb::Mat4d;
using openvdb::Vec3d;

enum class Kind { automatic, level_set, fog };
constexpr std::array<Choice<Kind>, 3> kinds{
    {{Kind::automatic, "auto", "As the class of the grid says"},
     {Kind::level_set, "level-set", "A level set: inside below the level"},
     {Kind::fog, "fog", "A fog volume: inside above the level"}}};

FloatGrid::ConstPtr asFloats(const GridConstPtr& grid) {
  if (auto floats = openvdb::gridConstPtrCast<FloatGrid>(grid)) return floats;
  if (const auto doubles = openvdb::gridConstPtrCast<openvdb::DoubleGrid>(grid))
    return std::make_shared<FloatGrid>(*doubles);
  return nullptr;
}

void checkFinite(const FloatGrid& grid, const std::string& name) {
  std::vector<const openvdb::FloatTree::LeafNodeType*> leaves;
  grid.tree().getNodes(leaves);
  const bool finite = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, leaves.size()), true,
      [&](const auto& range, bool good) {
        for (std::size_t n = range.begin(); n != range.end() && good; ++n) {
          const float* values = leaves[n]->buffer().data();
          good = std::all_of(values, values + openvdb::FloatTree::LeafNodeType::SIZE,
                             [](float value) { return std::isfinite(value); });
        }
        return good;
      },
      std::logical_and<>());
  bool tiles = true;
  auto tile = grid.tree().cbeginValueAll();
  tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) tiles = tiles && std::isfinite(*tile);
  if (!finite || !tiles)
    throw DataError("grid '" + name + "' holds values that are not finite numbers");
}

/// `surface` from a level set or a fog volume of another tool.
class Resample : public Source {
 public:
  void declare(Options& options) override {
    options.positional(
        "file", path_,
        "The .vdb of any tool, with any affine transform; standard input if missing or -", false);
    target_.declare(options);
    options.text("grid", grid_name_, "NAME",
                 "Grid to take; by default 'surface', or the only grid of numbers");
    options.choice("kind", kind_, kinds, "Which side of the surface is inside");
    options.number("level", level_, {-1e30, 1e30},
                   "Value at the surface; by default 0 in a level set and 0.5 in fog");
    placement_.declare(options, "the part");
    options.length("band", band_mm_, Range::above(0, 1000),
                   "Distance from the surface up to which distances are kept; by default one voxel "
                   "diameter along the normal");
  }

  Schema plan() override {
    Schema schema;
    const Vec3d pitch_mm = targetPitchMm(target_, schema);
    const FloatGrid::ConstPtr grid = readSurface(schema);
    surface_ = zeroSet(grid, pitch_mm);
    const ZeroSet::Bounds bounds = surface_->bounds();
    const Band band{1, band_mm_.value_or(0)};
    schema.lattice =
        latticeAround(bounds.min, bounds.max, std::max(pitch_mm.length(), band.mm), pitch_mm);
    const double leaves = leavesOf(schema.lattice, band.maximumMm(pitch_mm));
    const double at_surface =
        leavesOf(schema.lattice, std::min(band.maximumMm(pitch_mm), pitch_mm.length()));
    // The surface is taken to be spread evenly over the layers, but for a factor of two.
    const double rows = schema.lattice.layers().size() / static_cast<double>(leaf_layers) + 1;
    schema.footprint = {2 * leaves / rows, leaves, at_surface};
    held_band_mm_ = band.minimumMm(pitch_mm);
    field_ = std::make_unique<ZeroSetDistance>(surface_, schema.lattice, band, slack_mm_);
    const int bottom = schema.lattice.layers().begin;
    schema.grids = run({bottom, bottom});
    return schema;
  }

  [[nodiscard]] double memoryBytes() const override { return surface_->memoryBytes(); }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = cost::resample_us};
  }

  [[nodiscard]] Grids run(ZRange core) const override {
    const FloatGrid::Ptr surface = field_->run(core);
    setHeldBandMm(*surface, held_band_mm_);
    return {{surface_grid, surface}};
  }

 private:
  [[nodiscard]] bool isPipe() const { return path_.empty() || path_ == "-"; }

  FloatGrid::ConstPtr readSurface(Schema& schema) {
    if (isPipe() && ::isatty(STDIN_FILENO))
      throw UsageError("nothing is piped in; name a file: resample part.vdb");
    const VdbContents contents =
        isPipe() ? FrameReader::readWhole(STDIN_FILENO, "standard input") : readVdb(path_);
    if (const auto history = contents.metadata.find(history_key);
        history != contents.metadata.end()) {
      schema.metadata.insert(*history);
    }
    FloatGrid::ConstPtr grid = asFloats(chosen(contents.grids));
    if (!grid)
      throw DataError("grid '" + grid_name_ + "' is of " +
                      contents.grids.at(grid_name_)->valueType() + ", not of float or double");
    if (!grid->transform().isLinear())
      throw DataError("grid '" + grid_name_ +
                      "' lies in a frustum; only affine transforms will do");
    checkFinite(*grid, grid_name_);
    return grid;
  }

  GridConstPtr chosen(const Grids& grids) {
    std::string numbers;
    std::string names;
    int count = 0;
    for (const auto& [name, grid] : grids) {
      names += " '" + name + "'";
      if (!grid->isType<FloatGrid>() && !grid->isType<openvdb::DoubleGrid>()) continue;
      numbers = name;
      ++count;
    }
    if (grid_name_.empty()) {
      if (grids.contains(surface_grid)) {
        grid_name_ = surface_grid;
      } else if (count == 1) {
        grid_name_ = numbers;
      } else {
        throw UsageError("--grid: say which of" + (names.empty() ? " no grids" : names));
      }
    }
    const auto found = grids.find(grid_name_);
    if (found == grids.end())
      throw UsageError("--grid: no grid '" + grid_name_ + "'; there are" + names);
    return found->second;
  }

  /// Decides how the grid is read where the options leave it open.
  ZeroSet::Reading readingOf(const FloatGrid& grid) {
    if (kind_ == Kind::automatic) {
      const bool level_set = grid.getGridClass() == openvdb::GRID_LEVEL_SET;
      if (!level_set && grid.getGridClass() != openvdb::GRID_FOG_VOLUME)
        throw UsageError(
            "grid '" + grid_name_ +
            "' has no class that says what it is; give --kind level-set or --kind fog");
      kind_ = level_set ? Kind::level_set : Kind::fog;
    }
    if (!level_) level_ = kind_ == Kind::fog ? 0.5 : 0;
    const ZeroSet::Reading reading{static_cast<float>(*level_), kind_ == Kind::fog};
    const float outside = grid.background();
    if (reading.above ? outside > reading.level : outside < reading.level)
      throw DataError("grid '" + grid_name_ + "' is inside everywhere beyond its voxels; check " +
                      "--kind and --level");
    return reading;
  }

  std::shared_ptr<const ZeroSet> zeroSet(const FloatGrid::ConstPtr& grid, const Vec3d& pitch_mm) {
    Mat4d map = grid->transform().baseMap()->getAffineMap()->getMat4();
    map.postScale(Vec3d(placement_.mmPerUnit()));
    if (!(std::abs(map.det()) > 0))
      throw DataError("grid '" + grid_name_ + "' has a transform without volume");
    const ZeroSet::Reading reading = readingOf(*grid);
    const double minimum_mm = std::min({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()});
    double cell_mm = 0;
    double faces_mm2 = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto step = [&](int of) { return Vec3d(map(of, 0), map(of, 1), map(of, 2)); };
      cell_mm = std::max(cell_mm, step(axis).length());
      faces_mm2 += step(axis).cross(step((axis + 1) % 3)).length();
    }
    // Divisions are larger than voxels for speed; what is off, by about an eighth of a division's
    // square over the cell where the surface bends within one, is corrected and added to the band.
    const double divisions = std::clamp(std::ceil(std::sqrt(cell_mm / minimum_mm) / 2), 1.0, 8.0);
    slack_mm_ = cell_mm / (8 * divisions * divisions);
    division_mm2_ = faces_mm2 / 3 / (divisions * divisions);
    const auto made = [&](const Mat4d& placed) {
      return std::make_shared<const ZeroSet>(grid, placed, reading, static_cast<int>(divisions));
    };
    auto surface = made(map);
    if (surface->cells() == 0)
      throw DataError("grid '" + grid_name_ + "' has no surface: none of its values pass " +
                      shortestText(double{reading.level}) + "; check --kind and --level");
    if (!placement_.on_bed) return surface;
    map.postTranslate(bedCornerMm({pitch_mm, Vec3d(0.0), {}}) - surface->bounds().min);
    return made(map);
  }

  [[nodiscard]] double leavesOf(const Lattice& lattice, double band_mm) const {
    // Three divisions are passed where the area is that of the faces of two.
    const double area = surface_->cells() * division_mm2_ / 1.5;
    const Vec3d leaf_mm = lattice.pitch_mm * double{leaf_layers};
    const double across_mm = 0.5 * (leaf_mm.x() + leaf_mm.y() + leaf_mm.z());
    return area * (2 * band_mm + across_mm) / leaf_mm.product();
  }

  std::string path_;
  LatticeOptions target_;
  std::string grid_name_;
  Kind kind_ = Kind::automatic;
  std::optional<double> level_;
  PlacementOptions placement_;
  std::optional<double> band_mm_;

  double division_mm2_ = 0;  ///< the mean face of a division of a cell
  double slack_mm_ = 0;
  double held_band_mm_ = 0;
  std::shared_ptr<const ZeroSet> surface_;
  std::unique_ptr<ZeroSetDistance> field_;
};

}  // namespace

extern const OperatorInfo resample;
const OperatorInfo resample{
    "resample", "Signed distance in mm from a level set or fog volume of any tool",
    "mesh2sdf part.stl --pitch 50um,50um,50um -o cubes.vdb\nresample cubes.vdb "
    "--printer mimaki-3duj-553 -o surface.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Resample>(); }};

}  // namespace vdbdither
