// Time per active voxel of the distance field, and of openvdb::tools::meshToVolume on an isotropic
// grid with as many voxels and the same world band. Run by tests/bench/mesh2sdf.py, which prints
// the ratios. mesh_distance_bench [--benchmark_…] SIZE_MM mesh …

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/global_control.h>

#include "io/mesh/mesh_reader.h"
#include "ops/kernels/distance/mesh_distance.h"
#include "ops/kernels/mesh/solid_mesh.h"

namespace {

using namespace vdbdither;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

const Vec3d pitch_mm(0.042, 0.084, 0.022);
constexpr int slab_layers = 64;

struct Part {
  std::shared_ptr<Mesh> mesh;
  Lattice lattice;
};

Part partOf(const std::string& path, double size_mm) {
  const SolidOptions repair_alone{.guess = false, .find_walls = false};
  const auto mesh = std::make_shared<Mesh>(solidMesh(readMesh(path, {}), repair_alone).mesh);
  openvdb::math::BBox<Vec3d> bounds;
  for (const Vec3d& v : mesh->vertices) bounds.expand(v);
  const double scale = size_mm / bounds.extents()[bounds.maxExtent()];
  for (Vec3d& v : mesh->vertices) v = (v - bounds.min()) * scale;
  const Vec3d margin(pitch_mm.length());
  const Vec3d extent = bounds.extents() * scale;
  return {mesh,
          {pitch_mm, Vec3d(0, 0, 0),
           CoordBBox(Coord::floor(-margin / pitch_mm), Coord::ceil((extent + margin) / pitch_mm))}};
}

/// The high-water mark of the process, since it was last put back.
double peakBytes() {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word)
    if (word == "VmHWM:") break;
  double kilobytes = 0;
  status >> kilobytes;
  return 1024 * kilobytes;
}
void putBackPeak() { std::ofstream("/proc/self/clear_refs") << '5'; }

void tell(benchmark::State& state, double voxels, double before) {
  using benchmark::Counter;
  state.counters["voxels"] = voxels;
  state.counters["ns_per_voxel"] =
      Counter(voxels / 1e9, Counter::kIsIterationInvariantRate | Counter::kInvert);
  state.counters["peak_MB"] = (peakBytes() - before) / 1e6;
}

void ours(benchmark::State& state, const Part& part, Band band, int threads, int layers_at_once) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  const ZRange all = alignedToLeaves(part.lattice.layers());
  double voxels = 0;
  putBackPeak();
  const double before = peakBytes();
  for (auto _ : state) {
    voxels = 0;
    const MeshDistance field(*part.mesh, part.lattice, band);
    const int height = layers_at_once > 0 ? layers_at_once : all.size();
    for (int begin = all.begin; begin < all.end; begin += height)
      voxels += static_cast<double>(field.run({begin, begin + height}).surface->activeVoxelCount());
  }
  tell(state, voxels, before);
}

void peer(benchmark::State& state, const Part& part, double band_mm) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  const double edge_mm = std::cbrt(pitch_mm.product());
  std::vector<openvdb::Vec3s> points;
  for (const Vec3d& v : part.mesh->vertices) points.emplace_back(v / edge_mm);
  std::vector<openvdb::Vec3I> triangles;
  for (const Mesh::Triangle& t : part.mesh->triangles) triangles.emplace_back(t[0], t[1], t[2]);
  const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> adapter(
      points, triangles);
  const auto transform = openvdb::math::Transform::createLinearTransform(edge_mm);
  const auto half_width = static_cast<float>(band_mm / edge_mm);
  double voxels = 0;
  putBackPeak();
  const double before = peakBytes();
  for (auto _ : state) {
    const auto grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(adapter, *transform,
                                                                       half_width, half_width);
    voxels = static_cast<double>(grid->activeVoxelCount());
  }
  tell(state, voxels, before);
}

}  // namespace

int main(int count, char** arguments) {
  benchmark::Initialize(&count, arguments);
  if (count < 3) return EXIT_FAILURE;
  const double size_mm = std::atof(arguments[1]);
  for (int i = 2; i < count; ++i) {
    const auto part = std::make_shared<Part>(partOf(arguments[i], size_mm));
    const std::string name = std::filesystem::path(arguments[i]).stem();
    const double wide_mm = 2 * pitch_mm.length();
    const auto add = [&](const std::string& what, auto work) {
      benchmark::RegisterBenchmark((name + "/" + what).c_str(), work)
          ->Unit(benchmark::kMillisecond)
          ->MeasureProcessCPUTime();
    };
    add("default/slabs", [=](benchmark::State& s) { ours(s, *part, Band{}, 1, slab_layers); });
    add("default/slabs/2", [=](benchmark::State& s) { ours(s, *part, Band{}, 2, slab_layers); });
    add("default/whole", [=](benchmark::State& s) { ours(s, *part, Band{}, 1, 0); });
    add("wide/slabs", [=](benchmark::State& s) {
      ours(s, *part, Band{0, wide_mm}, 1, slab_layers);
    });
    add("wide/whole", [=](benchmark::State& s) { ours(s, *part, Band{0, wide_mm}, 1, 0); });
    add("wide/peer", [=](benchmark::State& s) { peer(s, *part, wide_mm); });
  }
  benchmark::RunSpecifiedBenchmarks();
}
