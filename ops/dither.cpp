#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "io/file/data_files.h"
#include "io/vdb/mask_cache.h"
#include "io/vdb/vdb.h"
#include "ops/kernels/dither/shape_dither.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/mask/mask_tile.h"
#include "ops/kernels/mask/threshold_mask.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;
using openvdb::Vec3SGrid;

ThresholdMask readMask(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) {
    throw UsageError("--mask: no such file '" + path.string() + "'");
  }
  try {
    const GridConstPtr grid = readGrid(path, mask_grid);
    const auto mask = openvdb::gridConstPtrCast<FloatGrid>(grid);
    if (!mask) throw DataError("a mask is a grid of float, not of " + grid->valueType());
    return ThresholdMask(*mask);
  } catch (const DataError& error) {
    throw DataError(std::string("--mask: ") + error.what());
  }
}

/// `solid` from `surface`: implicit shape dithering.
class Dither : public Filter {
 public:
  void declare(Options& options) override {
    options.text("mask", mask_, "preset|blue|paper|white|none|FILE.vdb",
                 "Thresholds: the installed blue noise, the paper's, white noise, none (plain "
                 "voxels), or a tile of your own");
    options.choice("preset", preset_, {"best", "paper"},
                   "What 'preset' stands for elsewhere: blue, adapted, voxel and walls; or the "
                   "paper's mask, 4, closest and none");
    options.text("amplitude", amplitude_, "preset|adapted|N",
                 "Half of it voxel diameters peak to peak, along the normal, up to 8; or adapted "
                 "to each facet, by its normal and the spread");
    options.choice("at", at_, {"preset", "closest", "foot", "voxel"},
                   "Where the mask is read: at the closest surface voxel, at the voxel of the foot "
                   "point, or at the voxel itself");
    options.choice("guard", guard_, {"preset", "walls", "none"},
                   "What is spared: walls and gaps too thin for the dither, or nothing");
    options.length("spread", spread_mm_,
                   "How far the printing process blurs, a standard deviation, for the adapted "
                   "amplitude");
    options.number("sigma", sigma_, 0, 16,
                   "Another standard deviation of the blue noise, voxels, at least 0.3; made once "
                   "and kept in the cache folder");
    options.integer("size", size_, 0, 256, "Another period of the blue noise, voxels; likewise");
    options.integer("seed", seed_, 0, std::numeric_limits<int>::max(), "Seed of the noise");
    options.flag("displaced", displaced_,
                 "Adds the grid 'displaced', the displaced distances in mm");
  }

  Schema plan(const Schema& in) override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    has_normals_ = in.grids.contains(normal_grid);
    if (has_normals_) findGrid<Vec3SGrid>(in.grids, normal_grid);

    dither_.pitch_mm = in.lattice.pitch_mm;
    const bool best = preset_ == "best";
    const auto chosen = [](const std::string& given, const std::string& by_preset) {
      return given == "preset" ? by_preset : given;
    };
    const std::string at = chosen(at_, best ? "voxel" : "closest");
    dither_.at = at == "closest" ? DitherAt::closest
                 : at == "foot"  ? DitherAt::foot
                                 : DitherAt::voxel;
    dither_.guarded = chosen(guard_, best ? "walls" : "none") == "walls";
    const std::string mask_name = chosen(mask_, best ? "blue" : "paper");
    dither_.mask = mask(mask_name);
    planAmplitude(mask_name == "none" ? "0" : chosen(amplitude_, best ? "adapted" : "4"));
    checkBand(surface->background());

