#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "io/image/png_spans.h"
#include "io/profile/material_table.h"
#include "io/profile/target_lattice.h"
#include "io/stack/colour_grids.h"
#include "io/stack/image_stack.h"
#include "io/stack/slice_spans.h"
#include "io/stack/stack_reader.h"
#include "ops/kernels/colour/empty_colours.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

/// The squares of eight by eight pixels that some span ends in.
double leavesCrossed(const SpanImage& image) {
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

/// Estimates the leaves at the surface of `layers` by those that it crosses in a few of the layers
/// that are stored.
template <typename Layer>
Footprint sampledFootprint(ZRange stored, ZRange layers, const Layer& layer) {
  constexpr int samples = 16;
  const int taken = std::min(samples, stored.size());
  double sum = 0;
  double fullest = 0;
  for (int sample = 0; sample < taken; ++sample) {
    const auto at = static_cast<std::int64_t>(stored.size()) * (2 * sample + 1) / (2 * taken);
    const double crossed = leavesCrossed(layer(stored.begin + static_cast<int>(at)));
    sum += crossed;
    fullest = std::max(fullest, crossed);
  }
  // A surface that leans crosses more leaves of a row than of one of its layers.
  constexpr double lean = 1.3;
  const double leaves = sum / taken * layers.size() / leaf_layers;
  return Footprint{fullest, leaves, leaves}.scaled(lean);
}

/// Makes the tree of the layers in `core`, where `layer` makes the spans of one; 0 is inactive.
template <typename Layer>
openvdb::Int32Tree::Ptr treeOfLayers(ZRange core, const SliceLayout& layout, const Layer& layer) {
  auto tree = std::make_shared<openvdb::Int32Tree>(0);
  for (ZRange rows = alignedToLeaves(core); rows.begin < rows.end; rows.begin += leaf_layers) {
    const ZRange layers = intersection({rows.begin, rows.begin + leaf_layers}, core);
    std::vector<SpanImage> images(static_cast<std::size_t>(std::max(0, layers.size())));
    tbb::parallel_for(layers.begin, layers.end,
                      [&](int z) { images[z - layers.begin] = layer(z); });
    tree->merge(gridOfSpans(images, layout, layers)->tree());
  }
  openvdb::tools::prune(*tree);
  return tree;
}

/// An empty grid for the schema.
template <typename Grid>
typename Grid::Ptr emptyGrid(const char* name, const Lattice& lattice) {
  auto grid = Grid::create(typename Grid::ValueType(0.0F));
  grid->setName(name);
  grid->setTransform(transformOf(lattice));
  return grid;
}

/// `tree` as the grid that stands under `name` in the schema.
template <typename Tree>
GridConstPtr gridLike(const Schema& schema, const char* name, const std::shared_ptr<Tree>& tree) {
  const auto grid =
      openvdb::gridPtrCast<openvdb::Grid<Tree>>(schema.grids.at(name)->copyGridWithNewTree());
  grid->setTree(tree);
  return grid;
}

GridConstPtr solidGrid(const Schema& schema, const openvdb::Int32Tree& values) {
  const auto solid =
      std::make_shared<openvdb::BoolTree>(values, false, true, openvdb::TopologyCopy());
  openvdb::tools::prune(*solid);
  return gridLike(schema, solid_grid, solid);
}

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
    schema_.grids[solid_grid] = emptyGrid<openvdb::BoolGrid>(solid_grid, schema_.lattice);
    if (tellsMaterials()) {
      schema_.grids[material_grid] = emptyGrid<openvdb::Int32Grid>(material_grid, schema_.lattice);
      schema_.metadata[materials_key] = toJson(manifest.materials);
    }
    schema_.footprint = sampledFootprint(manifest.layers, schema_.lattice.layers(),
                                         [&](int z) { return stack_.layer(z); });
  }

  [[nodiscard]] const std::string& path() const override { return path_; }
  [[nodiscard]] bool isPipe() const override { return false; }
  [[nodiscard]] const Schema& schema() const override { return schema_; }
  [[nodiscard]] double memoryBytes() const override { return 0; }
  void readToEnd() override {}

  Grids read(ZRange core) override {
    checkCovered(core);
    const auto material =
        treeOfLayers(core, stack_.manifest().layout, [&](int z) { return stack_.layer(z); });
    Grids grids;
    grids[solid_grid] = solidGrid(schema_, *material);
    if (tellsMaterials()) grids[material_grid] = gridLike(schema_, material_grid, material);
    return grids;
  }

 private:
  /// Grey says only whether a voxel is printed, and a stack of `solid` has no materials.
  [[nodiscard]] bool tellsMaterials() const {
    const Manifest& manifest = stack_.manifest();
    return manifest.grid == material_grid &&
           (stack_.format().pixel != SlicePixel::printed || manifest.materials.size() == 1);
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
    const ZRange groups = intersection(alignedToLeaves(stored), all);
    const auto text = [&](int z) { return std::to_string(z - all.begin); };
    throw DataError("'" + path_ + "' lacks layer " + text(missing) + "; " +
                    (whole.empty()
                         ? "a stack is read in whole groups of eight layers, and it has " +
                               text(stored.begin) + ":" + text(stored.end) +
                               "; export such groups: slice-export --layers " + text(groups.begin) +
                               ":" + text(groups.end)
                         : "--layers " + text(whole.begin) + ":" + text(whole.end) +
                               " takes what it has in whole groups of eight"));
  }

  std::string path_;
  StackReader stack_;
  Schema schema_;
};

