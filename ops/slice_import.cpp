#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "io/profile/material_table.h"
#include "io/stack/slice_spans.h"
#include "io/stack/stack_reader.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

/// The layers of a stack as the grids it was made from.
class StackLayers : public Input {
 public:
  /// Throws DataError, as StackReader does.
  StackLayers(std::string path, EditedStack edited,
              const std::function<void(const std::string&)>& warn)
      : path_(std::move(path)), stack_(path_, edited, warn) {
    const Manifest& manifest = stack_.manifest();
    schema_.lattice = manifest.lattice;
    if (!manifest.printer.empty()) schema_.metadata[printer_key] = manifest.printer;
    std::string history;
    for (const std::string& line : manifest.history)
      history += (history.empty() ? "" : "\n") + line;
    if (!history.empty()) schema_.metadata[history_key] = history;
    auto solid = openvdb::BoolGrid::create(false);
    solid->setName(solid_grid);
    solid->setTransform(transformOf(schema_.lattice));
    schema_.grids[solid_grid] = solid;
    if (tellsMaterials()) {
      auto material = openvdb::Int32Grid::create(0);
      material->setName(material_grid);
      material->setTransform(transformOf(schema_.lattice));
      schema_.grids[material_grid] = material;
      schema_.metadata[materials_key] = toJson(manifest.materials);
    }
    sampleLeaves();
  }

  [[nodiscard]] const std::string& path() const override { return path_; }
  [[nodiscard]] bool isPipe() const override { return false; }
  [[nodiscard]] const Schema& schema() const override { return schema_; }
  [[nodiscard]] double memoryBytes() const override { return 0; }
  void readToEnd() override {}

  Grids read(ZRange core) override {
    checkCovered(core);
    const auto material = std::make_shared<openvdb::Int32Tree>(0);
    for (ZRange rows = alignedToLeaves(core); rows.begin < rows.end; rows.begin += leaf_layers) {
      const ZRange layers = intersection({rows.begin, rows.begin + leaf_layers}, core);
      std::vector<SpanImage> images(static_cast<std::size_t>(std::max(0, layers.size())));
      tbb::parallel_for(layers.begin, layers.end,
                        [&](int z) { images[z - layers.begin] = stack_.layer(z); });
      material->merge(gridOfSpans(images, stack_.manifest().layout, layers)->tree());
    }
    openvdb::tools::prune(*material);
    const auto typed = [&](const char* name, const auto& tree, auto grid) {
      grid = openvdb::gridPtrCast<typename decltype(grid)::element_type>(
          schema_.grids.at(name)->copyGridWithNewTree());
      grid->setTree(tree);
      return grid;
    };
    Grids grids;
    const auto solid =
        std::make_shared<openvdb::BoolTree>(*material, false, true, openvdb::TopologyCopy());
    openvdb::tools::prune(*solid);
    grids[solid_grid] = typed(solid_grid, solid, openvdb::BoolGrid::Ptr());
    if (tellsMaterials())
      grids[material_grid] = typed(material_grid, material, openvdb::Int32Grid::Ptr());
    return grids;
  }

 private:
  /// Grey says only whether a voxel is printed, and a stack of `solid` has no materials.
  [[nodiscard]] bool tellsMaterials() const {
    const Manifest& manifest = stack_.manifest();
    return manifest.grid == material_grid &&
           (stack_.format().pixel != SlicePixel::printed || manifest.materials.size() == 1);
  }

  /// Estimates the leaves at the surface by those that it crosses in a few of the layers.
  void sampleLeaves() {
    constexpr int samples = 16;
    const ZRange stored = stack_.manifest().layers;
    const int taken = std::min(samples, stored.size());
    double sum = 0;
    double fullest = 0;
    for (int sample = 0; sample < taken; ++sample) {
      const auto at = static_cast<std::int64_t>(stored.size()) * (2 * sample + 1) / (2 * taken);
      const double crossed = leavesCrossed(stack_.layer(stored.begin + static_cast<int>(at)));
      sum += crossed;
      fullest = std::max(fullest, crossed);
    }
    // A surface that leans crosses more leaves of a row than of one of its layers.
    constexpr double lean = 1.3;
    const double leaves = sum / taken * schema_.lattice.layers().size() / leaf_layers;
    schema_.footprint = Footprint{fullest, leaves, leaves}.scaled(lean);
  }

  /// The squares of eight by eight pixels that some span ends in.
  static double leavesCrossed(const SpanImage& image) {
    double leaves = 0;
    std::vector<bool> crossed;
    for (std::uint32_t y = 0; y < image.height; ++y) {
      if (y % leaf_layers == 0) crossed.assign(image.width / leaf_layers + 1, false);
      for (const Span& span : image.row(y)) {
        if (span.end == image.width) continue;
        const std::uint32_t square = span.end / leaf_layers;
        if (!crossed[square]) ++leaves;
        crossed[square] = true;
      }
    }
    return leaves;
  }

  /// Layers are requested in whole leaves: those behind the last whole leaf are checked here.
  void checkCovered(ZRange core) const {
    const ZRange stored = stack_.manifest().knownLayers();
    if (intersection(core, stored) == core || core.empty()) return;
    const ZRange all = stack_.manifest().lattice.layers();
    ZRange whole = stored;
    if (whole.begin > all.begin) whole.begin = alignedToLeaves({whole.begin - 1, whole.begin}).end;
    if (whole.end < all.end) whole.end = alignedToLeaves({whole.end, whole.end + 1}).begin;
    const int missing = core.begin < stored.begin ? core.begin : stored.end;
    throw DataError("'" + path_ + "' lacks layer " + std::to_string(missing - all.begin) +
                    (whole.empty() ? make_stack_again
                                   : "; --layers " + std::to_string(whole.begin - all.begin) + ":" +
                                         std::to_string(whole.end - all.begin) +
                                         " takes what it has in whole groups of eight"));
  }

  std::string path_;
  StackReader stack_;
  Schema schema_;
};

class SliceImport : public Source {
 public:
  void declare(Options& options) override {
    options.positional("stack", path_,
                       "Stack of slice-export: the folder, its manifest.json, or the zip archive");
    options.flag("edited", edited_,
                 "Takes a stack that was changed after slice-export wrote it, such as retouched "
                 "slices, and warns of it");
  }

  Schema plan() override {
    stack_ =
        std::make_unique<StackLayers>(path_, edited_ ? EditedStack::taken : EditedStack::refused,
                                      [this](const std::string& text) { report().warn(text); });
    return stack_->schema();
  }

  [[nodiscard]] std::vector<Input*> inputs() override { return {stack_.get()}; }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::slice_import_us,
                .us_per_layer = cost::slice_import_us_per_layer};
  }

  [[nodiscard]] Grids run(ZRange core) const override { return stack_->read(core); }

 private:
  std::string path_;
  bool edited_ = false;
  std::unique_ptr<StackLayers> stack_;
};

}  // namespace

extern const OperatorInfo slice_import;
const OperatorInfo slice_import{
    "slice-import", "The voxels of a stack that slice-export made",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export out\n"
    "slice-import out -o again.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<SliceImport>(); }};

}  // namespace vdbdither
