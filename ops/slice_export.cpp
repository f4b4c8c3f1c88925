#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <tbb/task_arena.h>

#include "io/file/file_name.h"
#include "io/profile/material_table.h"
#include "io/stack/slice_format.h"
#include "io/stack/slice_spans.h"
#include "io/stack/stack_files.h"
#include "io/stack/stack_page.h"
#include "io/stack/stack_writer.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

class SliceExport : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("folder", folder_, "Folder for the stack, or a zip archive: NAME.zip");
    std::vector<Word> formats;
    for (const SliceFormat* format : sliceFormats()) {
      formats.push_back({std::string(format->name), std::string(format->summary)});
      encoders_[format] = format->encoder();
    }
    options.choice("format", format_name_, std::move(formats), "Format of the slices");
    options.text("prefix", names_.prefix, "TEXT", "Beginning of the file names");
    options.integer("digits", names_.digits, {1, 9},
                    "Digits of the number of a slice, with zeros in front");
    options.integer("first", names_.first, {0, 1000000}, "Number of the lowest slice");
    options.flag(
        "keep-blank", keep_blank_,
        "Writes the blank slices below and above the part too, which pieces of a job need to be "
        "numbered alike; exr always has them");
    options.integer("padding", stack_.layout.padding, {0, 100000},
                    "Empty voxels added on each side in x and y");
    options.flag(
        "flip-x", stack_.layout.flip_x,
        "Mirrors left to right; by default a slice is seen from above, with x to the right");
    options.flag("flip-y", stack_.layout.flip_y,
                 "Mirrors top to bottom; by default the maximum y is the top row");
    options.text("background", background_, "COLOUR",
                 "Colour of empty voxels in " + sliceFormatNames([](const auto& format) {
                   return format.showsColours();
                 }) + ": #rrggbb, or r,g,b,a from 0 to 255");
    options.file("page", page_name_, "FILE.html",
                 "Writes a page to look through the slices too, as preview does");
    for (const SliceFormat* format : sliceFormats()) encoders_[format]->declare(options);
    overwrite_.declare(options, "the stack");
  }

  void plan(const Schema& in) override {
    schema_ = in;
    if (in.lattice.box.empty())
      throw DataError("there is nothing to slice: the lattice has no voxels");
    format_ = findSliceFormat(format_name_);
    encoder_ = encoders_.at(format_).get();
    planStack();
    planMaterials();
    planColours();
    planNames();
    StackOutput::check(folder_, overwrite_.overwrite,
                       [this](const std::string& text) { report().warn(text); });
    if (in.lattice.box.dim().x() + std::int64_t{2} * stack_.layout.padding > 1 << 24 ||
        in.lattice.box.dim().y() + std::int64_t{2} * stack_.layout.padding > 1 << 24) {
      throw UsageError("slices would be more than 16777216 voxels wide");
    }
    encoder_->plan(stack_, in.grids);
    planPage();
  }

  [[nodiscard]] OutputEstimate output() const override {
    // Measured on dithered spheres, per leaf at the surface and per slice. A file of a folder
    // wastes half a block of the disk.
    const double leaves = schema_.footprint.at_surface;
    if (leaves == 0) return {folder_, 0};
    const double per_leaf = format_->bytes_per_leaf * filesOfLayer();
    const double per_slice = 500 + (folder_.ends_with(".zip") ? 0 : 2048 * filesOfLayer());
    return {folder_, leaves * per_leaf + schema_.lattice.layers().size() * per_slice};
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::slice_export_us * filesOfLayer(),
                .us_per_layer = cost::slice_export_us_per_layer * filesOfLayer()};
  }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    std::vector<std::string> names = encoder_->reads();
    names.insert(names.begin(), stack_.grid);
    return names;
  }

  void write(const Slab& in) override {
    if (!writer_) {
      writer_.emplace(folder_, stack_, names_, *encoder_, keep_blank_);
      if (!page_name_.empty()) page_.emplace(schema_.lattice.layers(), pageStack(folder_, stack_));
    }
    const int together =
        leaf_layers * ((tbb::this_task_arena::max_concurrency() + leaf_layers - 1) / leaf_layers);
    for (int z = in.core.begin; z < in.core.end;) {
      const int end =
          std::min(in.core.end, alignedToLeaves({z, z + together - leaf_layers + 1}).end);
      std::vector<SpanImage> images = slices(in, {z, end});
      std::vector<SpanImage> shown;
      if (page_) shown = images;
      writer_->add({z, end}, std::move(images), in.grids);
      for (int layer = z; layer < end && page_; ++layer)
        page_->add(layer, {std::move(shown[static_cast<std::size_t>(layer - z)])});
      z = end;
    }
  }

  void finish() override {
    if (!writer_) throw DataError("no layer came to slice");
    stack_ = writer_->finish();
    writer_.reset();
    if (page_) {
      page_->finish(page_name_);
      if (const std::string text = page_->warning(); !text.empty()) report().warn(text);
      page_.reset();
    }
    // Some layers of a job may well be empty.
    const std::vector<std::uint64_t>& voxels = stack_.voxels;
    if (stack_.layers == schema_.lattice.layers() &&
        std::all_of(voxels.begin(), voxels.end(), [](auto count) { return count == 0; }))
      report().warn("no voxel is printed; is the part thinner than a voxel, or its unit another?");
    report().count("slices", stack_.layers.size());
    for (std::size_t i = 0; i < voxels.size(); ++i) {
      report().count("voxels of " + stack_.materials[i].name, static_cast<double>(voxels[i]));
    }
  }

 private:
  [[nodiscard]] double filesOfLayer() const {
    return static_cast<double>(format_->filesOfLayer(stack_.materials.size()));
  }

  /// Plans everything about the stack except its materials.
  void planStack() {
    const auto metadata = [&](std::string_view key) {
      const auto entry = schema_.metadata.find(key);
      return entry == schema_.metadata.end() ? std::string() : entry->second;
    };
    stack_.format = format_name_;
    stack_.printer = metadata(printer_key);
    stack_.history.clear();
    std::istringstream history(metadata(history_key));
    for (std::string line; std::getline(history, line);) stack_.history.push_back(line);
    stack_.lattice = schema_.lattice;
    stack_.layout.box = schema_.lattice.box;
  }

  void planMaterials() {
    if (schema_.grids.contains(material_grid)) {
      findGrid<openvdb::Int32Grid>(schema_.grids, material_grid);
      const auto table = schema_.metadata.find(materials_key);
      if (table == schema_.metadata.end()) {
        throw DataError(
            "the grid 'material' comes without its table of materials; make it with "
            "material-assign");
      }
      stack_.materials = materialTableFromJson(table->second);
      stack_.grid = material_grid;
    } else if (schema_.grids.contains(solid_grid)) {
      findGrid<openvdb::BoolGrid>(schema_.grids, solid_grid);
      stack_.materials = {{"solid", {240, 240, 240, 255}}};
      stack_.grid = solid_grid;
    } else {
      throw UsageError(
          "needs a grid 'material' or 'solid'; put dither, and material-assign where there are "
          "materials, before it");
    }
  }

  void planPage() const {
    if (page_name_.empty()) return;
    const std::filesystem::path folder =
        std::filesystem::absolute(folder_ + "/").lexically_normal();
    const std::filesystem::path page = std::filesystem::absolute(page_name_).lexically_normal();
    if (std::mismatch(folder.begin(), std::prev(folder.end()), page.begin(), page.end()).first ==
        std::prev(folder.end()))
      throw UsageError("--page: '" + page_name_ + "' lies in the stack, which holds slices only");
    StackPage::check(page_name_, overwrite_.overwrite);
  }

  /// Names of files come from the prefix, and of folders from the materials.
  void planNames() const {
    const int last = names_.first + schema_.lattice.layers().size() - 1;
    const std::size_t digits =
        std::max(std::to_string(last).size(), static_cast<std::size_t>(names_.digits));
    const std::string slice =
        names_.prefix + std::string(digits, '0') + std::string(format_->ending);
    if (const auto problem = fileNameProblem(slice))
      throw UsageError("--prefix: the name of a slice, '" + slice + "', " + *problem);
    if (format_->pixel != SlicePixel::one_material) return;
    std::set<std::string> folders{manifest_name, preview_name};
    for (const Material& material : stack_.materials) {
      std::optional<std::string> problem = fileNameProblem(material.name);
      if (!problem && !folders.insert(lowerCase(material.name)).second)
        problem = "is that of another one, or of a file of the stack";
      if (!problem) continue;
      throw DataError(
          format_name_ + " has a folder for each material, and the name of the material '" +
          material.name + "' " + *problem + "; give it another one with material-assign, or take " +
          sliceFormatNames(
              [](const SliceFormat& other) { return other.pixel != SlicePixel::one_material; }));
    }
  }

  void planColours() {
    try {
      stack_.background = parseColour(background_);
    } catch (const UsageError& error) {
      throw UsageError(std::string("--background: ") + error.what());
    }
    for (const Material& material : stack_.materials) {
      if (format_->showsColours() && material.rgba == stack_.background) {
        throw UsageError("--background: the material '" + material.name + "' has the colour " +
                         background_ + "; choose another");
      }
    }
    const std::size_t count = stack_.materials.size();
    if (count > format_->most_materials) {
      throw UsageError("--format: " + format_name_ + " has room for " +
                       std::to_string(format_->most_materials) + " materials, and there are " +
                       std::to_string(count) + "; take " +
                       sliceFormatNames([&](const SliceFormat& other) {
                         return other.keepsMaterials() && count <= other.most_materials;
                       }));
    }
  }

  [[nodiscard]] std::vector<SpanImage> slices(const Slab& in, ZRange layers) const {
    return stack_.grid == material_grid
               ? sliceSpans(*findGrid<openvdb::Int32Grid>(in.grids, material_grid), stack_.layout,
                            layers)
               : sliceSpans(*findGrid<openvdb::BoolGrid>(in.grids, solid_grid), stack_.layout,
                            layers);
  }

  std::string folder_;
  std::string format_name_ = "png";
  std::string background_ = "0,0,0,255";
  SliceNames names_{"slice_", 5, 0};
  bool keep_blank_ = false;
  std::string page_name_;
  OverwriteOption overwrite_;
  std::map<const SliceFormat*, std::unique_ptr<SliceEncoder>> encoders_;

  Schema schema_;
  const SliceFormat* format_ = nullptr;
  SliceEncoder* encoder_ = nullptr;
  Manifest stack_;
  std::optional<StackWriter> writer_;
  std::optional<StackPage> page_;
};

}  // namespace

extern const OperatorInfo slice_export;
const OperatorInfo slice_export = {
    "slice-export", "One image per layer, with a manifest and a preview",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign ! slice-export out",
    [] { return std::unique_ptr<Operator>(std::make_unique<SliceExport>()); }};

}  // namespace vdbdither