/// How the images of another program become voxels.
struct ImageOptions {
  LatticeOptions target;
  std::string materials;
  std::string background;
  bool flip_x = false;
  bool flip_y = false;

  void declare(Options& options) {
    target.declare(options);
    options.text("materials", materials, "",
                 "Makes materials of the colours of images without a manifest, in place of Cd");
    options.words({{palette,
                    "A material for each colour, up to 255, named like #a6216a and "
                    "numbered from the bottom slice on, row by row"}});
    options.text("background", background, "COLOUR",
                 "Colour of the empty voxels in images without a manifest, also as #rrggbb; grey "
                 "images take black or white. By default black, and none if the images have "
                 "opacity");
    options.words({{"black", "Black"}, {"white", "White"}});
    options.flag("flip-x", flip_x,
                 "Takes the first column of these images as that of the greatest x");
    options.flag("flip-y", flip_y, "Takes the first row of these images as that of the least y");
  }

  /// The name of an option that a manifest answers, or nothing where none is given.
  [[nodiscard]] std::string given() const {
    if (target.pitch_mm) return "--pitch";
    if (!target.printer.empty()) return "--printer";
    if (target.layer_mm) return "--layer";
    if (!materials.empty()) return "--materials";
    if (!background.empty()) return "--background";
    return flip_x ? "--flip-x" : flip_y ? "--flip-y" : "";
  }

  [[nodiscard]] bool makesMaterials() const { return !materials.empty(); }

  static constexpr const char* palette = "palette";
};

/// The name of a material by its colour.
std::string nameOfColour(std::uint32_t colour) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(),
                colour >> 24 == 255 ? "#%02x%02x%02x" : "#%02x%02x%02x%02x", colour & 255,
                colour >> 8 & 255, colour >> 16 & 255, colour >> 24);
  return text.data();
}

