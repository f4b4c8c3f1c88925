#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <mutex>

#include "ops/kernels/mask/gradient_noise.h"
#include "ops/kernels/mask/mask_tile.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::Coord;

constexpr int greatest_size = 256;

enum class Kind { void_and_cluster, white, bayer, gradient_noise };
constexpr std::array<Choice<Kind>, 4> kinds{
    {{Kind::void_and_cluster, "void-and-cluster", "Blue noise, by void and cluster"},
     {Kind::white, "white", "White noise"},
     {Kind::bayer, "bayer", "Ordered dither, after Bayer"},
     {Kind::gradient_noise, "gradient-noise", "Perlin's gradient noise"}}};

constexpr std::array<Choice<MaskKernel::Shape>, 4> kernels{
    {{MaskKernel::Shape::peters, "peters",
      "A Gaussian, filtered on the discrete Fourier transform"},
     {MaskKernel::Shape::gauss, "gauss", "A sampled Gaussian"},
     {MaskKernel::Shape::axis_mix, "axis-mix",
      "A Gaussian in space and one in each lattice plane, mixed"},
     {MaskKernel::Shape::exponential, "exponential",
      "An exponential of the distance in space and in each lattice plane, mixed"}}};

/// The ranks of a Bayer (ordered) mask whose edges are powers of two, x fastest: the bits of the
/// exclusive or of the coordinates, the lowest first, decide most.
std::vector<std::uint32_t> bayerRanks(const Coord& size) {
  std::vector<std::uint32_t> ranks;
  const int bits =
      std::bit_width(static_cast<unsigned>(std::max({size.x(), size.y(), size.z()}) - 1));
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) {
        std::uint32_t rank = 0;
        for (int bit = 0; bit < bits; ++bit) {
          if (size.x() >> bit > 1) rank = 2 * rank + ((x ^ y ^ z) >> bit & 1);
          if (size.y() >> bit > 1) rank = 2 * rank + ((y ^ z) >> bit & 1);
          if (size.z() >> bit > 1) rank = 2 * rank + (z >> bit & 1);
        }
        ranks.push_back(rank);
      }
    }
  }
  return ranks;
}

class Mask : public Source {
 public:
  void declare(Options& options) override {
    options.triple("size", size_, "N|NX,NY,NZ", {1, greatest_size},
                   "Period of the tile along x, y and z, in voxels");
    options.choice("kind", kind_, kinds, "How the thresholds are ordered");
    options.choice("kernel", kernel_, kernels, "Kernel of void-and-cluster");
    options.triple("sigma", sigma_, "S|SX,SY,SZ", {0.3, 16},
                   "Standard deviation of the Gaussian of void-and-cluster, or length of decay of "
                   "exponential, along x, y and z, in voxels");
    options.belongTo(
        "--kind void-and-cluster", [this] { return kind_ == Kind::void_and_cluster; }, 2);
    options.number("plane-sigma", plane_sigma_, {0.3, 16},
                   "Standard deviation in the lattice planes of axis-mix, in voxels");
    options.belongTo("--kernel axis-mix",
                     [this] { return hasKernel({MaskKernel::Shape::axis_mix}); });
    options.number("space-weight", space_weight_, {0, 1e6},
                   "Weight of space in axis-mix and exponential");
    options.belongTo("--kernel axis-mix or exponential", [this] {
      return hasKernel({MaskKernel::Shape::axis_mix, MaskKernel::Shape::exponential});
    });
    options.integer("cell", cell_, {2, 128}, "Edge of the cells of gradient-noise, in voxels");
    options.belongTo("--kind gradient-noise", [this] { return kind_ == Kind::gradient_noise; });
    options.integer("seed", seed_, {0, std::numeric_limits<int>::max()},
                    "Seed of the random start");
  }

