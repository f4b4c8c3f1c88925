#include <algorithm>
#include <atomic>
#include <map>
#include <memory>

#include <nlohmann/json.hpp>
#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "io/file/digest.h"
#include "io/image/exr.h"
#include "io/image/png_decoder.h"
#include "io/image/png_runs.h"
#include "io/image/tiff.h"
#include "io/profile/material_table.h"
#include "io/stack/slice_runs.h"
#include "io/stack/stack_files.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

constexpr const char* make_again = "; make the stack again with slice-export";

/// A file of the stack.
struct SliceName {
  std::string file;
  std::string sha256;
};

std::string colourText(std::uint32_t colour) {
  std::string text;
  for (int channel = 0; channel < 4; ++channel)
    text += (channel ? "," : "") + std::to_string(colour >> 8 * channel & 255);
  return text;
}

/// Puts `value` where `mask` is not 0. Returns where something else is already: the row, or -1.
int overlay(RunImage& image, const RunImage& mask, std::uint32_t value) {
  RunsBuilder merged(image.width);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    const auto below = image.row(y);
    const auto above = mask.row(y);
    std::uint32_t begin = 0;
    for (std::size_t i = 0, j = 0; i < below.size() && j < above.size();) {
      if (above[j].value && below[i].value) return static_cast<int>(y);
      merged.pixel(begin, above[j].value ? value : below[i].value);
      const std::uint32_t end = std::min(below[i].end, above[j].end);
      begin = end;
      if (below[i].end == end) ++i;
      if (above[j].end == end) ++j;
    }
    merged.endRow();
  }
  image = merged.finish();
  return -1;
}

/// A stack of slice-export as the grids it was made from.
class SliceImport : public Source {
 public:
  void declare(Options& options) override {
    options.positional("stack", path_,
                       "What slice-export made: the folder, its manifest.json, or the zip archive");
  }

