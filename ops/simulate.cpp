#include <memory>
#include <optional>
#include <string>

#include "io/profile/printer_profile.h"
#include "ops/kernels/printing/gaussian_spread.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using openvdb::Vec3d;

/// `printed` from `solid`.
class Simulate : public Filter {
 public:
  void declare(Options& options) override {
    options.lengths(
        "spread", spread_mm_, "LENGTH|X,Y,Z", {0, 100},
        "Standard deviation of the Gaussian by which a droplet spreads; by default that "
        "of the printer's profile, or else 50um");
  }

  Schema plan(const Schema& in) override {
    const auto solid = findGrid<openvdb::BoolGrid>(in.grids, solid_grid);
    box_ = in.lattice.box;
    if (!spread_mm_) spread_mm_ = usualSpreadMm(in);
    spread_.emplace(in.lattice.pitch_mm, *spread_mm_);
    constexpr int furthest = 500;
    const openvdb::Coord reach = spread_->reach();
    if (std::max({reach.x(), reach.y(), reach.z()}) > furthest)
      throw UsageError("--spread: the droplets would reach over more than " +
                       std::to_string(furthest) + " voxels; give a smaller spread");
    Schema out = in;
    out.grids[printed_grid] = makePrintedGrid(solid->transform());
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    return {{solid_grid, Reach::stencil(spread_->reach().z())}};
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::simulate_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    return {{printed_grid, spread_->run(*findGrid<openvdb::BoolGrid>(in.grids, solid_grid), box_,
                                        in.core, in.valid)}};
  }

 private:
  static Vec3d usualSpreadMm(const Schema& in) {
    constexpr double usual_mm = 0.05;
    const auto profile = in.metadata.find(printer_key);
    if (profile == in.metadata.end()) return Vec3d(usual_mm);
    const Vec3d stated = printerProfileFromJson(profile->second).point_spread_mm;
    return stated.isZero() ? Vec3d(usual_mm) : stated;
  }

  std::optional<Vec3d> spread_mm_;
  openvdb::CoordBBox box_;
  std::optional<GaussianSpread> spread_;
};

}  // namespace

extern const OperatorInfo simulate;
const OperatorInfo simulate{
    "simulate", "What the printer makes of the voxels: the share of material after droplets spread",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! simulate ! mesh-export print.stl",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Simulate>(); }};

}  // namespace vdbdither
