#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/mesh/mesh_format.h"
#include "io/mesh/mesh_writer.h"
#include "ops/kernels/contour/grid_surface.h"
#include "ops/kernels/mesh/taubin.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

class MeshExport : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("file", file_, "Mesh to write: " + meshEndings());
    surface_grid_.declare(options);
    options.length("level", level_mm_, {-1000, 1000},
                   "Level of the surface, in place of 0 in a distance (mm) or 0.5 in a share of "
                   "material");
    smoothing_.declare(options);
    overwrite_.declare(options, "the file");
  }

  void plan(const Schema& in) override {
    std::vector<std::string> there;
    for (const auto& [name, grid] : in.grids) there.push_back(name);
    name_ = chosenSurfaceGrid(there, surface_grid_.grid);
    surface_.emplace(in.lattice, *in.grids.at(name_), level_mm_);
    MeshWriter::check(file_, overwrite_.overwrite);
    leaves_ = in.footprint.at_surface;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    const double writing = meshFormatNamedBy(file_)->us_per_vertex;
    const double smoothing = smooths() ? cost::smoothingUs(smoothing_.iterations) : 0;
    return Work{.us_per_surface_leaf =
                    GridSurface::vertices_per_leaf * (cost::mesh_export_us + writing + smoothing)};
  }

  [[nodiscard]] OutputEstimate output() const override {
    const double per_vertex = meshFormatNamedBy(file_)->bytes_per_vertex;
    return {file_, leaves_ * GridSurface::vertices_per_leaf * per_vertex};
  }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    return std::vector<std::string>{name_};
  }

  [[nodiscard]] bool isBarrier() const override { return smooths(); }

  void write(const Slab& in) override { take(surface_->add(in.grids.at(name_), in.core)); }

  void finish() override {
    take(surface_->finish());
    if (smooths()) {
      smooth(mesh_, taubin(), [this](double fraction) { report().progress(fraction); });
      begin();
      writer_->add(mesh_.vertices, mesh_.triangles, 0);
    }
    if (writer_->triangles() == 0)
      throw DataError("grid '" + name_ + "' has no surface: nothing of it is inside");
    report().count("vertices", static_cast<double>(writer_->vertices()));
    report().count("triangles", static_cast<double>(writer_->triangles()));
    writer_->commit();
    writer_.reset();
  }

 private:
  [[nodiscard]] bool smooths() const { return smoothing_.smoothing != Smoothing::none; }
  [[nodiscard]] Taubin taubin() const { return {.iterations = smoothing_.iterations}; }

  void begin() {
    if (!writer_) writer_ = std::make_unique<MeshWriter>(file_);
  }

  void take(SurfacePiece piece) {
    if (!smooths()) {
      begin();
      writer_->add(piece.vertices, piece.triangles, piece.open_from);
      return;
    }
    append(mesh_, piece);
  }

  std::string file_;
  SurfaceGridOption surface_grid_;
  std::optional<double> level_mm_;
  SmoothingOptions smoothing_;
  OverwriteOption overwrite_;

  std::string name_;
  double leaves_ = 0;
  std::optional<GridSurface> surface_;
  std::unique_ptr<MeshWriter> writer_;
  Mesh mesh_;
};

}  // namespace

extern const OperatorInfo mesh_export;
const OperatorInfo mesh_export{
    "mesh-export", "The surface of a grid as a closed triangle mesh",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! mesh-export printed.stl",
    []() -> std::unique_ptr<Operator> { return std::make_unique<MeshExport>(); }};

}  // namespace vdbdither
