#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <tbb/parallel_for.h>

#include "io/image/srgb.h"
#include "io/mesh/mesh_format.h"
#include "io/mesh/mesh_writer.h"
#include "ops/kernels/colour/nearest_colour.h"
#include "ops/kernels/contour/grid_surface.h"
#include "ops/kernels/mesh/taubin.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using Rgb = std::array<std::uint8_t, 3>;

std::string compressedEndings() {
  return meshEndings([](const MeshFormat& format) { return format.takes_draco; });
}

class MeshExport : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("file", file_, "Mesh to write, its coordinates floats: " + meshEndings());
    surface_grid_.declare(options);
    options.length("level", level_mm_, {-1000, 1000},
                   "Level of the surface, in place of 0 in a distance (mm) or 0.5 in a share of "
                   "material");
    smoothing_.declare(options);
    options.length("draco", draco_mm_, {0, 10},
                   "Compresses " + compressedEndings() +
                       " by Draco: coordinates are off by up to this length, and of 0 exact",
                   {"none", "Exact coordinates, and .glb without Draco"});
    overwrite_.declare(options, "the file");
  }

  void plan(const Schema& in) override {
    std::vector<std::string> there;
    for (const auto& [name, grid] : in.grids) there.push_back(name);
    name_ = chosenSurfaceGrid(there, surface_grid_.grid);
    surface_.emplace(in.lattice, *in.grids.at(name_), level_mm_);
    MeshWriter::check(file_, overwrite_.overwrite);
    if (draco_mm_ && !meshFormatNamedBy(file_)->takes_draco)
      throw UsageError("--draco: '" + file_ + "' is not compressed; name a " + compressedEndings() +
                       " file, or leave it out");
    leaves_ = in.footprint.at_surface;
    if (in.grids.contains(colour_grid) && meshFormatNamedBy(file_)->holds_extras) {
      findGrid<openvdb::Vec3SGrid>(in.grids, colour_grid);
      nearest_.emplace(in.lattice);
    }
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
    if (nearest_) return std::vector<std::string>{name_, colour_grid};
    return std::vector<std::string>{name_};
  }

  [[nodiscard]] bool isBarrier() const override { return smooths(); }

  void write(const Slab& in) override {
    if (nearest_) nearest_->add(findGrid<openvdb::Vec3SGrid>(in.grids, colour_grid));
    take(surface_->add(in.grids.at(name_), in.core));
  }

  void finish() override {
    take(surface_->finish());
    if (smooths()) {
      smooth(mesh_, taubin(), [this](double fraction) { report().progress(fraction); });
      begin();
      writer_->add(mesh_.vertices, mesh_.triangles, 0, colours_);
    }
    if (writer_->triangles() == 0)
      throw DataError("grid '" + name_ + "' has no surface: nothing of it is inside");
    report().count("vertices", static_cast<double>(writer_->vertices()));
    report().count("triangles", static_cast<double>(writer_->triangles()));
    writer_->complete();
  }

  void publish() override {
    writer_->commit();
    writer_.reset();
  }

 private:
  [[nodiscard]] bool smooths() const { return smoothing_.smoothing != Smoothing::none; }
  [[nodiscard]] Taubin taubin() const { return {.iterations = smoothing_.iterations}; }

  void begin() {
    if (writer_) return;
    MeshEncoding how{.extras = {}, .draco_mm = draco_mm_};
    how.extras.colour = nearest_.has_value();
    writer_ = std::make_unique<MeshWriter>(file_, how);
  }

  void take(const SurfacePiece& piece) {
    const std::vector<Rgb> colours = coloursOf(piece);
    if (!smooths()) {
      begin();
      writer_->add(piece.vertices, piece.triangles, piece.open_from, colours);
      return;
    }
    append(mesh_, piece);
    colours_.insert(colours_.end(), colours.begin(), colours.end());
  }

  /// The colours of the vertices: that of the voxel nearest to each, white where there is none.
  [[nodiscard]] std::vector<Rgb> coloursOf(const SurfacePiece& piece) const {
    if (!nearest_) return {};
    std::vector<Rgb> colours(piece.vertices.size());
    tbb::parallel_for(std::size_t{0}, colours.size(), [&](std::size_t n) {
      const openvdb::Vec3f colour =
          nearest_->at(piece.vertices[n]).value_or(openvdb::Vec3f(1, 1, 1));
      colours[n] = {srgbByteOf(colour.x()), srgbByteOf(colour.y()), srgbByteOf(colour.z())};
    });
    return colours;
  }

  std::string file_;
  SurfaceGridOption surface_grid_;
  std::optional<double> level_mm_;
  std::optional<double> draco_mm_;
  SmoothingOptions smoothing_;
  OverwriteOption overwrite_;

  std::string name_;
  double leaves_ = 0;
  std::optional<GridSurface> surface_;
  std::unique_ptr<MeshWriter> writer_;
  std::optional<NearestColour> nearest_;
  Mesh mesh_;
  std::vector<Rgb> colours_;  ///< of the vertices of `mesh_`
};

}  // namespace

extern const OperatorInfo mesh_export;
const OperatorInfo mesh_export{
    "mesh-export", "The surface of a grid as a closed triangle mesh",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! mesh-export printed.stl",
    []() -> std::unique_ptr<Operator> { return std::make_unique<MeshExport>(); }};

}  // namespace vdbdither
