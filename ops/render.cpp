#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/file/staged_output.h"
#include "io/image/exr.h"
#include "io/image/picture.h"
#include "io/image/png_runs.h"
#include "io/mesh/mesh_reader.h"
#include "ops/kernels/contour/grid_surface.h"
#include "ops/kernels/contour/voxel_faces.h"
#include "ops/kernels/picture/ray_picture.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

/// What a horizontal open place becomes where the user does not say: bright, but with room for what
/// faces the light more.
double brightnessOf(Look look) { return look == Look::staircase ? 0.2 : 0.6; }

std::uint8_t codedSrgb(double linear) {
  linear = std::clamp(linear, 0.0, 1.0);
  const double coded =
      linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * coded));
}

class Render : public Sink {
 public:
  void declare(Options& options) override {
    options.positionals("files", files_,
                        "The .png or .exr to write; before it, a mesh to draw in place of what "
                        "comes down a chain: STL, OBJ or PLY");
    options.text("grid", grid_, "NAME",
                 "Whose surface comes down the chain: of solid its voxels, of printed, displaced "
                 "and surface a level; auto takes the furthest down the chain");
    options.flag("blocks", blocks_,
                 "Draws the voxels that are inside as blocks, not their surface");
    options.choice("look", look_, {look_names.begin(), look_names.end()},
                   "The light: a lamp above, a large light above, a sky all around, or a lamp so "
                   "low, from the left, that every step shows");
    options.number("azimuth", camera_.azimuth_degrees, -360, 360,
                   "From where it is seen: 0 from the front (-y), 90 from the right, in degrees");
    options.number("elevation", camera_.elevation_degrees, -90, 90,
                   "From how high: 90 from above, in degrees");
    options.choice("projection", projection_, {"perspective", "orthographic"},
                   "As from the eye's distance, or from infinitely far");
    options.length("distance", distance_mm_, "From the eye to the middle of the object");
    options.length("pixel", camera_.pixel_mm,
                   "The side of a pixel at the middle of the object; by default what 50 cycles per "
                   "degree need from 50 cm");
    options.text("frame", frame_file_, "FILE",
                 "Frames the picture as that of this mesh, so that pictures of its prints can be "
                 "compared with it pixel by pixel");
    options.integer("margin", margin_, 0, 1000, "Pixels left free around it");
    options.integer("samples", samples_, 1, 65536, "Rays for each pixel");
    options.integer("seed", seed_, 0, 1 << 30, "Of the pattern of the rays");
    options.number("brightness", brightness_, 0, 100,
                   "What a horizontal open place becomes, linear, where 1 is white; 0 takes 0.6, "
                   "and 0.2 where the light is low");
    options.flag("overwrite", overwrite_, "Replace the picture if it is there");
  }

  [[nodiscard]] bool standsAlone() const override { return files_.size() == 2; }

  void plan(const Schema& in) override {
    if (files_.size() > 2)
      throw UsageError("name the picture to write, and before it at most one mesh to draw");
    const std::string& picture = files_.back();
    if (!picture.ends_with(".png") && !picture.ends_with(".exr"))
      throw UsageError("'" + picture + "' is no .png or .exr");
    if (!(camera_.pixel_mm > 0)) throw UsageError("--pixel: must be more than 0 mm");
    if (projection_ == "perspective") {
      if (!(distance_mm_ > 0)) throw UsageError("--distance: must be more than 0 mm");
      camera_.distance_mm = distance_mm_;
    }
    StagedOutput::check(picture, StagedOutput::Kind::file, overwrite_);
    if (!frame_file_.empty()) frame(camera_, meshOf(frame_file_), margin_);
    if (standsAlone()) {
      if (blocks_) throw UsageError("--blocks: a mesh has no voxels");
      return;
    }
    std::vector<std::string> there;
    for (const auto& [name, grid] : in.grids) there.push_back(name);
    name_ = chosenSurfaceGrid(there, grid_);
    lattice_ = in.lattice;
    surface_.emplace(in.lattice, *in.grids.at(name_), std::nullopt);
    if (blocks_) faces_.emplace(in.lattice);
  }

  [[nodiscard]] bool isBarrier() const override { return true; }

