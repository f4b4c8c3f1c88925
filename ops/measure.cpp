#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/file/staged_output.h"
#include "io/file/text_bytes.h"
#include "io/mesh/mesh_format.h"
#include "io/mesh/mesh_reader.h"
#include "io/mesh/mesh_writer.h"
#include "ops/kernels/contour/grid_surface.h"
#include "ops/kernels/measure/axis_errors.h"
#include "ops/kernels/measure/facet_roughness.h"
#include "ops/kernels/measure/surface_error.h"
#include "ops/kernels/measure/voxel_components.h"
#include "ops/kernels/mesh/closest_point.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/solid_mesh.h"
#include "ops/kernels/mesh/solid_volume.h"
#include "ops/kernels/mesh/taubin.h"
#include "ops/kernels/picture/diverging_colours.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

/// The endings of the mesh files that hold the error of each vertex.
std::string colouredEndings() {
  return meshEndings([](const MeshFormat& format) { return format.holds_extras; });
}

ordered_json json(const ErrorStatistics& statistics) {
  ordered_json result{{"weight", statistics.weight},         {"bias_mm", statistics.bias_mm},
                      {"mean_mm", statistics.mean_mm},       {"rms_mm", statistics.rms_mm},
                      {"p50_mm", statistics.percentile(50)}, {"p90_mm", statistics.percentile(90)},
                      {"p95_mm", statistics.percentile(95)}, {"p99_mm", statistics.percentile(99)},
                      {"max_mm", statistics.maximum_mm}};
  for (int percent = 0; percent <= 100; ++percent)
    result["cumulative_mm"].push_back(statistics.percentile(percent));
  return result;
}

ordered_json json(const std::vector<std::uint64_t>& sizes) {
  constexpr std::size_t most_listed = 16;
  std::uint64_t sum = 0;
  for (const std::uint64_t size : sizes) sum += size;
  ordered_json result{{"count", sizes.size()}, {"voxels", sum}};
  result["largest"] = std::vector<std::uint64_t>(
      sizes.begin(),
      sizes.begin() + static_cast<std::ptrdiff_t>(std::min(most_listed, sizes.size())));
  return result;
}

ordered_json json(const AxisError& axis) {
  ordered_json result{{"correlation", axis.correlation},
                      {"area_mm2", axis.area_mm2},
                      {"bias_mm", axis.bias_mm},
                      {"mean_mm", axis.mean_mm},
                      {"rms_mm", axis.rms_mm}};
  if (axis.phase) {
    result["staircase_mm"] = axis.phase->staircase_mm;
    result["staircase_share"] = axis.phase->explained;
    result["modulation_mm"] = axis.phase->modulation_mm;
  }
  return result;
}

ordered_json json(const FacetRoughness& facet) {
  return {{"triangle", facet.triangle},
          {"normal", {facet.normal.x(), facet.normal.y(), facet.normal.z()}},
          {"area_mm2", facet.area_mm2},
          {"measured_mm2", facet.measured_mm2},
          {"bias_mm", facet.bias_mm},
          {"sa_mm", facet.sa_mm},
          {"sq_mm", facet.sq_mm},
          {"sq_band_mm", facet.sq_band_mm}};
}

ordered_json json(const Mesh& mesh) {
  return {{"vertices", mesh.vertices.size()},
          {"triangles", mesh.triangles.size()},
          {"area_mm2", areaOf(mesh)},
          {"volume_mm3", volumeOf(mesh)}};
}

/// `mm` in µm, for people.
std::string micrometres(const ordered_json& mm) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%9.3f", mm.get<double>() * 1000);
  return text.data();
}

std::string plainText(const ordered_json& all) {
  std::string text =
      "error, um      bias      mean       rms       p50       p90       p95       p99       max\n";
  for (const char* by : {"area", "vertices"}) {
    text += by == std::string("area") ? "by area   " : "by vertex ";
    for (const char* name :
         {"bias_mm", "mean_mm", "rms_mm", "p50_mm", "p90_mm", "p95_mm", "p99_mm", "max_mm"})
      text += micrometres(all[by][name]) + " ";
    text.back() = '\n';
  }
  text += "volume    " + shortestText(all["surface"]["volume_mm3"]) + " mm3, " +
          shortestText(all["volume_error_percent"]) + " % off\n";
  for (const char* axis : {"x", "y", "z"}) {
    const ordered_json& of = all["axes"][axis];
    text += std::string("towards ") + axis + " bias" + micrometres(of["bias_mm"]) + "  mean" +
            micrometres(of["mean_mm"]) + "  rms" + micrometres(of["rms_mm"]);
    if (of.contains("staircase_mm")) text += "  staircase" + micrometres(of["staircase_mm"]);
    text += "\n";
  }
  for (const ordered_json& facet : all["facets"]) {
    std::array<char, 64> normal{};
    std::snprintf(normal.data(), normal.size(), "(%6.3f %6.3f %6.3f)",
                  facet["normal"][0].get<double>(), facet["normal"][1].get<double>(),
                  facet["normal"][2].get<double>());
    text += std::string("facet ") + normal.data() + "  Sa" + micrometres(facet["sa_mm"]) + "  Sq" +
            micrometres(facet["sq_mm"]) + "  band" + micrometres(facet["sq_band_mm"]) + "\n";
  }
  if (all.contains("components")) {
    text += "pieces    " + all["components"]["count"].dump() + ", cavities " +
            all["cavities"]["count"].dump() + "\n";
  }
  return text;
}

