#include <algorithm>
#include <memory>
#include <sstream>

#include "io/profile/ink_set.h"
#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "ops/kernels/leaf/part_values.h"
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
using openvdb::Int32Grid;

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
                 "A material for each part, in the order of the meshes; several parts may have the "
                 "same");
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
    planTable(in);
    if (!parts_.empty()) {
      checkPartCount(*findGrid<Int32Grid>(in.grids, part_grid), part_materials_.size(),
                     "take the last one", [this](const std::string& text) { report().warn(text); });
    }

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
                              core_material_);
    } else {
      material = makeMaterialGrid(solid->transform());
      material->setTree(valueWhereActive(solid->tree(), 1));
      if (!parts_.empty()) {
        const std::uint64_t strays =
            takeParts(material->tree(), findGrid<Int32Grid>(in.grids, part_grid)->tree(),
                      part_materials_, part_materials_.back());
        if (strays > 0) report().count("voxels_of_no_part", static_cast<double>(strays));
      }
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
    part_materials_.clear();
    if (!parts_.empty()) {
      for (const std::string& name : materialEntries(parts_))
        part_materials_.push_back(add("--parts", name, known));
    } else if (!shell_.empty()) {
      double depth_mm = 0;
      for (const std::string& layer : materialEntries(shell_)) {
        constexpr double thickest_mm = 1000;
        const auto [thickness_mm, name] =
            parseMaterialLayer("--shell", layer, thickest_mm, "0.5mm:white");
        depth_mm += thickness_mm;
        bands_.push_back({depth_mm, add("--shell", name, known)});
      }
      core_material_ = add("--core", core_, known);
    } else {
      if (material_.empty()) material_ = known.empty() ? "white" : known.front().name;
      add("--material", material_, known);
    }
  }

  /// Returns the index of the material that `text` names.
  std::int32_t add(const std::string& option, const std::string& text,
                   const std::vector<Material>& known) {
    try {
      return addMaterial(table_, parseMaterial(text, known));
    } catch (const UsageError& error) {
      throw UsageError(option + ": " + error.what());
    }
  }

  std::string material_;
  std::string parts_;
  std::string shell_;
  std::string core_;

  std::unique_ptr<Filter> colours_;  ///< where colours choose the materials
  Lattice lattice_;
  MaterialTable table_;
  std::vector<DepthBand> bands_;              ///< of the shell
  std::int32_t core_material_ = 1;            ///< beneath the shell
  std::vector<std::int32_t> part_materials_;  ///< of each part
};

}  // namespace

extern const OperatorInfo material_assign;
const OperatorInfo material_assign = {
    "material-assign", "The material of every printed voxel",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign --shell 0.5mm:white "
    "--core clear ! slice-export out",
    [] { return std::unique_ptr<Operator>(std::make_unique<MaterialAssign>()); }};

}  // namespace vdbdither
