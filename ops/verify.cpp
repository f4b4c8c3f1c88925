#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <tbb/parallel_for.h>

#include "io/file/standard_streams.h"
#include "io/image/png_spans.h"
#include "io/profile/printer_profile.h"
#include "io/profile/target_lattice.h"
#include "io/stack/checked_stack.h"
#include "io/stack/container.h"
#include "io/stack/expected_voxels.h"
#include "io/stack/image_stack.h"
#include "ops/kernels/measure/print_regions.h"
#include "ops/kernels/measure/span_difference.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;
using openvdb::Coord;
using openvdb::CoordBBox;
using Severity = Finding::Severity;

/// Layers that are held together.
constexpr int batch = 16;

// Where smaller, islands, cups and cavities are the grain of dithering: the first are narrower than
// the tip of a support.
constexpr double least_island_mm2 = 0.04;
constexpr double least_cup_mm3 = 1;
constexpr double least_cavity_mm3 = 0.001;

std::string rounded(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g", value);
  return text.data();
}

/// The material of a printer that a stack means, or null.
const Material* knownMaterial(const Material& material, const std::vector<Material>& known) {
  if (const Material* called = materialCalled(material.name, known)) return called;
  for (const Material& other : known) {
    if (!other.resin.empty() && sameName(other.resin, material.name)) return &other;
  }
  const auto alike = std::find_if(known.begin(), known.end(), [&](const Material& other) {
    return other.rgba == material.rgba;
  });
  return alike == known.end() ? nullptr : &*alike;
}

Material materialOfColour(std::uint32_t colour) {
  std::array<char, 16> name{};
  std::snprintf(name.data(), name.size(), "#%02x%02x%02x", colour & 255, colour >> 8 & 255,
                colour >> 16 & 255);
  return {name.data(),
          {static_cast<std::uint8_t>(colour & 255), static_cast<std::uint8_t>(colour >> 8 & 255),
           static_cast<std::uint8_t>(colour >> 16 & 255), static_cast<std::uint8_t>(colour >> 24)}};
}

/// Whether a printer would take a stack of slices, and whether it holds the part.
class Verify : public Tool {
 public:
  void declare(Options& options) override {
    options.positional(
        "stack", path_,
        "Stack of slices: a folder with manifest.json or a zip archive of one, a "
        "container (.gcvf, .sl1, .uvj, .3mf), or numbered images of another program");
    options.file("against", against_, "VDB",
                 "Also tells where the stack is not voxel for voxel the grid 'material' or 'solid' "
                 "of this .vdb");
    target_.declare(options);
    options.text("background", background_, "COLOUR",
                 "Colour of the empty voxels in images without a manifest, also as #rrggbb. By "
                 "default black, and none if the images have opacity");
    options.words({{"black", "Black"}, {"white", "White"}});
    options.flag("flip-x", flip_x_,
                 "Takes the first column of these images as that of the greatest x");
    options.flag("flip-y", flip_y_, "Takes the first row of these images as that of the least y");
    json_.declare(options);
  }

  void run() override {
    readPrinter();
    if (!against_.empty()) readExpected();
    open();
    if (stack_) {
      readLayers();
      stack_->finish(totals_, findings_);
      checkPrinter(*stack_, totals_, printer_, findings_);
      if (totals_.printed.empty())
        findings_.error("nothing-printed", "no voxel is printed; make the stack again");
      if (expected_) compare();
    }
    printData((json_.json ? inJson() : plainText()).c_str());
    if (findings_.errors() > 0)
      throw DataError("'" + path_ + "' has " + counted(findings_.errors(), "error"));
  }

 private:
  void readPrinter() {
    if (target_.printer.empty() && target_.layer_mm)
      throw UsageError("--layer goes with --printer");
    if (target_.printer.empty() && !target_.pitch_mm) return;
    Schema schema;
    pitch_mm_ = targetPitchMm(target_, schema);
    printer_ = printerProfileOf(schema);
  }

  void readExpected() {
    try {
      expected_ = std::make_unique<ExpectedVoxels>(against_);
    } catch (const UsageError& error) {
      throw UsageError(std::string("--against: ") + error.what());
    }
  }

