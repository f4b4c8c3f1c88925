#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "io/file/whole_file.h"
#include "io/image/texture.h"
#include "io/mesh/mesh_format.h"
#include "io/mesh/mesh_reader.h"
#include "io/profile/size_question.h"
#include "io/profile/target_lattice.h"
#include "ops/kernels/colour/colour_field.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/leaf/part_index.h"
#include "ops/kernels/mesh/enclosure.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/mesh_parts.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/solid_mesh.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using openvdb::Vec3d;

constexpr std::array<Choice<PartOrder>, 2> overlaps{
    {{PartOrder::first, "first", "To the first of the parts, in the order of the files"},
     {PartOrder::last, "last", "To the last of the parts"}}};

/// `surface` from triangle meshes.
class MeshToSdf : public Source {
 public:
  void declare(Options& options) override {
    options.positionals(
        "mesh", paths_,
        "Mesh files: " + meshFormatNames() +
            ". Several, and closed solids of an STL that have names, are printed as one part, and "
            "the grid 'part' tells them apart");
    target_.declare(options);
    placement_.declare(options, "the mesh");
    options.integer("refine-y", refine_y_, {1, 16}, "Voxels in place of one along y");
    options.parsed(
        "band", "N|LENGTH", [this](const std::string& text) { band_ = bandFrom(text); },
        [this] { return bandText(); },
        "Distance from the surface up to which distances are kept: a number of voxel diameters "
        "along the normal, or a length with its unit");
    options.flag("strict", strict_, "Refuses a mesh that needs repair");
    options.flag("normals", extras_.normals, "Adds the grid 'N' of exact unit outward normals");
    options.flag("closest", extras_.closest,
                 "Adds the grid 'closest' with the index of the nearest triangle");
    options.flag("colour", colour_,
                 "Adds the grid 'Cd' of the linear red, green and blue of the nearest point of the "
                 "surface and, where some of the surface is less than opaque, 'Alpha', the "
                 "opacity. Voxels from one diameter outside to --colour-depth inside have them");
    options.length("colour-depth", colour_depth_mm_, {0, 1000},
                   "How far below the surface voxels have a colour");
    options.belongTo("--colour", [this] { return colour_; });
    options.file("texture", texture_file_, "FILE",
                 "Image for the meshes that have texture coordinates but name no image of their "
                 "own; needs --colour");
    options.choice("overlap", part_order_, overlaps,
                   "To which part a voxel belongs that lies in several, and whose colour it has");
  }

  Schema plan() override {
    Schema schema;
    const Vec3d pitch_mm = targetPitchMm(target_, schema);
    held_band_mm_ = band_.minimumMm(pitch_mm);
    std::vector<Mesh> files = readFiles();
    const double tie_mm = placed(files, pitch_mm);
    questionSize(files, schema);
    std::shared_ptr<const SurfaceColours> colours;
    if (colour_) colours = std::make_shared<SurfaceColours>(files, pitch_mm);
    const SolidBodies solids = solidsOf(partsOfAll(std::move(files)));
    schema.lattice = latticeOfMesh(solids.whole.mesh, pitch_mm);  // a guess may be larger
    const Lattice& lattice = schema.lattice;
    for (const SolidMesh& part : solids.bodies)
      parts_.emplace_back(part.mesh, lattice, band_, DistanceExtras{.closest = colour_}, part.walls,
                          tie_mm);
    countLeaves(solids.whole.mesh, schema);
    DistanceExtras extras = extras_;
    extras.closest = extras.closest || colour_;
    field_ = std::make_unique<MeshDistance>(solids.whole.mesh, lattice, band_, extras,
                                            solids.whole.walls, tie_mm);
    if (colour_) {
      colours_.emplace(std::move(colours), lattice, colour_depth_mm_, tie_mm);
      colours_->add(solids.whole);
      for (const SolidMesh& part : solids.bodies) colours_->add(part);
    }
    schema.grids = run({lattice.box.min().z(), lattice.box.min().z()});
    return schema;
  }

  [[nodiscard]] double memoryBytes() const override {
    double bytes = field_->memoryBytes();
    for (const MeshDistance& part : parts_) bytes += part.memoryBytes();
    if (colours_) bytes += colours_->memoryBytes();
    return bytes;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    // Every leaf looks at the triangles near its nearest ones.
    const double per_leaf = cost::mesh2sdf_us +
                            cost::mesh2sdf_us_per_triangle * triangles_per_leaf_ +
                            (extras_.normals ? cost::mesh2sdf_normals_us : 0) +
                            (extras_.closest || colour_ ? cost::mesh2sdf_closest_us : 0) +
                            (colour_ ? cost::mesh2sdf_colour_us : 0);
    const double fields = parts_.empty() ? 1 : 2;
    return Work{.us_per_held_leaf = fields * per_leaf};
  }

