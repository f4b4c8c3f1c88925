#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "io/file/staged_output.h"
#include "io/image/exr.h"
#include "io/image/picture.h"
#include "io/image/png_spans.h"
#include "io/image/srgb.h"
#include "io/mesh/mesh_format.h"
#include "io/mesh/mesh_reader.h"
#include "ops/kernels/colour/nearest_colour.h"
#include "ops/kernels/colour/surface_colours.h"
#include "ops/kernels/contour/grid_surface.h"
#include "ops/kernels/contour/voxel_faces.h"
#include "ops/kernels/picture/ray_picture.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

constexpr std::array<Choice<Look>, 4> looks{
    {{Look::area, "area", "A lamp of 30 cm, 1 m above, and some light from all around"},
     {Look::large, "large", "A light of 2 m, 1 m above"},
     {Look::sky, "sky", "The same light from everywhere above the horizon"},
     {Look::staircase, "staircase",
      "A lamp 10 degrees high on the left, so that every step casts a shadow"}}};

enum class Tint { automatic, none };
constexpr std::array<Choice<Tint>, 2> tints{
    {{Tint::automatic, "auto", "Those of the grid Cd, or of the mesh, if it has any"},
     {Tint::none, "none", "None: the surface is white"}}};

enum class Projection { perspective, orthographic };
constexpr std::array<Choice<Projection>, 2> projections{
    {{Projection::perspective, "perspective", "As seen from --distance"},
     {Projection::orthographic, "orthographic", "As seen from infinitely far away"}}};

/// What a horizontal open place becomes where the user does not say: bright, but with room for what
/// faces the light more.
double brightnessOf(Look look) { return look == Look::staircase ? 0.2 : 0.6; }

Mesh readMeshOf(const std::string& file, Reporter& reporter,
                MeshColours colours = MeshColours::skip) {
  return readMesh(
      file, [&](const std::string& text) { reporter.warn(text); }, colours);
}

/// Draws a surface, wherever it comes from, and writes the picture.
class SurfacePicture {
 public:
  void declare(Options& options) {
    options.positional("picture", file_, "The .png or .exr to write");
    surface_grid_.declare(options);
    options.flag("blocks", blocks_, "Draws the voxels that are inside as blocks");
    options.choice("look", look_, looks, "Light");
    options.choice("colours", tint_, tints, "Colours of the surface");
    options.number("azimuth", camera_.azimuth_degrees, {-360, 360},
                   "Direction of the eye in degrees: 0 is the front (-y), 90 the right");
    options.number("elevation", camera_.elevation_degrees, {-90, 90},
                   "Height of the eye in degrees: 90 is above");
    options.choice("projection", projection_, projections, "Projection");
    view_.declare(options);
    options.file("frame", frame_file_, "FILE",
                 "Frames the picture as that of this mesh, so that pictures of its prints can be "
                 "compared with it pixel by pixel");
    options.integer("margin", margin_, {0, 1000}, "Pixels left free around the object");
    options.integer("samples", samples_, {1, 65536}, "Rays for each pixel");
    options.integer("seed", seed_, {0, 1 << 30}, "Seed of the pattern of the rays");
    options.number("brightness", brightness_, Range::above(0, 100),
                   "Linear brightness of an open horizontal place, where 1 is white",
                   {"auto", "0.6, and 0.2 with --look staircase"});
    overwrite_.declare(options, "the picture");
  }

  /// Makes every check that does not need the surface.
  void begin(Reporter& reporter) {
    if (!file_.ends_with(".png") && !file_.ends_with(".exr"))
      throw UsageError("'" + file_ + "' must end in .png or .exr");
    camera_.pixel_mm = view_.pixel_mm;
    camera_.distance_mm = projection_ == Projection::perspective ? view_.distance_mm : 0;
    StagedOutput::check(file_, StagedOutput::Kind::file, overwrite_.overwrite);
    if (!frame_file_.empty()) fit(camera_, readMeshOf(frame_file_, reporter), margin_);
  }

  [[nodiscard]] const SurfaceGridOption& surfaceGrid() const { return surface_grid_; }
  [[nodiscard]] bool drawsBlocks() const { return blocks_; }
  [[nodiscard]] bool drawsColours() const { return tint_ == Tint::automatic; }

  [[nodiscard]] std::optional<Work> work(const Lattice& lattice) const {
    const std::optional<double> pixels = drawnPixels(lattice);
    if (!pixels) return std::nullopt;
    return Work{.us_per_surface_leaf = cost::render_us * GridSurface::vertices_per_leaf,
                .seconds = 1e-6 * cost::render_us_per_ray * *pixels * samples_};
  }