/// Measures how far a surface, wherever it comes from, lies from the one it should be.
class SurfaceMeasurement {
 public:
  void declare(Options& options) {
    options.file("reference", reference_file_, "FILE", "Mesh that the surface should be");
    options.required();
    placement_.declare(options, "the reference");
    surface_grid_.declare(options);
    smoothing_.declare(options);
    options.length("spacing", spacing_mm_, {1e-3, 1000},
                   "Maximum distance between the points at which a triangle is measured");
    options.length("cutoff", rules_.cutoff_mm, {1e-3, 1e4},
                   "Minimum wavelength that counts for the band-limited roughness");
    options.length("margin", rules_.margin_mm, {0, 1000},
                   "Distance from the edges of a facet within which its roughness is not measured");
    options.file("report", report_file_, "FILE.json", "Writes all figures to a file");
    options.file("map", map_file_, "FILE",
                 "Writes the mesh, coloured by its error, into a " + colouredEndings() + " file");
    options.length("map-range", map_range_mm_, Range::above(0, 1000),
                   "Error that the last colours of the map stand for",
                   {"auto", "The 99th percentile of the error"});
    options.belongTo("--map", [this] { return !map_file_.empty(); });
    json_.declare(options);
    overwrite_.declare(options, "each file");
  }

  /// Makes every check that does not need the surface, and reads the reference.
  /// `lattice`: the surface's, or null.
  void begin(const Lattice* lattice, Reporter& reporter) {
    if (placement_.on_bed && lattice == nullptr)
      throw UsageError(
          "--place: the bed is a face of a lattice's voxels, and a mesh has no lattice; measure a "
          ".vdb");
    if (!report_file_.empty())
      StagedOutput::check(report_file_, StagedOutput::Kind::file, overwrite_.overwrite);
    if (!map_file_.empty()) {
      const MeshFormat* format = meshFormatNamedBy(map_file_);
      if (format == nullptr || !format->holds_extras)
        throw UsageError("--map: '" + map_file_ + "' cannot hold colours; name a " +
                         colouredEndings() + " file");
      MeshWriter::check(map_file_, overwrite_.overwrite);
    }
    readReference(lattice, reporter);
  }

  [[nodiscard]] const SurfaceGridOption& surfaceGrid() const { return surface_grid_; }
  [[nodiscard]] bool smooths() const { return smoothing_.smoothing != Smoothing::none; }

  [[nodiscard]] Work work(const Lattice& lattice) const {
    // Triangles at the surface are about as long as the diagonal of a voxel's largest face.
    const openvdb::Vec3d& pitch = lattice.pitch_mm;
    const double side_mm =
        std::sqrt(pitch.lengthSqr() - std::pow(std::min({pitch.x(), pitch.y(), pitch.z()}), 2));
    const double cuts = side_mm > spacing_mm_ ? std::ceil(side_mm / spacing_mm_) : 0;
    const double points = 1 + 2 * cuts * cuts;  // for a vertex
    const double smoothing = smooths() ? cost::smoothingUs(smoothing_.iterations) : 0;
    const double vertex_us = cost::measure_us + cost::measure_us_per_point * points + smoothing;
    const auto triangles = static_cast<double>(reference_->mesh().triangles.size());
    return Work{.us_per_surface_leaf = GridSurface::vertices_per_leaf * vertex_us,
                .seconds = 1e-6 * cost::measure_us_per_triangle * triangles};
  }