  [[nodiscard]] Grids run(ZRange core) const override {
    std::vector<DistanceGrids> bands{field_->run(core)};
    Grids grids = gridsOf(bands.front());
    openvdb::Int32Grid::Ptr part_of_voxels;
    if (!parts_.empty()) {
      std::vector<openvdb::FloatGrid::ConstPtr> surfaces;
      for (const MeshDistance& part : parts_)
        surfaces.push_back(bands.emplace_back(part.run(core)).surface);
      part_of_voxels = partIndex(surfaces, part_order_);
      grids[part_grid] = part_of_voxels;
    }
    if (!colours_) return grids;
    const ColourGrids colours = colours_->run(bands, part_of_voxels.get(), core);
    grids[colour_grid] = colours.colour;
    if (colours.opacity) grids[opacity_grid] = colours.opacity;
    return grids;
  }

 private:
  /// Moves the meshes to where they are printed. Returns the length that their files leave open of
  /// a position, mm: most files hold coordinates in single precision.
  double placed(std::vector<Mesh>& meshes, const Vec3d& pitch_mm) const {
    constexpr double open = 0x1p-20;
    const MeshBounds bounds = boundsOf(meshes);
    double greatest = 0;
    for (int axis = 0; axis < 3; ++axis)
      greatest = std::max({greatest, std::abs(bounds.min[axis]), std::abs(bounds.max[axis])});
    MeshPlacement placement{placement_.rotate_degrees, placement_.mmPerUnit(),
                            placement_.fit_mm.value_or(0)};
    if (placement_.on_bed) placement.corner_mm = bedCornerMm({pitch_mm, Vec3d(0.0), {}});
    return open * greatest * place(meshes, placement);
  }

  static Band bandFrom(const std::string& text) {
    constexpr Range diameters = Range::above(0, 1000);
    constexpr Range lengths_mm = Range::above(0, 1000);
    if (text.find_first_not_of("0123456789.") == std::string::npos)
      return {parseNumber(text, diameters, "a number " + diameters.text() + ", or a length"), 0};
    return {0, parseLengthMm(text, lengths_mm)};
  }

  [[nodiscard]] std::string bandText() const {
    return band_.mm > 0 ? shortestText(band_.mm) + "mm" : shortestText(band_.diameters);
  }

  /// The solids that the meshes bound, with a warning for every repair and every guess.
  SolidBodies solidsOf(std::vector<Mesh> meshes) {
    SolidOptions options;
    options.before_guess = [this](const LooseTriangles& loose) {
      if (strict_)
        throw DataError(
            "the mesh needs repair, which --strict forbids: the triangles enclose nothing, " +
            loose.text());
      if (extras_.closest)
        throw DataError("the triangles enclose nothing, " + loose.text() +
                        ": the part is guessed, and no point of its surface has a triangle for "
                        "--closest to name; leave it out");
    };
    options.progress = [this](double fraction) { report().progress(fraction); };
    SolidBodies solids = solidBodies(std::move(meshes), options);
    for (const SurfaceGuess& guess : solids.whole.report.guesses) {
      report().warn("the triangles enclose nothing, " + guess.loose.text() +
                    ": the part is guessed, as where their winding number is above one half" +
                    (guess.turned ? ", seen from behind since they face inwards" : "") +
                    ", on cells down to " + shortestText(std::round(guess.cell_mm * 1e4) / 10) +
                    " um");
      report().count("winding_cell_mm", guess.cell_mm);
    }
    if (solids.whole.mesh.triangles.empty())
      throw DataError("the mesh has no surface: all its triangles are degenerate or cancel");
    reportRepairs(solids.whole.report);
    return solids;
  }