  Schema plan() override {
    stack_ = std::make_unique<StackInput>(path_);
    Schema schema = readManifest();
    checkFiles();
    planColours();
    const auto transform = std::make_shared<openvdb::math::Transform>(mapOf(schema.lattice));
    auto solid = openvdb::BoolGrid::create(false);
    solid->setName(solid_grid);
    solid->setTransform(transform->copy());
    schema.grids[solid_grid] = solid;
    if (tellsMaterials()) {
      auto material = openvdb::Int32Grid::create(0);
      material->setName(material_grid);
      material->setTransform(transform->copy());
      schema.grids[material_grid] = material;
      schema.metadata[materials_key] = toJson(materials_);
    }
    prototypes_ = schema.grids;
    sampleLeaves(schema);
    return schema;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::slice_import_us,
                .us_per_layer = cost::slice_import_us_per_layer};
  }

  [[nodiscard]] Grids run(ZRange core) const override {
    checkCovered(core);
    const auto material = std::make_shared<openvdb::Int32Tree>(0);
    for (ZRange rows = alignedToLeaves(core); rows.begin < rows.end; rows.begin += leaf_layers) {
      const ZRange layers = intersection({rows.begin, rows.begin + leaf_layers}, core);
      std::vector<RunImage> images(static_cast<std::size_t>(std::max(0, layers.size())));
      tbb::parallel_for(layers.begin, layers.end,
                        [&](int z) { images[z - layers.begin] = readLayer(z); });
      material->merge(gridOfRuns(images, frame_, layers)->tree());
    }
    openvdb::tools::prune(*material);
    const auto typed = [&](const char* name, const auto& tree, auto grid) {
      grid = openvdb::gridPtrCast<typename decltype(grid)::element_type>(
          prototypes_.at(name)->copyGridWithNewTree());
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
  static openvdb::math::MapBase::Ptr mapOf(const Lattice& lattice) {
    if (lattice.origin_mm == openvdb::Vec3d(0.0))
      return std::make_shared<openvdb::math::ScaleMap>(lattice.pitch_mm);
    return std::make_shared<openvdb::math::ScaleTranslateMap>(lattice.pitch_mm, lattice.origin_mm);
  }

  [[nodiscard]] bool oneStackEach() const { return format_ == "png1" || format_ == "tiff1"; }

  /// Grey says only whether a voxel is printed, and a stack of `solid` has no materials.
  [[nodiscard]] bool tellsMaterials() const {
    return of_materials_ && (format_ != "png8" || materials_.size() == 1);
  }

  Schema readManifest() {
    const std::vector<std::uint8_t> bytes = stack_->read(manifest_name);
    Schema schema;
    try {
      const ordered_json manifest = ordered_json::parse(bytes.begin(), bytes.end());
      const auto vector = [](const ordered_json& json) {
        return openvdb::Vec3d(json.at(0).get<double>(), json.at(1).get<double>(),
                              json.at(2).get<double>());
      };
      const auto coord = [](const ordered_json& json) {
        return openvdb::Coord(json.at(0).get<int>(), json.at(1).get<int>(), json.at(2).get<int>());
      };
      schema.lattice.pitch_mm = vector(manifest.at("pitch_mm"));
      schema.lattice.origin_mm = vector(manifest.at("origin_mm"));
      schema.lattice.box = {coord(manifest.at("box").at("min")),
                            coord(manifest.at("box").at("max"))};
      format_ = manifest.at("format");
      of_materials_ = manifest.value("grid", material_grid) == material_grid;
      frame_ = {schema.lattice.box, manifest.at("padding"), manifest.at("flip_x"),
                manifest.at("flip_y")};
      layers_.begin = manifest.at("first_layer");
      layers_.end = layers_.begin + manifest.at("size").at(2).get<int>();
      const std::array<std::uint8_t, 4> background = manifest.at("background");
      background_ = rgba(background[0], background[1], background[2], background[3]);
      for (const ordered_json& entry : manifest.at("materials"))
        materials_.push_back({entry.at("name"), entry.at("rgba")});
      if (!manifest.at("printer").is_null())
        schema.metadata[printer_key] = manifest["printer"].dump();
      std::string history;
      for (const ordered_json& line : manifest.at("history"))
        history += (history.empty() ? "" : "\n") + line.get<std::string>();
      if (!history.empty()) schema.metadata[history_key] = history;
      for (const ordered_json& entry : manifest.at("slices")) {
        const std::string material = entry.value("material", "");
        names_[entry.at("layer")][material] = {entry.at("file"), entry.at("sha256")};
      }
    } catch (const ordered_json::exception& error) {
      throw DataError("'" + stack_->shown(manifest_name) +
                      "' is not a manifest of slice-export: " + error.what());
    }
    const auto refuse = [&](const std::string& why) {
      return DataError("'" + stack_->shown(manifest_name) + "': " + why + make_again);
    };
    for (int axis = 0; axis < 3; ++axis) {
      if (!(schema.lattice.pitch_mm[axis] > 0)) throw refuse("pitch_mm is not above zero");
    }
    if (schema.lattice.box.empty() || frame_.padding < 0 ||
        intersection(layers_, schema.lattice.layers()) != layers_ || layers_.empty()) {
      throw refuse("box, padding and layers do not fit together");
    }
    return schema;
  }

  /// The manifest tells of every slice, and they are there.
  void checkFiles() const {
    for (int z = layers_.begin; z < layers_.end; ++z) {
      std::vector<std::string> materials = {""};
      if (oneStackEach()) {
        materials.clear();
        for (const Material& material : materials_) materials.push_back(material.name);
      }
      for (const std::string& material : materials) {
        const auto layer = names_.find(z);
        if (layer == names_.end() || !layer->second.contains(material)) {
          throw DataError("'" + stack_->shown(manifest_name) + "' names no slice of layer " +
                          std::to_string(z - frame_.box.min().z()) +
                          (material.empty() ? "" : " for '" + material + "'") + make_again);
        }
        const std::string& file = layer->second.at(material).file;
        if (!stack_->contains(file)) {
          throw DataError("the slice '" + stack_->shown(file) + "' of layer " +
                          std::to_string(z - frame_.box.min().z()) + " is missing" + make_again);
        }
      }
    }
  }

  /// What pixels mean, by their value.
  void planColours() {
    if (format_ == "png") {
      meanings_[background_] = 0;
      for (std::size_t i = 0; i < materials_.size(); ++i) {
        const auto& colour = materials_[i].rgba;
        const auto [place, fresh] = meanings_.try_emplace(
            rgba(colour[0], colour[1], colour[2], colour[3]), static_cast<std::uint32_t>(i + 1));
        if (!fresh) {
          throw DataError("the material '" + materials_[i].name + "' has the colour of " +
                          (place->second == 0 ? "the background"
                                              : "'" + materials_[place->second - 1].name + "'") +
                          "; make the stack with slice-export --format png1, tiff or exr");
        }
      }
    } else if (oneStackEach() || format_ == "png8") {
      const std::uint32_t black = format_ == "tiff1" ? 0 : rgba(0, 0, 0);
      const std::uint32_t white = format_ == "tiff1" ? 1 : rgba(255, 255, 255);
      meanings_ = {{black, 0}, {white, 1}};
    } else if (format_ == "tiff" || format_ == "exr") {
      for (std::uint32_t i = 0; i <= materials_.size(); ++i) meanings_[i] = i;
    } else {
      throw DataError("'" + stack_->shown(manifest_name) + "': there is no format '" + format_ +
                      "'" + make_again);
    }
  }

  /// Estimates the leaves at the surface by those that it crosses in a few of the layers.
  void sampleLeaves(Schema& schema) const {
    constexpr int samples = 16;
    const int taken = std::min(samples, layers_.size());
    double sum = 0;
    double fullest = 0;
    for (int sample = 0; sample < taken; ++sample) {
      const auto at = static_cast<std::int64_t>(layers_.size()) * (2 * sample + 1) / (2 * taken);
      const double crossed = leavesCrossed(readLayer(layers_.begin + static_cast<int>(at)));
      sum += crossed;
      fullest = std::max(fullest, crossed);
    }
    // A surface that leans crosses more leaves of a row than of one of its layers.
    constexpr double lean = 1.3;
    const double leaves = sum / taken * schema.lattice.layers().size() / leaf_layers;
    schema.footprint = Footprint{fullest, leaves, leaves}.scaled(lean);
  }

  /// The squares of eight by eight pixels that some run ends in.
  static double leavesCrossed(const RunImage& image) {
    double leaves = 0;
    std::vector<bool> crossed;
    for (std::uint32_t y = 0; y < image.height; ++y) {
      if (y % leaf_layers == 0) crossed.assign(image.width / leaf_layers + 1, false);
      for (const Run& run : image.row(y)) {
        if (run.end == image.width) continue;
        const std::uint32_t square = run.end / leaf_layers;
        if (!crossed[square]) ++leaves;
        crossed[square] = true;
      }
    }
    return leaves;
  }

  /// Layers are asked for in whole leaves, so of a stack that does not end at one some are left.
  void checkCovered(ZRange core) const {
    if (intersection(core, layers_) == core || core.empty()) return;
    const ZRange all{frame_.box.min().z(), frame_.box.max().z() + 1};
    ZRange whole = layers_;
    if (whole.begin > all.begin) whole.begin = alignedToLeaves({whole.begin - 1, whole.begin}).end;
    if (whole.end < all.end) whole.end = alignedToLeaves({whole.end, whole.end + 1}).begin;
    const int missing = core.begin < layers_.begin ? core.begin : layers_.end;
    throw DataError("'" + path_ + "' lacks layer " + std::to_string(missing - all.begin) +
                    (whole.empty() ? make_again
                                   : "; --layers " + std::to_string(whole.begin - all.begin) + ":" +
                                         std::to_string(whole.end - all.begin) +
                                         " takes what it has in whole groups of eight"));
  }

  [[nodiscard]] RunImage readLayer(int z) const {
    const auto& files = names_.at(z);
    if (!oneStackEach()) return readSlice(files.at(""), z);
    RunImage all{frame_.width(), frame_.height(), {}, {}};
    for (std::uint32_t y = 0; y <= all.height; ++y) all.row_begin.push_back(y);
    all.runs.assign(all.height, {all.width, 0});
    for (std::size_t i = 0; i < materials_.size(); ++i) {
      const SliceName& name = files.at(materials_[i].name);
      const int row = overlay(all, readSlice(name, z), static_cast<std::uint32_t>(i + 1));
      if (row >= 0) {
        throw DataError("the slice '" + stack_->shown(name.file) + "' has voxels in row " +
                        std::to_string(row) +
                        " that another material has already; take them out "
                        "of one of the two");
      }
    }
    return all;
  }

  [[nodiscard]] RunImage readSlice(const SliceName& name, int z) const {
    const std::vector<std::uint8_t> bytes = stack_->read(name.file);
    Digest digest;
    digest.update(bytes.data(), bytes.size());
    if (hexText(digest.finish()) != name.sha256 && !told_.exchange(true)) {
      report().warn("'" + stack_->shown(name.file) +
                    "' is not as its manifest describes it; it is taken as it is, and so are "
                    "others like it");
    }
    try {
      RunImage image = decoded(bytes);
      if (image.width != frame_.width() || image.height != frame_.height()) {
        throw DataError("has " + std::to_string(image.width) + " x " +
                        std::to_string(image.height) + " pixels, not " +
                        std::to_string(frame_.width()) + " x " + std::to_string(frame_.height()) +
                        " as the stack" + make_again);
      }
      translate(image);
      return image;
    } catch (const DataError& error) {
      throw DataError("the slice '" + stack_->shown(name.file) + "' of layer " +
                      std::to_string(z - frame_.box.min().z()) + " " + error.what());
    }
  }

  [[nodiscard]] RunImage decoded(std::span<const std::uint8_t> bytes) const {
    if (format_ == "exr") return decodeExr(bytes, "material");
    return format_.starts_with("tiff") ? decodeTiff(bytes) : decodePng(bytes);
  }

  /// From pixels to indices of materials.
  void translate(RunImage& image) const {
    for (std::uint32_t y = 0; y < image.height; ++y) {
      std::uint32_t begin = 0;
      for (std::size_t i = image.row_begin[y]; i < image.row_begin[y + 1]; ++i) {
        Run& run = image.runs[i];
        const auto meaning = meanings_.find(run.value);
        if (meaning == meanings_.end()) {
          const bool index = format_ == "exr" || format_.starts_with("tiff");
          throw DataError(
              "has the " +
              (index ? "value " + std::to_string(run.value) : "colour " + colourText(run.value)) +
              " in column " + std::to_string(begin) + " of row " + std::to_string(y) +
              ", which no material of the manifest has; give it one of theirs" +
              (index ? "" : ", and mind that smoothing makes new colours"));
        }
        run.value = meaning->second;
        begin = run.end;
      }
    }
  }

  std::string path_;
  std::unique_ptr<StackInput> stack_;
  std::string format_;
  bool of_materials_ = true;
  SliceFrame frame_;
  ZRange layers_;  ///< that the stack has
  std::uint32_t background_ = 0;
  MaterialTable materials_;
  std::map<int, std::map<std::string, SliceName>> names_;  ///< by layer and material
  std::map<std::uint32_t, std::uint32_t> meanings_;
  Grids prototypes_;
  mutable std::atomic<bool> told_ = false;
};

}  // namespace

extern const OperatorInfo slice_import;
const OperatorInfo slice_import{
    "slice-import", "The voxels of a stack that slice-export made",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export out\n"
    "slice-import out -o again.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<SliceImport>(); }};

}  // namespace vdbdither