  /// Draws the picture and completes its file.
  void finish(Mesh mesh, const SurfaceTint& tint, Reporter& reporter) {
    if (frame_file_.empty()) fit(camera_, mesh, margin_);
    reporter.count("triangles", static_cast<double>(mesh.triangles.size()));
    const RayScene scene(mesh);
    mesh = {};
    const RayPicture picture = scene.picture(
        camera_, look_, samples_, static_cast<std::uint32_t>(seed_),
        [&](double fraction) { reporter.progress(fraction); }, tint);
    reporter.count("width", picture.width);
    reporter.count("height", picture.height);
    const double brightness = brightness_.value_or(brightnessOf(look_));
    const std::vector<std::uint8_t> bytes =
        file_.ends_with(".exr") ? exrOf(picture, brightness) : pngOf(picture, brightness);
    output_.emplace(file_, StagedOutput::Kind::file);
    writeFile(output_->path(), bytes, file_);
    output_->complete();
  }

  /// Gives the file that `finish` completed its name.
  void publish() {
    output_->commit();
    output_.reset();
  }

 private:
  /// About how many pixels show something; nothing where the picture may be refused.
  [[nodiscard]] std::optional<double> drawnPixels(const Lattice& lattice) const {
    const auto pixels = [](const Camera& camera) { return 1.0 * camera.width * camera.height; };
    if (!frame_file_.empty()) return 0.55 * pixels(camera_);
    Mesh corners;
    for (int corner = 0; corner < 8; ++corner) {
      openvdb::Vec3d at = lattice.position(lattice.box.min());
      for (int axis = 0; axis < 3; ++axis) {
        if ((corner >> axis & 1) != 0) at[axis] = lattice.position(lattice.box.max())[axis];
      }
      corners.vertices.push_back(at);
    }
    Camera camera = camera_;
    try {
      fit(camera, corners, 0);
    } catch (const DataError&) {
      return std::nullopt;
    }
    return 0.35 * pixels(camera);
  }

  static std::vector<std::uint8_t> pngOf(const RayPicture& picture, double brightness) {
    Picture coded{
        static_cast<std::uint32_t>(picture.width), static_cast<std::uint32_t>(picture.height), {}};
    coded.pixels.reserve(picture.light.size());
    for (std::size_t i = 0; i < picture.light.size(); ++i) {
      const openvdb::Vec3d light = brightness * openvdb::Vec3d(picture.light[i]);
      const auto cover = static_cast<std::uint8_t>(std::lround(255 * picture.cover[i]));
      coded.pixels.push_back(
          rgba(srgbByteOf(light.x()), srgbByteOf(light.y()), srgbByteOf(light.z()), cover));
    }
    return encodePicture(coded);
  }

  static std::vector<std::uint8_t> exrOf(const RayPicture& picture, double brightness) {
    const std::vector<ExrChannel> channels{{"A"}, {"B"}, {"G"}, {"R"}};
    return encodeExr(
        static_cast<std::uint32_t>(picture.width), static_cast<std::uint32_t>(picture.height), {},
        channels, [&](std::uint32_t row, std::size_t channel, std::span<float> values) {
          const std::size_t begin = std::size_t{row} * static_cast<std::size_t>(picture.width);
          for (std::size_t x = 0; x < values.size(); ++x) {
            // An OpenEXR's colours are those of the object times what it covers.
            const float cover = picture.cover[begin + x];
            values[x] = cover;
            if (channel > 0) {
              const int colour = 3 - static_cast<int>(channel);  // blue, green, red
              values[x] *= static_cast<float>(brightness * picture.light[begin + x][colour]);
            }
          }
        });
  }

  std::string file_;
  SurfaceGridOption surface_grid_;
  bool blocks_ = false;
  Look look_ = Look::area;
  Tint tint_ = Tint::automatic;
  Camera camera_{.azimuth_degrees = 30, .elevation_degrees = 35};
  Projection projection_ = Projection::perspective;
  ViewOptions view_;
  std::string frame_file_;
  int margin_ = 8;
  int samples_ = 64;
  int seed_ = 0;
  std::optional<double> brightness_;
  std::optional<StagedOutput> output_;
  OverwriteOption overwrite_;
};

/// The surface of a grid, or its voxels.
class Render : public Sink {
 public:
  void declare(Options& options) override { picture_.declare(options); }

