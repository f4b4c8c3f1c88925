#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include <nlohmann/json.hpp>

#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "io/vdb/grid_checks.h"
#include "io/vdb/vdb.h"
#include "ops/kernels/measure/grid_summary.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;
using openvdb::GridBase;

std::string shortText(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

template <typename Vector>
ordered_json triple(const Vector& v) {
  return ordered_json::array({v[0], v[1], v[2]});
}

/// Three numbers with blanks between them.
template <typename Vector>
std::string tripleText(const Vector& v, const char* separator = " ") {
  return shortText(v[0]) + separator + shortText(v[1]) + separator + shortText(v[2]);
}

/// Numbers in a row with blanks between them.
std::string rowText(const openvdb::Mat4d& matrix, int column) {
  std::string text;
  for (int row = 0; row < 4; ++row) text += (row > 0 ? " " : "") + shortText(matrix(row, column));
  return text;
}

bool isVector(const GridBase& grid) { return grid.valueType().starts_with("vec3"); }
bool isCarried(const GridBase& grid) {
  return grid.apply<CarriedGrids>([](const auto&) {});
}
/// Whether its values lie between two that are worth telling.
bool hasRange(const GridBase& grid) {
  return isCarried(grid) && !grid.isType<openvdb::BoolGrid>() && !grid.isType<openvdb::MaskGrid>();
}

/// The metadata of a grid that no other line tells, as text; long values are cut.
std::map<std::string, std::string> metadataOf(const GridBase& grid, std::size_t longest) {
  std::map<std::string, std::string> texts;
  for (auto entry = grid.beginMeta(); entry != grid.endMeta(); ++entry) {
    const std::string& key = entry->first;
    if (key == GridBase::META_GRID_NAME || key == GridBase::META_GRID_CLASS ||
        key == GridBase::META_VECTOR_TYPE)
      continue;
    texts[printable(key)] = shortened(entry->second->str(), longest);
  }
  return texts;
}

constexpr const char* margin = "          ";
constexpr std::size_t longest_in_text = 100;
constexpr std::size_t longest_in_json = 1000;

/// Whether all grids lie on one lattice, as those of a job do.
bool isJob(const Grids& grids) {
  std::optional<Lattice> first;
  for (const auto& [name, grid] : grids) {
    const std::optional<Lattice> lattice = latticeOf(*grid);
    if (!lattice || !isCarried(*grid)) return false;
    if (!first) first = lattice;
    if (lattice->pitch_mm != first->pitch_mm || lattice->origin_mm != first->origin_mm)
      return false;
  }
  return true;
}

/// What of vdbdither takes a grid of a file from elsewhere; none, and why, where nothing does.
struct Takers {
  std::vector<std::string> commands;
  std::string why_not;
};

Takers takersOf(const GridBase& grid, const std::string& path, const std::string& name) {
  if (!isCarried(grid))
    return {{}, "no operator takes " + grid.type() + "; make a level set of it first"};
  if (!grid.transform().isLinear())
    return {{}, "no operator takes a frustum; resample it in the tool that it comes from"};
  Takers takers;
  if (!isVector(grid))
    takers.commands.push_back("resample " + quotedForShell(path) + " --grid " +
                              quotedForShell(name) + " --printer NAME");
  if (latticeOf(grid)) {
    takers.commands.push_back("read " + quotedForShell(path) + " --grids " + quotedForShell(name));
  } else if (takers.commands.empty()) {
    takers.why_not =
        "only numbers and voxels are brought from a turned lattice onto a printer's, by resample";
  }
  return takers;
}

/// What is told of a grid.
struct Summary : GridSummary {
  std::optional<std::string> fault;  ///< for which every other verb refuses it
};

Summary summaryOf(const GridBase& grid) {
  Summary summary;
  if (isCarried(grid)) {
    static_cast<GridSummary&>(summary) = gridSummary(grid);
    summary.fault = faultOf(grid);
  }
  return summary;
}

/// Describes the lattice, grids, value ranges, materials and history of a job.
class Description {
 public:
  explicit Description(const Schema& schema) : schema_(schema) {
    for (const auto& [name, grid] : schema.grids) summaries_[name];
  }

  /// Of a whole file at `path`.
  Description(const VdbContents& contents, const std::string& path)
      : schema_(schemaOf(contents, "'" + path + "'")) {
    for (const auto& [name, grid] : contents.grids) summaries_[name] = summaryOf(*grid);
    layers_ = takeHeldLayers(schema_, "'" + path + "'").value_or(schema_.lattice.layers()).size();
  }

  void add(const Slab& slab) {
    for (auto& [name, summary] : summaries_) {
      if (const auto found = slab.grids.find(name); found != slab.grids.end())
        summary.add(gridSummary(*found->second));
    }
    layers_ += slab.core.size();
  }

  [[nodiscard]] std::string json() const {
    ordered_json all;
    const Lattice& lattice = schema_.lattice;
    all["lattice"] = {{"pitch_mm", triple(lattice.pitch_mm)},
                      {"origin_mm", triple(lattice.origin_mm)}};
    if (!lattice.box.empty()) {
      all["lattice"]["min"] = triple(lattice.box.min());
      all["lattice"]["max"] = triple(lattice.box.max());
    }
    all["layers"] = layers_;
    all["metadata"] = otherMetadata(longest_in_json);
    all["grids"] = ordered_json::array();
    for (const auto& [name, summary] : summaries_) {
      all["grids"].push_back(gridJson(name, *schema_.grids.at(name), summary));
    }
    const ordered_json printer = parsedJson(metadata(printer_key));
    if (!printer.is_discarded()) all["printer"] = printer;
    all["history"] = history();
    return jsonText(all) + "\n";
  }

  [[nodiscard]] std::string text() const {
    std::ostringstream words;
    const Lattice& lattice = schema_.lattice;
    words << "lattice   " << tripleText(lattice.pitch_mm, " x ") << " mm";
    if (lattice.origin_mm != openvdb::Vec3d(0.0))
      words << " from " << tripleText(lattice.origin_mm) << " mm";
    words << "\n";
    if (!lattice.box.empty()) {
      const openvdb::Vec3d size = lattice.box.dim().asVec3d();
      words << "box       " << tripleText(size, " x ") << " voxels, "
            << tripleText(size * lattice.pitch_mm, " x ") << " mm, from "
            << tripleText(lattice.box.min()) << " to " << tripleText(lattice.box.max()) << "\n";
      if (layers_ != lattice.layers().size()) words << "layers    " << layers_ << " of them\n";
    }
    if (const std::string printer = metadata(printer_key); !printer.empty()) {
      const PrinterProfile profile = printerProfileFromJson(printer);
      words << "printer   " << profile.name << ", " << profile.title << "\n";
    }
    for (const auto& [key, value] : otherMetadata(longest_in_text))
      words << "metadata  " << key << ": " << printable(value) << "\n";
    for (const auto& [name, summary] : summaries_)
      gridText(words, name, *schema_.grids.at(name), summary);
    const char* head = "history   ";
    for (const std::string& line : history()) {
      words << head << printable(line) << "\n";
      head = margin;
    }
    return words.str();
  }

  [[nodiscard]] ordered_json gridJson(const std::string& name, const GridBase& grid,
                                      const Summary& summary) const {
    ordered_json entry = {{"name", name}, {"type", grid.valueType()}, {"class", className(grid)}};
    if (isCarried(grid)) {
      entry["active_voxels"] = summary.active_voxels;
      entry["leaves"] = summary.leaves;
      entry["leaf_bytes"] = summary.leaf_bytes;
    }
    if (isVector(grid)) entry["vector_type"] = GridBase::vecTypeToString(grid.getVectorType());
    if (summary.active_voxels > 0) {
      entry["min"] = triple(summary.box.min());
      entry["max"] = triple(summary.box.max());
      if (hasRange(grid) && isVector(grid)) {
        entry["least"] = triple(summary.minimum);
        entry["greatest"] = triple(summary.maximum);
      } else if (hasRange(grid)) {
        entry["least"] = summary.minimum[0];
        entry["greatest"] = summary.maximum[0];
      }
    }
    entry["metadata"] = metadataOf(grid, longest_in_json);
    if (summary.fault) entry["fault"] = *summary.fault;
    if (name == material_grid) {
      entry["materials"] = ordered_json::array();
      for (const auto& [value, voxels] : summary.counts) {
        entry["materials"].push_back(
            {{"index", value}, {"name", materialName(value)}, {"voxels", voxels}});
      }
    }
    return entry;
  }

  void gridText(std::ostringstream& text, const std::string& name, const GridBase& grid,
                const Summary& summary) const {
    text << name << std::string(name.size() < 9 ? 10 - name.size() : 1, ' ') << grid.valueType();
    if (grid.getGridClass() != openvdb::GRID_UNKNOWN) text << ", " << className(grid);
    if (isVector(grid) && grid.getVectorType() != openvdb::VEC_INVARIANT)
      text << ", " << GridBase::vecTypeToString(grid.getVectorType());
    if (!isCarried(grid)) {
      text << ": voxels not read\n";
      for (const auto& [key, value] : metadataOf(grid, longest_in_text))
        text << margin << key << ": " << printable(value) << "\n";
      return;
    }
    text << ": " << summary.active_voxels << " voxels";
    if (summary.active_voxels > 0) {
      text << " from " << tripleText(summary.box.min()) << " to " << tripleText(summary.box.max());
      if (hasRange(grid) && isVector(grid)) {
        text << ", values (" << tripleText(summary.minimum) << ") to ("
             << tripleText(summary.maximum) << ")";
      } else if (hasRange(grid)) {
        text << ", values " << shortText(summary.minimum[0]) << " to "
             << shortText(summary.maximum[0]);
      }
    }
    text << ", " << bytesText(static_cast<double>(summary.leaf_bytes)) << " in " << summary.leaves
         << " leaves\n";
    if (summary.fault) text << margin << *summary.fault << "\n";
    for (const auto& [key, value] : metadataOf(grid, longest_in_text))
      text << margin << key << ": " << printable(value) << "\n";
    if (name != material_grid) return;
    for (const auto& [value, voxels] : summary.counts) {
      const std::string known = materialName(value);
      text << margin << value << " " << (known.empty() ? "(not in the table)" : known) << ": "
           << voxels << " voxels\n";
    }
  }

 private:
  [[nodiscard]] std::string metadata(std::string_view key) const {
    const auto found = schema_.metadata.find(key);
    return found == schema_.metadata.end() ? "" : found->second;
  }

  /// What a value of the grid `material` is called; nothing where the table does not know.
  [[nodiscard]] std::string materialName(std::int64_t value) const {
    const std::string text = metadata(materials_key);
    if (text.empty()) return "";
    const MaterialTable table = materialTableFromJson(text);
    return value >= 1 && value <= static_cast<std::int64_t>(table.size()) ? table[value - 1].name
                                                                          : "";
  }

  /// The metadata of the file that no other line tells.
  [[nodiscard]] std::map<std::string, std::string> otherMetadata(std::size_t longest) const {
    std::map<std::string, std::string> texts;
    for (const auto& [key, value] : schema_.metadata) {
      if (key != history_key && key != printer_key && key != materials_key)
        texts[key] = shortened(value, longest);
    }
    return texts;
  }

  [[nodiscard]] std::vector<std::string> history() const {
    std::vector<std::string> lines;
    std::istringstream text(metadata(history_key));
    for (std::string line; std::getline(text, line);) lines.push_back(line);
    return lines;
  }

  static std::string className(const GridBase& grid) {
    return GridBase::gridClassToString(grid.getGridClass());
  }

  Schema schema_;
  std::map<std::string, Summary> summaries_;
  int layers_ = 0;
};

class Info : public Sink {
 public:
  void declare(Options& options) override { json_.declare(options); }

  void plan(const Schema& in) override { description_.emplace(in); }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = cost::info_us};
  }

  void write(const Slab& in) override { description_->add(in); }

  void finish() override {
    report().print(json_.json ? description_->json() : description_->text());
  }

 private:
  JsonOption json_;
  std::optional<Description> description_;
};

