#include <algorithm>
#include <bit>
#include <cmath>
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
    options.triple("size", size_, "N", "Period of the tile along x, y, z, voxels, 1 to 256");
    options.choice(
        "kind", kind_, {"void-and-cluster", "white", "bayer", "gradient-noise"},
        "How the ranks are ordered: blue noise, white noise, ordered dither, or Perlin's "
        "noise");
    options.choice("kernel", kernel_, {"peters", "gauss", "axis-mix"},
                   "Void and cluster: the Gaussian filtered on the DFT, sampled, or mixed with its "
                   "lattice planes");
    options.triple("sigma", sigma_, "S",
                   "Void and cluster: standard deviation of the Gaussian along x, y, z, voxels");
    options.number("plane-sigma", plane_sigma_, 0.3, 16,
                   "axis-mix: standard deviation in the lattice planes, voxels");
    options.number("space-weight", space_weight_, 0, 1e6,
                   "axis-mix: weight of the Gaussian in space");
    options.integer("cell", cell_, 2, 128, "Gradient noise: edge of its cells, voxels");
    options.integer("seed", seed_, 0, std::numeric_limits<int>::max(), "Seed of the random start");
  }

  Schema plan() override {
    for (int axis = 0; axis < 3; ++axis) {
      const double edge = size_[axis];
      if (!(edge >= 1 && edge <= greatest_size && edge == std::floor(edge))) {
        throw UsageError("--size: " + shortestText(edge) +
                         " is no period; whole numbers from 1 to 256 are");
      }
      if (kind_ == "bayer" && !std::has_single_bit(static_cast<unsigned>(edge))) {
        throw UsageError("--size: " + shortestText(edge) +
                         " is no power of two, which --kind bayer needs");
      }
      if (kind_ == "gradient-noise" && static_cast<int>(edge) % cell_ != 0) {
        throw UsageError("--size: " + shortestText(edge) + " is no multiple of --cell " +
                         std::to_string(cell_));
      }
      if (!(sigma_[axis] >= 0.3 && sigma_[axis] <= 16)) {
        throw UsageError("--sigma: " + shortestText(sigma_[axis]) +
                         " is out of range; 0.3 to 16 are accepted");
      }
    }
    const Coord size = tileSize();
    Schema schema;
    schema.lattice.box = openvdb::CoordBBox(Coord(0, 0, 0), size.offsetBy(-1));
    schema.grids[mask_grid] = emptyGrid();
    const auto leaves = [](int voxels) { return (voxels + leaf_layers - 1) / leaf_layers; };
    const double row = leaves(size.x()) * leaves(size.y());
    schema.footprint = {row, row * leaves(size.z()), row * leaves(size.z())};
    return schema;
  }

  [[nodiscard]] double memoryBytes() const override {
    const Coord size = tileSize();
    const double ranks = 4.0 * size.x() * size.y() * size.z();
    return kind_ == "void-and-cluster" ? 8 * ranks
           : kind_ == "gradient-noise" ? 5 * ranks
                                       : 2 * ranks;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    const Coord size = tileSize();
    const double voxels = static_cast<double>(size.x()) * size.y() * size.z();
    const double search_seconds =
        kind_ == "void-and-cluster" ? voidAndClusterSeconds(settings()) : 0;
    const double us_per_voxel = kind_ == "void-and-cluster" ? cost::mask_void_and_cluster_us
                                : kind_ == "gradient-noise" ? cost::mask_gradient_noise_us
                                                            : cost::mask_us;
    return Work{.seconds = search_seconds + 1e-6 * us_per_voxel * voxels};
  }

  [[nodiscard]] Grids run(ZRange core) const override {
    std::call_once(made_, [&] { ranks_ = makeRanks(); });
    const openvdb::FloatGrid::Ptr grid = emptyGrid();
    const ZRange layers = intersection(core, {0, tileSize().z()});
    if (!layers.empty()) addThresholds(ranks_, layers.begin, layers.end, *grid);
    return {{mask_grid, grid}};
  }

 private:
  [[nodiscard]] Coord tileSize() const { return Coord::floor(size_); }

  [[nodiscard]] VoidAndCluster settings() const {
    VoidAndCluster settings;
    settings.size = tileSize();
    settings.kernel.shape = kernel_ == "peters"  ? MaskKernel::Shape::peters
                            : kernel_ == "gauss" ? MaskKernel::Shape::gauss
                                                 : MaskKernel::Shape::axis_mix;
    settings.kernel.sigma = sigma_;
    settings.kernel.plane_sigma = plane_sigma_;
    settings.kernel.space_weight = space_weight_;
    settings.seed = seed_;
    return settings;
  }

  [[nodiscard]] openvdb::FloatGrid::Ptr emptyGrid() const {
    if (kind_ == "void-and-cluster") return emptyMask(settings());
    openvdb::FloatGrid::Ptr grid = emptyMask(tileSize(), kind_);
    if (kind_ == "gradient-noise") grid->insertMeta("mask:cell", openvdb::Int32Metadata(cell_));
    if (kind_ != "bayer") grid->insertMeta("mask:seed", openvdb::Int32Metadata(seed_));
    return grid;
  }

  [[nodiscard]] std::vector<std::uint32_t> makeRanks() const {
    const Coord size = tileSize();
    if (kind_ == "bayer") return bayerRanks(size);
    if (kind_ == "gradient-noise") return gradientNoiseRanks(size, cell_, seed_);
    if (kind_ == "white") return randomPermutation(size.x() * size.y() * size.z(), seed_);
    return voidAndCluster(settings(), [this](double fraction) { report().progress(fraction); });
  }

  openvdb::Vec3d size_{128, 128, 128};
  std::string kind_ = "void-and-cluster";
  std::string kernel_ = "peters";
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
