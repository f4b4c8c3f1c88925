#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/mesh/mesh_writer.h"
#include "ops/kernels/contour/grid_surface.h"
#include "ops/kernels/mesh/taubin.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

class MeshExport : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("file", file_, "The .stl, .obj or .ply to write");
    options.text("grid", grid_, "NAME",
                 "Whose surface: of solid its voxels, of surface and displaced a level of the "
                 "distance, of printed a level of the occupancy; auto takes the furthest down the "
                 "chain");
    options.text("level", level_, "MM",
                 "Another level than 0 of a distance, in mm, or than 0.5 of an occupancy");
    options.choice(
        "smooth", smooth_, {"none", "taubin"},
        "taubin: Taubin's smoothing, lambda 0.5 and mu -0.53, which holds the whole mesh");
    options.integer("iterations", taubin_.iterations, 1, 100000, "How often it smooths");
    options.flag("overwrite", overwrite_, "Replace the file if it is there");
  }

  void plan(const Schema& in) override {
    std::vector<std::string> there;
    for (const auto& [name, grid] : in.grids) there.push_back(name);
    name_ = chosenSurfaceGrid(there, grid_);
    std::optional<double> level;
    if (!level_.empty()) level = parseLengthMm(level_);
    surface_.emplace(in.lattice, *in.grids.at(name_), level);
    MeshWriter::check(file_, overwrite_);
    leaves_ = in.surface_leaves;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    const double writing = file_.ends_with(".obj") ? 0.55 : 0.2;
    const double smoothing = smooth_ == "none" ? 0 : taubin_.usPerVertex();
    return Work{.us_per_leaf = GridSurface::vertices_per_leaf * (0.1 + writing + smoothing)};
  }

  [[nodiscard]] OutputEstimate output() const override {
    // Two triangles for a vertex: 50 bytes each, or 13 and the vertex 12, or lines of text.
    const double per_vertex = file_.ends_with(".stl") ? 100 : file_.ends_with(".ply") ? 38 : 74;
    return {file_, leaves_ * GridSurface::vertices_per_leaf * per_vertex};
  }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    return std::vector<std::string>{name_};
  }

  [[nodiscard]] bool isBarrier() const override { return smooth_ != "none"; }

  void write(const Slab& in) override { take(surface_->add(in.grids.at(name_), in.core)); }

  void finish() override {
    take(surface_->finish());
    if (smooth_ != "none") {
      smooth(mesh_, taubin_, [this](double fraction) { report().progress(fraction); });
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
  void begin() {
    if (!writer_) writer_ = std::make_unique<MeshWriter>(file_);
  }

  void take(SurfacePiece piece) {
    if (smooth_ == "none") {
      begin();
      writer_->add(piece.vertices, piece.triangles, piece.open_from);
      return;
    }
    append(mesh_, piece);
  }

  std::string file_;
  std::string grid_ = "auto";
  std::string level_;
  std::string smooth_ = "none";
  Taubin taubin_;
  bool overwrite_ = false;

  std::string name_;
  double leaves_ = 0;
  std::optional<GridSurface> surface_;
  std::unique_ptr<MeshWriter> writer_;
  Mesh mesh_;
};

}  // namespace

extern const OperatorInfo mesh_export;
const OperatorInfo mesh_export{
    "mesh-export", "The surface of a grid as a closed triangle mesh: STL, OBJ or PLY",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! mesh-export printed.stl",
    []() -> std::unique_ptr<Operator> { return std::make_unique<MeshExport>(); }};

}  // namespace vdbdither