/// Describes a file as it is: grids that do not lie on one lattice, which `read` would refuse, one
/// by one.
class InfoFile : public Tool {
 public:
  static bool takes(const std::string& file) {
    std::error_code none;
    return std::filesystem::is_regular_file(file, none);
  }

  void declare(Options& options) override {
    options.positional("file", path_, "The .vdb to describe if there is no chain", false);
    json_.declare(options);
  }

  void run() override {
    const VdbContents contents = readVdb(path_);
    if (contents.grids.empty()) throw DataError("'" + path_ + "' holds no grid");
    if (!isJob(contents.grids)) return tellGrids(contents.grids);
    const Description description(contents, path_);
    report().print(json_.json ? description.json() : description.text());
  }

 private:
  void tellGrids(const Grids& grids) {
    const Description none{Schema()};
    ordered_json json;
    std::ostringstream text;
    if (grids.size() > 1) text << "the grids lie on no common lattice; each by itself:\n";
    json["grids"] = ordered_json::array();
    for (const auto& [name, grid] : grids) {
      const Summary summary = summaryOf(*grid);
      ordered_json entry = none.gridJson(name, *grid, summary);
      none.gridText(text, name, *grid, summary);
      tellPlace(*grid, entry, text);
      const Takers takers = takersOf(*grid, path_, name);
      for (const std::string& command : takers.commands)
        text << margin << "vdbdither " << command << "\n";
      entry["takers"] = takers.commands;
      if (!takers.why_not.empty()) {
        text << margin << takers.why_not << "\n";
        entry["why_not"] = takers.why_not;
      }
      json["grids"].push_back(std::move(entry));
    }
    report().print(json_.json ? jsonText(json) + "\n" : text.str());
  }