  [[nodiscard]] std::optional<Work> work() const override {
    const std::optional<double> pixels = drawnPixels();
    if (!pixels) return std::nullopt;
    return Work{.us_per_leaf = 1.4 * GridSurface::vertices_per_leaf,
                .seconds = 1.1e-6 * *pixels * samples_};
  }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    return std::vector<std::string>{name_};
  }

  void write(const Slab& in) override {
    const GridConstPtr& grid = in.grids.at(name_);
    if (!faces_) return append(mesh_, surface_->add(grid, in.core));
    int z = in.core.begin;
    for (BitLayer& layer : surface_->insideOf(grid, in.core))
      append(mesh_, faces_->add(std::move(layer), z++));
  }

  void finish() override {
    if (standsAlone()) {
      mesh_ = meshOf(files_.front());
    } else {
      append(mesh_, faces_ ? faces_->finish() : surface_->finish());
    }
    if (mesh_.triangles.empty())
      throw DataError("grid '" + name_ + "' has no surface: nothing of it is inside");
    if (frame_file_.empty()) frame(camera_, mesh_, margin_);
    report().count("triangles", static_cast<double>(mesh_.triangles.size()));
    const RayScene scene(mesh_);
    mesh_ = {};
    const auto look = static_cast<Look>(std::find(look_names.begin(), look_names.end(), look_) -
                                        look_names.begin());
    const RayPicture picture =
        scene.picture(camera_, look, samples_, static_cast<std::uint32_t>(seed_),
                      [this](double fraction) { report().progress(fraction); });
    report().count("width", picture.width);
    report().count("height", picture.height);
    const double brightness = brightness_ > 0 ? brightness_ : brightnessOf(look);
    const std::vector<std::uint8_t> bytes =
        files_.back().ends_with(".exr") ? exrOf(picture, brightness) : pngOf(picture, brightness);
    StagedOutput staged(files_.back(), StagedOutput::Kind::file);
    writeFile(staged.path(), bytes, files_.back());
    staged.commit();
  }

 private:
  [[nodiscard]] Mesh meshOf(const std::string& file) const {
    return readMesh(file, [this](const std::string& text) { report().warn(text); });
  }

  /// About how many pixels show something; nothing where the picture may be refused.
  [[nodiscard]] std::optional<double> drawnPixels() const {
    const auto pixels = [](const Camera& camera) { return 1.0 * camera.width * camera.height; };
    if (!frame_file_.empty()) return 0.55 * pixels(camera_);
    Mesh corners;
    for (int corner = 0; corner < 8; ++corner) {
      openvdb::Vec3d at = lattice_.position(lattice_.box.min());
      for (int axis = 0; axis < 3; ++axis) {
        if ((corner >> axis & 1) != 0) at[axis] = lattice_.position(lattice_.box.max())[axis];
      }
      corners.vertices.push_back(at);
    }
    Camera camera = camera_;
    try {
      frame(camera, corners, 0);
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
      const std::uint8_t grey = codedSrgb(brightness * picture.light[i]);
      const auto cover = static_cast<std::uint8_t>(std::lround(255 * picture.cover[i]));
      coded.pixels.push_back(rgba(grey, grey, grey, cover));
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
            values[x] = channel == 0
                            ? cover
                            : static_cast<float>(brightness * picture.light[begin + x]) * cover;
          }
        });
  }

  std::vector<std::string> files_;
  std::string grid_ = "auto";
  bool blocks_ = false;
  std::string look_ = "area";
  Camera camera_{.azimuth_degrees = 30, .elevation_degrees = 35, .pixel_mm = 0.0873};
  std::string projection_ = "perspective";
  double distance_mm_ = 500;
  std::string frame_file_;
  int margin_ = 8;
  int samples_ = 64;
  int seed_ = 0;
  double brightness_ = 0;
  bool overwrite_ = false;

  std::string name_;
  Lattice lattice_;
  std::optional<GridSurface> surface_;
  std::optional<VoxelFaces> faces_;
  Mesh mesh_;
};

}  // namespace

extern const OperatorInfo render;
const OperatorInfo render{
    "render", "A picture of a surface, printed, simulated or meant, as the eye would see it",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! simulate ! render print.png --frame "
    "part.stl",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Render>(); }};

}  // namespace vdbdither
