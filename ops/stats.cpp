#include <array>
#include <cstdio>
#include <optional>

#include <nlohmann/json.hpp>

#include "io/profile/material_table.h"
#include "io/stack/slice_spans.h"
#include "ops/kernels/measure/histogram.h"
#include "ops/kernels/measure/surface_area.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

/// The voxels of one value, and those of their faces behind which there is nothing.
struct Tally {
  std::uint64_t voxels = 0;
  std::array<std::uint64_t, 3> faces{};  ///< across x, y, z
};

/// Tallies layers as they come, rising.
class LayerTally {
 public:
  void add(SpanImage&& layer) {
    for (std::uint32_t y = 0; y < layer.height; ++y) {
      std::uint32_t begin = 0;
      std::uint32_t before = 0;
      for (const Span& span : layer.row(y)) {
        if (span.value) tallies_[span.value].voxels += span.end - begin;
        meet(before, span.value, 0, 1);
        begin = span.end;
        before = span.value;
      }
      meet(before, 0, 0, 1);
      meetRows(y > 0 ? layer.row(y - 1) : std::span<const Span>(), layer.row(y), 1);
      meetRows(below_.height ? below_.row(y) : std::span<const Span>(), layer.row(y), 2);
    }
    if (layer.height) meetRows(layer.row(layer.height - 1), {}, 1);
    below_ = std::move(layer);
  }

  /// After the last layer.
  void finish() {
    for (std::uint32_t y = 0; y < below_.height; ++y) meetRows(below_.row(y), {}, 2);
    below_ = {};
  }

  [[nodiscard]] const std::map<std::uint32_t, Tally>& tallies() const { return tallies_; }

 private:
  void meet(std::uint32_t a, std::uint32_t b, int axis, std::uint64_t faces) {
    if ((a == 0) == (b == 0)) return;
    tallies_[a ? a : b].faces[axis] += faces;
  }

  /// Rows that lie face to face; one without spans is empty.
  void meetRows(std::span<const Span> a, std::span<const Span> b, int axis) {
    const Span nothing{a.empty() ? b.back().end : a.back().end, 0};
    if (a.empty()) a = {&nothing, 1};
    if (b.empty()) b = {&nothing, 1};
    std::uint32_t begin = 0;
    for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
      const std::uint32_t end = std::min(a[i].end, b[j].end);
      meet(a[i].value, b[j].value, axis, end - begin);
      begin = end;
      if (a[i].end == end) ++i;
      if (b[j].end == end) ++j;
    }
  }

  SpanImage below_;
  std::map<std::uint32_t, Tally> tallies_;
};

/// Volumes, voxels, areas, a histogram.
class Stats : public Sink {
 public:
  void declare(Options& options) override {
    options.text("histogram", histogram_grid_, "GRID",
                 "Counts the active values of this grid of numbers in bins");
    options.integer("bins", bins_, {2, 65536},
                    "Maximum number of bins; their edges are multiples of a power of two");
    options.belongTo("--histogram", [this] { return !histogram_grid_.empty(); });
    json_.declare(options);
  }

