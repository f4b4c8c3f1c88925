#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/file/staged_output.h"
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
#include "ops/kernels/mesh/mesh_repair.h"
#include "ops/kernels/mesh/taubin.h"
#include "ops/kernels/picture/diverging_colours.h"
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
                      {"max_mm", statistics.most_mm}};
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

/// How far a surface lies from the one it should be.
class Measure : public Sink {
 public:
  void declare(Options& options) override {
    options.positional(
        "mesh", file_,
        "Mesh to measure in place of the volume that reaches this step: " + meshFormatNames(),
        false);
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
    json_.declare(options);
    overwrite_.declare(options, "each file");
  }

  [[nodiscard]] bool standsAlone() const override { return !file_.empty(); }

  void plan(const Schema& in) override {
    if (placement_.on_bed && standsAlone())
      throw UsageError(
          "--place: the bed is a face of the lattice's voxels, and a mesh has no lattice; measure "
          "a .vdb");
    if (!report_file_.empty())
      StagedOutput::check(report_file_, StagedOutput::Kind::file, overwrite_.overwrite);
    if (!map_file_.empty()) {
      const MeshFormat* format = meshFormatNamedBy(map_file_);
      if (format == nullptr || !format->holds_extras)
        throw UsageError("--map: '" + map_file_ + "' cannot hold colours; name a " +
                         colouredEndings() + " file");
      MeshWriter::check(map_file_, overwrite_.overwrite);
    }
    if (!standsAlone()) {
      std::vector<std::string> there;
      for (const auto& [name, grid] : in.grids) there.push_back(name);
      name_ = chosenSurfaceGrid(there, surface_grid_.grid);
      lattice_ = in.lattice;
      surface_.emplace(in.lattice, *in.grids.at(name_), std::nullopt);
      components_.emplace(surface_->frame());
    }
    readReference();
  }

  [[nodiscard]] bool isBarrier() const override { return true; }

