#include <memory>
#include <string>
#include <string_view>

#include "io/profile/ink_set.h"
#include "io/profile/material_table.h"
#include "ops/kernels/colour/coverage_reader.h"
#include "ops/kernels/colour/halftone.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;
using openvdb::Vec3SGrid;

/// `coverage_NAME` of every ink from `Cd` and `Alpha`.
class Separate : public Filter {
 public:
  void declare(Options& options) override { inks_.declare(options); }

  Schema plan(const Schema& in) override {
    const auto colour = findGrid<Vec3SGrid>(in.grids, colour_grid);
    has_opacity_ = in.grids.contains(opacity_grid);
    if (has_opacity_) findGrid<FloatGrid>(in.grids, opacity_grid);
    set_ = inkSetOf(inks_, in);
    separation_ = separationInto(set_);
    if (has_opacity_ && !set_.clear)
      report().warn("no ink is clear: 'Alpha' is ignored and all is printed opaque");
    Schema out = in;
    std::erase_if(out.grids, [](const auto& entry) {
      return std::string_view(entry.first).starts_with(coverage_prefix);
    });
    for (std::size_t ink = 0; ink < set_.inks.size(); ++ink) {
      const auto grid = makeCoverageGrid(colour->transform());
      grid->setName(coverageGridOf(set_.inks[ink]));
      out.grids[grid->getName()] = grid;
    }
    out.metadata[materials_key] = toJson(MaterialTable(set_.inks));
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    std::vector<Read> reads{{colour_grid, Reach::point()}};
    if (has_opacity_) reads.push_back({opacity_grid, Reach::point()});
    return reads;
  }

  [[nodiscard]] double memoryBytes() const override { return separation_->memoryBytes(); }
  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::separate_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto colour = findGrid<Vec3SGrid>(in.grids, colour_grid);
    const auto opacity = has_opacity_ ? findGrid<FloatGrid>(in.grids, opacity_grid) : nullptr;
    const ColourCoverages coverages(*colour, opacity.get(), set_, *separation_);
    const auto grids = coverageGrids(*colour, coverages, set_.inks.size(), in.core);
    Grids out;
    for (std::size_t ink = 0; ink < grids.size(); ++ink) {
      grids[ink]->setName(coverageGridOf(set_.inks[ink]));
      out[grids[ink]->getName()] = grids[ink];
    }
    return out;
  }

 private:
  static std::string coverageGridOf(const Material& ink) { return coverage_prefix + ink.name; }

  InkOptions inks_;
  bool has_opacity_ = false;
  InkSet set_;
  std::unique_ptr<Separation> separation_;
};

}  // namespace

extern const OperatorInfo separate;
const OperatorInfo separate{
    "separate", "Coverages of the inks for the colours of a grid",
    "mesh2sdf part.ply --printer mimaki-3duj-553 --colour ! separate -o coverages.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Separate>(); }};

}  // namespace vdbdither
