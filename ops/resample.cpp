#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <unistd.h>

#include "io/profile/size_question.h"
#include "io/profile/target_lattice.h"
#include "io/vdb/frames.h"
#include "io/vdb/grid_checks.h"
#include "io/vdb/vdb.h"
#include "ops/kernels/contour/inside_signs.h"
#include "ops/kernels/distance/zero_set_distance.h"
#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/leaf/sampled_grid.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "vdbdither/engine/comma_list.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;
using openvdb::GridBase;
using openvdb::Mat4d;
using openvdb::Vec3d;

/// Grids whose voxels are in the part or not.
using VoxelGrids =
    openvdb::TypeList<openvdb::BoolGrid, openvdb::MaskGrid, openvdb::Int32Grid, openvdb::Int64Grid>;

enum class Kind { automatic, level_set, fog };
constexpr std::array<Choice<Kind>, 3> kinds{
    {{Kind::automatic, "auto", "As the class of the grid says"},
     {Kind::level_set, "level-set", "A level set: inside below the level"},
     {Kind::fog, "fog", "A fog volume: inside above the level"}}};

bool isOfNumbers(const GridBase& grid) {
  return grid.isType<FloatGrid>() || grid.isType<openvdb::DoubleGrid>();
}

bool isOfVoxels(const GridBase& grid) {
  return grid.apply<VoxelGrids>([](const auto&) {});
}

/// 1 in the active voxels that are not 0, and 0 elsewhere.
template <typename GridT>
FloatGrid::Ptr fogOf(const GridT& grid) {
  using ValueT = typename GridT::ValueType;
  auto fog = FloatGrid::create(
      std::make_shared<openvdb::FloatTree>(grid.tree(), 0.0F, 1.0F, openvdb::TopologyCopy()));
  if constexpr (!std::is_same_v<GridT, openvdb::MaskGrid>) {
    openvdb::CoordBBox box;
    for (auto value = grid.cbeginValueOn(); value; ++value) {
      if (*value != ValueT(0)) continue;
      value.getBoundingBox(box);
      fog->tree().fill(box, 0.0F, false);
    }
  }
  fog->setTransform(grid.transform().copy());
  return fog;
}

/// Whether a name of another program means the same grid of colours.
bool namesColours(const std::string& name) {
  return name == colour_grid || name == opacity_grid || name == "alpha";
}

/// The name that a grid of another program gets.
std::string carriedName(const std::string& name) { return name == "alpha" ? opacity_grid : name; }

/// Why a grid cannot be sampled at positions, or nothing.
std::optional<std::string> sampleProblem(const GridBase& grid) {
  if (!SampledGrid::takes(grid))
    return "is of " + grid.valueType() + ", not of float, double, vec3s or vec3d";
  if (!grid.transform().isLinear()) return "lies in a frustum; only affine transforms will do";
  if (grid.getVectorType() != openvdb::VEC_INVARIANT)
    return "holds directions (" + GridBase::vecTypeToString(grid.getVectorType()) +
           "), which would have to turn with the part; normals makes those of the surface";
  return std::nullopt;
}

/// Numbers as floats, and voxels as fog. Null for other types.
FloatGrid::ConstPtr asFloats(const GridConstPtr& grid) {
  if (auto floats = openvdb::gridConstPtrCast<FloatGrid>(grid)) return floats;
  if (const auto doubles = openvdb::gridConstPtrCast<openvdb::DoubleGrid>(grid))
    return std::make_shared<FloatGrid>(*doubles);
  FloatGrid::ConstPtr fog;
  grid->apply<VoxelGrids>([&](const auto& typed) { fog = fogOf(typed); });
  return fog;
}

/// How much of a fog volume there is, in voxels.
struct FogAmount {
  double any = 0;    ///< above 0
  double above = 0;  ///< above the level
  float greatest = 0;
};

FogAmount amountOf(const FloatGrid& fog, float level) {
  FogAmount amount;
  for (auto value = fog.cbeginValueOn(); value; ++value) {
    const auto voxels = static_cast<double>(value.getVoxelCount());
    if (*value > 0) amount.any += voxels;
    if (*value > level) amount.above += voxels;
    amount.greatest = std::max(amount.greatest, *value);
  }
  return amount;
}

std::string rounded(double value) { return shortestText(std::round(value * 1e4) / 1e4); }