    Schema out = in;
    out.grids[solid_grid] = makeSolidGrid(surface->transform());
    if (displaced_) out.grids[displaced_grid] = makeDisplacedGrid(*surface);
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    const ShapeDither::Layers reach = dither_.reach(has_normals_);
    std::vector<Read> reads{{surface_grid, Reach::stencil(reach.surface)}};
    if (has_normals_ && dither_.amplitude != 0)
      reads.push_back({normal_grid, Reach::stencil(reach.normals)});
    return reads;
  }

  [[nodiscard]] double memoryBytes() const override {
    return static_cast<double>(dither_.mask.bytes());
  }

  [[nodiscard]] std::optional<Work> work() const override {
    if (dither_.amplitude == 0) return Work{.us_per_surface_leaf = cost::dither_plain_us};
    const double own_normals = has_normals_ ? 0 : cost::dither_own_normals_us;
    return Work{.us_per_surface_leaf = cost::dither_us + own_normals};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    const auto normals = has_normals_ && dither_.amplitude != 0
                             ? findGrid<Vec3SGrid>(in.grids, normal_grid)
                             : nullptr;
    const ShapeDither::Result result =
        dither_.run(*surface, normals.get(), in.core, in.valid, displaced_);
    Grids out{{solid_grid, result.solid}};
    if (displaced_) out[displaced_grid] = result.displaced;
    return out;
  }

 private:
  void planAmplitude(const std::string& text) {
    dither_.adapted = nullptr;
    if (text == "adapted") {
      if (!(spread_mm_ >= 0.01 && spread_mm_ <= 1))
        throw UsageError("--spread: " + shortestText(spread_mm_) +
                         " mm is not between 0.01 mm and 1 mm");
      dither_.amplitude = 2;
      dither_.adapted = std::make_shared<AdaptedAmplitude>(dither_.pitch_mm, spread_mm_);
    } else {
      double constant = -1;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), constant);
      if (error != std::errc() || end != text.data() + text.size() ||
          !(constant >= 0 && constant <= 8))
        throw UsageError("--amplitude: '" + text +
                         "' is neither 'adapted' nor a number from 0 to 8");
      dither_.amplitude = constant;
    }
  }

  [[nodiscard]] ThresholdMask mask(const std::string& name) const {
    if (name != "blue" && name != "paper") {
      for (const auto& [option, given] :
           {std::pair("--sigma", sigma_ != 0), {"--size", size_ != 0}})
        if (given)
          throw UsageError(std::string(option) + ": of the blue noise, and --mask is '" + name +
                           "'; blue and paper take it");
    }
    if (name == "none") return ThresholdMask::constant(0.5F);
    if (name == "white") return ThresholdMask::whiteNoise(static_cast<std::uint64_t>(seed_));
    if (name != "blue" && name != "paper") return readMask(name);
    if (name == "paper" || sigma_ != 0 || size_ != 0 || seed_ != 1) return madeMask(name);
    const auto installed = findDataFile("masks/blue.vdb");
    if (!installed)
      throw UsageError(
          "--mask: the default mask 'masks/blue.vdb' is in no data folder; give a file or --mask "
          "white");
    return readMask(*installed);
  }

  /// Out of the user's cache, or new.
  [[nodiscard]] ThresholdMask madeMask(const std::string& name) const {
    VoidAndCluster settings = name == "paper" ? paperMask() : defaultMask();
    if (sigma_ != 0) {
      if (sigma_ < 0.3) {
        throw UsageError("--sigma: " + shortestText(sigma_) +
                         " is out of range; 0.3 to 16 are accepted");
      }
      settings.kernel.sigma = openvdb::Vec3d(sigma_);
    }
    if (size_ != 0) settings.size = openvdb::Coord(size_);
    settings.seed = static_cast<std::uint64_t>(seed_);
    const auto make = [&] {
      return maskOf(settings, [this](double fraction) { report().progress(fraction); });
    };
    return ThresholdMask(*cachedMask(*emptyMask(settings), make,
                                     [this](const std::string& text) { report().warn(text); }));
  }

  /// The distances must reach as far as the displacements, and the surface voxels must have theirs.
  void checkBand(double band_mm) const {
    const double needed_mm = std::max(dither_.largestDisplacementMm(), dither_.pitch_mm.length());
    if (dither_.amplitude == 0 || band_mm * (1 + 1e-6) >= needed_mm) return;
    const auto text = [](double mm) { return shortestText(std::round(mm * 1e4) / 1e4) + " mm"; };
    throw DataError("grid 'surface' holds distances up to " + text(band_mm) + ", and --amplitude " +
                    (dither_.adapted ? "adapted" : shortestText(dither_.amplitude)) +
                    " on this lattice needs " + text(needed_mm));
  }

  std::string mask_ = "preset";
  std::string preset_ = "best";
  std::string amplitude_ = "preset";
  std::string at_ = "preset";
  std::string guard_ = "preset";
  double spread_mm_ = 0.05;
  double sigma_ = 0;
  int size_ = 0;
  int seed_ = 1;
  bool displaced_ = false;

  ShapeDither dither_;
  bool has_normals_ = false;
};

}  // namespace

extern const OperatorInfo dither;
const OperatorInfo dither{
    "dither", "The printed voxels: shape dithering of the distance to the surface",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! normals ! dither ! slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Dither>(); }};

}  // namespace vdbdither
