#include <algorithm>
#include <atomic>
#include <memory>
#include <sstream>

#include <openvdb/tree/LeafManager.h>

#include "io/profile/ink_set.h"
#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/leaf/split_tiles.h"
#include "ops/kernels/printing/depth_bands.h"
#include "vdbdither/engine/history.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::Int32Grid;
using openvdb::Int32Tree;

/// `material` from `solid`.
class MaterialAssign : public Filter {
 public:
  void declare(Options& options) override {
    options.text(
        "material", material_, "NAME",
        "One material for all voxels: a name of the printer's profile, or NAME=#rrggbb; by "
        "default those of the colours, as halftone chooses them, where there are colours and a "
        "profile, or else the first of the profile, or white");
    options.text("parts", parts_, "NAME,...",
                 "A material for each part, in the order of the meshes");
    options.text("shell", shell_, "LENGTH:NAME,...",
                 "Layers under the printed surface from the outside in, each with its thickness, "
                 "such as 0.2mm:white,0.5mm:black. The depth of a voxel is the distance from its "
                 "centre to that of the nearest empty voxel");
    options.text("core", core_, "NAME", "Material beneath the shell");
  }

  Schema plan(const Schema& in) override {
    lattice_ = in.lattice;
    colours_.reset();
    const auto solid = findGrid<BoolGrid>(in.grids, solid_grid);
    if (shell_.empty() != core_.empty())
      throw UsageError("--shell and --core go together; give both");
    if (!shell_.empty() + !parts_.empty() + !material_.empty() > 1) {
      throw UsageError("--material, --parts and --shell exclude each other; give one");
    }
    if (material_.empty() && parts_.empty() && shell_.empty() && in.grids.contains(colour_grid) &&
        canMixColours(printerProfileOf(in).materials)) {
      const OperatorInfo& halftone = findOperator("halftone");
      Options options;
      colours_ = made(halftone, options);
      Schema out = colours_->plan(in);
      addToHistory(out, halftone.name, options);
      return out;
    }
    if (!parts_.empty()) findGrid<Int32Grid>(in.grids, part_grid);
    planTable(in);

    Schema out = in;
    out.grids[material_grid] = makeMaterialGrid(solid->transform());
    out.metadata[materials_key] = toJson(table_);
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    if (colours_) return colours_->reads();
    std::vector<Read> reads = {
        {solid_grid, Reach::stencil(depthReach(bands_, lattice_.pitch_mm.z()))}};
    if (!parts_.empty()) reads.push_back({part_grid, Reach::point()});
    return reads;
  }

  [[nodiscard]] bool keepsHistory() const override { return colours_ != nullptr; }

  [[nodiscard]] double memoryBytes() const override {
    return colours_ ? colours_->memoryBytes() : 0;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    if (colours_) return colours_->work();
    return Work{.us_per_surface_leaf =
                    bands_.empty() ? cost::material_us : cost::material_shell_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    if (colours_) return colours_->run(in);
    const auto solid = findGrid<BoolGrid>(in.grids, solid_grid);
    Int32Grid::Ptr material;
    if (!bands_.empty()) {
      material = valueByDepth(*solid, lattice_.pitch_mm, lattice_.box, in.core, in.valid, bands_,
                              static_cast<std::int32_t>(table_.size()));
    } else {
      material = makeMaterialGrid(solid->transform());
      material->setTree(valueWhereActive(solid->tree(), 1));
      if (!parts_.empty())
        takeParts(material->tree(), findGrid<Int32Grid>(in.grids, part_grid)->tree());
    }
    material->setName(material_grid);
    return {{material_grid, material}};
  }

 private:
  /// Makes another operator, with the defaults of its options.
  [[nodiscard]] std::unique_ptr<Filter> made(const OperatorInfo& info, Options& options) {
    std::unique_ptr<Operator> made = info.make();
    made->declare(options);
    made->setReporter(&report());
    return std::unique_ptr<Filter>(&dynamic_cast<Filter&>(*made.release()));
  }

  void planTable(const Schema& in) {
    const std::vector<Material> known = printerProfileOf(in).materials;
    table_.clear();
    bands_.clear();
    if (!parts_.empty()) {
      for (const std::string& name : materialEntries(parts_)) add("--parts", name, known);
    } else if (!shell_.empty()) {
      double depth_mm = 0;
      for (const std::string& layer : materialEntries(shell_)) {
        constexpr double thickest_mm = 1000;
        const auto [thickness_mm, name] =
            parseMaterialLayer("--shell", layer, thickest_mm, "0.5mm:white");
        depth_mm += thickness_mm;
        add("--shell", name, known);
        bands_.push_back({depth_mm, static_cast<std::int32_t>(table_.size())});
      }
      add("--core", core_, known);
    } else {
      if (material_.empty()) material_ = known.empty() ? "white" : known.front().name;
      add("--material", material_, known);
    }
  }

  void add(const std::string& option, const std::string& text, const std::vector<Material>& known) {
    try {
      table_.push_back(parseMaterial(text, known));
    } catch (const UsageError& error) {
      throw UsageError(option + ": " + error.what());
    }
    for (const Material& other : table_) {
      if (other.name == table_.back().name && other.rgba != table_.back().rgba) {
        throw UsageError(option + ": '" + other.name + "' has two colours");
      }
    }
  }

  /// Replaces the voxels of `material` by the parts they belong to. A voxel of no part, or of one
  /// beyond the list, takes the last material.
  void takeParts(Int32Tree& material, const Int32Tree& part) const {
    const auto count = static_cast<std::int32_t>(table_.size());
    std::atomic<std::uint64_t> strays = 0;
    const auto material_of = [&](std::int32_t index, std::uint64_t voxels) {
      if (index >= 1 && index <= count) return index;
      strays += voxels;
      return count;
    };
    const openvdb::tree::ValueAccessor<const Int32Tree> nodes(part);
    splitTiles(material, [&](const Coord& at) { return nodes.probeConstLeaf(at) != nullptr; });
    auto tile = material.beginValueOn();
    tile.setMaxDepth(Int32Tree::ValueOnIter::LEAF_DEPTH - 1);
    for (; tile; ++tile)
      tile.setValue(material_of(part.getValue(tile.getCoord()), tile.getVoxelCount()));
    openvdb::tree::LeafManager<Int32Tree> leaves(material);
    leaves.foreach ([&](Int32Tree::LeafNodeType& leaf, std::size_t) {
      const openvdb::tree::ValueAccessor<const Int32Tree> accessor(part);
      for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) {
        voxel.setValue(material_of(accessor.getValue(voxel.getCoord()), 1));
      }
    });
    if (strays > 0) report().count("voxels_of_no_part", static_cast<double>(strays));
  }

  std::string material_;
  std::string parts_;
  std::string shell_;
  std::string core_;

  std::unique_ptr<Filter> colours_;  ///< where colours choose the materials
  Lattice lattice_;
  MaterialTable table_;
  std::vector<DepthBand> bands_;  ///< of the shell; the core is the last of the table
};

}  // namespace

extern const OperatorInfo material_assign;
const OperatorInfo material_assign = {
    "material-assign", "The material of every printed voxel",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign --shell 0.5mm:white "
    "--core clear ! slice-export out",
    [] { return std::unique_ptr<Operator>(std::make_unique<MaterialAssign>()); }};

}  // namespace vdbdither
