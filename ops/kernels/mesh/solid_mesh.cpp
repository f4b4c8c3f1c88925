#include "ops/kernels/mesh/solid_mesh.h"

#include <cstddef>
#include <utility>

#include "ops/kernels/mesh/enclosure.h"
#include "ops/kernels/mesh/winding_surface.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

SolidMesh guessed(DerivedMesh given, const LooseTriangles& open, const SolidOptions& options) {
  SolidMesh solid;
  solid.report.is_guess = true;
  const DerivedMesh loose = withoutDuplicates(std::move(given), solid.report.repairs);
  SurfaceGuess guess{open};
  guess.loose.triangles = loose.mesh.triangles.size();
  if (options.before_guess) options.before_guess(guess.loose);
  WindingSurface surface = windingSurface(loose.mesh, options.progress);
  if (surface.mesh.triangles.empty())
    throw DataError("the triangles enclose nothing: " + open.text() + ", and " +
                    (surface.is_given_up ? "they are too tangled to guess the part"
                                         : "their winding number is above one half nowhere") +
                    "; join them in a mesh editor first");
  guess.cell_mm = surface.cell_mm;
  guess.turned = surface.turned;
  solid.report.guesses.push_back(guess);
  solid.mesh = std::move(surface.mesh);
  solid.source = std::move(surface.source);
  for (std::uint32_t& source : solid.source)
    if (source != no_source) source = loose.source[source];
  return solid;
}

/// `triangles` made to bound a solid, without a look at its walls.
SolidMesh closed(DerivedMesh triangles, const SolidOptions& options) {
  // A guess needs the triangles as they were given. Repair keeps the vertices and appends others.
  DerivedMesh given;
  const std::size_t given_vertices = triangles.mesh.vertices.size();
  if (options.guess) given = {{{}, triangles.mesh.triangles}, triangles.source};
  MeshRepairs repairs;
  SolidMesh solid{repaired(std::move(triangles), repairs)};
  const std::size_t count = solid.mesh.triangles.size();
  if (options.guess && repairs.areOfLooseTriangles(count)) {
    given.mesh.vertices = std::move(solid.mesh.vertices);
    given.mesh.vertices.resize(given_vertices);
    solid = {};
    return guessed(
        std::move(given),
        {.open_sides = repairs.boundary_edges, .sides = 3 * (count - repairs.filling_triangles)},
        options);
  }
  if (options.guess) {
    const Enclosure enclosure = enclosureOf(solid.mesh, repairs.filling_triangles);
    if (!enclosure.boundsVolume())
      throw DataError("the triangles bound no volume: " + enclosure.text(repairs.closed_holes) +
                      "; close the surface or give it a thickness in a mesh editor first");
  }
  solid.report.repairs = repairs;
  return solid;
}

void findWalls(SolidMesh& solid) {
  solid.walls = swallowedWalls(solid.mesh);
  solid.report.repairs.swallowed_triangles = solid.walls.swallowed;
  solid.report.repairs.cut_triangles = solid.walls.cut;
}

}  // namespace

std::string LooseTriangles::text() const {
  return std::to_string(open_sides) + " of their " + std::to_string(sides) + " sides meet no other";
}

SolidMesh solidMesh(Mesh triangles, const SolidOptions& options) {
  SolidMesh solid = closed(derived(std::move(triangles)), options);
  if (options.find_walls && !solid.report.is_guess) findWalls(solid);
  return solid;
}

SolidBodies solidBodies(std::vector<Mesh> bodies, const SolidOptions& options) {
  SolidBodies made;
  if (bodies.size() == 1) {
    made.whole = solidMesh(std::move(bodies.front()), options);
    return made;
  }
  SolidReport report;
  std::vector<DerivedMesh> enclosing;
  std::vector<DerivedMesh> guesses;
  std::uint32_t first = 0;
  for (Mesh& body : bodies) {
    DerivedMesh triangles = derived(std::move(body), first);
    first += static_cast<std::uint32_t>(triangles.source.size());
    SolidMesh& solid = made.bodies.emplace_back();
    try {
      solid = closed(triangles, options);
    } catch (const DataError& error) {
      throw DataError("mesh " + std::to_string(made.bodies.size()) + " of " +
                      std::to_string(bodies.size()) + ": " + error.what());
    }
    if (solid.report.is_guess) {
      guesses.push_back({solid.mesh, solid.source});
      report.repairs.degenerate_triangles += solid.report.repairs.degenerate_triangles;
      report.repairs.duplicate_triangles += solid.report.repairs.duplicate_triangles;
      report.guesses.push_back(solid.report.guesses.front());
    } else {
      enclosing.push_back(std::move(triangles));
    }
    if (options.find_walls) findWalls(solid);
  }
  DerivedMesh whole = repaired(joined(std::move(enclosing)), report.repairs);
  report.is_guess = whole.mesh.triangles.empty() && !guesses.empty();
  guesses.insert(guesses.begin(), std::move(whole));
  made.whole = {joined(std::move(guesses)), {}, report};
  if (options.find_walls && !report.is_guess) findWalls(made.whole);
  return made;
}

}  // namespace vdbdither