  void open() {
    const bool is_foreign = ImageStack::isAt(path_);
    for (const auto& [option, given] :
         {std::pair("--background", !background_.empty()), std::pair("--flip-x", flip_x_),
          std::pair("--flip-y", flip_y_), std::pair("--pitch", target_.pitch_mm.has_value())}) {
      if (given && !is_foreign)
        throw UsageError(std::string(option) + ": '" + path_ + "' states it; leave it out");
    }
    if (is_foreign && !pitch_mm_) {
      throw UsageError("'" + path_ + "' holds no " + manifest_name +
                       ", so it is not a stack made by slice-export; for slices of another "
                       "program give --pitch DX,DY,DZ or --printer NAME");
    }
    try {
      if (is_foreign) {
        const auto& takes = printer_.containers;
        stack_ =
            openImages(path_,
                       {.pitch_mm = *pitch_mm_,
                        .background = backgroundColour(background_),
                        .flip_x = flip_x_,
                        .flip_y = flip_y_,
                        .wants_rgba = std::find(takes.begin(), takes.end(), "png") != takes.end()},
                       findings_);
      } else {
        stack_ = openDescribedStack(path_, findings_);
        if (printer_.name.empty()) printer_ = printerOf(stack_->manifest());
      }
    } catch (const DataError& error) {
      std::error_code none;
      if (!std::filesystem::exists(path_, none) && !is_foreign) throw;
      findings_.error("unreadable-stack", error.what());
      stack_.reset();
    }
  }

  [[nodiscard]] std::string technology() const {
    if (!printer_.technology.empty()) return printer_.technology;
    const std::string& format = stack_->manifest().format;
    return stack_->showsDisplay()                  ? "resin"
           : format == "gcvf" || format == "objet" ? "jetting"
                                                   : "";
  }

  [[nodiscard]] double voxelMl() const {
    return stack_->manifest().lattice.pitch_mm.product() / 1000;
  }

  /// Calls take(layers) for all layers in rising order, some of them together.
  template <typename Take>
  void forEachBatch(double from, double to, const Take& take) {
    const ZRange all = stack_->manifest().layers;
    for (int begin = all.begin; begin < all.end; begin += batch) {
      throwIfInterrupted();
      report().progress(from + (to - from) * (begin - all.begin) / all.size());
      std::vector<CheckedLayer> layers(static_cast<std::size_t>(std::min(batch, all.end - begin)));
      tbb::parallel_for(std::size_t{0}, layers.size(), [&](std::size_t i) {
        layers[i] = stack_->layer(begin + static_cast<int>(i));
      });
      take(layers);
    }
    report().progress(to);
  }

  void readLayers() {
    const openvdb::Vec3d& pitch_mm = stack_->manifest().lattice.pitch_mm;
    const auto atLeast = [](double size, double voxel) {
      return static_cast<std::uint64_t>(std::max(1.0, std::ceil(size / voxel - 1e-6)));
    };
    PrintRegions regions({.island = atLeast(least_island_mm2, pitch_mm.x() * pitch_mm.y()),
                          .cup = atLeast(least_cup_mm3, pitch_mm.product())});
    forEachBatch(0, expected_ ? 0.5 : 1, [&](std::vector<CheckedLayer>& layers) {
      std::vector<PrintRegions::Layer> known;
      for (CheckedLayer& layer : layers) {
        totals_.add(layer, stack_->shown(layer.z), findings_);
        if (layer.image) known.push_back({layer.z, *layer.image});
      }
      regions.add(known);
    });
    tellRegions(regions.finish());
  }

  /// Adds the largest regions of a kind, and how many more there are.
  template <typename Text>
  void tell(const std::string& id, Severity severity, const Regions& regions, const Text& text) {
    for (const Region& region : regions.largest) {
      findings_.add({id,
                     severity,
                     text(region.voxels),
                     stack_->shown(region.layer),
                     stack_->numberOf(region.layer),
                     {{region.column, region.row}},
                     region.voxels});
    }
    findings_.leaveOut(id, severity, regions.count - regions.largest.size());
  }