  void reportRepairs(const SolidReport& solid) {
    const MeshRepairs& repairs = solid.repairs;
    const std::vector<std::string> lines = repairs.lines();
    if (strict_ && !lines.empty())
      throw DataError("the mesh needs repair, which --strict forbids: " + lines.front() +
                      (lines.size() > 1 ? " and more" : ""));
    for (const std::string& line : lines) report().warn(line);
    LooseTriangles loose;
    for (const SurfaceGuess& guess : solid.guesses) {
      loose.triangles += guess.loose.triangles;
      loose.open_sides += guess.loose.open_sides;
    }
    report().count("welded_vertices", static_cast<double>(repairs.welded_vertices));
    report().count("degenerate_triangles", static_cast<double>(repairs.degenerate_triangles));
    report().count("duplicate_triangles", static_cast<double>(repairs.duplicate_triangles));
    report().count("flipped_triangles", static_cast<double>(repairs.flipped_triangles));
    report().count("turned_parts", static_cast<double>(repairs.turned_parts));
    report().count("boundary_edges",
                   static_cast<double>(repairs.boundary_edges + loose.open_sides));
    report().count("closed_holes", static_cast<double>(repairs.closed_holes));
    report().count("loose_triangles", static_cast<double>(loose.triangles));
    report().count("swallowed_triangles", static_cast<double>(repairs.swallowed_triangles));
    report().count("cut_triangles", static_cast<double>(repairs.cut_triangles));
  }

  std::vector<Mesh> readFiles() {
    std::vector<Mesh> files;
    for (const std::string& path : paths_)
      files.push_back(readMesh(
          path, [this](const std::string& text) { report().warn(text); },
          colour_ ? MeshColours::read : MeshColours::skip));
    for (std::size_t n = 0; n < files.size(); ++n) checkUnit(files[n], paths_[n], placement_);
    if (!texture_file_.empty()) addTexture(files);
    const auto has_colours = [](const Mesh& mesh) {
      return mesh.appearance && mesh.appearance->hasColours();
    };
    if (colour_ && std::none_of(files.begin(), files.end(), has_colours))
      report().warn("--colour: no mesh has colours; all voxels become white");
    return files;
  }