  /// Measures `mesh`, gives the figures out and completes the files.
  ///
  /// \param of          the name of the surface in the report
  /// \param lattice     of the voxels that the surface was made from, or null
  /// \param components  their components, or null
  void finish(Mesh mesh, const std::string& of, const Lattice* lattice, VoxelComponents* components,
              Reporter& reporter) {
    const auto progress = [&](double fraction) { reporter.progress(fraction); };
    if (smooths()) smooth(mesh, {.iterations = smoothing_.iterations}, progress);
    const SurfaceErrors errors = surfaceErrors(mesh, *reference_, spacing_mm_, progress);
    const ordered_json all = figures(errors, mesh, of, lattice, components);
    for (const char* name :
         {"bias_mm", "mean_mm", "rms_mm", "p50_mm", "p90_mm", "p95_mm", "p99_mm", "max_mm"})
      reporter.count(name, all["area"][name].get<double>());
    if (!report_file_.empty()) {
      const std::string text = jsonText(all, 1) + "\n";
      report_.emplace(report_file_, StagedOutput::Kind::file);
      writeFile(report_->path(), textBytes(text), report_file_);
      report_->complete();
    }
    if (!map_file_.empty()) writeMap(mesh, errors, all["map_range_mm"].get<double>());
    if (json_.json) {
      reporter.print(jsonText(all, 1) + "\n");
    } else if (report_file_.empty()) {
      reporter.print(plainText(all));
    }
  }

  /// Gives the files that `finish` completed their names.
  void publish() {
    if (map_) map_->commit();
    if (report_) report_->commit();
    map_.reset();
    report_.reset();
  }

 private:
  void readReference(const Lattice* lattice, Reporter& reporter) {
    Mesh mesh = readMesh(reference_file_, [&](const std::string& text) { reporter.warn(text); });
    const MeshPlacementOptions& given = placement_;
    checkUnit(mesh, reference_file_, given);
    MeshPlacement placement{given.rotate_degrees, given.mmPerUnit(), given.fit_mm.value_or(0)};
    if (given.on_bed) placement.corner_mm = bedCornerMm(*lattice);
    place(mesh, placement);
    // Errors are measured to the triangles given, so that nothing is guessed in their place.
    SolidMesh solid = solidMesh(std::move(mesh), {.guess = false});
    if (solid.mesh.triangles.empty())
      throw DataError(
          "--reference: the mesh has no surface: all its triangles are degenerate or "
          "cancel");
    // Walls within the reference are no fault of it.
    solid.report.repairs.swallowed_triangles = solid.report.repairs.cut_triangles = 0;
    for (const std::string& line : solid.report.repairs.lines())
      reporter.warn("--reference: " + line);
    reference_volume_mm3_ = volumeOf(solid);
    reference_.emplace(std::move(solid.mesh));
  }

  [[nodiscard]] ordered_json figures(const SurfaceErrors& errors, const Mesh& mesh,
                                     const std::string& of, const Lattice* lattice,
                                     VoxelComponents* components) const {
    ordered_json all;
    all["surface"] = json(mesh);
    all["surface"]["of"] = of;
    all["surface"]["smoothing"] = smooths() ? smoothing_.iterations : 0;
    all["reference"] = json(reference_->mesh());
    all["reference"]["volume_mm3"] = reference_volume_mm3_;
    all["reference"]["of"] = reference_file_;
    const double volume = all["surface"]["volume_mm3"];
    const double wanted = all["reference"]["volume_mm3"];
    all["volume_error_mm3"] = volume - wanted;
    all["volume_error_percent"] = wanted != 0 ? 100 * (volume - wanted) / wanted : 0;
    const ErrorStatistics by_area = statisticsByArea(errors);
    all["area"] = json(by_area);
    all["vertices"] = json(statisticsByVertex(errors));
    const auto axes = axisErrors(errors, *reference_, lattice);
    for (std::size_t axis = 0; axis < 3; ++axis)
      all["axes"][std::string(1, static_cast<char>('x' + axis))] = json(axes[axis]);
    all["cutoff_mm"] = rules_.cutoff_mm;
    all["margin_mm"] = rules_.margin_mm;
    all["facets"] = ordered_json::array();
    for (const FacetRoughness& facet : facetRoughness(errors, *reference_, rules_))
      all["facets"].push_back(json(facet));
    if (components) {
      const VoxelComponents::Counts counts = components->finish();
      all["components"] = json(counts.components);
      all["cavities"] = json(counts.cavities);
    }
    all["map_range_mm"] = map_range_mm_.value_or(by_area.percentile(99));
    return all;
  }

