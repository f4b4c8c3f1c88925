#include "ops/kernels/colour/halftone.h"

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/profile/ink_set.h"
#include "io/profile/material_table.h"
#include "io/vdb/mask_cache.h"
#include "ops/kernels/colour/coverage_reader.h"
#include "ops/kernels/colour/surface_columns.h"
#include "ops/kernels/leaf/part_values.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/mask/mask_tile.h"
#include "ops/kernels/mask/threshold_mask.h"
#include "ops/kernels/printing/depth_bands.h"
#include "vdbdither/engine/comma_list.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using openvdb::BoolGrid;
using openvdb::FloatGrid;
using openvdb::Int32Grid;
using openvdb::Vec3SGrid;

enum class MaskSource { blue, white };
constexpr std::array<Choice<MaskSource>, 2> mask_sources{
    {{MaskSource::blue, "blue", "Blue noise for the lattice, made once and cached"},
     {MaskSource::white, "white", "White noise: every voxel on its own"}}};

/// `material` from `solid` and colours or coverages.
class HalftoneFilter : public Filter {
 public:
  void declare(Options& options) override {
    inks_.declare(options);
    options.text("core", core_, "NAME",
                 "Material of voxels without a colour; by default the lightest ink");
    options.text("coat", coat_, "LENGTH:NAME",
                 "Material over the colours, down to this depth below the printed surface, such as "
                 "0.1mm:VeroClear");
    options.text("parts", parts_, "NAME,...",
                 "A material for each part, in the order of the meshes; 'colours' for a part that "
                 "is printed in its colours");
    options.text("coverages", coverages_, "GRID=NAME,...",
                 "Grids of float that hold the coverages of materials, in place of colours; by "
                 "default the grids coverage_NAME, if there are any");
    options.text("rest", rest_, "NAME",
                 "Material of what coverages leave to a sum of 1; by default they are divided by "
                 "their sum");
    options.choice("mask", mask_, mask_sources, "Thresholds");
    options.triple(
        "size", size_, "N|NX,NY,NZ", {0, 256},
        "Period of --mask blue along x, y and z, in voxels; 0: powers of two, 1.75 mm or "
        "more");
    options.integer("seed", seed_, {0, std::numeric_limits<int>::max()}, "Seed of the mask");
  }

  Schema plan(const Schema& in) override {
    const auto solid = findGrid<BoolGrid>(in.grids, solid_grid);
    planGrids(in);
    set_ = inkSetOf(inks_, in, inksOfCoverages(in));
    for (Column& column : columns_) column.material = indexOf("--coverages", column.name);
    if (columns_.empty()) {
      separation_ = separationInto(set_);
      if (has_opacity_ && !set_.clear)
        report().warn("no ink is clear: 'Alpha' is ignored and all is printed opaque");
    } else if (!inks_.icc.empty() || !inks_.mixing_given.empty()) {
      throw UsageError((inks_.icc.empty() ? inks_.mixing_given : "--icc") +
                       ": coverages are not separated again; leave it out");
    }
    if (!rest_.empty() && columns_.empty())
      throw UsageError("--rest: colours have no rest; leave it out");

    const std::vector<std::size_t> order = darkestFirst(set_);
    if (core_.empty()) core_ = set_.inks[order.back()].name;
    core_material_ = materialOf("--core", core_);
    planCoat();
    planParts(in);
    lattice_ = in.lattice;
    rest_material_ = rest_.empty() ? std::nullopt : std::optional(indexOf("--rest", rest_));
    halftone_.emplace(order, mask(in.lattice.pitch_mm));

    Schema out = in;
    out.grids[material_grid] = makeMaterialGrid(solid->transform());
    out.metadata[materials_key] = toJson(MaterialTable(set_.inks));
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    int solid_layers = depthReach(coat_band_, lattice_.pitch_mm.z());
    std::vector<Read> reads;
    if (has_surface_) {
      const int layers = SurfaceColumns::reachLayers(lattice_.pitch_mm, columnDepthMm());
      reads.push_back({surface_grid, Reach::stencil(layers)});
      solid_layers = std::max(solid_layers, layers);
    }
    reads.push_back({solid_grid, Reach::stencil(solid_layers)});
    for (const Column& column : columns_) reads.push_back({column.grid, Reach::point()});
    if (!part_materials_.empty()) reads.push_back({part_grid, Reach::point()});
    if (!columns_.empty()) return reads;
    reads.push_back({colour_grid, Reach::point()});
    if (has_opacity_) reads.push_back({opacity_grid, Reach::point()});
    return reads;
  }