  void plan(const Schema& in) override {
    lattice_ = in.lattice;
    const auto has = [&](const char* name) { return in.grids.contains(name); };
    if (has(material_grid)) {
      findGrid<openvdb::Int32Grid>(in.grids, material_grid);
      const auto table = in.metadata.find(materials_key);
      if (table != in.metadata.end()) materials_ = materialTableFromJson(table->second);
    }
    if (has(solid_grid)) findGrid<openvdb::BoolGrid>(in.grids, solid_grid);
    if (has(surface_grid)) {
      if (findGrid<openvdb::FloatGrid>(in.grids, surface_grid)->getGridClass() !=
          openvdb::GRID_LEVEL_SET) {
        throw DataError("grid 'surface' is no level set: it holds no distances");
      }
    }
    for (const char* name : {material_grid, solid_grid, surface_grid}) {
      if (has(name)) measured_.emplace_back(name);
    }
    if (!histogram_grid_.empty()) planHistogram(in);
    if (measured_.empty() && !histogram_) {
      throw UsageError(
          "there is no grid 'material', 'solid' or 'surface' to measure; --histogram GRID counts "
          "the values of another");
    }
  }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    std::vector<std::string> names = measured_;
    if (histogram_) names.push_back(histogram_grid_);
    return names;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::stats_us};
  }

  void write(const Slab& in) override {
    const SliceLayout layout{lattice_.box, 0, false, false};
    // Few layers at a time, as their spans are not small.
    for (int z = in.core.begin; z < in.core.end;) {
      const int end = std::min(in.core.end, alignedToLeaves({z, z + 1}).end);
      if (measures(material_grid)) {
        const auto grid = findGrid<openvdb::Int32Grid>(in.grids, material_grid);
        for (SpanImage& layer : sliceSpans(*grid, layout, {z, end}))
          by_material_.add(std::move(layer));
      }
      if (measures(solid_grid)) {
        const auto grid = findGrid<openvdb::BoolGrid>(in.grids, solid_grid);
        for (SpanImage& layer : sliceSpans(*grid, layout, {z, end}))
          of_solid_.add(std::move(layer));
      }
      z = end;
    }
    if (measures(surface_grid)) {
      auto surface = findGrid<openvdb::FloatGrid>(in.grids, surface_grid);
      if (below_) area_mm2_ += surfaceArea(*below_, *surface, below_layers_, lattice_.pitch_mm);
      below_ = std::move(surface);
      below_layers_ = in.core;
    }
    if (histogram_) count(*in.grids.at(histogram_grid_));
  }

  void finish() override {
    by_material_.finish();
    of_solid_.finish();
    if (below_) {
      // The surface ends with the job: its uppermost layer goes on upwards.
      const ZRange layers{below_layers_.begin, below_layers_.end - 1};
      if (!layers.empty()) area_mm2_ += surfaceArea(*below_, *below_, layers, lattice_.pitch_mm);
      below_.reset();
    }
    report().print(json_.json ? inJson() : plainText());
  }

 private:
  [[nodiscard]] bool measures(std::string_view name) const {
    return std::find(measured_.begin(), measured_.end(), name) != measured_.end();
  }

  void planHistogram(const Schema& in) {
    const auto grid = in.grids.find(histogram_grid_);
    if (grid == in.grids.end()) findGrid<openvdb::FloatGrid>(in.grids, histogram_grid_);
    const std::string type = grid->second->valueType();
    const bool whole = type.starts_with("int");
    if (!whole && type != "float" && type != "double")
      throw UsageError("--histogram: grid '" + histogram_grid_ + "' is of " + type +
                       ", not of numbers");
    constexpr int finest_exponent = -40;
    histogram_.emplace(bins_, whole ? 0 : finest_exponent);
  }

  void count(const openvdb::GridBase& grid) {
    visitGrid(grid, [&](const auto& typed) {
      if constexpr (std::is_arithmetic_v<typename std::decay_t<decltype(typed)>::ValueType>) {
        for (auto value = typed.cbeginValueOn(); value; ++value)
          histogram_->add(static_cast<double>(*value), value.getVoxelCount());
      }
    });
  }

  [[nodiscard]] double millilitres(const Tally& tally) const {
    return static_cast<double>(tally.voxels) * lattice_.pitch_mm.product() / 1000;
  }
  [[nodiscard]] double facesMm2(const Tally& tally) const {
    const openvdb::Vec3d& d = lattice_.pitch_mm;
    return static_cast<double>(tally.faces[0]) * d.y() * d.z() +
           static_cast<double>(tally.faces[1]) * d.x() * d.z() +
           static_cast<double>(tally.faces[2]) * d.x() * d.y();
  }

  [[nodiscard]] std::string materialName(std::uint32_t value) const {
    return value >= 1 && value <= materials_.size() ? materials_[value - 1].name
                                                    : "(not in the table)";
  }

  [[nodiscard]] ordered_json json(const Tally& tally) const {
    return {{"voxels", tally.voxels}, {"ml", millilitres(tally)}, {"faces_mm2", facesMm2(tally)}};
  }

  [[nodiscard]] std::string inJson() const {
    ordered_json all;
    all["voxel_mm3"] = lattice_.pitch_mm.product();
    if (measures(material_grid)) {
      all["materials"] = ordered_json::array();
      for (const auto& [value, tally] : by_material_.tallies()) {
        ordered_json entry = {{"index", static_cast<std::int32_t>(value)},
                              {"name", materialName(value)}};
        entry.update(json(tally));
        all["materials"].push_back(std::move(entry));
      }
    }
    if (measures(solid_grid)) all["solid"] = json(solidTally());
    if (measures(surface_grid))
      all["surface"] = {{"area_mm2", area_mm2_}, {"estimate", "marching tetrahedra"}};
    if (histogram_) {
      all["histogram"] = {{"grid", histogram_grid_}, {"bins", ordered_json::array()}};
      for (const Histogram::Bin& bin : histogram_->bins()) {
        all["histogram"]["bins"].push_back(
            {{"from", bin.from}, {"to", bin.to}, {"voxels", bin.count}});
      }
      if (histogram_->notFinite() > 0) all["histogram"]["not_finite"] = histogram_->notFinite();
    }
    return jsonText(all) + "\n";
  }

  [[nodiscard]] Tally solidTally() const {
    const auto& tallies = of_solid_.tallies();
    return tallies.empty() ? Tally{} : tallies.begin()->second;
  }

  [[nodiscard]] std::string plainText() const {
    std::string text;
    const auto row = [&](const std::string& name, const Tally& tally) {
      std::array<char, 160> line{};
      std::snprintf(line.data(), line.size(), "%-18s %14llu %12.6g %12.6g\n", name.c_str(),
                    static_cast<unsigned long long>(tally.voxels), millilitres(tally),
                    facesMm2(tally));
      text += line.data();
    };
    if (measures(material_grid) || measures(solid_grid))
      text += "                           voxels           ml    faces mm2\n";
    for (const auto& [value, tally] : by_material_.tallies()) row(materialName(value), tally);
    if (measures(solid_grid)) row("solid", solidTally());
    if (measures(surface_grid)) {
      text += "surface            " + shortestText(std::round(area_mm2_ * 1e6) / 1e6) +
              " mm2 by marching tetrahedra\n";
    }
    if (histogram_) text += histogramText();
    return text;
  }

  [[nodiscard]] std::string histogramText() const {
    constexpr double widest = 40;
    const std::vector<Histogram::Bin> bins = histogram_->bins();
    std::uint64_t most = 1;
    for (const Histogram::Bin& bin : bins) most = std::max(most, bin.count);
    std::string text = histogram_grid_ + " from, to, voxels\n";
    for (const Histogram::Bin& bin : bins) {
      std::array<char, 96> line{};
      std::snprintf(line.data(), line.size(), "%12.6g %12.6g %14llu ", bin.from, bin.to,
                    static_cast<unsigned long long>(bin.count));
      const double share = static_cast<double>(bin.count) / static_cast<double>(most);
      text += line.data() + std::string(static_cast<std::size_t>(std::lround(widest * share)), '#');
      while (text.ends_with(' ')) text.pop_back();
      text += '\n';
    }
    if (histogram_->notFinite() > 0)
      text += std::to_string(histogram_->notFinite()) + " values are not finite\n";
    return text;
  }

  std::string histogram_grid_;
  int bins_ = 32;
  JsonOption json_;

  Lattice lattice_;
  MaterialTable materials_;
  std::vector<std::string> measured_;
  LayerTally by_material_;
  LayerTally of_solid_;
  openvdb::FloatGrid::ConstPtr below_;
  ZRange below_layers_;
  double area_mm2_ = 0;
  std::optional<Histogram> histogram_;
};

}  // namespace

extern const OperatorInfo stats;
const OperatorInfo stats{
    "stats", "Volumes, voxels and areas of what is printed, and histograms",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign ! write part.vdb ! "
    "stats",
    [] { return std::unique_ptr<Operator>(std::make_unique<Stats>()); }};

}  // namespace vdbdither