  Schema plan() override {
    for (int axis = 0; axis < 3; ++axis) {
      const int edge = size_[axis];
      if (kind_ == Kind::bayer && !std::has_single_bit(static_cast<unsigned>(edge)))
        throw UsageError("--size: --kind bayer needs a power of two, not " + std::to_string(edge));
      if (kind_ == Kind::gradient_noise && edge % cell_ != 0)
        throw UsageError("--size: --kind gradient-noise needs a multiple of --cell " +
                         std::to_string(cell_) + ", not " + std::to_string(edge));
    }
    Schema schema;
    schema.lattice.box = openvdb::CoordBBox(Coord(0, 0, 0), size_.offsetBy(-1));
    schema.grids[mask_grid] = emptyGrid();
    const auto leaves = [](int voxels) { return (voxels + leaf_layers - 1) / leaf_layers; };
    const double row = leaves(size_.x()) * leaves(size_.y());
    schema.footprint = {row, row * leaves(size_.z()), row * leaves(size_.z())};
    return schema;
  }

  [[nodiscard]] double memoryBytes() const override {
    const double ranks = 4.0 * voxels();
    return kind_ == Kind::void_and_cluster ? 8 * ranks
           : kind_ == Kind::gradient_noise ? 5 * ranks
                                           : 2 * ranks;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    const double search_seconds =
        kind_ == Kind::void_and_cluster ? voidAndClusterSeconds(settings()) : 0;
    const double us_per_voxel = kind_ == Kind::void_and_cluster ? cost::mask_void_and_cluster_us
                                : kind_ == Kind::gradient_noise ? cost::mask_gradient_noise_us
                                                                : cost::mask_us;
    return Work{.seconds = search_seconds + 1e-6 * us_per_voxel * voxels()};
  }

  [[nodiscard]] Grids run(ZRange core) const override {
    std::call_once(made_, [&] { ranks_ = makeRanks(); });
    const openvdb::FloatGrid::Ptr grid = emptyGrid();
    const ZRange layers = intersection(core, {0, size_.z()});
    if (!layers.empty()) addThresholds(ranks_, layers.begin, layers.end, *grid);
    return {{mask_grid, grid}};
  }

 private:
  [[nodiscard]] bool hasKernel(std::initializer_list<MaskKernel::Shape> shapes) const {
    return kind_ == Kind::void_and_cluster && std::ranges::count(shapes, kernel_) > 0;
  }

  [[nodiscard]] double voxels() const {
    return static_cast<double>(size_.x()) * size_.y() * size_.z();
  }

  [[nodiscard]] VoidAndCluster settings() const {
    VoidAndCluster settings;
    settings.size = size_;
    settings.kernel.shape = kernel_;
    settings.kernel.sigma = sigma_;
    settings.kernel.plane_sigma = plane_sigma_;
    settings.kernel.space_weight = space_weight_;
    settings.seed = seed_;
    return settings;
  }

  [[nodiscard]] openvdb::FloatGrid::Ptr emptyGrid() const {
    if (kind_ == Kind::void_and_cluster) return emptyMask(settings());
    openvdb::FloatGrid::Ptr grid = emptyMask(size_, std::string(nameOf(kinds, kind_)));
    if (kind_ == Kind::gradient_noise) grid->insertMeta("mask:cell", openvdb::Int32Metadata(cell_));
    if (kind_ != Kind::bayer) grid->insertMeta("mask:seed", openvdb::Int32Metadata(seed_));
    return grid;
  }

  [[nodiscard]] std::vector<std::uint32_t> makeRanks() const {
    if (kind_ == Kind::bayer) return bayerRanks(size_);
    if (kind_ == Kind::gradient_noise) return gradientNoiseRanks(size_, cell_, seed_);
    if (kind_ == Kind::white) return randomPermutation(size_.x() * size_.y() * size_.z(), seed_);
    return voidAndCluster(settings(), [this](double fraction) { report().progress(fraction); });
  }

  Coord size_{128, 128, 128};
  Kind kind_ = Kind::void_and_cluster;
  MaskKernel::Shape kernel_ = MaskKernel::Shape::peters;
  openvdb::Vec3d sigma_{1.1, 1.1, 1.1};
  double plane_sigma_ = 2.3;
  double space_weight_ = 2;
  int cell_ = 4;
  int seed_ = 1;
  mutable std::once_flag made_;
  mutable std::vector<std::uint32_t> ranks_;
};

}  // namespace

extern const OperatorInfo mask{
    "mask", "A periodic tile of dither thresholds, by void and cluster",
    "mask --size 16 --sigma 1.1 -o mask.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Mask>(); }};

}  // namespace vdbdither
