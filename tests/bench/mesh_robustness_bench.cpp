// Signs of the distance field against a generalized winding number in double, on the meshes given:
// mesh_robustness_bench SAMPLES mesh … prints a table in Markdown.

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <random>

#include "io/mesh_reader.h"
#include "ops/kernels/mesh_distance.h"
#include "ops/kernels/mesh_repair.h"

namespace {

using namespace vdbdither;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

double windingNumber(const Mesh& mesh, const Vec3d& p) {
  double sum = 0;
  for (const Mesh::Triangle& t : mesh.triangles) {
    const Vec3d a = mesh.vertices[t[0]] - p;
    const Vec3d b = mesh.vertices[t[1]] - p;
    const Vec3d c = mesh.vertices[t[2]] - p;
    const double la = a.length();
    const double lb = b.length();
    const double lc = c.length();
    sum +=
        std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (2 * std::numbers::pi);
}

void judge(const std::filesystem::path& path, int samples) {
  Mesh raw = readMesh(path, {});
  openvdb::math::BBox<Vec3d> bounds;
  for (const Vec3d& v : raw.vertices) bounds.expand(v);
  const double scale = 50 / bounds.extents()[bounds.maxExtent()];
  for (Vec3d& v : raw.vertices) v = (v - bounds.min()) * scale;

  MeshRepairs repairs;
  const auto solid = std::make_shared<Mesh>(repaired(raw, repairs));
  Mesh oriented = *solid;
  oriented.triangles.resize(oriented.triangles.size() - repairs.filling_triangles);

  const Vec3d pitch(0.1, 0.2, 0.05);
  const Lattice lattice{
      pitch, Vec3d(0, 0, 0),
      CoordBBox(Coord(-2), Coord::ceil(bounds.extents() * scale / pitch).offsetBy(2))};
  const DistanceGrids grids = MeshDistance(*solid, lattice, Band{}).run(lattice.layers());
  const auto surface = grids.surface->getConstAccessor();

  std::mt19937 random(1);
  const auto wrongAt = [&](const Coord& ijk, const Mesh& mesh) {
    const float distance = surface.getValue(ijk);
    if (std::abs(distance) < 1e-6F) return false;  // on the surface
    return (std::abs(windingNumber(mesh, lattice.position(ijk))) > 0.5) != (distance < 0);
  };
  std::vector<Coord> band;
  for (auto it = grids.surface->cbeginValueOn(); it; ++it)
    if (std::abs(*it) > 1e-6F) band.push_back(it.getCoord());
  int band_wrong = 0;
  for (int i = 0; i < samples; ++i) band_wrong += wrongAt(band[random() % band.size()], oriented);
  int raw_wrong = 0;
  int oriented_wrong = 0;
  int inside = 0;
  for (int i = 0; i < samples; ++i) {
    Coord ijk;
    for (int axis = 0; axis < 3; ++axis)
      ijk[axis] = lattice.box.min()[axis] +
                  static_cast<int>(random() % static_cast<unsigned>(lattice.box.dim()[axis]));
    inside += surface.getValue(ijk) < 0;
    raw_wrong += wrongAt(ijk, raw);
    oriented_wrong += wrongAt(ijk, oriented);
  }
  std::string told;
  for (const std::string& line : repairs.lines()) told += (told.empty() ? "" : "; ") + line;
  std::printf("| %s | %zu | %.1f %% | %d of %d | %.2f %% | %.2f %% | %s |\n",
              path.filename().c_str(), raw.triangles.size(), 100.0 * inside / samples, band_wrong,
              samples, 100.0 * oriented_wrong / std::max(1, inside),
              100.0 * raw_wrong / std::max(1, inside), told.c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  std::printf(
      "| mesh | triangles | solid of its box | wrong in the band | differs inside, of the solid | "
      "the same, as given "
      "| repairs |\n|---|---|---|---|---|---|---|\n");
  for (int i = 2; i < count; ++i) {
    try {
      judge(arguments[i], std::atoi(arguments[1]));
    } catch (const std::exception& failure) {
      std::printf("| %s | refused: %s |\n", arguments[i], failure.what());
    }
  }
}
