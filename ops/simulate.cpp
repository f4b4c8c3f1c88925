#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <tbb/task_arena.h>

#include "io/profile/ink_set.h"
#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "ops/kernels/colour/empty_colours.h"
#include "ops/kernels/colour/seen_colours.h"
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
    options.length("translucency", translucency_mm_, {0.001, 10},
                   "Adds 'Cd', the colours that the print shows: means of the materials around, by "
                   "a Gaussian of this standard deviation, which is how far light wanders in them",
                   {"none", "Adds no colours"});
  }

  Schema plan(const Schema& in) override {
    const auto solid = findGrid<openvdb::BoolGrid>(in.grids, solid_grid);
    box_ = in.lattice.box;
    if (!spread_mm_) spread_mm_ = pointSpreadMmOf(in);
    spread_.emplace(in.lattice.pitch_mm, *spread_mm_);
    checkReach(*spread_, 500, "--spread: the droplets would reach", "spread");
    Schema out = in;
    // Distances have a margin around the part; the box of voxels alone can end at the part.
    if (!in.grids.contains(surface_grid) && !box_.empty()) {
      box_.min() -= spread_->reach();
      box_.max() += spread_->reach();
      out.lattice.box = box_;
    }
    out.grids[printed_grid] = makePrintedGrid(solid->transform());
    if (translucency_mm_) {
      planColours(in);
      out.grids[colour_grid] = emptyColours(in.lattice);
      out.grids.erase(opacity_grid);
    }
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    std::vector<Read> reads{{solid_grid, Reach::stencil(spread_->reach().z())}};
    if (seen_) reads.push_back({material_grid, Reach::stencil(light_->reach().z())});
    return reads;
  }

  [[nodiscard]] double memoryBytes() const override {
    return seen_ ? seen_->memoryBytes() * tbb::this_task_arena::max_concurrency() : 0;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::simulate_us + (seen_ ? cost::simulate_colours_us : 0)};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto printed =
        spread_->run(*findGrid<openvdb::BoolGrid>(in.grids, solid_grid), box_, in.core, in.valid);
    Grids out{{printed_grid, printed}};
    if (seen_) {
      const auto material = findGrid<openvdb::Int32Grid>(in.grids, material_grid);
      const auto colours = seen_->run(*material, *printed, in.core, in.valid);
      colours->setName(colour_grid);
      out[colour_grid] = colours;
    }
    return out;
  }

 private:
  static void checkReach(const GaussianSpread& spread, int furthest, const std::string& what,
                         const std::string& remedy) {
    const openvdb::Coord reach = spread.reach();
    if (std::max({reach.x(), reach.y(), reach.z()}) > furthest)
      throw UsageError(what + " over more than " + std::to_string(furthest) +
                       " voxels; give a smaller " + remedy);
  }

  /// Prepares the colours of the table of materials; measured ones come from the profile.
  void planColours(const Schema& in) {
    findGrid<openvdb::Int32Grid>(in.grids, material_grid);
    const auto table = in.metadata.find(materials_key);
    if (table == in.metadata.end())
      throw DataError(
          "--translucency: no table of materials says what colour 'material' has; make "
          "it with halftone or material-assign");
    light_.emplace(in.lattice.pitch_mm, Vec3d(*translucency_mm_));
    checkReach(*light_, 64, "--translucency: the light would reach", "length");
    const MaterialTable materials = materialTableFromJson(table->second);
    std::vector<bool> is_seen;
    for (const Material& material : materials) is_seen.push_back(!isClear(material));
    const PrinterProfile printer = printerProfileOf(in);
    seen_.emplace(std::array{light_->weights(0), light_->weights(1), light_->weights(2)},
                  linearColoursOf(materials, printer), is_seen, printer.yule_nielsen);
  }

  std::optional<Vec3d> spread_mm_;
  std::optional<double> translucency_mm_;
  openvdb::CoordBBox box_;
  std::optional<GaussianSpread> spread_;
  std::optional<GaussianSpread> light_;
  std::optional<SeenColours> seen_;
};

}  // namespace

extern const OperatorInfo simulate;
const OperatorInfo simulate{
    "simulate", "What the printer makes of the voxels: the share of material after droplets spread",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! simulate ! mesh-export print.stl",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Simulate>(); }};

}  // namespace vdbdither