  void tellRegions(const PrintFindings& found) {
    for (const ZRange& layers : found.empty_layers) {
      findings_.add({"empty-layers", Severity::warning,
                     (layers.size() == 1
                          ? std::string("the layer is empty")
                          : "the layers up to " + std::to_string(stack_->numberOf(layers.end - 1)) +
                                " are empty") +
                         " amid the part, which falls into two; see whether slices were lost",
                     stack_->shown(layers.begin), stack_->numberOf(layers.begin), std::nullopt,
                     static_cast<std::uint64_t>(layers.size())});
    }
    const std::string kind = technology();
    const auto ml = [&](std::uint64_t voxels) {
      return rounded(static_cast<double>(voxels) * voxelMl()) + " ml";
    };
    if (kind != "jetting")
      tellIslands(found, kind == "resin" ? Severity::error : Severity::warning);
    if (found.cavities.count > 0) {
      const double largest_mm3 =
          static_cast<double>(found.cavities.largest[0].voxels) * voxelMl() * 1000;
      tellTogether("cavity", largest_mm3 < least_cavity_mm3 ? Severity::note : Severity::warning,
                   found.cavities,
                   counted(found.cavities.count, "closed cavity", "closed cavities") + ", " +
                       ml(found.cavities.voxels) + " in all, the largest one of " +
                       counted(found.cavities.largest[0].voxels, "voxel") +
                       " here; they keep resin or support: open large ones with hollow --drain");
    }
    if (kind == "resin") {
      tell("cup", Severity::warning, found.cups, [&](std::uint64_t voxels) {
        return "a cup of " + ml(voxels) +
               " holds resin and sucks at the film until it opens; turn the part, or add a hole";
      });
    }
    if (found.specks.count > 0) {
      tellTogether("speck", Severity::note, found.specks,
                   counted(found.specks.count, "voxel") +
                       (found.specks.count == 1 ? " touches no other, here"
                                                : " touch no others, the first one here") +
                       "; they may come off, but do no harm where they are the grain of dithering");
    }
  }

  void tellIslands(const PrintFindings& found, Severity severity) {
    const openvdb::Vec3d& pitch_mm = stack_->manifest().lattice.pitch_mm;
    const auto mm2 = [&](std::uint64_t voxels) {
      return rounded(static_cast<double>(voxels) * pitch_mm.x() * pitch_mm.y()) + " mm2";
    };
    tell("island", severity, found.islands, [&](std::uint64_t voxels) {
      return "an island of " + mm2(voxels) +
             " has nothing below it and is lost in the resin; turn the part, or add support";
    });
    const Regions& small = found.small_islands;
    if (small.count > 0) {
      tellTogether("small-island", Severity::note, small,
                   counted(small.count, "island") + " of less than " + rounded(least_island_mm2) +
                       " mm2 with nothing below, the largest one of " +
                       mm2(small.largest[0].voxels) +
                       " here; they do no harm where they are the grain of dithering");
    }
  }

  /// Adds all regions of a kind as one finding, at the place of the largest one.
  void tellTogether(const std::string& id, Severity severity, const Regions& regions,
                    const std::string& text) {
    const Region& largest = regions.largest[0];
    findings_.add({id,
                   severity,
                   text,
                   stack_->shown(largest.layer),
                   stack_->numberOf(largest.layer),
                   {{largest.column, largest.row}},
                   regions.count});
  }

  /// The box of the printed voxels, as indices of the stack's lattice.
  [[nodiscard]] CoordBBox printedBox() const {
    const SliceLayout& layout = stack_->manifest().layout;
    const CoordBBox& pixels = totals_.printed;
    CoordBBox box;
    for (const Coord& at : {pixels.min(), pixels.max()}) {
      const int column = at.x() - layout.padding;
      const int row = at.y() - layout.padding;
      box.expand({layout.flip_x ? layout.box.max().x() - column : layout.box.min().x() + column,
                  layout.flip_y ? layout.box.min().y() + row : layout.box.max().y() - row, at.z()});
    }
    return box;
  }

  /// Which value of the archive each value of the stack stands for.
  [[nodiscard]] std::map<std::uint32_t, std::uint32_t> counterparts(bool by_material) const;
  void compare();
  void tellDifference(const SpanDifference& difference, std::uint64_t outside);
  [[nodiscard]] bool latticesDiffer();

  [[nodiscard]] Material materialOf(std::uint32_t value) const {
    const MaterialTable& table = stack_->manifest().materials;
    if (value == stray_value) return {"(of no material)", {}};
    if (!stack_->hasColours())
      return value <= table.size() ? table[value - 1] : Material{"printed", {}};
    if (!stack_->tellsMaterials()) return {"printed", {}};
    return materialOfColour(value);
  }

  [[nodiscard]] ordered_json materialsInJson() const;
  [[nodiscard]] std::string inJson() const;
  [[nodiscard]] std::string plainText() const;

  std::string path_;
  std::string against_;
  LatticeOptions target_;
  std::string background_;
  bool flip_x_ = false;
  bool flip_y_ = false;
  JsonOption json_;

  std::optional<openvdb::Vec3d> pitch_mm_;
  PrinterProfile printer_;
  std::unique_ptr<ExpectedVoxels> expected_;
  std::unique_ptr<CheckedStack> stack_;
  StackTotals totals_;
  Findings findings_;
};

