#include <array>
#include <cstdio>
#include <sstream>

#include <nlohmann/json.hpp>

#include "io/material_table.h"
#include "io/printer_profile.h"
#include "ops/kernels/grid_summary.h"
#include "vdbdither/openvdb.h"
#include "vdbdither/operator.h"
#include "vdbdither/run_options.h"

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

/// Says what there is: grids, lattice, ranges, materials, history.
class Info : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("file", path_, "The .vdb to look into; nothing: what comes to it", false);
    options.flag("json", json_, "Say it as JSON");
  }

  [[nodiscard]] std::string inputFile() const override { return path_; }

  void plan(const Schema& in) override {
    schema_ = in;
    for (const auto& [name, grid] : in.grids) summaries_[name];
  }

  void write(const Slab& in) override {
    for (auto& [name, summary] : summaries_) {
      if (const auto found = in.grids.find(name); found != in.grids.end())
        summary.add(gridSummary(*found->second));
    }
    layers_ += in.core.size();
  }

  void finish() override { report().print(json_ ? jsonText() : plainText()); }

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

  [[nodiscard]] std::vector<std::string> history() const {
    std::vector<std::string> lines;
    std::istringstream text(metadata("vdbdither:history"));
    for (std::string line; std::getline(text, line);) lines.push_back(line);
    return lines;
  }

  static std::string className(const GridBase& grid) {
    return GridBase::gridClassToString(grid.getGridClass());
  }

  static bool isVector(const GridBase& grid) { return grid.valueType().starts_with("vec3"); }
  static bool isSet(const GridBase& grid) {
    return grid.valueType() == "bool" || grid.valueType() == "mask";
  }

  [[nodiscard]] std::string jsonText() const {
    ordered_json json;
    const Lattice& lattice = schema_.lattice;
    json["lattice"] = {{"pitch_mm", triple(lattice.pitch_mm)},
                       {"origin_mm", triple(lattice.origin_mm)}};
    if (!lattice.box.empty()) {
      json["lattice"]["min"] = triple(lattice.box.min());
      json["lattice"]["max"] = triple(lattice.box.max());
    }
    json["layers"] = layers_;
    json["grids"] = ordered_json::array();
    for (const auto& [name, summary] : summaries_) {
      const GridBase& grid = *schema_.grids.at(name);
      ordered_json entry = {{"name", name},
                            {"type", grid.valueType()},
                            {"class", className(grid)},
                            {"active_voxels", summary.active_voxels},
                            {"leaves", summary.leaves},
                            {"leaf_bytes", summary.leaf_bytes}};
      if (isVector(grid)) entry["vector_type"] = GridBase::vecTypeToString(grid.getVectorType());
      if (summary.active_voxels > 0) {
        entry["min"] = triple(summary.box.min());
        entry["max"] = triple(summary.box.max());
        if (isVector(grid)) {
          entry["least"] = triple(summary.least);
          entry["greatest"] = triple(summary.greatest);
        } else if (!isSet(grid)) {
          entry["least"] = summary.least[0];
          entry["greatest"] = summary.greatest[0];
        }
      }
      if (name == "material") {
        entry["materials"] = ordered_json::array();
        for (const auto& [value, voxels] : summary.counts) {
          entry["materials"].push_back(
              {{"index", value}, {"name", materialName(value)}, {"voxels", voxels}});
        }
      }
      json["grids"].push_back(std::move(entry));
    }
    const ordered_json printer = ordered_json::parse(metadata("vdbdither:printer"), nullptr, false);
    if (!printer.is_discarded()) json["printer"] = printer;
    json["history"] = history();
    return json.dump() + "\n";
  }

  [[nodiscard]] std::string plainText() const {
    std::ostringstream text;
    const Lattice& lattice = schema_.lattice;
    text << "lattice   " << tripleText(lattice.pitch_mm, " x ") << " mm";
    if (lattice.origin_mm != openvdb::Vec3d(0.0))
      text << " from " << tripleText(lattice.origin_mm) << " mm";
    text << "\n";
    if (!lattice.box.empty()) {
      const openvdb::Vec3d size = lattice.box.dim().asVec3d();
      text << "box       " << tripleText(size, " x ") << " voxels, "
           << tripleText(size * lattice.pitch_mm, " x ") << " mm, from "
           << tripleText(lattice.box.min()) << " to " << tripleText(lattice.box.max()) << "\n";
      if (layers_ != lattice.layers().size()) text << "layers    " << layers_ << " of them\n";
    }
    if (const std::string printer = metadata("vdbdither:printer"); !printer.empty()) {
      const PrinterProfile profile = printerProfileFromJson(printer);
      text << "printer   " << profile.name << ", " << profile.title << "\n";
    }
    for (const auto& [name, summary] : summaries_) gridText(text, name, summary);
    const char* head = "history   ";
    for (const std::string& line : history()) {
      text << head << line << "\n";
      head = "          ";
    }
    return text.str();
  }

  void gridText(std::ostringstream& text, const std::string& name,
                const GridSummary& summary) const {
    const GridBase& grid = *schema_.grids.at(name);
    text << name << std::string(name.size() < 9 ? 10 - name.size() : 1, ' ') << grid.valueType();
    if (grid.getGridClass() != openvdb::GRID_UNKNOWN) text << ", " << className(grid);
    if (isVector(grid) && grid.getVectorType() != openvdb::VEC_INVARIANT)
      text << ", " << GridBase::vecTypeToString(grid.getVectorType());
    text << ": " << summary.active_voxels << " voxels";
    if (summary.active_voxels > 0) {
      text << " from " << tripleText(summary.box.min()) << " to " << tripleText(summary.box.max());
      if (isVector(grid)) {
        text << ", values (" << tripleText(summary.least) << ") to ("
             << tripleText(summary.greatest) << ")";
      } else if (!isSet(grid)) {
        text << ", values " << shortText(summary.least[0]) << " to "
             << shortText(summary.greatest[0]);
      }
    }
    text << ", " << bytesText(static_cast<double>(summary.leaf_bytes)) << " in " << summary.leaves
         << " leaves\n";
    if (name != "material") return;
    for (const auto& [value, voxels] : summary.counts) {
      const std::string known = materialName(value);
      text << "          " << value << " " << (known.empty() ? "(not in the table)" : known) << ": "
           << voxels << " voxels\n";
    }
  }

  std::string path_;
  bool json_ = false;
  Schema schema_;
  std::map<std::string, GridSummary> summaries_;
  int layers_ = 0;
};

}  // namespace

extern const OperatorInfo info;
const OperatorInfo info{"info",
                        "Says what is in a .vdb or comes along: grids, ranges, materials, history",
                        "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign ! "
                        "write part.vdb ! info",
                        [] { return std::unique_ptr<Operator>(std::make_unique<Info>()); }};

}  // namespace vdbdither
