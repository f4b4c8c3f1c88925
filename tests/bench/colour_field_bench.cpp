// CPU time per voxel of `Cd`, with the distance band that it is made with, on one thread.
// colour_field_bench [--benchmark_…] SIZE_MM DEPTH_MM mesh [texture]

#include <cstdlib>
#include <malloc.h>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include "io/file/whole_file.h"
#include "io/image/texture.h"
#include "io/mesh/mesh_reader.h"
#include "ops/kernels/colour/colour_field.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/mesh_placement.h"

namespace {

using namespace vdbdither;
using openvdb::Coord;
using openvdb::Vec3d;

const Vec3d pitch_mm(25.4 / 600, 25.4 / 300, 0.014);
constexpr int slab_layers = 64;

struct Part {
  SolidMesh solid;
  std::shared_ptr<const SurfaceColours> colours;
  Lattice lattice;
};

Part partOf(const std::string& path, const std::string& texture_file, double size_mm) {
  std::vector<Mesh> meshes{readMesh(path, {}, MeshColours::read)};
  if (!texture_file.empty()) {
    const auto bytes = readWholeFile(texture_file, texture_file, most_texture_bytes);
    meshes[0].appearance = std::make_shared<Appearance>(textured(
        *meshes[0].appearance,
        decodeTexture({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, texture_file)));
  }
  MeshPlacement placement;
  placement.fit_mm = size_mm;
  place(meshes, placement);
  const auto colours = std::make_shared<SurfaceColours>(meshes, pitch_mm);
  const MeshBounds bounds = boundsOf(meshes);
  const Vec3d margin(pitch_mm.length());
  const Lattice lattice{pitch_mm,
                        Vec3d(0.0),
                        {Coord::floor((bounds.min - margin) / pitch_mm),
                         Coord::ceil((bounds.max + margin) / pitch_mm)}};
  return {solidMesh(std::move(meshes[0])), colours, lattice};
}

/// @param with_colour  otherwise the band alone, with the nearest triangles
void run(benchmark::State& state, const Part& part, double depth_mm, bool with_colour) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  const ZRange layers = alignedToLeaves(part.lattice.layers());
  double voxels = 0;
  for (auto _ : state) {
    voxels = 0;
    const MeshDistance distance(part.solid.mesh, part.lattice, Band{},
                                DistanceExtras{.closest = with_colour}, part.solid.walls);
    ColourField field(part.colours, part.lattice, depth_mm, 0);
    if (with_colour) field.add(part.solid);
    for (int begin = layers.begin; begin < layers.end; begin += slab_layers) {
      const ZRange core{begin, begin + slab_layers};
      const std::vector<DistanceGrids> bands{distance.run(core)};
      voxels += static_cast<double>(with_colour
                                        ? field.run(bands, nullptr, core).colour->activeVoxelCount()
                                        : bands[0].surface->activeVoxelCount());
    }
  }
  state.counters["voxels"] = voxels;
  state.counters["ns_per_voxel"] = benchmark::Counter(
      voxels / 1e9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

}  // namespace

int main(int argc, char** argv) {
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
  openvdb::initialize();
  benchmark::Initialize(&argc, argv);
  if (argc < 4) return EXIT_FAILURE;
  const double depth_mm = std::atof(argv[2]);
  const Part part = partOf(argv[3], argc > 4 ? argv[4] : "", std::atof(argv[1]));
  for (const bool with_colour : {false, true})
    benchmark::RegisterBenchmark(
        with_colour ? "with Cd" : "distance alone",
        [=, &part](benchmark::State& state) { run(state, part, depth_mm, with_colour); })
        ->Unit(benchmark::kMillisecond);
  benchmark::RunSpecifiedBenchmarks();
  return EXIT_SUCCESS;
}
