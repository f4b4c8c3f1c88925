#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>

#include "io/file/data_files.h"
#include "io/file/digest.h"
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

enum class MaskSource { blue, paper, white, none, file };
constexpr std::array<Choice<MaskSource>, 4> mask_sources{
    {{MaskSource::blue, "blue", "Blue noise, installed with the program"},
     {MaskSource::paper, "paper", "Blue noise of Morsy et al. (2022), made once and cached"},
     {MaskSource::white, "white", "White noise"},
     {MaskSource::none, "none", "No thresholds: voxels whose centre is inside are printed"}}};

constexpr std::array<Choice<DitherAt>, 3> places{
    {{DitherAt::closest, "closest", "At the closest surface voxel"},
     {DitherAt::foot, "foot", "At the voxel that contains the closest point of the surface"},
     {DitherAt::voxel, "voxel", "At the voxel itself"}}};

enum class Guard { walls, none };
constexpr std::array<Choice<Guard>, 2> guards{
    {{Guard::walls, "walls", "Leaves walls and gaps that are too thin for the dither as they are"},
     {Guard::none, "none", "Dithers everything"}}};

enum class Preset { best, paper };
constexpr std::array<Choice<Preset>, 2> presets{
    {{Preset::best, "best",
      "Minimum error after printing: --mask blue --amplitude adapted --at voxel --guard walls"},
     {Preset::paper, "paper",
      "The method of Morsy et al. (2022): --mask paper --amplitude 4 --at closest --guard none"}}};

const Word adapted{"adapted", "Adapted to each facet, by its normal and --spread"};

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
    options.preset<Preset>(
        "preset", preset_, presets, [this](Preset preset) { fill(preset); },
        "Defaults of the four options that follow");
    options.choiceOrFile("mask", mask_, mask_sources, MaskSource::file, mask_file_, "FILE.vdb",
                         "Thresholds: one of these masks, or the tile of a file");
    options.number("amplitude", amplitude_, {0, 8},
                   "Amplitude along the normal, peak to peak, in halves of a voxel diameter",
                   adapted);
    options.choice("at", at_, places, "Where the mask is read");
    options.choice("guard", guard_, guards, "What is left undithered");
    options.length("spread", spread_mm_, {0.01, 1},
                   "Standard deviation of the blur of the printing process, which the adapted "
                   "amplitude allows for");
    options.number("sigma", sigma_, {0.3, 16},
                   "Standard deviation of the Gaussian of --mask blue or paper, in voxels; another "
                   "mask is made with it once and cached");
    options.integer("size", size_, {1, 256},
                    "Period of --mask blue or paper, in voxels; another mask is made with it once "
                    "and cached");
    options.integer("seed", seed_, {0, std::numeric_limits<int>::max()},
                    "Seed of the noise of the mask");
    options.text("mask-digest", mask_digest_, "HEX",
                 "Refuses a mask of another digest, which the history of a file records");
    options.flag("displaced", displaced_,
                 "Adds the grid 'displaced' with the displaced distances in mm");
  }

  Schema plan(const Schema& in) override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    has_normals_ = in.grids.contains(normal_grid);
    if (has_normals_) findGrid<Vec3SGrid>(in.grids, normal_grid);

    dither_.pitch_mm = in.lattice.pitch_mm;
    dither_.at = at_;
    dither_.guarded = guard_ == Guard::walls;
    dither_.mask = mask();
    checkDigest();
    planAmplitude();
    checkBand(surface->background());

    Schema out = in;
    out.grids[solid_grid] = makeSolidGrid(surface->transform());
    if (displaced_) out.grids[displaced_grid] = makeDisplacedGrid(*surface);
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    const ShapeDither::Reach reach = dither_.reach(has_normals_);
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
  void fill(Preset preset) {
    const bool best = preset == Preset::best;
    mask_ = best ? MaskSource::blue : MaskSource::paper;
    amplitude_ = best ? std::nullopt : std::optional(4.0);
    at_ = best ? DitherAt::voxel : DitherAt::closest;
    guard_ = best ? Guard::walls : Guard::none;
  }

  void planAmplitude() {
    if (mask_ == MaskSource::none) amplitude_ = 0;
    dither_.amplitude = amplitude_.value_or(2);
    dither_.adapted =
        amplitude_ ? nullptr : std::make_shared<AdaptedAmplitude>(dither_.pitch_mm, spread_mm_);
  }

  [[nodiscard]] bool isBlueNoise() const {
    return mask_ == MaskSource::blue || mask_ == MaskSource::paper;
  }

  [[nodiscard]] ThresholdMask mask() const {
    for (const auto& [option, given] :
         {std::pair("--sigma", sigma_.has_value()), {"--size", size_.has_value()}}) {
      if (given && !isBlueNoise())
        throw UsageError(std::string(option) +
                         ": only --mask blue and --mask paper have it; leave it out");
    }
    if (mask_ == MaskSource::none) return ThresholdMask::constant(0.5F);
    if (mask_ == MaskSource::white)
      return ThresholdMask::whiteNoise(static_cast<std::uint64_t>(seed_));
    if (mask_ == MaskSource::file) return readMask(mask_file_);
    if (mask_ == MaskSource::paper || sigma_ || size_ || seed_ != 1) return madeMask();
    const auto installed = findDataFile("masks/blue.vdb");
    if (!installed)
      throw UsageError(
          "--mask: the default mask 'masks/blue.vdb' is in no data folder; give a file or --mask "
          "white");
    return readMask(*installed);
  }

  /// Resolves the digest of a mask that is a tile, for the history.
  void checkDigest() {
    if (!isBlueNoise() && mask_ != MaskSource::file) {
      if (!mask_digest_.empty())
        throw UsageError("--mask-digest: only a mask that is a tile has it; leave it out");
      return;
    }
    const std::string digest = digestOf(dither_.mask);
    if (!mask_digest_.empty() && mask_digest_ != digest)
      throw DataError("--mask-digest: the digest of the mask is " + digest + ", not '" +
                      mask_digest_ + "'; give the mask that was used, or leave the option out");
    mask_digest_ = digest;
  }

  static std::string digestOf(const ThresholdMask& mask) {
    constexpr std::size_t length = 16;
    const openvdb::Coord size = mask.size();
    const std::span<const float> values = mask.values();
    Digest digest;
    digest.update(size.data(), 3 * sizeof(openvdb::Int32));
    digest.update(values.data(), values.size_bytes());
    return hexText(digest.finish()).substr(0, length);
  }

  /// Out of the user's cache, or new.
  [[nodiscard]] ThresholdMask madeMask() const {
    VoidAndCluster settings = mask_ == MaskSource::paper ? paperMask() : defaultMask();
    if (sigma_) settings.kernel.sigma = openvdb::Vec3d(*sigma_);
    if (size_) settings.size = openvdb::Coord(*size_);
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

  Preset preset_ = Preset::best;
  MaskSource mask_{};
  std::string mask_file_;
  std::optional<double> amplitude_;  ///< none: adapted
  DitherAt at_{};
  Guard guard_{};
  double spread_mm_ = 0.05;
  std::optional<double> sigma_;
  std::optional<int> size_;
  int seed_ = 1;
  std::string mask_digest_;
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