  void writeMap(const Mesh& mesh, const SurfaceErrors& errors, double range_mm) {
    const VertexExtras extras{true, true,
                              "quality is the error in mm; blue is -" + shortestText(range_mm) +
                                  ", grey 0, red " + shortestText(range_mm)};
    map_.emplace(map_file_, MeshEncoding{extras, {}});
    std::vector<std::array<std::uint8_t, 3>> colours;
    std::vector<float> qualities;
    for (std::size_t vertex = 0; vertex < errors.vertices; ++vertex) {
      const double error = errors.error_mm[vertex];
      colours.push_back(divergingColour(range_mm > 0 ? error / range_mm : 0));
      qualities.push_back(static_cast<float>(error));
    }
    map_->add(mesh.vertices, mesh.triangles, 0, colours, qualities);
    map_->complete();
  }

  std::string reference_file_;
  MeshPlacementOptions placement_;
  SurfaceGridOption surface_grid_;
  SmoothingOptions smoothing_;
  double spacing_mm_ = 0.1;
  RoughnessRules rules_;
  std::string report_file_;
  std::string map_file_;
  std::optional<double> map_range_mm_;
  JsonOption json_;
  OverwriteOption overwrite_;

  std::optional<ClosestPoints> reference_;
  double reference_volume_mm3_ = 0;  ///< where shells overlap counted once
  std::optional<StagedOutput> report_;
  std::optional<MeshWriter> map_;
};

/// The surface of a grid.
class Measure : public Sink {
 public:
  void declare(Options& options) override { measurement_.declare(options); }

  void plan(const Schema& in) override {
    std::vector<std::string> there;
    for (const auto& [name, grid] : in.grids) there.push_back(name);
    name_ = chosenSurfaceGrid(there, measurement_.surfaceGrid().grid);
    lattice_ = in.lattice;
    surface_.emplace(in.lattice, *in.grids.at(name_), std::nullopt);
    components_.emplace(surface_->layout());
    measurement_.begin(&lattice_, report());
  }

  [[nodiscard]] bool isBarrier() const override { return true; }

  [[nodiscard]] std::optional<Work> work() const override { return measurement_.work(lattice_); }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    return std::vector<std::string>{name_};
  }

  void write(const Slab& in) override {
    const GridConstPtr& grid = in.grids.at(name_);
    for (const BitLayer& layer : surface_->insideOf(grid, in.core)) components_->add(layer);
    append(mesh_, surface_->add(grid, in.core));
  }

  void finish() override {
    append(mesh_, surface_->finish());
    if (mesh_.triangles.empty())
      throw DataError("grid '" + name_ + "' has no surface: nothing of it is inside");
    measurement_.finish(std::move(mesh_), "grid " + name_, &lattice_, &*components_, report());
  }

  void publish() override { measurement_.publish(); }

 private:
  SurfaceMeasurement measurement_;
  std::string name_;
  Lattice lattice_;
  std::optional<GridSurface> surface_;
  std::optional<VoxelComponents> components_;
  Mesh mesh_;
};

/// The surface of a mesh file.
class MeasureMesh : public Tool {
 public:
  static bool takes(const std::string& file) { return !file.ends_with(".vdb"); }

  void declare(Options& options) override {
    options.positional("mesh", file_, "Mesh to measure if there is no chain: " + meshFormatNames(),
                       false);
    measurement_.declare(options);
  }

  void run() override {
    measurement_.begin(nullptr, report());
    Mesh mesh = readMesh(file_, [this](const std::string& text) { report().warn(text); });
    if (measurement_.smooths()) checkClosed(mesh);
    measurement_.finish(std::move(mesh), file_, nullptr, nullptr, report());
    measurement_.publish();
  }

 private:
  /// Refuses to smooth a mesh that is not closed: borders would be measured as smoothing left them.
  void checkClosed(const Mesh& mesh) const {
    const std::vector<std::string> lines =
        solidMesh(mesh, {.guess = false, .find_walls = false}).report.repairs.lines();
    if (!lines.empty()) {
      throw DataError("--smooth: '" + file_ + "' is no closed mesh (" + lines.front() +
                      "); measure it as it is, or repair it first");
    }
  }

  std::string file_;
  SurfaceMeasurement measurement_;
};

}  // namespace

extern const OperatorInfo measure;
const OperatorInfo measure{
    .name = "measure",
    .summary = "How far a surface, printed or simulated, lies from the mesh that it should be",
    .example =
        "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! simulate ! measure "
        "--reference part.stl --report error.json",
    .make = []() -> std::unique_ptr<Operator> { return std::make_unique<Measure>(); },
    .on_file = {.takes = MeasureMesh::takes,
                .make = []() -> std::unique_ptr<Tool> { return std::make_unique<MeasureMesh>(); }}};

}  // namespace vdbdither
