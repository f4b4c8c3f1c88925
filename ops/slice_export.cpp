#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <utility>

#include <nlohmann/json.hpp>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include "io/file/digest.h"
#include "io/image/exr.h"
#include "io/image/png_runs.h"
#include "io/image/tiff.h"
#include "io/profile/material_table.h"
#include "io/stack/slice_runs.h"
#include "io/stack/stack_files.h"
#include "io/stack/stack_preview.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using Bytes = std::vector<std::uint8_t>;
using nlohmann::ordered_json;

std::uint32_t pixel(const std::array<std::uint8_t, 4>& colour) {
  return rgba(colour[0], colour[1], colour[2], colour[3]);
}

/// A file of the stack, by its place in it.
struct SliceFile {
  std::string name;
  std::string material;  ///< whose voxels it shows; empty: all
  Bytes bytes;
  std::string sha256;
};

/// A layer on its way through the threads.
struct LayerOutput {
  int z = 0;
  RunImage image;
  std::vector<SliceFile> files;
  std::vector<std::uint64_t> voxels;  ///< per value of the image
};

class SliceExport : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("folder", folder_,
                       "Folder that will hold the stack, or a zip archive: NAME.zip");
    options.choice(
        "format", format_, {"png", "png1", "png8", "tiff", "tiff1", "exr"},
        "png: 32-bit RGBA in the colours of the materials. png1, tiff1: a stack of 1 bit "
        "a voxel for each material, in a folder of its own. png8: grey, 255 where "
        "printed, else 0. tiff: a palette of the colours. exr: material index, and "
        "distance and normal where they are there");
    options.text("prefix", prefix_, "TEXT", "What the file names begin with");
    options.integer("digits", digits_, 1, 9, "Digits of the running number, zeros in front");
    options.integer("first", first_, 0, 1000000, "Number of the lowest layer");
    options.integer("padding", padding_, 0, 100000, "Empty voxels added on each side in x and y");
    options.flag("flip-x", flip_x_,
                 "Mirror left to right. By default a slice is seen from above: x to the right");
    options.flag("flip-y", flip_y_,
                 "Mirror top to bottom. By default a slice is seen from above: the top row has the "
                 "greatest y");
    options.text("background", background_, "COLOUR",
                 "Colour of what is not printed, in png and tiff: #rrggbb, or r,g,b,a of 0 to 255");
    options.choice(
        "exr-packing", exr_packing_, {"none", "rle", "zips", "zip", "piz"},
        "How exr is packed, always without loss: zips and rle by rows, zip by 16 and piz "
        "by 32 of them");
    options.integer("exr-tile", exr_tile_, 0, 4096, "Edge of the tiles of exr; 0 makes rows");
    options.flag("exr-half", exr_half_, "Distances in exr take 16 bits in place of 32");
    options.flag("overwrite", overwrite_, "Replace a stack that is there already");
  }

  void plan(const Schema& in) override {
    schema_ = in;
    if (in.lattice.box.empty())
      throw DataError("there is nothing to slice: the lattice has no voxels");
    planMaterials();
    planColours();
    if (format_ == "tiff" && materials_.size() > 255)
      throw UsageError("--format: tiff has room for 255 materials, and there are " +
                       std::to_string(materials_.size()) + "; take exr");
    if (prefix_.find('/') != std::string::npos)
      throw UsageError("--prefix: '" + prefix_ + "' must not hold a '/'");
    StackOutput::check(folder_, overwrite_);
    frame_ = {in.lattice.box, padding_, flip_x_, flip_y_};
    if (in.lattice.box.dim().x() + std::int64_t{2} * padding_ > 1 << 24 ||
        in.lattice.box.dim().y() + std::int64_t{2} * padding_ > 1 << 24) {
      throw UsageError("slices would be more than 16777216 voxels wide");
    }
    if (format_ == "exr") planChannels();
    std::vector<std::uint32_t> display = {0};
    for (const Material& material : materials_) display.push_back(pixel(material.rgba));
    preview_.emplace(in.lattice.pitch_mm, frame_.width(), frame_.height(), in.lattice.layers(),
                     display);
    voxels_.assign(materials_.size() + 1, 0);
  }

  [[nodiscard]] OutputEstimate output() const override {
    // Measured on dithered spheres, per leaf at the surface and per slice. A file of a folder
    // wastes half a block of the disk.
    const double leaves = schema_.footprint.at_surface;
    if (leaves == 0) return {folder_, 0};
    const double stacks = oneStackEach() ? static_cast<double>(materials_.size()) : 1;
    const double per_leaf = format_ == "png"    ? 125
                            : format_ == "tiff" ? 250
                            : format_ == "exr"  ? 1300
                                                : 80 * stacks;
    const double per_slice = 500 + (folder_.ends_with(".zip") ? 0 : 2048 * stacks);
    return {folder_, leaves * per_leaf + schema_.lattice.layers().size() * per_slice};
  }

  [[nodiscard]] std::optional<Work> work() const override {
    const double stacks = oneStackEach() ? static_cast<double>(materials_.size()) : 1;
    return Work{.us_per_surface_leaf = cost::slice_export_us * stacks,
                .us_per_layer = cost::slice_export_us_per_layer * stacks};
  }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    std::vector<std::string> names{source_};
    if (format_ == "exr") names.insert(names.end(), {surface_grid, normal_grid});
    return names;
  }

  void write(const Slab& in) override {
    if (!stack_) stack_.emplace(folder_);
    const int together =
        leaf_layers * ((tbb::this_task_arena::max_concurrency() + leaf_layers - 1) / leaf_layers);
    for (int z = in.core.begin; z < in.core.end;) {
      const int end =
          std::min(in.core.end, alignedToLeaves({z, z + together - leaf_layers + 1}).end);
      writeLayers(in, {z, end});
      z = end;
    }
  }

  void finish() override {
    if (!stack_) throw DataError("no layer came to slice");
    stack_->write("preview.png", encodePng(preview_->picture(), {}));
    const std::string manifest = manifestText();
    stack_->write(manifest_name,
                  {reinterpret_cast<const std::uint8_t*>(manifest.data()), manifest.size()});
    stack_->commit();
    stack_.reset();
    // Some layers of a job may well be empty.
    const bool all = ZRange{first_layer_, last_layer_ + 1} == schema_.lattice.layers();
    if (all &&
        std::all_of(voxels_.begin() + 1, voxels_.end(), [](auto count) { return count == 0; }))
      report().warn("no voxel is printed; is the part thinner than a voxel, or its unit another?");
    report().count("slices", static_cast<double>(last_layer_ - first_layer_ + 1));
    for (std::size_t i = 0; i < materials_.size(); ++i) {
      report().count("voxels of " + materials_[i].name, static_cast<double>(voxels_[i + 1]));
    }
  }

 private:
  [[nodiscard]] bool oneStackEach() const { return format_ == "png1" || format_ == "tiff1"; }

  void planMaterials() {
    if (schema_.grids.contains(material_grid)) {
      findGrid<openvdb::Int32Grid>(schema_.grids, material_grid);
      const auto table = schema_.metadata.find(materials_key);
      if (table == schema_.metadata.end()) {
        throw DataError(
            "the grid 'material' comes without its table of materials; make it with "
            "material-assign");
      }
      materials_ = materialTableFromJson(table->second);
      source_ = material_grid;
    } else if (schema_.grids.contains(solid_grid)) {
      findGrid<openvdb::BoolGrid>(schema_.grids, solid_grid);
      materials_ = {{"solid", {240, 240, 240, 255}}};
      source_ = solid_grid;
    } else {
      throw UsageError(
          "needs a grid 'material' or 'solid'; put dither, and material-assign where there are "
          "materials, before it");
    }
  }

  void planColours() {
    try {
      background_rgba_ = parseColour(background_);
    } catch (const UsageError& error) {
      throw UsageError(std::string("--background: ") + error.what());
    }
    palette_ = {pixel(background_rgba_)};
    for (const Material& material : materials_) {
      palette_.push_back(pixel(material.rgba));
      if ((format_ == "png" || format_ == "tiff") && palette_.back() == palette_.front()) {
        throw UsageError("--background: the material '" + material.name + "' has the colour " +
                         background_ + "; choose another");
      }
    }
  }

  /// Channels of exr, and the grids behind them.
  void planChannels() {
    constexpr std::size_t most_in_half = 2048;
    channels_ = {{"material", materials_.size() <= most_in_half}};
    if (schema_.grids.contains(surface_grid)) {
      findGrid<openvdb::FloatGrid>(schema_.grids, surface_grid);
      channels_.push_back({"distance", exr_half_});
    }
    if (schema_.grids.contains(normal_grid)) {
      findGrid<openvdb::Vec3SGrid>(schema_.grids, normal_grid);
      for (const char* name : {"N.x", "N.y", "N.z"}) channels_.push_back({name, true});
    }
  }

  [[nodiscard]] std::string fileName(int z, const char* extension) const {
    std::string number = std::to_string(first_ + z - schema_.lattice.box.min().z());
    if (number.size() < static_cast<std::size_t>(digits_))
      number.insert(0, digits_ - number.size(), '0');
    return prefix_ + number + extension;
  }

  void writeLayers(const Slab& in, ZRange layers) {
    std::vector<RunImage> images =
        source_ == material_grid
            ? sliceRuns(*findGrid<openvdb::Int32Grid>(in.grids, source_), frame_, layers)
            : sliceRuns(*findGrid<openvdb::BoolGrid>(in.grids, source_), frame_, layers);
    // They are kept here, for TBB forgets what is on its way when one of the steps fails.
    std::vector<LayerOutput> outputs(static_cast<std::size_t>(layers.size()));
    std::size_t next = 0;
    using Layer = LayerOutput*;
    const auto take = [&](tbb::flow_control& control) -> Layer {
      if (next == outputs.size()) {
        control.stop();
        return nullptr;
      }
      LayerOutput& layer = outputs[next];
      layer.z = layers.begin + static_cast<int>(next);
      layer.image = std::move(images[next]);
      ++next;
      return &layer;
    };
    const auto encode = [&](Layer layer) {
      countVoxels(*layer);
      encodeLayer(in, *layer);
      for (SliceFile& file : layer->files) {
        Digest digest;
        digest.update(file.bytes.data(), file.bytes.size());
        file.sha256 = hexText(digest.finish());
      }
      return layer;
    };
    const auto store = [&](Layer layer) {
      storeLayer(*layer);
      *layer = {};
    };
    tbb::parallel_pipeline(
        std::size_t{2} * tbb::this_task_arena::max_concurrency(),
        tbb::make_filter<void, Layer>(tbb::filter_mode::serial_in_order, take) &
            tbb::make_filter<Layer, Layer>(tbb::filter_mode::parallel, encode) &
            tbb::make_filter<Layer, void>(tbb::filter_mode::serial_in_order, store));
  }

  void countVoxels(LayerOutput& layer) const {
    layer.voxels.assign(materials_.size() + 1, 0);
    for (std::uint32_t y = 0; y < layer.image.height; ++y) {
      std::uint32_t begin = 0;
      for (const Run& run : layer.image.row(y)) {
        if (run.value > materials_.size()) {
          throw DataError("layer " + std::to_string(layer.z) + " holds material " +
                          std::to_string(static_cast<std::int32_t>(run.value)) +
                          ", but the table of materials ends at " +
                          std::to_string(materials_.size()));
        }
        layer.voxels[run.value] += run.end - begin;
        begin = run.end;
      }
    }
  }

  void encodeLayer(const Slab& in, LayerOutput& layer) const {
    const openvdb::Vec3d& pitch = schema_.lattice.pitch_mm;
    if (format_ == "exr") {
      layer.files.push_back({fileName(layer.z, ".exr"), "", encodeChannels(in, layer), ""});
    } else if (format_ == "tiff") {
      layer.files.push_back({fileName(layer.z, ".tif"), "",
                             encodeTiff(layer.image, {palette_, pitch.x(), pitch.y()}), ""});
    } else if (oneStackEach()) {
      for (std::size_t i = 1; i <= materials_.size(); ++i) {
        std::vector<std::uint32_t> only(materials_.size() + 1, 0);
        only[i] = 1;
        const std::string& name = materials_[i - 1].name;
        if (format_ == "tiff1") {
          layer.files.push_back({name + "/" + fileName(layer.z, ".tif"), name,
                                 encodeTiff(masked(layer.image, static_cast<std::uint32_t>(i)),
                                            {{}, pitch.x(), pitch.y()}),
                                 ""});
        } else {
          layer.files.push_back(
              {name + "/" + fileName(layer.z, ".png"), name,
               encodePng(layer.image, {PngPixels::grey1, only, pitch.x(), pitch.y()}), ""});
        }
      }
    } else if (format_ == "png8") {
      std::vector<std::uint32_t> grey(materials_.size() + 1, 255);
      grey[0] = 0;
      layer.files.push_back({fileName(layer.z, ".png"), "",
                             encodePng(layer.image, {PngPixels::grey8, grey, pitch.x(), pitch.y()}),
                             ""});
    } else {
      layer.files.push_back(
          {fileName(layer.z, ".png"), "",
           encodePng(layer.image, {PngPixels::rgba8, palette_, pitch.x(), pitch.y()}), ""});
    }
  }

  /// 1 where `image` has this value, else 0.
  static RunImage masked(RunImage image, std::uint32_t value) {
    for (Run& run : image.runs) run.value = run.value == value ? 1 : 0;
    return image;
  }

  [[nodiscard]] Bytes encodeChannels(const Slab& in, const LayerOutput& layer) const {
    const openvdb::CoordBBox& box = frame_.box;
    const auto fill_row = [&](std::uint32_t row, std::span<float> values, const auto& grid,
                              const auto& convert) {
      std::fill(values.begin(), values.end(), convert(grid.background()));
      const int from_top = static_cast<int>(row) - padding_;
      if (from_top < 0 || from_top >= box.dim().y()) return;
      const auto accessor = grid.getConstAccessor();
      openvdb::Coord at(0, flip_y_ ? box.min().y() + from_top : box.max().y() - from_top, layer.z);
      for (int i = 0; i < box.dim().x(); ++i) {
        at.x() = flip_x_ ? box.max().x() - i : box.min().x() + i;
        values[padding_ + i] = convert(accessor.getValue(at));
      }
    };
    const auto fill = [&](std::uint32_t row, std::size_t channel, std::span<float> values) {
      const std::string& name = channels_[channel].name;
      if (name == "material") {
        std::uint32_t begin = 0;
        for (const Run& run : layer.image.row(row)) {
          std::fill(values.begin() + begin, values.begin() + run.end,
                    static_cast<float>(run.value));
          begin = run.end;
        }
      } else if (name == "distance") {
        fill_row(row, values, *findGrid<openvdb::FloatGrid>(in.grids, surface_grid),
                 [](float value) { return value; });
      } else {
        const int axis = name.back() - 'x';
        fill_row(row, values, *findGrid<openvdb::Vec3SGrid>(in.grids, normal_grid),
                 [axis](const openvdb::Vec3s& normal) { return normal[axis]; });
      }
    };
    const ExrFormat format{schema_.lattice.pitch_mm.x() / schema_.lattice.pitch_mm.y(),
                           exr_packing_ == "none"   ? ExrPacking::none
                           : exr_packing_ == "rle"  ? ExrPacking::rle
                           : exr_packing_ == "zips" ? ExrPacking::zips
                           : exr_packing_ == "zip"  ? ExrPacking::zip
                                                    : ExrPacking::piz,
                           exr_tile_};
    return encodeExr(frame_.width(), frame_.height(), format, channels_, fill);
  }

  void storeLayer(LayerOutput& layer) {
    if (!slices_.empty() && layer.z != last_layer_ + 1) {
      throw DataError("layers " + std::to_string(last_layer_ + 1) + " to " +
                      std::to_string(layer.z - 1) + " are missing");
    }
    if (slices_.empty()) first_layer_ = layer.z;
    last_layer_ = layer.z;
    for (const SliceFile& file : layer.files) {
      stack_->write(file.name, file.bytes);
      ordered_json entry = {{"layer", layer.z}, {"file", file.name}, {"sha256", file.sha256}};
      if (!file.material.empty()) entry["material"] = file.material;
      slices_.push_back(std::move(entry));
    }
    std::uint64_t filled = 0;
    for (std::size_t value = 0; value < voxels_.size(); ++value) {
      voxels_[value] += layer.voxels[value];
      if (value > 0) filled += layer.voxels[value];
    }
    preview_->add(layer.z, std::move(layer.image), filled);
  }

  [[nodiscard]] std::string manifestText() const {
    const Lattice& lattice = schema_.lattice;
    const auto triple = [](const auto& v) { return ordered_json::array({v[0], v[1], v[2]}); };
    const auto metadata = [&](std::string_view key) {
      const auto entry = schema_.metadata.find(key);
      return entry == schema_.metadata.end() ? std::string() : entry->second;
    };
    ordered_json manifest;
    manifest["creator"] = std::string("vdbdither ") + version;
    const ordered_json printer = ordered_json::parse(metadata(printer_key), nullptr, false);
    manifest["printer"] = printer.is_discarded() ? ordered_json() : printer;
    manifest["format"] = format_;
    manifest["grid"] = source_;
    manifest["pitch_mm"] = triple(lattice.pitch_mm);
    manifest["origin_mm"] = triple(lattice.origin_mm);
    manifest["size"] = {frame_.width(), frame_.height(), last_layer_ - first_layer_ + 1};
    manifest["first_layer"] = first_layer_;
    manifest["box"] = {{"min", triple(lattice.box.min())}, {"max", triple(lattice.box.max())}};
    manifest["padding"] = padding_;
    manifest["flip_x"] = flip_x_;
    manifest["flip_y"] = flip_y_;
    manifest["background"] = background_rgba_;
    manifest["materials"] = ordered_json::array();
    for (std::size_t i = 0; i < materials_.size(); ++i) {
      manifest["materials"].push_back(
          {{"index", i + 1},
           {"name", materials_[i].name},
           {"rgba", materials_[i].rgba},
           {"voxels", voxels_[i + 1]},
           {"ml", static_cast<double>(voxels_[i + 1]) * lattice.pitch_mm.product() / 1000}});
    }
    manifest["history"] = ordered_json::array();
    std::istringstream history(metadata(history_key));
    for (std::string line; std::getline(history, line);) manifest["history"].push_back(line);
    manifest["slices"] = slices_;
    return manifest.dump(1) + "\n";
  }

  std::string folder_;
  std::string format_ = "png";
  std::string prefix_ = "slice_";
  int digits_ = 5;
  int first_ = 0;
  int padding_ = 0;
  bool flip_x_ = false;
  bool flip_y_ = false;
  std::string background_ = "0,0,0,255";
  std::string exr_packing_ = "zips";
  int exr_tile_ = 0;
  bool exr_half_ = false;
  bool overwrite_ = false;

  Schema schema_;
  SliceFrame frame_;
  std::string source_;  ///< the grid that is sliced
  MaterialTable materials_;
  std::array<std::uint8_t, 4> background_rgba_{};
  std::vector<std::uint32_t> palette_;  ///< per material index; 0 is the background
  std::vector<ExrChannel> channels_;

  std::optional<StackOutput> stack_;
  std::optional<StackPreview> preview_;
  ordered_json slices_ = ordered_json::array();
  std::vector<std::uint64_t> voxels_;
  int first_layer_ = 0;
  int last_layer_ = 0;
};

}  // namespace

extern const OperatorInfo slice_export;
const OperatorInfo slice_export = {
    "slice-export", "One image per layer, with a manifest and a preview",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign ! slice-export out",
    [] { return std::unique_ptr<Operator>(std::make_unique<SliceExport>()); }};

}  // namespace vdbdither