/// `surface` from a level set or a fog volume of another tool.
class Resample : public Source {
 public:
  void declare(Options& options) override {
    options.positional(
        "file", path_,
        "The .vdb of any tool, with any affine transform; standard input if missing or -", false);
    target_.declare(options);
    options.text("grid", grid_name_, "NAME",
                 "Grid to take; by default 'surface', or the only grid of numbers, or else of "
                 "voxels (bool, mask, whole numbers)");
    options.choice("kind", kind_, kinds, "Which side of the surface is inside");
    options.number("level", level_, {-1e30, 1e30},
                   "Value at the surface; by default 0 in a level set and 0.5 in fog");
    placement_.declare(options, "the part");
    options.length("band", band_mm_, Range::above(0, 1000),
                   "Distance from the surface up to which distances are kept; by default one voxel "
                   "diameter along the normal");
    options.text(
        "with", with_, "NAME,...",
        "Grids of numbers or colours to take along, at the voxels that have a distance, up "
        "to one voxel diameter outside; 'none' for none; by default 'Cd' and 'Alpha' (or "
        "'alpha') as far as there are");
  }

  Schema plan() override {
    Schema schema;
    const Vec3d pitch_mm = targetPitchMm(target_, schema);
    const FloatGrid::ConstPtr grid = readSurface(schema);
    surface_ = zeroSet(grid, pitch_mm);
    const ZeroSet::Bounds bounds = surface_->bounds();
    questionSize(bounds.max - bounds.min, pitch_mm, schema);
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
    lattice_ = schema.lattice;
    for (const auto& [name, foreign] : foreign_)
      carried_.emplace(name, SampledGrid(foreign, mmFromIndex(*foreign)));
    foreign_.clear();
    const int bottom = schema.lattice.layers().begin;
    schema.grids = run({bottom, bottom});
    return schema;
  }