  [[nodiscard]] double memoryBytes() const override {
    return halftone_->memoryBytes() + (separation_ ? separation_->memoryBytes() : 0);
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf =
                    cost::halftone_us + (has_surface_ ? cost::halftone_columns_us : 0)};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto solid = findGrid<BoolGrid>(in.grids, solid_grid);
    const Int32Grid::Ptr material = makeMaterialGrid(solid->transform());
    std::optional<SurfaceColumns> places;
    if (has_surface_)
      places.emplace(findGrid<FloatGrid>(in.grids, surface_grid)->tree(), solid->tree(),
                     lattice_.pitch_mm, columnDepthMm(), in.valid);
    // Without the halo, which the result would have to be cut at.
    const GridLayers with_halo{solid, in.valid};
    const auto core = openvdb::gridConstPtrCast<BoolGrid>(joinLayers({&with_halo, 1}, in.core));
    const auto halftoned = [&](const CoverageSource& source) {
      return halftone_->run(core->tree(), source, core_material_, in.core,
                            places ? &*places : nullptr);
    };
    if (columns_.empty()) {
      const auto colour = findGrid<Vec3SGrid>(in.grids, colour_grid);
      const auto opacity = has_opacity_ ? findGrid<FloatGrid>(in.grids, opacity_grid) : nullptr;
      const ColourCoverages source(*colour, opacity.get(), set_, *separation_);
      material->setTree(halftoned(source));
    } else {
      std::vector<FloatGrid::ConstPtr> held;
      std::vector<GridCoverages::Grid> grids;
      for (const Column& column : columns_) {
        held.push_back(findGrid<FloatGrid>(in.grids, column.grid));
        grids.push_back({held.back().get(), column.grid, column.material});
      }
      const GridCoverages source(std::move(grids), rest_material_);
      material->setTree(halftoned(source));
    }
    if (!part_materials_.empty()) {
      const auto part = findGrid<Int32Grid>(in.grids, part_grid);
      takeParts(material->tree(), part->tree(), part_materials_, keeps_colours);
    }
    if (!coat_band_.empty()) {
      const auto coat =
          valueByDepth(*solid, lattice_.pitch_mm, lattice_.box, in.core, in.valid, coat_band_, 0);
      takeCoat(material->tree(), coat->tree());
    }
    return {{material_grid, material}};
  }

 private:
  /// Of a part, in place of the index of a material.
  static constexpr std::int32_t keeps_colours = 0;

  /// A grid of coverages.
  struct Column {
    std::string grid;
    std::string name;  ///< of the material
    std::size_t material = 0;
  };

  /// As deep as light comes back from, below what lies over the colours.
  [[nodiscard]] double columnDepthMm() const {
    constexpr double seen_mm = 0.15;
    return seen_mm + (coat_band_.empty() ? 0 : coat_band_.front().to_mm);
  }

  void planCoat() {
    coat_band_.clear();
    if (coat_.empty()) return;
    constexpr double thickest_mm = 10;
    const MaterialLayer coat = parseMaterialLayer("--coat", coat_, thickest_mm, "0.1mm:VeroClear");
    coat_band_.push_back({coat.thickness_mm, materialOf("--coat", coat.material)});
  }

  void planParts(const Schema& in) {
    part_materials_.clear();
    if (parts_.empty()) return;
    for (const std::string& name : commaList(parts_)) {
      part_materials_.push_back(name == "colours" ? keeps_colours : materialOf("--parts", name));
    }
    checkPartCount(*findGrid<Int32Grid>(in.grids, part_grid), part_materials_.size(),
                   "have their colours", [this](const std::string& text) { report().warn(text); });
  }

  /// Replaces the voxels of `material` that have a value in `coat`. All of these lie in leaves of
  /// `coat`, or in tiles of one value.
  static void takeCoat(openvdb::Int32Tree& material, const openvdb::Int32Tree& coat) {
    openvdb::tree::ValueAccessor<openvdb::Int32Tree, false> to(material);
    for (auto value = coat.cbeginValueOn(); value; ++value) {
      if (*value == 0) continue;
      if (value.isVoxelValue()) {
        to.setValue(value.getCoord(), *value);
      } else {
        material.fill(value.getBoundingBox(), *value, true);
      }
    }
  }

  /// Finds out whether coverages or colours are read.
  void planGrids(const Schema& in) {
    columns_.clear();
    for (const std::string& entry :
         coverages_.empty() ? std::vector<std::string>{} : commaList(coverages_)) {
      const std::size_t equals = entry.find('=');
      if (equals == std::string::npos || equals == 0 || equals + 1 == entry.size())
        throw UsageError("--coverages: '" + entry +
                         "' must be a grid and a material, as in density=black");
      const std::string grid = entry.substr(0, equals);
      if (std::any_of(columns_.begin(), columns_.end(),
                      [&](const Column& other) { return other.grid == grid; }))
        throw UsageError("--coverages: '" + grid + "' is there twice");
      columns_.push_back({grid, entry.substr(equals + 1)});
    }
    if (coverages_.empty()) {
      const std::string prefix = coverage_prefix;
      for (const auto& [name, grid] : in.grids)
        if (name.starts_with(prefix) && name != prefix)
          columns_.push_back({name, name.substr(prefix.size())});
    }
    for (const Column& column : columns_) findGrid<FloatGrid>(in.grids, column.grid);
    has_surface_ = in.grids.contains(surface_grid);
    if (has_surface_) findGrid<FloatGrid>(in.grids, surface_grid);
    has_opacity_ = columns_.empty() && in.grids.contains(opacity_grid);
    if (has_opacity_) findGrid<FloatGrid>(in.grids, opacity_grid);
    if (!columns_.empty()) return;
    if (!in.grids.contains(colour_grid))
      throw DataError(
          "no colours: there must be the grid 'Cd' (mesh2sdf --colour makes it), grids named "
          "coverage_ and a material, or those that --coverages names");
    findGrid<Vec3SGrid>(in.grids, colour_grid);
  }

  /// The inks that coverages were made for, if the metadata hold all of them.
  [[nodiscard]] MaterialTable inksOfCoverages(const Schema& in) const {
    const auto found = in.metadata.find(materials_key);
    if (columns_.empty() || found == in.metadata.end()) return {};
    const MaterialTable table = materialTableFromJson(found->second);
    const bool whole = std::all_of(columns_.begin(), columns_.end(), [&](const Column& column) {
      return materialCalled(column.name, table) != nullptr;
    });
    return whole ? table : MaterialTable();
  }

  [[nodiscard]] std::size_t indexOf(const std::string& option, const std::string& name) const {
    if (const Material* ink = materialCalled(name, set_.inks))
      return static_cast<std::size_t>(ink - set_.inks.data());
    std::string message = option + ": no ink '" + name + "'; there are";
    for (const Material& ink : set_.inks) message += " " + ink.name;
    throw UsageError(message);
  }

  /// Counted from 1, as the grid counts them.
  [[nodiscard]] std::int32_t materialOf(const std::string& option, const std::string& name) const {
    return static_cast<std::int32_t>(indexOf(option, name)) + 1;
  }

  /// Out of the user's cache, or new.
  [[nodiscard]] ThresholdMask mask(const openvdb::Vec3d& pitch_mm) const {
    if (mask_ == MaskSource::white) {
      if (size_ != openvdb::Coord(0))
        throw UsageError("--size: only --mask blue has it; leave it out");
      return ThresholdMask::whiteNoise(static_cast<std::uint64_t>(seed_));
    }
    VoidAndCluster settings = halftoneMask(pitch_mm, seed_);
    for (int axis = 0; axis < 3; ++axis)
      if (size_[axis] != 0) settings.size[axis] = size_[axis];
    const auto make = [&] {
      return maskOf(settings, [this](double fraction) { report().progress(fraction); });
    };
    return ThresholdMask(*cachedMask(*emptyMask(settings), make,
                                     [this](const std::string& text) { report().warn(text); }));
  }

  InkOptions inks_;
  std::string core_;
  std::string coat_;
  std::string parts_;
  std::string coverages_;
  std::string rest_;
  MaskSource mask_ = MaskSource::blue;
  openvdb::Coord size_{0, 0, 0};
  int seed_ = 1;

  std::vector<Column> columns_;  ///< empty: colours are read
  bool has_surface_ = false;
  bool has_opacity_ = false;
  InkSet set_;
  std::unique_ptr<Separation> separation_;
  std::optional<Halftone> halftone_;
  std::int32_t core_material_ = 1;
  Lattice lattice_;
  std::vector<DepthBand> coat_band_;          ///< at most one
  std::vector<std::int32_t> part_materials_;  ///< of each part; empty: all have their colours
  std::optional<std::size_t> rest_material_;
};

}  // namespace

extern const OperatorInfo halftone;
const OperatorInfo halftone{
    "halftone", "The material of every printed voxel, for colours or coverages",
    "mesh2sdf part.ply --printer mimaki-3duj-553 --colour ! dither ! halftone ! slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<HalftoneFilter>(); }};

}  // namespace vdbdither
