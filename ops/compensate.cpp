#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/profile/printer_profile.h"
#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/printing/detail_compensation.h"
#include "ops/kernels/printing/gaussian_spread.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;
using openvdb::Vec3d;

/// `surface` moved where the printing process loses detail.
class Compensate : public Filter {
 public:
  void declare(Options& options) override {
    options.lengths(
        "spread", spread_mm_, "LENGTH|X,Y,Z", {0, 1},
        "Standard deviation of the Gaussian by which a droplet spreads; by default that "
        "of the printer's profile, or else 50um");
    options.integer("steps", steps_, {1, 2},
                    "Steps: the second corrects what the first leaves or overdoes");
  }

  Schema plan(const Schema& in) override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    if (!spread_mm_) spread_mm_ = pointSpreadMmOf(in);
    if (spread_mm_->isZero())
      throw UsageError("--spread: must be above 0 mm along an axis; leave the operator out");
    const openvdb::Coord reach = GaussianSpread(in.lattice.pitch_mm, *spread_mm_).reach();
    if (std::max({reach.x(), reach.y(), reach.z()}) > most_reach)
      throw UsageError("--spread: the droplets would reach over more than " +
                       std::to_string(most_reach) + " voxels; give a smaller spread");
    // A feature is found with a voxel diameter of distances. The band stays what it is.
    checkHolds(surface->background(), in.lattice.diagonalMm(), "'compensate' needs");
    compensation_ = DetailCompensation{in.lattice, *spread_mm_, steps_};
    Schema out = withoutOutdated(in, surface_grid);
    out.grids[surface_grid] = surface->copyGridWithNewTree();
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    return {{surface_grid, Reach::stencil(compensation_.reachLayers())}};
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::compensate_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    return {{surface_grid,
             compensation_.run(*findGrid<FloatGrid>(in.grids, surface_grid), in.core, in.valid)}};
  }

 private:
  static constexpr int most_reach = 100;

  std::optional<Vec3d> spread_mm_;
  int steps_ = 2;
  DetailCompensation compensation_;
};

}  // namespace

extern const OperatorInfo compensate;
const OperatorInfo compensate{
    "compensate", "The surface thickened and deepened where the printing process loses detail",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! compensate ! dither ! slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Compensate>(); }};

}  // namespace vdbdither
