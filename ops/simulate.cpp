#include <memory>
#include <optional>
#include <string>

#include "io/profile/printer_profile.h"
#include "ops/kernels/printing/gaussian_spread.h"
#include "vdbdither/engine/comma_list.h"
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
    options.text("spread", spread_text_, "MM|X,Y,Z",
                 "How far a droplet spreads: standard deviation of a Gaussian, one length or one "
                 "for each axis; by default what the printer's profile states, or else 50um");
  }

  Schema plan(const Schema& in) override {
    const auto solid = findGrid<openvdb::BoolGrid>(in.grids, solid_grid);
    box_ = in.lattice.box;
    spread_.emplace(in.lattice.pitch_mm, spreadMm(in));
    constexpr int furthest = 500;
    const openvdb::Coord reach = spread_->reach();
    if (std::max({reach.x(), reach.y(), reach.z()}) > furthest)
      throw UsageError("--spread: droplets would reach over more than " + std::to_string(furthest) +
                       " voxels");
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
  [[nodiscard]] Vec3d spreadMm(const Schema& in) const {
    constexpr double usual_mm = 0.05;
    if (spread_text_.empty()) {
      const auto profile = in.metadata.find(printer_key);
      if (profile == in.metadata.end()) return Vec3d(usual_mm);
      const Vec3d stated = printerProfileFromJson(profile->second).point_spread_mm;
      return stated.isZero() ? Vec3d(usual_mm) : stated;
    }
    const std::vector<std::string> lengths = commaList(spread_text_);
    if (lengths.size() != 1 && lengths.size() != 3) refuse();
    Vec3d spread_mm;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double length_mm = parseLengthMm(lengths[axis % lengths.size()]);
      if (!(length_mm >= 0)) refuse();
      spread_mm[static_cast<int>(axis)] = length_mm;
    }
    return spread_mm;
  }

  [[noreturn]] void refuse() const {
    throw UsageError("--spread: '" + spread_text_ +
                     "' is neither a length such as 50um nor three of them");
  }

  std::string spread_text_;
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