  [[nodiscard]] double memoryBytes() const override {
    double bytes = surface_->memoryBytes();
    for (const auto& [name, grid] : carried_) bytes += grid.memoryBytes();
    return bytes;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = cost::resample_us};
  }

  [[nodiscard]] Grids run(ZRange core) const override {
    const FloatGrid::Ptr surface = field_->run(core);
    setHeldBandMm(*surface, held_band_mm_);
    Grids grids{{surface_grid, surface}};
    const Vec3d& pitch_mm = lattice_.pitch_mm;
    for (const auto& [name, grid] : carried_)
      grids.emplace(name, grid.run(*surface, pitch_mm, pitch_mm.length()));
    return grids;
  }

 private:
  [[nodiscard]] bool isPipe() const { return path_.empty() || path_ == "-"; }

  FloatGrid::ConstPtr readSurface(Schema& schema) {
    if (isPipe() && ::isatty(STDIN_FILENO))
      throw UsageError("nothing is piped in; name a file: resample part.vdb");
    const std::string where = isPipe() ? "standard input" : "'" + path_ + "'";
    const VdbContents contents =
        isPipe() ? FrameReader::readWhole(STDIN_FILENO, where) : readVdb(path_);
    if (const auto history = contents.metadata.find(history_key);
        history != contents.metadata.end()) {
      schema.metadata.insert(*history);
    }
    const bool is_clear = !grid_name_.empty() || contents.metadata.contains(history_key);
    const GridConstPtr grid = chosen(contents.grids);
    if (!isOfNumbers(*grid) && !isOfVoxels(*grid))
      throw DataError("grid '" + grid_name_ + "' is of " + grid->valueType() +
                      ", not of float, double, bool, mask or whole numbers");
    if (!grid->transform().isLinear())
      throw DataError("grid '" + grid_name_ +
                      "' lies in a frustum; only affine transforms will do");
    checked(Grids::value_type(grid_name_, grid), where);
    chooseForeign(contents.grids, where);
    tellUnused(contents.grids, is_clear);
    is_voxels_ = isOfVoxels(*grid);
    voxel_mm_ = picoGkVoxelMm(*grid);
    if (!voxel_mm_ && (*grid)["PicoGK.VoxelSize"] && grid->transform().isIdentity())
      report().warn(
          "grid '" + grid_name_ +
          "' comes from PicoGK, but its metadata PicoGK.VoxelSize is no length in metres; "
          "its voxels are taken as 1 mm, see --scale");
    return withInside(asFloats(grid));
  }

  [[nodiscard]] bool isToBeCarried(const std::string& name) const {
    if (with_.empty()) return namesColours(name);
    const std::vector<std::string> names = commaList(with_);
    return std::find(names.begin(), names.end(), name) != names.end();
  }

  /// Keeps the grids that are taken along, under the names that they get.
  void chooseForeign(const Grids& grids, const std::string& where) {
    if (with_ == "none") return;
    if (!with_.empty()) {
      for (const std::string& name : commaList(with_)) {
        if (!grids.contains(name)) throw UsageError("--with: no grid '" + name + "' in " + where);
        if (name == grid_name_ || name == surface_grid)
          throw UsageError("--with: '" + name + "' is the name of the surface");
      }
    }
    for (const auto& [name, grid] : grids) {
      if (name == grid_name_ || !isToBeCarried(name)) continue;
      if (const auto problem = sampleProblem(*grid)) {
        const std::string what = "grid '" + name + "' " + *problem;
        if (!with_.empty()) throw UsageError("--with: " + what);
        report().warn(what + "; it is not taken along");
        continue;
      }
      checked(Grids::value_type(name, grid), where);
      if (!foreign_.emplace(carriedName(name), grid).second)
        throw UsageError("--with: both 'Alpha' and 'alpha' become 'Alpha'; name one of them");
    }
  }

  /// Names the grids that are left out, which may be parts of the same thing. If the user chose
  /// among them, or they are those of a job (`is_clear`), a second grid of the same name is told
  /// only.
  void tellUnused(const Grids& grids, bool is_clear) const {
    std::string others;
    for (const auto& [name, grid] : grids) {
      if (name == grid_name_ || foreign_.contains(carriedName(name))) continue;
      others += (others.empty() ? "'" : ", '") + name + "' (" + grid->valueType() + ")";
    }
    const bool has_namesake = grids.contains(grid_name_ + "_2");
    if (others.empty() || (is_clear && !has_namesake)) return;
    report().warn("only grid '" + grid_name_ + "' is used, not " + others +
                  (has_namesake ? "; '" + grid_name_ +
                                      "_2' is a second grid of that name; csg "
                                      "--union joins what resample makes of each"
                                : ""));
  }

  /// A level set whose inside has its sign.
  FloatGrid::ConstPtr withInside(const FloatGrid::ConstPtr& grid) const {
    const bool is_level_set =
        kind_ == Kind::level_set ||
        (kind_ == Kind::automatic && grid->getGridClass() == openvdb::GRID_LEVEL_SET);
    // Bands of our own state their width; they are closed however thin the part is.
    if (!is_level_set || is_voxels_ || statesHeldBand(*grid)) return grid;
    const SignedLevelSet level_set = withInsideSigns(grid);
    const std::string name = "grid '" + grid_name_ + "'";
    if (level_set.signs == InsideSigns::missing) {
      const openvdb::Coord& at = level_set.open_at;
      throw DataError(name + " is a level set with its inside at +background, and its surface is " +
                      "open at voxel " + std::to_string(at.x()) + " " + std::to_string(at.y()) +
                      " " + std::to_string(at.z()) +
                      ", so that nothing says what is inside; close the surface, or fill the signs "
                      "(signed flood fill) in the tool that it comes from");
    }
    if (level_set.signs == InsideSigns::filled)
      report().warn(name +
                    " has its inside at +background, as if it were hollow; its surface is "
                    "closed, and the inside is filled");
    return level_set.grid;
  }

  void questionSize(const Vec3d& size_mm, const Vec3d& pitch_mm, const Schema& schema) const {
    // PicoGK says how large its voxels are: then no unit is a guess.
    const bool is_known = voxel_mm_.has_value();
    auto question = sizeQuestion(size_mm, placement_, is_known, schema, "see --unit and --scale");
    if (!question) question = fewVoxelsQuestion(size_mm, placement_, is_known, pitch_mm);
    if (question) report().warn(*question);
  }

  GridConstPtr chosen(const Grids& grids) {
    std::vector<std::string> numbers;
    std::vector<std::string> voxels;
    std::string names;
    for (const auto& [name, grid] : grids) {
      names += " '" + name + "'";
      if (isOfNumbers(*grid) && !isToBeCarried(name)) numbers.push_back(name);
      if (isOfVoxels(*grid)) voxels.push_back(name);
    }
    if (grids.empty()) throw DataError("the file holds no grids; archive it again with one");
    if (grid_name_.empty()) {
      const std::vector<std::string>& likely = numbers.empty() ? voxels : numbers;
      if (grids.contains(surface_grid)) {
        grid_name_ = surface_grid;
      } else if (likely.size() == 1) {
        grid_name_ = likely.front();
      } else {
        throw UsageError("--grid: say which of" + names);
      }
    }
    const auto found = grids.find(grid_name_);
    if (found == grids.end())
      throw UsageError("--grid: no grid '" + grid_name_ + "'; there are" + names);
    return found->second;
  }

  /// Decides how the grid is read where the options leave it open.
  ZeroSet::Reading readingOf(const FloatGrid& grid) {
    if (is_voxels_) {
      if (kind_ == Kind::level_set)
        throw UsageError("--kind: grid '" + grid_name_ + "' holds voxels and no distances");
      kind_ = Kind::fog;
    }
    if (kind_ == Kind::automatic) {
      const bool level_set = grid.getGridClass() == openvdb::GRID_LEVEL_SET;
      if (!level_set && grid.getGridClass() != openvdb::GRID_FOG_VOLUME)
        throw UsageError(
            "grid '" + grid_name_ +
            "' has no class that says what it is; give --kind level-set or --kind fog");
      kind_ = level_set ? Kind::level_set : Kind::fog;
    }
    asked_level_ = level_.has_value();
    if (!level_) level_ = kind_ == Kind::fog ? 0.5 : 0;
    const ZeroSet::Reading reading{static_cast<float>(*level_), kind_ == Kind::fog};
    const float outside = grid.background();
    if (reading.above ? outside > reading.level : outside < reading.level)
      throw DataError("grid '" + grid_name_ + "' is inside everywhere beyond its voxels; check " +
                      "--kind and --level");
    return reading;
  }

  std::shared_ptr<const ZeroSet> zeroSet(const FloatGrid::ConstPtr& grid, const Vec3d& pitch_mm) {
    if (voxel_mm_)
      report().warn("grid '" + grid_name_ + "' comes from PicoGK: its voxels are " +
                    shortestText(*voxel_mm_) + " mm, as its metadata says");
    const Mat4d map = mmFromIndex(*grid);
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
                      shortestText(double{reading.level}) +
                      (reading.above ? " (the greatest is " +
                                           rounded(amountOf(*grid, reading.level).greatest) + ")"
                                     : "") +
                      "; check --kind and --level");
    questionFog(*grid, reading, std::abs(map.det()), surface->cells() * division_mm2_ / 1.5);
    if (!placement_.on_bed) return surface;
    moved_mm_ = bedCornerMm({pitch_mm, Vec3d(0.0), {}}) - surface->bounds().min;
    return made(mmFromIndex(*grid));
  }

  /// Where the nodes of a grid of the file come to lie.
  [[nodiscard]] Mat4d mmFromIndex(const GridBase& grid) const {
    Mat4d map = grid.transform().baseMap()->getAffineMap()->getMat4();
    map.postScale(Vec3d(voxel_mm_ ? *voxel_mm_ * placement_.scale : placement_.mmPerUnit()));
    if (placement_.on_bed) map.postTranslate(moved_mm_);
    return map;
  }

  /// Warns of fog whose level was not given and lies far from where the fog begins.
  void questionFog(const FloatGrid& grid, const ZeroSet::Reading& reading, double voxel_mm3,
                   double area_mm2) const {
    if (!reading.above || is_voxels_ || asked_level_) return;
    const FogAmount amount = amountOf(grid, reading.level);
    const double edge_mm = std::cbrt(voxel_mm3);
    const double depth_mm = (amount.any - amount.above) * voxel_mm3 / area_mm2;
    const std::string fog =
        "grid '" + grid_name_ + "' is fog of values up to " + rounded(amount.greatest);
    if (amount.greatest > 4 * reading.level) {
      report().warn(fog + ", and its surface is taken at 0.5; --level " +
                    rounded(0.5 * amount.greatest) + " is half of that");
    } else if (depth_mm > edge_mm) {
      report().warn(fog + ", which begins about " + rounded(depth_mm) + " mm, or " +
                    rounded(depth_mm / edge_mm) +
                    " of its voxels, outside its surface at 0.5; if it is solid where it begins, "
                    "give --level 0.01");
    }
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
  bool asked_level_ = false;
  PlacementOptions placement_;
  std::optional<double> band_mm_;
  std::string with_;

  bool is_voxels_ = false;          ///< a grid of voxels, read as fog of 0 and 1
  std::optional<double> voxel_mm_;  ///< of PicoGK
  double division_mm2_ = 0;         ///< the mean face of a division of a cell
  double slack_mm_ = 0;
  double held_band_mm_ = 0;
  Vec3d moved_mm_{0.0};  ///< by --place
  Lattice lattice_;
  Grids foreign_;                               ///< of the file, to be taken along
  std::map<std::string, SampledGrid> carried_;  ///< by name
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