std::map<std::uint32_t, std::uint32_t> Verify::counterparts(bool by_material) const {
  std::map<std::uint32_t, std::uint32_t> result;
  const MaterialTable& theirs = expected_->materials();
  for (const auto& [value, voxels] : totals_.voxels) {
    if (!by_material) {
      result[value] = 1;
      continue;
    }
    if (value == stray_value) continue;
    const Material material = materialOf(value);
    const auto by = [&](const auto& is_same) {
      const auto found = std::find_if(theirs.begin(), theirs.end(), is_same);
      return found == theirs.end() ? 0U : static_cast<std::uint32_t>(found - theirs.begin() + 1);
    };
    std::uint32_t index = by([&](const Material& other) { return other.name == material.name; });
    if (index == 0) index = by([&](const Material& other) { return other.rgba == material.rgba; });
    if (index == 0 && !stack_->hasColours()) index = value;
    result[value] = index == 0 ? stray_value : index;
  }
  return result;
}

bool Verify::latticesDiffer() {
  const Lattice& ours = stack_->manifest().lattice;
  const Lattice& theirs = expected_->lattice();
  // Containers round.
  const double tolerance = stack_->hasLattice() ? 1e-6 : 0.005;
  for (int axis = 0; axis < 3; ++axis) {
    const double pitch_mm = theirs.pitch_mm[axis];
    if (std::abs(ours.pitch_mm[axis] / pitch_mm - 1) > tolerance) {
      findings_.error("other-lattice",
                      std::string("along ") + "xyz"[axis] + " its voxels are " +
                          shortestText(pitch_mm) + " mm long, those of the stack " +
                          rounded(ours.pitch_mm[axis]) +
                          " mm; compare with the .vdb that was exported",
                      against_);
      return true;
    }
    if (stack_->hasLattice() &&
        std::abs(ours.origin_mm[axis] - theirs.origin_mm[axis]) > tolerance * pitch_mm) {
      findings_.error(
          "other-lattice",
          "its lattice has another origin than that of the stack; compare with the .vdb "
          "that was exported",
          against_);
      return true;
    }
  }
  return false;
}

void Verify::compare() {
  if (latticesDiffer() || totals_.printed.empty()) return;
  const bool by_material = stack_->tellsMaterials() && expected_->tellsMaterials();
  const auto meanings = counterparts(by_material);
  const Coord shift = stack_->hasLattice() || expected_->box().empty()
                          ? Coord(0)
                          : expected_->box().min() - printedBox().min();
  SliceLayout layout = stack_->manifest().layout;
  for (int axis = 0; axis < 2; ++axis) {
    layout.box.min()[axis] += shift[axis];
    layout.box.max()[axis] += shift[axis];
  }
  SpanDifference difference;
  std::map<std::uint32_t, std::uint64_t> seen;
  forEachBatch(0.5, 1, [&](std::vector<CheckedLayer>& layers) {
    const int first = layers.front().z + shift.z();
    std::vector<SpanImage> expected =
        expected_->layersOf(layout, {first, first + static_cast<int>(layers.size())});
    for (const SpanImage& image : expected) countVoxels(image, seen);
    std::vector<SpanDifference> differences(layers.size());
    tbb::parallel_for(std::size_t{0}, layers.size(), [&](std::size_t i) {
      if (!layers[i].image) return;
      for (Span& span : layers[i].image->spans) {
        if (span.value == 0) continue;
        const auto meaning = meanings.find(span.value);
        span.value = meaning == meanings.end() ? stray_value : meaning->second;
      }
      if (!by_material) {
        for (Span& span : expected[i].spans) span.value = span.value != 0 ? 1 : 0;
      }
      differences[i].add(layers[i].z, *layers[i].image, expected[i]);
    });
    for (const SpanDifference& layer : differences) difference.add(layer);
  });
  std::uint64_t outside = 0;
  for (const auto& [value, count] : expected_->voxels()) {
    const auto found = seen.find(value);
    outside += count - (found == seen.end() ? 0 : found->second);
  }
  tellDifference(difference, outside);
}