  void plan(const Schema& in) override {
    std::vector<std::string> there;
    for (const auto& [name, grid] : in.grids) there.push_back(name);
    name_ = chosenSurfaceGrid(there, picture_.surfaceGrid().grid);
    lattice_ = in.lattice;
    surface_.emplace(in.lattice, *in.grids.at(name_), std::nullopt);
    if (picture_.drawsBlocks()) faces_.emplace(in.lattice);
    if (picture_.drawsColours() && in.grids.contains(colour_grid)) {
      findGrid<openvdb::Vec3SGrid>(in.grids, colour_grid);
      colours_.emplace(in.lattice);
    }
    picture_.begin(report());
  }

  [[nodiscard]] bool isBarrier() const override { return true; }

  [[nodiscard]] std::optional<Work> work() const override { return picture_.work(lattice_); }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    if (colours_) return std::vector<std::string>{name_, colour_grid};
    return std::vector<std::string>{name_};
  }

  void write(const Slab& in) override {
    const GridConstPtr& grid = in.grids.at(name_);
    if (colours_) colours_->add(findGrid<openvdb::Vec3SGrid>(in.grids, colour_grid));
    if (!faces_) return take(surface_->add(grid, in.core));
    int z = in.core.begin;
    for (BitLayer& layer : surface_->insideOf(grid, in.core))
      take(faces_->add(std::move(layer), z++));
  }

  void finish() override {
    take(faces_ ? faces_->finish() : surface_->finish());
    if (mesh_.triangles.empty())
      throw DataError("grid '" + name_ + "' has no surface: nothing of it is inside");
    SurfaceTint tint;
    if (colours_)
      tint = [this](std::uint32_t triangle, const openvdb::Vec3d&) { return tints_[triangle]; };
    picture_.finish(std::move(mesh_), tint, report());
  }

  void publish() override { picture_.publish(); }

 private:
  /// Adds triangles, which have the colour of the voxel nearest to their middle; white where there
  /// is none.
  void take(const SurfacePiece& piece) {
    const std::size_t first = mesh_.triangles.size();
    append(mesh_, piece);
    if (!colours_) return;
    tints_.resize(mesh_.triangles.size());
    tbb::parallel_for(first, mesh_.triangles.size(), [this](std::size_t t) {
      const Mesh::Triangle& corners = mesh_.triangles[t];
      const openvdb::Vec3d middle =
          (mesh_.vertices[corners[0]] + mesh_.vertices[corners[1]] + mesh_.vertices[corners[2]]) /
          3.0;
      tints_[t] = colours_->at(middle).value_or(openvdb::Vec3f(1, 1, 1));
    });
  }

  SurfacePicture picture_;
  std::string name_;
  Lattice lattice_;
  std::optional<GridSurface> surface_;
  std::optional<VoxelFaces> faces_;
  std::optional<NearestColour> colours_;
  Mesh mesh_;
  std::vector<openvdb::Vec3f> tints_;  ///< by triangle, where there are colours
};

/// The surface of a mesh file.
class RenderMesh : public Tool {
 public:
  static bool takes(const std::string& file) { return !file.ends_with(".vdb"); }

  void declare(Options& options) override {
    options.positional("mesh", file_, "Mesh to draw if there is no chain: " + meshFormatNames(),
                       false);
    picture_.declare(options);
  }

  void run() override {
    picture_.begin(report());
    if (picture_.drawsBlocks()) throw UsageError("--blocks: a mesh has no voxels");
    Mesh mesh = readMeshOf(file_, report(),
                           picture_.drawsColours() ? MeshColours::read : MeshColours::skip);
    SurfaceTint tint;
    if (mesh.appearance) {
      const auto colours =
          std::make_shared<SurfaceColours>(std::span(&mesh, 1), openvdb::Vec3d(0.0));
      tint = [colours](std::uint32_t triangle, const openvdb::Vec3d& p) {
        const openvdb::Vec4f colour = colours->at(triangle, p);
        return openvdb::Vec3f(colour.x(), colour.y(), colour.z());
      };
    }
    picture_.finish(std::move(mesh), tint, report());
    picture_.publish();
  }

 private:
  std::string file_;
  SurfacePicture picture_;
};

}  // namespace

extern const OperatorInfo render;
const OperatorInfo render{
    .name = "render",
    .summary = "A picture of a surface, printed, simulated or meant, as the eye would see it",
    .example =
        "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! simulate ! render print.png "
        "--frame part.stl",
    .make = []() -> std::unique_ptr<Operator> { return std::make_unique<Render>(); },
    .on_file = {.takes = RenderMesh::takes,
                .make = []() -> std::unique_ptr<Tool> { return std::make_unique<RenderMesh>(); }}};

}  // namespace vdbdither