  void addTexture(std::vector<Mesh>& files) const {
    if (!colour_) throw UsageError("--texture needs --colour");
    const std::string shown = inQuotes(texture_file_);
    const std::vector<std::uint8_t> bytes = readWholeFile(texture_file_, shown, most_texture_bytes);
    const Texture texture =
        decodeTexture({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, shown);
    bool used = false;
    for (Mesh& file : files) {
      if (!file.appearance || file.appearance->coordinates.empty()) continue;
      used = true;
      file.appearance = std::make_shared<Appearance>(textured(*file.appearance, texture));
    }
    if (!used) throw UsageError("--texture: no mesh has texture coordinates; leave it out");
  }

  std::vector<Mesh> partsOfAll(std::vector<Mesh> files) const {
    std::vector<Mesh> parts;
    for (std::size_t n = 0; n < files.size(); ++n) {
      files[n].appearance.reset();
      for (Mesh& part : partsOf(std::move(files[n]))) {
        const std::string flat = whyFlat(part);
        if (!flat.empty())
          throw DataError(inQuotes(paths_[n]) + ": bounds no volume: " + flat +
                          "; give the surface a thickness in a mesh editor first");
        parts.push_back(std::move(part));
      }
    }
    return parts;
  }

  /// Warns of a part that is hardly meant to be as large or as small as it is.
  void questionSize(std::span<const Mesh> meshes, const Schema& schema) const {
    const MeshBounds bounds = boundsOf(meshes);
    const bool is_known =
        placement_.fit_mm || std::any_of(meshes.begin(), meshes.end(),
                                         [](const Mesh& mesh) { return mesh.states_unit; });
    if (const auto question = sizeQuestion(bounds.max - bounds.min, placement_, is_known, schema,
                                           "turn it with --rotate, or see --unit and --fit"))
      report().warn(*question);
  }

  /// The voxels within a voxel diagonal, or the band, of the mesh's bounding box.
  [[nodiscard]] Lattice latticeOfMesh(const Mesh& mesh, const Vec3d& pitch_mm) const {
    const MeshBounds bounds = boundsOf(mesh);
    const double margin_mm = std::max(pitch_mm.length(), band_.maximumMm(pitch_mm));
    return latticeAround(bounds.min, bounds.max, margin_mm, pitch_mm, refine_y_);
  }

  /// Every leaf that the band meets, spread by the area of the surface over the rows that it
  /// crosses, and how many of them the surface itself does.
  void countLeaves(const Mesh& mesh, Schema& schema) {
    const Lattice& lattice = schema.lattice;
    const Vec3d leaf_mm = lattice.pitch_mm * double{leaf_layers};
    const double low = lattice.layers().begin * lattice.pitch_mm.z();
    const double band_mm = band_.maximumMm(lattice.pitch_mm);
    const MeshBounds bounds = boundsOf(mesh);
    const Vec3d size_mm = bounds.max - bounds.min;
    // Nothing lies deeper than half of the thickness of the part.
    const double depth_mm =
        std::min(colour_depth_mm_, 0.5 * std::min({size_mm.x(), size_mm.y(), size_mm.z()}));
    // On each side of the surface, on average.
    const double held_mm =
        colour_ ? std::max(band_mm, 0.5 * (depth_mm + lattice.diagonalMm())) : band_mm;
    const int top_row = lattice.layers().size() / leaf_layers + 1;
    std::vector<double> rows(static_cast<std::size_t>(top_row) + 1, 0.0);
    const auto rowAt = [&](double z_mm) {
      return static_cast<std::size_t>(
          std::clamp((z_mm - low) / leaf_mm.z(), 0.0, static_cast<double>(top_row)));
    };
    // A wide band reaches the middle of the part, and grows around it as a ball does.
    const double area_mm2 = areaOf(mesh);
    const double inner_share =
        std::min(1.0, std::abs(volumeOf(mesh)) / std::max(held_mm * area_mm2, 1e-300));
    const double corners_mm3 =
        std::numbers::pi * held_mm * held_mm * (size_mm.sum() + 4 * held_mm / 3);
    const auto spread = [&](double leaves, double z_low, double z_high) {
      const std::size_t first = rowAt(z_low - band_mm);
      const std::size_t last = rowAt(z_high + band_mm);
      for (std::size_t row = first; row <= last; ++row)
        rows[row] += leaves / static_cast<double>(last - first + 1);
    };
    double across_mm3 = 0;  // swept by leaves that touch the surface
    const auto leavesWithin = [&](double distance_mm, double area, double across) {
      return ((1 + inner_share) * distance_mm * area + across) / leaf_mm.product();
    };
    for (const Mesh::Triangle& t : mesh.triangles) {
      const Vec3d& a = mesh.vertices[t[0]];
      const Vec3d facing = 0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
      const double area = facing.length();
      // The leaf's own extent along the normal.
      const double across = std::abs(facing.x()) * leaf_mm.x() +
                            std::abs(facing.y()) * leaf_mm.y() + std::abs(facing.z()) * leaf_mm.z();
      across_mm3 += across;
      const auto [z_low, z_high] =
          std::minmax({mesh.vertices[t[0]].z(), mesh.vertices[t[1]].z(), mesh.vertices[t[2]].z()});
      spread(leavesWithin(held_mm, area, across), z_low, z_high);
    }
    const double corner_leaves = corners_mm3 / leaf_mm.product();
    // The middle of a ball is half as large again as its mean.
    spread(1.5 * corner_leaves, bounds.min.z(), bounds.max.z());
    triangles_per_leaf_ =
        static_cast<double>(mesh.triangles.size()) / leavesWithin(0, area_mm2, across_mm3);
    const double diagonal_mm = lattice.pitch_mm.length();
    schema.footprint = {*std::max_element(rows.begin(), rows.end()),
                        leavesWithin(held_mm, area_mm2, across_mm3) + corner_leaves,
                        leavesWithin(std::min(band_mm, diagonal_mm), area_mm2, across_mm3)};
  }

  [[nodiscard]] Grids gridsOf(const DistanceGrids& made) const {
    setHeldBandMm(*made.surface, held_band_mm_);
    Grids grids{{surface_grid, made.surface}};
    if (made.normals) grids[normal_grid] = made.normals;
    if (extras_.closest) grids[closest_grid] = made.closest;
    return grids;
  }

  std::vector<std::string> paths_;
  LatticeOptions target_;
  MeshPlacementOptions placement_;
  bool strict_ = false;
  int refine_y_ = 1;
  DistanceExtras extras_;
  bool colour_ = false;
  double colour_depth_mm_ = 1;
  std::string texture_file_;
  PartOrder part_order_ = PartOrder::first;

  Band band_;
  double held_band_mm_ = 0;
  std::unique_ptr<MeshDistance> field_;
  double triangles_per_leaf_ = 0;    ///< of those that the surface itself meets
  std::vector<MeshDistance> parts_;  ///< of every file, where there are several
  std::optional<ColourField> colours_;
};

}  // namespace

extern const OperatorInfo mesh2sdf;
const OperatorInfo mesh2sdf{
    "mesh2sdf", "Signed distance in mm from triangle meshes, on the printer's lattice",
    "mesh2sdf part.stl --printer mimaki-3duj-553 -o surface.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<MeshToSdf>(); }};

}  // namespace vdbdither
