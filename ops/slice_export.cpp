#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
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
#include "io/profile/printer_profile.h"
#include "io/stack/slice_format.h"
#include "io/stack/slice_frame.h"
#include "io/stack/slice_spans.h"
#include "io/stack/span_spool.h"
#include "io/stack/stack_files.h"
#include "io/stack/stack_page.h"
#include "io/stack/stack_writer.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

class SliceExport : public Sink {
 public:
  void declare(Options& options) override {
    std::string endings;
    std::string prescribed;
    for (const SliceFormat* format : sliceFormats()) {
      if (!format->container_ending.empty())
        endings += ", NAME" + std::string(format->container_ending);
    }
    prescribed = sliceFormatNames([](const auto& format) { return format.names != nullptr; });
    options.positional("folder", folder_,
                       "Folder for the stack, a zip archive NAME.zip, or a container" + endings);
    std::vector<Word> formats;
    for (const SliceFormat* format : sliceFormats()) {
      formats.push_back({std::string(format->name), std::string(format->summary)});
      encoders_[format] = format->encoder();
    }
    options.choice("format", format_name_, std::move(formats),
                   "Format of the slices; the name of a container says its own");
    options.noteGiven(format_given_);
    options.text("prefix", names_.prefix, "TEXT",
                 "Beginning of the file names; " + prescribed + " prescribe their names");
    options.noteGiven(name_given_);
    options.integer("digits", names_.digits, {1, 9},
                    "Digits of the number of a slice, with zeros in front");
    options.noteGiven(name_given_);
    options.integer("first", names_.first, {0, 1000000}, "Number of the lowest slice");
    options.noteGiven(name_given_);
    options.flag(
        "keep-blank", keep_blank_,
        "Writes the blank slices below and above the part too, which pieces of a job need to be "
        "numbered alike; exr always has them");
    frame_.declare(options);
    options.text("background", background_, "COLOUR",
                 "Colour of empty voxels in " + sliceFormatNames([](const auto& format) {
                   return format.showsColours();
                 }) + ": #rrggbb, or r,g,b,a from 0 to 255");
    options.file("page", page_name_, "FILE.html",
                 "Writes a page to look through the slices too, as preview does");
    for (const SliceFormat* format : sliceFormats()) {
      const std::size_t before = options.all().size();
      encoders_[format]->declare(options);
      const std::size_t count = options.all().size() - before;
      options.noteGiven(option_given_[format], count);
      options.onlyIf([this, format] { return format == format_; }, count);
    }
    overwrite_.declare(options, "the stack");
  }

  void makePiece(const std::filesystem::path& folder) override {
    if (frame_.crop) {
      throw UsageError(
          "--crop: the frame of the slices follows from all layers, and a piece has some; leave it "
          "out");
    }
    if (!page_name_.empty())
      throw UsageError("--page: a piece has no page; leave it out, and use preview afterwards");
    part_ = StackPart::piece;
    target_ = folder;
  }

  void plan(const Schema& in) override {
    schema_ = in;
    if (part_ == StackPart::whole) target_ = folder_;
    if (in.lattice.box.empty())
      throw DataError("there is nothing to slice: the lattice has no voxels");
    planFormat();
    planStack();
    planMaterials();
    planColours();
    planNames();
    if (part_ == StackPart::whole) {
      StackOutput::check(folder_, overwrite_.overwrite,
                         [this](const std::string& text) { report().warn(text); });
    }
    printer_ = printerProfileOf(in);
    // Of a part that is cropped the place is not known yet.
    const auto warn = [this](const std::string& text) {
      if (!frame_.crop) report().warn(text);
    };
    planFrame(frame_, in.lattice.box, *format_, printer_, warn, stack_);
    checkPrinterTakes(*format_, printer_, stack_);
    minimum_layers_ = printer_.minimum_slices;
    encoder_->plan(stack_, in.grids);
    if (frame_.crop && !encoder_->reads().empty()) {
      throw UsageError("--crop: " + format_name_ +
                       " shows more than what is printed; leave it out, or take another format");
    }
    spool_.reset();
    printed_ = {};
    planPage();
  }

  [[nodiscard]] OutputEstimate output() const override {
    // Measured on dithered spheres, per leaf at the surface and per slice. A file of a folder
    // wastes half a block of the disk.
    const double leaves = schema_.footprint.at_surface;
    if (leaves == 0) return {target_.string(), 0};
    const double per_leaf = format_->bytes_per_leaf * filesOfLayer();
    const double per_slice = 500 + (namesArchive(folder_) ? 0 : 2048 * filesOfLayer());
    return {target_.string(), leaves * per_leaf + schema_.lattice.layers().size() * per_slice};
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
    if (frame_.crop) {
      if (!spool_) spool_.emplace(std::filesystem::path(folder_).parent_path());
      if (spool_->size() == 0) first_kept_ = in.core.begin;
    } else {
      if (!writer_) begin();
      checkWithin(in);
    }
    inGroups(in.core, [&](ZRange layers) {
      if (frame_.crop) {
        for (const SpanImage& slice : slices(in, layers, wholeLayout())) keep(slice);
      } else {
        add(layers, slices(in, layers, stack_.layout), in.grids);
      }
    });
  }

