#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>

#include "io/file/data_files.h"
#include "io/file/digest.h"
#include "io/profile/printer_profile.h"
#include "io/vdb/mask_cache.h"
#include "io/vdb/vdb.h"
#include "ops/kernels/dither/error_diffusion.h"
#include "ops/kernels/dither/refinement.h"
#include "ops/kernels/dither/shape_dither.h"
#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/mask/mask_tile.h"
#include "ops/kernels/mask/threshold_mask.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;
using openvdb::Vec3d;
using openvdb::Vec3SGrid;

enum class Method { diffusion, mask };
constexpr std::array<Choice<Method>, 2> methods{
    {{Method::diffusion, "diffusion",
      "Voxel by voxel, so that each makes up for the errors of those around it"},
     {Method::mask, "mask",
      "By thresholds: the default once --mask or what belongs to it is given"}}};

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
      "Minimum error after printing: --method diffusion --guard walls; with --method mask: --mask "
      "blue --amplitude 2 --at voxel"},
     {Preset::paper, "paper",
      "Shape dithering of Morsy et al. (2022): --method mask --mask paper --amplitude 4 --at "
      "closest --guard none"}}};

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

/// `solid` from `surface`: surface error diffusion or implicit shape dithering.
class Dither : public Filter {
 public:
  void declare(Options& options) override {
    options.preset<Preset>(
        "preset", preset_, presets, [this](Preset preset) { fill(preset); },
        "Defaults of the options that follow");
    options.choice("method", method_, methods, "How voxels are chosen");
    options.noteGiven(method_given_);
    options.choice("guard", guard_, guards, "What is left undithered");
    options.lengths("spread", spread_mm_, "LENGTH|X,Y,Z", {least_spread_mm, most_spread_mm},
                    "Standard deviation of the blur of the printing process, which --method "
                    "diffusion allows for; by default that of the printer's profile, or else 50um");
    options.noteGiven(diffusion_option_);
    options.onlyIf([this] { return method_ == Method::diffusion; });

    options.integer("refine", sweeps_, {0, 8},
                    "Sweeps of direct binary search after --method diffusion, as refine does them");
    options.noteGiven(diffusion_option_);
    options.onlyIf([this] { return method_ == Method::diffusion; });

    const auto ofMask = [&] {
      options.noteGiven(mask_option_);
      options.onlyIf([this] { return method_ == Method::mask; });
    };
    options.choiceOrFile("mask", mask_, mask_sources, MaskSource::file, mask_file_, "FILE.vdb",
                         "Thresholds: one of these masks, or the tile of a file");
    ofMask();
    options.number("amplitude", amplitude_, {0, 8},
                   "Amplitude along the normal, peak to peak, in halves of a voxel diameter");
    ofMask();
    options.choice("at", at_, places, "Where the mask is read");
    ofMask();
    options.number("sigma", sigma_, {0.3, 16},
                   "Standard deviation of the Gaussian of --mask blue or paper, in voxels; another "
                   "mask is made with it once and cached");
    ofMask();
    options.integer("size", size_, {1, 256},
                    "Period of --mask blue or paper, in voxels; another mask is made with it once "
                    "and cached");
    ofMask();
    options.integer("seed", seed_, {0, std::numeric_limits<int>::max()},
                    "Seed of the noise of the mask");
    ofMask();
    options.text("mask-digest", mask_digest_, "HEX",
                 "Refuses a mask of another digest, which the history of a file records");
    ofMask();
    options.flag("displaced", displaced_,
                 "Adds the grid 'displaced' with the displaced distances in mm");
    ofMask();
  }

  Schema plan(const Schema& in) override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    has_normals_ = in.grids.contains(normal_grid);
    if (has_normals_) findGrid<Vec3SGrid>(in.grids, normal_grid);

    resolveMethod();
    const Vec3d& pitch_mm = in.lattice.pitch_mm;
    if (method_ == Method::diffusion) {
      if (!spread_mm_) spread_mm_ = pointSpreadMmOf(in);
      const bool guarded = guard_ == Guard::walls;
      diffusion_.emplace(pitch_mm, *spread_mm_, guarded);
      if (sweeps_ > 0) refinement_.emplace(pitch_mm, *spread_mm_, guarded, sweeps_);
      checkHolds(surface->background(), pitch_mm.length(), "'dither' needs");
    } else {
      planMask(pitch_mm);
      if (dither_.amplitude != 0)
        checkHolds(surface->background(),
                   std::max(dither_.largestDisplacementMm(), pitch_mm.length()),
                   "--amplitude " + shortestText(dither_.amplitude) + " needs");
    }

