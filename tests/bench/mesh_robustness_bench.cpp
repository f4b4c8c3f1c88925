// Signs of the distance field against a generalized winding number in double, on the meshes given:
// mesh_robustness_bench SAMPLES mesh … prints a table in Markdown.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <random>

#include <tbb/parallel_reduce.h>

#include "io/mesh/mesh_reader.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/mesh/mesh_repair.h"
#include "ops/kernels/mesh/swallowed_walls.h"
#include "ops/kernels/mesh/winding_number.h"
#include "ops/kernels/mesh/winding_surface.h"

namespace {

using namespace vdbdither;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

void judge(const std::filesystem::path& path, std::size_t samples) {
  Mesh raw = readMesh(path, {});
  openvdb::math::BBox<Vec3d> bounds;
  for (const Vec3d& v : raw.vertices) bounds.expand(v);
  const double scale = 50 / bounds.extents()[bounds.maxExtent()];
  for (Vec3d& v : raw.vertices) v = (v - bounds.min()) * scale;

  MeshRepairs repairs;
  Mesh solid = repaired(raw, repairs);
  Mesh oriented = solid;
  oriented.triangles.resize(oriented.triangles.size() - repairs.filling_triangles);
  std::string told;
  const bool is_guess = repairs.areOfLooseTriangles(solid.triangles.size());
  bool is_turned = false;
  if (is_guess) {
    repairs = {};
    oriented = withoutDuplicates(raw, repairs);
    WindingSurface surface = windingSurface(oriented);
    char text[80];
    std::snprintf(text, sizeof text, "guessed from the winding number, on cells down to %.2f mm",
                  surface.cell_mm);
    told = text;
    solid = std::move(surface.mesh);
    is_turned = surface.turned;
  }

  const Vec3d pitch(0.1, 0.2, 0.05);
  const Lattice lattice{
      pitch, Vec3d(0, 0, 0),
      CoordBBox(Coord(-2), Coord::ceil(bounds.extents() * scale / pitch).offsetBy(2))};
  const SwallowedWalls walls = is_guess ? SwallowedWalls{} : swallowedWalls(solid);
  repairs.swallowed_triangles = walls.swallowed;
  repairs.cut_triangles = walls.cut;
  const DistanceGrids grids = MeshDistance(solid, lattice, Band{}, {}, walls).run(lattice.layers());

  const WindingNumber closed_winding(solid);
  const WindingNumber oriented_winding(oriented);
  const WindingNumber raw_winding(raw);
  const auto isInside = [&](double number) {
    if (!is_guess) return std::abs(number) > 0.5;
    return is_turned ? number < -0.5 : number > 0.5;
  };
  // How many of so many voxels have another sign.
  const auto wrongOf = [&](const std::vector<Coord>& voxels, const WindingNumber& winding) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, voxels.size()), 0,
        [&](const tbb::blocked_range<std::size_t>& range, int wrong) {
          const auto surface = grids.surface->getConstAccessor();
          for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const float distance = surface.getValue(voxels[i]);
            if (std::abs(distance) < 1e-6F) continue;  // on the surface
            const double number = winding.judgedAt(lattice.position(voxels[i]));
            wrong += (&winding == &closed_winding ? std::abs(number) > 0.5 : isInside(number)) !=
                     (distance < 0);
          }
          return wrong;
        },
        std::plus<>());
  };
  std::mt19937 random(1);
  std::vector<Coord> band, deep, box;
  for (auto it = grids.surface->cbeginValueOn(); it; ++it) band.push_back(it.getCoord());
  std::shuffle(band.begin(), band.end(), random);
  band.resize(std::min(band.size(), samples));
  const auto surface = grids.surface->getConstAccessor();
  const auto anywhere = [&] {
    Coord ijk;
    for (int axis = 0; axis < 3; ++axis)
      ijk[axis] = lattice.box.min()[axis] +
                  static_cast<int>(random() % static_cast<unsigned>(lattice.box.dim()[axis]));
    return ijk;
  };
  std::size_t inside = 0;
  while (box.size() < samples) {
    box.push_back(anywhere());
    const bool within = surface.getValue(box.back()) < 0;
    inside += within;
    if (within && !surface.isValueOn(box.back())) deep.push_back(box.back());
  }
  const auto share = [&](int wrong) {
    return 100.0 * wrong / static_cast<double>(std::max<std::size_t>(1, inside));
  };
  for (const std::string& line : repairs.lines()) told += (told.empty() ? "" : "; ") + line;
  std::printf(
      "| %s | %zu | %.1f %% | %d of %zu | %d of %zu | %d of %zu | %.3f %% | %.3f %% | %s |\n",
      path.filename().c_str(), raw.triangles.size(),
      100.0 * static_cast<double>(inside) / static_cast<double>(samples),
      wrongOf(band, closed_winding), band.size(), wrongOf(deep, closed_winding), deep.size(),
      wrongOf(band, oriented_winding), band.size(), share(wrongOf(box, oriented_winding)),
      share(wrongOf(box, raw_winding)), told.c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  std::printf(
      "| mesh | triangles | solid of its box | wrong in the band | wrong deep inside | band, "
      "without "
      "fillings | differs, of the solid | the same, as given | repairs "
      "|\n|---|---|---|---|---|---|---|---|---|\n");
  for (int i = 2; i < count; ++i) {
    try {
      judge(arguments[i], std::strtoull(arguments[1], nullptr, 10));
    } catch (const std::exception& failure) {
      std::printf("| %s | refused: %s |\n", arguments[i], failure.what());
    }
  }
}