  [[nodiscard]] std::optional<Work> work() const override {
    // Triangles at the surface are about as long as the diagonal of a voxel's largest face.
    const openvdb::Vec3d& pitch = lattice_.pitch_mm;
    const double side_mm =
        std::sqrt(pitch.lengthSqr() - std::pow(std::min({pitch.x(), pitch.y(), pitch.z()}), 2));
    const double cuts = side_mm > spacing_mm_ ? std::ceil(side_mm / spacing_mm_) : 0;
    const double points = 1 + 2 * cuts * cuts;  // for a vertex
    const double smoothing = smooths() ? taubin().usPerVertex() : 0;
    return Work{.us_per_leaf = GridSurface::vertices_per_leaf * (0.3 + 1.3 * points + smoothing),
                .seconds = 2e-6 * static_cast<double>(reference_->mesh().triangles.size())};
  }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    return std::vector<std::string>{name_};
  }

  void write(const Slab& in) override {
    const GridConstPtr& grid = in.grids.at(name_);
    for (const BitLayer& layer : surface_->insideOf(grid, in.core)) components_->add(layer);
    take(surface_->add(grid, in.core));
  }

  void finish() override {
    const auto progress = [this](double fraction) { report().progress(fraction); };
    const auto warn = [this](const std::string& text) { report().warn(text); };
    if (standsAlone()) {
      mesh_ = readMesh(file_, warn);
      if (smooths()) checkClosed();
    } else {
      take(surface_->finish());
    }
    if (mesh_.triangles.empty())
      throw DataError("grid '" + name_ + "' has no surface: nothing of it is inside");
    if (smooths()) smooth(mesh_, taubin(), progress);
    const SurfaceErrors errors = surfaceErrors(mesh_, *reference_, spacing_mm_, progress);
    const ordered_json all = figures(errors);
    for (const char* name :
         {"bias_mm", "mean_mm", "rms_mm", "p50_mm", "p90_mm", "p95_mm", "p99_mm", "max_mm"})
      report().count(name, all["area"][name].get<double>());
    // Both files appear, or none.
    std::optional<StagedOutput> staged;
    if (!report_file_.empty()) {
      const std::string text = all.dump(1) + "\n";
      staged.emplace(report_file_, StagedOutput::Kind::file);
      writeFile(staged->path(), {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()},
                report_file_);
    }
    if (!map_file_.empty()) writeMap(errors, all["map_range_mm"].get<double>());
    if (staged) staged->commit();
    if (json_.json) {
      report().print(all.dump(1) + "\n");
    } else if (report_file_.empty()) {
      report().print(plainText(all));
    }
  }

 private:
  [[nodiscard]] bool smooths() const { return smoothing_.smoothing != Smoothing::none; }
  [[nodiscard]] Taubin taubin() const { return {.iterations = smoothing_.iterations}; }

  void readReference() {
    Mesh mesh = readMesh(reference_file_, [this](const std::string& text) { report().warn(text); });
    const MeshPlacementOptions& given = placement_;
    MeshPlacement placement{given.rotate_degrees, given.mmPerUnit(), given.fit_mm.value_or(0)};
    if (given.on_bed) placement.corner_mm = bedCornerMm(lattice_);
    place(mesh, placement);
    MeshRepairs repairs;
    mesh = repaired(std::move(mesh), repairs);
    if (mesh.triangles.empty())
      throw DataError(
          "--reference: the mesh has no surface: all its triangles are degenerate or "
          "cancel");
    for (const std::string& line : repairs.lines()) report().warn("--reference: " + line);
    reference_.emplace(std::move(mesh));
  }

  /// What smoothing makes of borders is nothing to measure.
  void checkClosed() const {
    MeshRepairs repairs;
    repaired(mesh_, repairs);
    const std::vector<std::string> lines = repairs.lines();
    if (!lines.empty()) {
      throw DataError("--smooth: '" + file_ + "' is no closed mesh (" + lines.front() +
                      "); measure it as it is, or repair it first");
    }
  }

  void take(const SurfacePiece& piece) {
    mesh_.vertices.insert(mesh_.vertices.end(), piece.vertices.begin(), piece.vertices.end());
    mesh_.triangles.insert(mesh_.triangles.end(), piece.triangles.begin(), piece.triangles.end());
  }

  [[nodiscard]] ordered_json figures(const SurfaceErrors& errors) {
    ordered_json all;
    all["surface"] = json(mesh_);
    all["surface"]["of"] = standsAlone() ? file_ : "grid " + name_;
    all["surface"]["smoothing"] = smooths() ? smoothing_.iterations : 0;
    all["reference"] = json(reference_->mesh());
    all["reference"]["of"] = reference_file_;
    const double volume = all["surface"]["volume_mm3"];
    const double wanted = all["reference"]["volume_mm3"];
    all["volume_error_mm3"] = volume - wanted;
    all["volume_error_percent"] = wanted != 0 ? 100 * (volume - wanted) / wanted : 0;
    const ErrorStatistics by_area = statisticsByArea(errors);
    all["area"] = json(by_area);
    all["vertices"] = json(statisticsByVertex(errors));
    const auto axes = axisErrors(errors, *reference_, standsAlone() ? nullptr : &lattice_);
    for (std::size_t axis = 0; axis < 3; ++axis)
      all["axes"][std::string(1, static_cast<char>('x' + axis))] = json(axes[axis]);
    all["cutoff_mm"] = rules_.cutoff_mm;
    all["margin_mm"] = rules_.margin_mm;
    all["facets"] = ordered_json::array();
    for (const FacetRoughness& facet : facetRoughness(errors, *reference_, rules_))
      all["facets"].push_back(json(facet));
    if (components_) {
      const VoxelComponents::Counts counts = components_->finish();
      all["components"] = json(counts.components);
      all["cavities"] = json(counts.cavities);
    }
    all["map_range_mm"] = map_range_mm_.value_or(by_area.percentile(99));
    return all;
  }

  void writeMap(const SurfaceErrors& errors, double range_mm) const {
    VertexExtras extras{true, true,
                        "quality is the error in mm; blue is -" + shortestText(range_mm) +
                            ", grey 0, red " + shortestText(range_mm)};
    MeshWriter writer(map_file_, extras);
    std::vector<std::array<std::uint8_t, 3>> colours;
    std::vector<float> qualities;
    for (std::size_t vertex = 0; vertex < errors.vertices; ++vertex) {
      const double error = errors.error_mm[vertex];
      colours.push_back(divergingColour(range_mm > 0 ? error / range_mm : 0));
      qualities.push_back(static_cast<float>(error));
    }
    writer.add(mesh_.vertices, mesh_.triangles, 0, colours, qualities);
    writer.commit();
  }

  std::string file_;
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

  std::string name_;
  Lattice lattice_;
  std::optional<GridSurface> surface_;
  std::optional<VoxelComponents> components_;
  std::optional<ClosestPoints> reference_;
  Mesh mesh_;
};

}  // namespace

extern const OperatorInfo measure;
const OperatorInfo measure{
    "measure", "How far a surface, printed or simulated, lies from the mesh that it should be",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! simulate ! measure --reference "
    "part.stl --report error.json",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Measure>(); }};

}  // namespace vdbdither