/// The slices of another program as voxels and their colours.
class ImageLayers : public Input {
 public:
  /// Throws UsageError, and DataError as ImageStack does.
  ImageLayers(std::string path, const ImageOptions& options,
              const std::function<void(const std::string&)>& warn)
      : path_(std::move(path)) {
    if (!options.target.pitch_mm && options.target.printer.empty()) {
      throw DataError("'" + path_ + "' holds no " + manifest_name +
                      ", so it is not a stack made by slice-export; for slices of another program "
                      "give --pitch DX,DY,DZ or --printer NAME");
    }
    schema_.lattice.pitch_mm = targetPitchMm(options.target, schema_);
    if (options.makesMaterials() && options.materials != ImageOptions::palette)
      throw UsageError("--materials: '" + options.materials + "' is not known; give palette");
    empty_.background = backgroundColour(options.background);
    stack_ = std::make_unique<ImageStack>(path_, warn);
    schema_.lattice.box = openvdb::CoordBBox(
        {0, 0, 0}, {static_cast<int>(stack_->width()) - 1, static_cast<int>(stack_->height()) - 1,
                    stack_->layers() - 1});
    layout_ = {.box = schema_.lattice.box, .flip_x = options.flip_x, .flip_y = options.flip_y};
    makes_materials_ = options.makesMaterials();
    empty_.is_mask = stack_->isGrey() && !makes_materials_;
    if (!empty_.background && !stack_->hasOpacity()) empty_.background = rgba(0, 0, 0);
    if (empty_.is_mask && empty_.background && empty_.background != rgba(0, 0, 0) &&
        empty_.background != rgba(255, 255, 255)) {
      throw UsageError("--background: '" + stack_->shown(0) + "' is grey; give black or white");
    }
    planGrids();
    const ZRange layers = schema_.lattice.layers();
    bool any_empty = false;
    bool any_printed = false;
    schema_.footprint = sampledFootprint(layers, layers, [&](int z) {
      SpanImage image = layer(z);
      for (const Span& span : image.spans) (span.value == 0 ? any_empty : any_printed) = true;
      return image;
    });
    if (!any_printed) {
      warn("'" + path_ + "': the images that were looked at print nothing" +
           (empty_.is_mask ? "; of grey images, pixels above half are printed" : ""));
    }
    if (!any_empty) {
      warn("'" + path_ + "': no pixel of its images is empty" +
           (options.background.empty() ? "; give their --background if they have one" : ""));
    }
  }

  [[nodiscard]] const std::string& path() const override { return path_; }
  [[nodiscard]] bool isPipe() const override { return false; }
  [[nodiscard]] const Schema& schema() const override { return schema_; }
  [[nodiscard]] double memoryBytes() const override { return 0; }
  void readToEnd() override {}

  Grids read(ZRange core) override {
    const auto values = treeOfLayers(core, layout_, [&](int z) { return layer(z); });
    Grids grids;
    grids[solid_grid] = solidGrid(schema_, *values);
    if (makes_materials_) grids[material_grid] = gridLike(schema_, material_grid, values);
    if (schema_.grids.contains(colour_grid))
      grids[colour_grid] = gridLike(schema_, colour_grid, linearColours(*values));
    if (schema_.grids.contains(opacity_grid))
      grids[opacity_grid] = gridLike(schema_, opacity_grid, opacities(*values));
    return grids;
  }

 private:
  void planGrids() {
    schema_.grids[solid_grid] = emptyGrid<openvdb::BoolGrid>(solid_grid, schema_.lattice);
    if (makes_materials_) {
      findMaterials();
      schema_.grids[material_grid] = emptyGrid<openvdb::Int32Grid>(material_grid, schema_.lattice);
      return;
    }
    if (empty_.is_mask) return;
    schema_.grids[colour_grid] = emptyColours(schema_.lattice);
    if (stack_->hasOpacity()) schema_.grids[opacity_grid] = emptyOpacities(schema_.lattice);
  }

  /// The spans of a layer: 0 where it is empty, else the index of the material, the colour, or 1 in
  /// a mask.
  [[nodiscard]] SpanImage layer(int z) const {
    SpanImage image = stack_->layer(z);
    for (Span& span : image.spans) {
      if (empty_.contains(span.value)) {
        span.value = 0;
      } else if (makes_materials_) {
        span.value = indices_.at(span.value);
      } else if (empty_.is_mask) {
        span.value = 1;
      }
    }
    return image;
  }