    Schema out = withoutOutdated(in, solid_grid);
    out.grids[solid_grid] = makeSolidGrid(surface->transform());
    if (displaced_) out.grids[displaced_grid] = makeDisplacedGrid(*surface);
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    if (diffusion_) {
      const Reach reach = Reach::stencil(diffusion_->reachLayers() + refinedLayers());
      std::vector<Read> reads{{surface_grid, reach}};
      if (has_normals_) reads.push_back({normal_grid, reach});
      return reads;
    }
    const ShapeDither::Reach reach = dither_.reach(has_normals_);
    std::vector<Read> reads{{surface_grid, Reach::stencil(reach.surface)}};
    if (has_normals_ && dither_.amplitude != 0)
      reads.push_back({normal_grid, Reach::stencil(reach.normals)});
    return reads;
  }

  [[nodiscard]] double memoryBytes() const override {
    return diffusion_ ? 0 : static_cast<double>(dither_.mask.bytes());
  }

  [[nodiscard]] std::optional<Work> work() const override {
    const double own_normals = has_normals_ ? 0 : cost::dither_own_normals_us;
    if (diffusion_) {
      const double refining =
          sweeps_ > 0 ? cost::refine_us + sweeps_ * cost::refine_us_per_sweep : 0;
      return Work{.us_per_surface_leaf = cost::diffusion_us + own_normals + refining};
    }
    if (dither_.amplitude == 0) return Work{.us_per_surface_leaf = cost::dither_plain_us};
    return Work{.us_per_surface_leaf = cost::dither_us + own_normals};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    const auto normals = has_normals_ && (diffusion_ || dither_.amplitude != 0)
                             ? findGrid<Vec3SGrid>(in.grids, normal_grid)
                             : nullptr;
    if (diffusion_) return {{solid_grid, diffused(*surface, normals.get(), in)}};
    const ShapeDither::Result result =
        dither_.run(*surface, normals.get(), in.core, in.valid, displaced_);
    Grids out{{solid_grid, result.solid}};
    if (displaced_) out[displaced_grid] = result.displaced;
    return out;
  }

 private:
  [[nodiscard]] int refinedLayers() const { return refinement_ ? refinement_->reachLayers() : 0; }

  [[nodiscard]] openvdb::BoolGrid::Ptr diffused(const FloatGrid& surface, const Vec3SGrid* normals,
                                                const Slab& in) const {
    if (!refinement_) return diffusion_->run(surface, normals, in.core, in.valid);
    const ZRange around = grownWithin(in.core, refinedLayers(), in.valid);
    const auto solid = diffusion_->run(surface, normals, around, in.valid);
    return refinement_->run(surface, normals, *solid, in.core, around);
  }

  void fill(Preset preset) {
    const bool best = preset == Preset::best;
    method_ = best ? Method::diffusion : Method::mask;
    mask_ = best ? MaskSource::blue : MaskSource::paper;
    amplitude_ = best ? 2 : 4;
    at_ = best ? DitherAt::voxel : DitherAt::closest;
    guard_ = best ? Guard::walls : Guard::none;
  }

  /// An option of one method selects it, unless --method says otherwise.
  void resolveMethod() {
    if (method_given_.empty() && !mask_option_.empty()) method_ = Method::mask;
    const bool diffuses = method_ == Method::diffusion;
    const std::string& other = diffuses ? mask_option_ : diffusion_option_;
    if (!other.empty())
      throw UsageError(other + ": only --method " +
                       std::string(nameOf(methods, diffuses ? Method::mask : Method::diffusion)) +
                       " has it; leave it out");
  }

  void planMask(const Vec3d& pitch_mm) {
    dither_.pitch_mm = pitch_mm;
    dither_.at = at_;
    dither_.guarded = guard_ == Guard::walls;
    dither_.mask = mask();
    checkDigest();
    if (mask_ == MaskSource::none) amplitude_ = 0;
    dither_.amplitude = amplitude_;
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

  Preset preset_ = Preset::best;
  Method method_{};
  std::string method_given_;      ///< the option, if it is given
  std::string diffusion_option_;  ///< one that is given and belongs to diffusion alone
  std::string mask_option_;       ///< the same of the mask
  MaskSource mask_{};
  std::string mask_file_;
  double amplitude_ = 0;
  DitherAt at_{};
  Guard guard_{};
  std::optional<Vec3d> spread_mm_;
  int sweeps_ = 0;
  std::optional<double> sigma_;
  std::optional<int> size_;
  int seed_ = 1;
  std::string mask_digest_;
  bool displaced_ = false;

  std::optional<ErrorDiffusion> diffusion_;
  std::optional<Refinement> refinement_;
  ShapeDither dither_;
  bool has_normals_ = false;
};

}  // namespace

extern const OperatorInfo dither;
const OperatorInfo dither{
    "dither", "The printed voxels: what is inside, dithered at the surface",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! normals ! dither ! slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Dither>(); }};

}  // namespace vdbdither