  /// Where the voxels of a grid lie.
  static void tellPlace(const GridBase& grid, ordered_json& entry, std::ostringstream& text) {
    const openvdb::math::Transform& transform = grid.transform();
    if (const auto voxel_mm = picoGkVoxelMm(grid)) {
      entry["place"] = "picogk";
      entry["voxel_size"] = triple(openvdb::Vec3d(*voxel_mm));
      text << margin << "PicoGK: voxels of " << shortText(*voxel_mm)
           << " mm by its metadata, which resample honours\n";
      return;
    }
    entry["voxel_size"] = triple(transform.voxelSize());
    text << margin << "voxels of " << tripleText(transform.voxelSize(), " x ");
    if (const std::optional<Lattice> lattice = latticeOf(grid)) {
      entry["place"] = "plain";
      entry["origin"] = triple(lattice->origin_mm);
      if (lattice->origin_mm != openvdb::Vec3d(0.0))
        text << " from " << tripleText(lattice->origin_mm);
      text << "\n";
    } else if (transform.isLinear()) {
      entry["place"] = "affine";
      entry["matrix"] = ordered_json::array();
      const openvdb::Mat4d matrix = transform.baseMap()->getAffineMap()->getMat4();
      text << ", turned, mirrored or sheared: x y z of index i j k are\n";
      for (int column = 0; column < 3; ++column) {
        text << margin << "  " << rowText(matrix, column) << "\n";
        entry["matrix"].push_back(
            {matrix(0, column), matrix(1, column), matrix(2, column), matrix(3, column)});
      }
    } else {
      entry["place"] = "frustum";
      text << " in the middle of a frustum\n";
    }
  }

  std::string path_;
  JsonOption json_;
};

}  // namespace

extern const OperatorInfo info;
const OperatorInfo info{
    .name = "info",
    .summary = "Says what is in a .vdb or comes along: grids, ranges, materials, history",
    .example =
        "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign ! "
        "write part.vdb ! info",
    .make = []() -> std::unique_ptr<Operator> { return std::make_unique<Info>(); },
    .on_file = {.takes = InfoFile::takes,
                .make = []() -> std::unique_ptr<Tool> { return std::make_unique<InfoFile>(); }}};

}  // namespace vdbdither