  /// Numbers the colours in the order in which they first appear.
  void findMaterials() {
    MaterialTable materials;
    constexpr int batch = 16;
    const ZRange layers = schema_.lattice.layers();
    for (int begin = 0; begin < layers.end; begin += batch) {
      throwIfInterrupted();
      const int end = std::min(begin + batch, layers.end);
      std::vector<std::vector<std::uint32_t>> colours(static_cast<std::size_t>(end - begin));
      tbb::parallel_for(begin, end, [&](int z) { colours[z - begin] = coloursOf(z); });
      for (int z = begin; z < end; ++z) {
        for (const std::uint32_t colour : colours[z - begin]) {
          const auto index = static_cast<std::uint32_t>(materials.size() + 1);
          if (!indices_.try_emplace(colour, index).second) continue;
          if (index > most_materials) {
            throw DataError("'" + stack_->shown(z) + "' has colour " + std::to_string(index) +
                            " of the stack, and at most " + std::to_string(most_materials) +
                            " can be materials; leave out --materials to read them as colours");
          }
          materials.push_back({nameOfColour(colour),
                               {static_cast<std::uint8_t>(colour & 255),
                                static_cast<std::uint8_t>(colour >> 8 & 255),
                                static_cast<std::uint8_t>(colour >> 16 & 255),
                                static_cast<std::uint8_t>(colour >> 24)}});
        }
      }
    }
    schema_.metadata[materials_key] = toJson(materials);
  }

  /// The colours of a layer in the order of their first pixels, no more than too many.
  [[nodiscard]] std::vector<std::uint32_t> coloursOf(int z) const {
    std::vector<std::uint32_t> colours;
    std::unordered_set<std::uint32_t> known;
    for (const Span& span : stack_->layer(z).spans) {
      if (empty_.contains(span.value) || !known.insert(span.value).second) continue;
      colours.push_back(span.value);
      if (colours.size() > most_materials) break;
    }
    return colours;
  }

  static constexpr std::size_t most_materials = 255;

  std::string path_;
  Schema schema_;
  std::unique_ptr<ImageStack> stack_;
  SliceLayout layout_;
  bool makes_materials_ = false;
  EmptyPixels empty_;
  std::unordered_map<std::uint32_t, std::uint32_t> indices_;  ///< of the materials, by colour
};

class SliceImport : public Source {
 public:
  void declare(Options& options) override {
    options.positional(
        "stack", path_,
        "Stack of slice-export: the folder, its manifest.json, or the zip archive. Or slices of "
        "another program, PNG or TIFF: a folder, a zip archive, or a pattern in quotes, such as "
        "'out/layer_*.png'");
    options.flag("edited", edited_,
                 "Takes a stack that was changed after slice-export wrote it, such as retouched "
                 "slices, and warns of it");
    images_.declare(options);
  }

  Schema plan() override {
    const auto warn = [this](const std::string& text) { report().warn(text); };
    is_foreign_ = ImageStack::isAt(path_);
    if (is_foreign_) {
      if (edited_)
        throw UsageError("--edited: '" + path_ + "' has no " + manifest_name + "; leave it out");
      stack_ = std::make_unique<ImageLayers>(path_, images_, warn);
    } else {
      stack_ = std::make_unique<StackLayers>(
          path_, edited_ ? EditedStack::taken : EditedStack::refused, warn);
      if (const std::string option = images_.given(); !option.empty()) {
        throw UsageError(option + ": the " + manifest_name + " of '" + path_ +
                         "' states it; leave it out");
      }
    }
    return stack_->schema();
  }

  [[nodiscard]] std::vector<Input*> inputs() override { return {stack_.get()}; }

  [[nodiscard]] std::optional<Work> work() const override {
    if (is_foreign_) return std::nullopt;
    return Work{.us_per_surface_leaf = cost::slice_import_us,
                .us_per_layer = cost::slice_import_us_per_layer};
  }

  [[nodiscard]] Grids run(ZRange core) const override { return stack_->read(core); }

 private:
  std::string path_;
  bool edited_ = false;
  ImageOptions images_;
  bool is_foreign_ = false;
  std::unique_ptr<Input> stack_;
};

}  // namespace

extern const OperatorInfo slice_import;
const OperatorInfo slice_import{
    "slice-import", "The voxels of a stack of slices, of slice-export or another program",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export out\n"
    "slice-import out -o again.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<SliceImport>(); }};

}  // namespace vdbdither