  void takePiece(const std::filesystem::path& folder, ZRange /*core*/) override {
    if (!writer_) begin();
    writer_->takePiece(folder);
  }

  void finish() override {
    if (spool_) writeKept();
    if (!writer_) throw DataError("no layer came to slice");
    stack_ = writer_->finish();
    if (page_) {
      page_->finish(page_name_);
      if (const std::string text = page_->warning(); !text.empty()) report().warn(text);
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

  void publish() override {
    writer_->commit();
    writer_.reset();
    if (page_) page_->commit();
    page_.reset();
  }

 private:
  [[nodiscard]] double filesOfLayer() const {
    return static_cast<double>(format_->filesOfLayer(stack_.materials.size()));
  }

  /// The name of a container says its format.
  void planFormat() {
    const SliceFormat* container = sliceFormatOfContainer(folder_);
    if (format_given_.empty() && container != nullptr) format_name_ = container->name;
    const SliceFormat& format = *findSliceFormat(format_name_);
    if (container != nullptr ? container != &format : !format.container_ending.empty()) {
      const SliceFormat& named = container != nullptr ? *container : format;
      throw UsageError("--format: the name of a " + std::string(named.name) + " ends with " +
                       std::string(named.container_ending) +
                       ", that of other stacks does not; it is '" + folder_ + "'");
    }
    format_ = &format;
    if (format_->names != nullptr) {
      if (!name_given_.empty()) {
        throw UsageError(name_given_ + ": " + format_name_ +
                         " prescribes the names of its files; leave it out");
      }
      names_ = *format_->names;
    }
    for (const auto& [other, option] : option_given_) {
      if (other != format_ && !option.empty())
        throw UsageError(option + ": belongs to " + std::string(other->name) +
                         ", and the slices are " + format_name_ + "; leave it out");
    }
    encoder_ = encoders_.at(format_).get();
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
    if (liesWithin(page_name_, folder_))
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
          sliceFormatNames([](const SliceFormat& other) {
            return other.pixel != SlicePixel::one_material && other.container_ending.empty();
          }));
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
    checkMaterialsApart();
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

  /// All materials count, whether they are printed or not: what reads the slices back knows the
  /// table, and not what the chain could print.
  void checkMaterialsApart() const {
    std::set<std::string> names;
    for (const Material& material : stack_.materials) {
      // Those of folders follow in planNames.
      if (!names.insert(material.name).second && format_->pixel != SlicePixel::one_material)
        throw DataError("the table of materials has '" + material.name +
                        "' twice; assign the materials again");
    }
    if (format_->keepsMaterials() || !format_->showsColours()) return;
    std::map<std::array<std::uint8_t, 4>, const Material*> colours;
    for (const Material& material : stack_.materials) {
      const auto [same, is_new] = colours.try_emplace(material.rgba, &material);
      if (is_new) continue;
      std::string colour;
      for (const std::uint8_t channel : material.rgba)
        colour += (colour.empty() ? "" : ",") + std::to_string(channel);
      throw UsageError("--format: " + format_name_ + " tells materials apart by colour, and '" +
                       same->second->name + "' and '" + material.name + "' both have " + colour +
                       "; give one another colour where materials are assigned, as in " +
                       material.name + "=#rrggbb, or in the profile of the printer, or take " +
                       sliceFormatNames([&](const SliceFormat& other) {
                         return other.keepsMaterials() && other.container_ending.empty();
                       }));
    }
  }

  /// Calls `work` for layers that all threads can work on together.
  template <typename Work>
  static void inGroups(ZRange all, const Work& work) {
    const int together =
        leaf_layers * ((tbb::this_task_arena::max_concurrency() + leaf_layers - 1) / leaf_layers);
    for (int z = all.begin; z < all.end;) {
      const int end = std::min(all.end, alignedToLeaves({z, z + together - leaf_layers + 1}).end);
      work(ZRange{z, end});
      z = end;
    }
  }

  /// That of slices whose frame is not known yet.
  [[nodiscard]] SliceLayout wholeLayout() const { return {schema_.lattice.box, 0, false, false}; }

  /// Keeps a slice of the whole lattice, and grows the box of what is printed.
  void keep(const SpanImage& slice) {
    expandByPrinted(printed_, slice, static_cast<int>(spool_->size()));
    spool_->add(slice);
  }

  /// Writes the slices that were kept, in the frame of what is printed.
  void writeKept() {
    openvdb::CoordBBox part = schema_.lattice.box;
    if (!printed_.empty()) {
      // The first row of a slice is that of the maximum y.
      const openvdb::CoordBBox whole = part;
      part.min().x() = whole.min().x() + printed_.min().x();
      part.max().x() = whole.min().x() + printed_.max().x();
      part.min().y() = whole.max().y() - printed_.max().y();
      part.max().y() = whole.max().y() - printed_.min().y();
    }
    planFrame(
        frame_, part, *format_, printer_, [this](const std::string& text) { report().warn(text); },
        stack_);
    encoder_->plan(stack_, schema_.grids);
    begin();
    inGroups({first_kept_, first_kept_ + static_cast<int>(spool_->size())}, [&](ZRange layers) {
      throwIfInterrupted();
      std::vector<SpanImage> kept;
      for (int z = layers.begin; z < layers.end; ++z)
        kept.push_back(spool_->read(static_cast<std::size_t>(z - first_kept_)));
      add(layers, sliceSpans(*gridOfSpans(kept, wholeLayout(), layers), stack_.layout, layers), {});
    });
    spool_.reset();
  }

  void begin() {
    writer_.emplace(target_, stack_, names_, *encoder_, blankLayers(), part_);
    if (!page_name_.empty()) page_.emplace(schema_.lattice.layers(), pageStack(folder_, stack_));
  }

  void add(ZRange layers, std::vector<SpanImage> images, const Grids& grids) {
    std::vector<SpanImage> shown;
    if (page_) shown = images;
    writer_->add(layers, std::move(images), grids);
    for (std::size_t i = 0; i < shown.size(); ++i)
      page_->add(layers.begin + static_cast<int>(i), {std::move(shown[i])});
  }

  [[nodiscard]] BlankLayers blankLayers() const {
    return {.keep = keep_blank_, .minimum_layers = minimum_layers_};
  }

  /// A tray may be smaller than the lattice around the part, but not than the part.
  void checkWithin(const Slab& in) const {
    const openvdb::CoordBBox& frame = stack_.layout.box;
    const openvdb::CoordBBox& all = schema_.lattice.box;
    const auto cuts = [&](const openvdb::CoordBBox& box) {
      return box.min().x() < frame.min().x() || box.max().x() > frame.max().x() ||
             box.min().y() < frame.min().y() || box.max().y() > frame.max().y();
    };
    if (!cuts(all)) return;
    const openvdb::CoordBBox printed = in.grids.at(stack_.grid)->evalActiveVoxelBoundingBox();
    if (printed.empty() || !cuts(printed)) return;
    throw DataError(
        std::string("the part reaches beyond the display or tray; make it smaller, ") +
        (frame_.tray == Tray::placed ? "or give --tray centred" : "turn it, or give --tray none"));
  }

  [[nodiscard]] std::vector<SpanImage> slices(const Slab& in, ZRange layers,
                                              const SliceLayout& layout) const {
    return stack_.grid == material_grid
               ? sliceSpans(*findGrid<openvdb::Int32Grid>(in.grids, material_grid), layout, layers)
               : sliceSpans(*findGrid<openvdb::BoolGrid>(in.grids, solid_grid), layout, layers);
  }

  std::string folder_;
  std::filesystem::path target_;  ///< `folder_`, or that of a piece
  StackPart part_ = StackPart::whole;
  std::string format_name_ = "png";
  std::string background_ = usual_background;
  SliceNames names_{"slice_", 5, 0};
  FrameOptions frame_;
  bool keep_blank_ = false;
  PrinterProfile printer_;
  int minimum_layers_ = 0;
  std::string format_given_;
  std::string name_given_;
  std::string page_name_;
  OverwriteOption overwrite_;
  std::map<const SliceFormat*, std::unique_ptr<SliceEncoder>> encoders_;
  std::map<const SliceFormat*, std::string>
      option_given_;  ///< one of the encoder's, if it is given

  Schema schema_;
  const SliceFormat* format_ = nullptr;
  SliceEncoder* encoder_ = nullptr;
  Manifest stack_;
  std::optional<StackWriter> writer_;
  std::optional<SpanSpool> spool_;  ///< slices whose frame is not known yet
  int first_kept_ = 0;              ///< the layer of the first of these
  openvdb::CoordBBox printed_;      ///< columns, rows and numbers of the slices kept
  std::optional<StackPage> page_;
};

}  // namespace

extern const OperatorInfo slice_export;
const OperatorInfo slice_export = {
    "slice-export", "One image per layer, with a manifest and a preview",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign ! slice-export out",
    [] { return std::unique_ptr<Operator>(std::make_unique<SliceExport>()); }};

}  // namespace vdbdither