void Verify::tellDifference(const SpanDifference& difference, std::uint64_t outside) {
  constexpr const char* again = "; export the .vdb again, or see which of the two is right";
  const std::string id = "differs";
  for (const SpanDifference::DifferingLayer& layer : difference.first()) {
    findings_.add(
        {id, Severity::error,
         counted(layer.pixels, "voxel") + " of the layer differ from '" + against_ + "'" + again,
         stack_->shown(layer.z), stack_->numberOf(layer.z), layer.first, layer.pixels});
  }
  findings_.leaveOut(id, Severity::error, difference.layers() - difference.first().size());
  const bool by_material = stack_->tellsMaterials() && expected_->tellsMaterials();
  for (const auto& [value, tally] : difference.tallies()) {
    if (value == 0) continue;
    const MaterialTable& table = expected_->materials();
    const std::string name = !by_material            ? "printed"
                             : value == stray_value  ? "(of no material)"
                             : value <= table.size() ? table[value - 1].name
                                                     : "material " + std::to_string(value);
    findings_.add({"differs-in-material", Severity::error,
                   "'" + name + "': " + counted(tally.missing, "voxel") + " missing, " +
                       grouped(tally.extra) + " too many",
                   against_, std::nullopt, std::nullopt, tally.missing + tally.extra});
  }
  if (outside > 0) {
    findings_.add({"differs-outside", Severity::error,
                   counted(outside, "printed voxel") + " of it lie outside of the slices" + again,
                   against_, std::nullopt, std::nullopt, outside});
  }
}

ordered_json Verify::materialsInJson() const {
  ordered_json all = ordered_json::array();
  for (const auto& [value, voxels] : totals_.voxels) {
    const Material material = materialOf(value);
    const double ml = static_cast<double>(voxels) * voxelMl();
    ordered_json entry = {{"name", material.name}, {"voxels", voxels}, {"ml", ml}};
    const Material* known =
        value == stray_value ? nullptr : knownMaterial(material, printer_.materials);
    if (known != nullptr && known->density_g_per_cm3) entry["g"] = ml * *known->density_g_per_cm3;
    all.push_back(std::move(entry));
  }
  return all;
}

std::string Verify::inJson() const {
  ordered_json json = {{"stack", path_},
                       {"errors", findings_.errors()},
                       {"warnings", findings_.warnings()},
                       {"findings", ordered_json::array()},
                       {"left_out", ordered_json::object()}};
  for (const Finding& finding : findings_.kept()) {
    ordered_json entry = {
        {"id", finding.id}, {"severity", nameOf(finding.severity)}, {"text", finding.text}};
    if (!finding.file.empty()) entry["file"] = finding.file;
    if (finding.layer) entry["layer"] = *finding.layer;
    if (finding.pixel) entry["pixel"] = *finding.pixel;
    if (finding.count) entry["count"] = *finding.count;
    if (const std::uint64_t more = findings_.leftOut(finding.id); more > 0)
      json["left_out"][finding.id] = more;
    json["findings"].push_back(std::move(entry));
  }
  if (stack_) {
    const Manifest& manifest = stack_->manifest();
    const openvdb::Vec3d& pitch_mm = manifest.lattice.pitch_mm;
    if (!manifest.format.empty()) json["format"] = manifest.format;
    if (!printer_.name.empty()) json["printer"] = printer_.name;
    json["pitch_mm"] = {pitch_mm.x(), pitch_mm.y(), pitch_mm.z()};
    json["size"] = {manifest.layout.width(), manifest.layout.height(), manifest.layers.size()};
    json["materials"] = materialsInJson();
  }
  return jsonText(json, 1) + "\n";
}

std::string Verify::plainText() const {
  std::string text;
  std::string last;
  const auto tellMore = [&] {
    const std::uint64_t more = last.empty() ? 0 : findings_.leftOut(last);
    if (more > 0) text += "  and " + grouped(more) + " more [" + last + "]\n";
  };
  for (const Finding& finding : findings_.kept()) {
    if (finding.id != last) tellMore();
    last = finding.id;
    text += textOf(finding) + "\n";
  }
  tellMore();
  text += counted(findings_.errors(), "error") + ", " + counted(findings_.warnings(), "warning");
  if (!stack_) return text + "\n";
  constexpr std::size_t most = 16;
  const ordered_json materials = materialsInJson();
  for (std::size_t i = 0; i < materials.size() && i < most; ++i) {
    const ordered_json& material = materials[i];
    text += "; " + printable(material["name"].get<std::string>()) + " " +
            counted(material["voxels"].get<std::uint64_t>(), "voxel") + ", " +
            rounded(material["ml"].get<double>()) + " ml";
    if (material.contains("g")) text += ", " + rounded(material["g"].get<double>()) + " g";
  }
  if (materials.size() > most) text += "; and " + grouped(materials.size() - most) + " more";
  return text + "\n";
}

}  // namespace

extern const ToolInfo verify;
const ToolInfo verify{
    .name = "verify",
    .summary = "Whether a printer would take a stack of slices, and whether it is the part",
    .example =
        "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! write part.vdb ! slice-export out\n"
        "verify out --against part.vdb",
    .make = []() -> std::unique_ptr<Tool> { return std::make_unique<Verify>(); },
    .takes_run_options = true};

}  // namespace vdbdither
