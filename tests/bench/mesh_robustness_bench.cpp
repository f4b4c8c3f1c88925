// Signs of the distance field against a generalized winding number in double, on the meshes given:
// mesh_robustness_bench SAMPLES mesh … prints a table in Markdown. mesh_robustness_bench walls
// prints what it costs to find the walls of many shells.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <tbb/parallel_reduce.h>

#include "io/mesh/mesh_reader.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "ops/kernels/mesh/solid_mesh.h"
#include "ops/kernels/mesh/winding_number.h"
#include "tests/bench/mesh_robustness/wall_costs.h"

namespace {

using namespace vdbdither;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

/// A mesh as it was given, scaled to 50 mm, and the solid that it bounds.
struct Part {
  Mesh raw;
  SolidMesh solid;
  Mesh oriented;  ///< the solid's mesh without fillings; of a guess, the triangles it was made from
  Lattice lattice;
};

Part partOf(const std::filesystem::path& path) {
  Part part;
  part.raw = readMesh(path, {});
  place(part.raw, {.fit_mm = 50, .corner_mm = openvdb::Vec3d(0.0)});
  part.solid = solidMesh(part.raw);
  part.oriented = part.solid.mesh;
  if (part.solid.report.is_guess) {
    MeshRepairs repairs;
    part.oriented = withoutDuplicates(derived(part.raw), repairs).mesh;
  } else {
    part.oriented.triangles.resize(part.oriented.triangles.size() -
                                   part.solid.report.repairs.filling_triangles);
  }
  const Vec3d pitch(0.1, 0.2, 0.05);
  part.lattice = {pitch, Vec3d(0, 0, 0),
                  CoordBBox(Coord(-2), Coord::ceil(boundsOf(part.raw).max / pitch).offsetBy(2))};
  return part;
}

/// Voxels to judge: at random of those in the band, of all, and of these the ones deep inside.
struct Samples {
  std::vector<Coord> band, box, deep;
  std::size_t inside = 0;  ///< of those in `box`
};

Samples samplesOf(const openvdb::FloatGrid& surface, const CoordBBox& box, std::size_t count) {
  std::mt19937 random(1);
  Samples samples;
  for (auto it = surface.cbeginValueOn(); it; ++it) samples.band.push_back(it.getCoord());
  std::shuffle(samples.band.begin(), samples.band.end(), random);
  samples.band.resize(std::min(samples.band.size(), count));
  const auto at = surface.getConstAccessor();
  const auto anywhere = [&] {
    Coord ijk;
    for (int axis = 0; axis < 3; ++axis)
      ijk[axis] =
          box.min()[axis] + static_cast<int>(random() % static_cast<unsigned>(box.dim()[axis]));
    return ijk;
  };
  while (samples.box.size() < count) {
    samples.box.push_back(anywhere());
    const bool within = at.getValue(samples.box.back()) < 0;
    samples.inside += within;
    if (within && !at.isValueOn(samples.box.back())) samples.deep.push_back(samples.box.back());
  }
  return samples;
}

/// How many voxels have another sign than `isInside` says of the winding number there.
template <class IsInside>
int wrongOf(const std::vector<Coord>& voxels, const openvdb::FloatGrid& surface,
            const Lattice& lattice, const WindingNumber& winding, const IsInside& isInside) {
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, voxels.size()), 0,
      [&](const tbb::blocked_range<std::size_t>& range, int wrong) {
        const auto at = surface.getConstAccessor();
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          const float distance = at.getValue(voxels[i]);
          if (std::abs(distance) < 1e-6F) continue;  // on the surface
          wrong += isInside(winding.judgedAt(lattice.position(voxels[i]))) != (distance < 0);
        }
        return wrong;
      },
      std::plus<>());
}

std::string remarksOn(const SolidReport& report) {
  std::vector<std::string> lines = report.repairs.lines();
  for (const SurfaceGuess& guess : report.guesses) {
    char text[80];
    std::snprintf(text, sizeof text, "guessed from the winding number, on cells down to %.2f mm",
                  guess.cell_mm);
    lines.insert(lines.begin(), text);
  }
  std::string remarks;
  for (const std::string& line : lines) remarks += (remarks.empty() ? "" : "; ") + line;
  return remarks;
}

void judge(const std::filesystem::path& path, std::size_t count) {
  const Part part = partOf(path);
  const SolidReport& report = part.solid.report;
  const DistanceGrids grids =
      MeshDistance(part.solid.mesh, part.lattice, Band{}, {}, part.solid.walls)
          .run(part.lattice.layers());
  const Samples samples = samplesOf(*grids.surface, part.lattice.box, count);

  const WindingNumber closed(part.solid.mesh);
  const auto againstClosed = [&](const std::vector<Coord>& voxels) {
    return wrongOf(voxels, *grids.surface, part.lattice, closed,
                   [](double number) { return std::abs(number) > 0.5; });
  };
  const auto againstOpen = [&](const std::vector<Coord>& voxels, const WindingNumber& winding) {
    return wrongOf(voxels, *grids.surface, part.lattice, winding, [&](double number) {
      if (!report.is_guess) return std::abs(number) > 0.5;
      return report.guesses.front().turned ? number < -0.5 : number > 0.5;
    });
  };
  const WindingNumber oriented(part.oriented);
  const auto share = [&](int wrong) {
    return 100.0 * wrong / static_cast<double>(std::max<std::size_t>(1, samples.inside));
  };
  std::printf(
      "| %s | %zu | %.1f %% | %d of %zu | %d of %zu | %d of %zu | %.3f %% | %.3f %% | %s |\n",
      path.filename().c_str(), part.raw.triangles.size(),
      100.0 * static_cast<double>(samples.inside) / static_cast<double>(count),
      againstClosed(samples.band), samples.band.size(), againstClosed(samples.deep),
      samples.deep.size(), againstOpen(samples.band, oriented), samples.band.size(),
      share(againstOpen(samples.box, oriented)),
      share(againstOpen(samples.box, WindingNumber(part.raw))), remarksOn(report).c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  if (count == 2 && std::string(arguments[1]) == "walls") {
    printWallCosts();
    return 0;
  }
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
