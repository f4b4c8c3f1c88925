#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include <benchmark/benchmark.h>

#include "io/mesh/mesh_reader.h"
#include "tests/support/mesh_files.h"
#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

/// A sphere of 1,006,008 triangles, its coordinates rounded to nanometres (decimals as they are
/// usually exported); in random order no vertex is met again soon.
Mesh part(bool shuffled = false) {
  Mesh mesh = sphereMesh({10.0, 20.0, 30.0}, 25.0, 502);
  for (openvdb::Vec3d& vertex : mesh.vertices) {
    for (int axis = 0; axis < 3; ++axis) vertex[axis] = std::round(vertex[axis] * 1e6) / 1e6;
  }
  if (shuffled) std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), std::mt19937(1));
  return mesh;
}

template <class MakeBytes>
void read(benchmark::State& state, const MakeBytes& make_bytes) {
  const std::string bytes = make_bytes();
  const auto path = std::filesystem::temp_directory_path() / "vdbdither_mesh_reader_bench";
  std::ofstream(path, std::ios::binary) << bytes;
  std::size_t triangles = 0;
  for (auto run : state) triangles = readMesh(path, {}).triangles.size();
  std::filesystem::remove(path);
  state.counters["MB"] = static_cast<double>(bytes.size()) * 1e-6;
  state.counters["triangles"] = static_cast<double>(triangles);
}

BENCHMARK_CAPTURE(read, binary_stl, [] {
  return binaryStl(part());
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, binary_stl_shuffled, [] {
  return binaryStl(part(true));
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, ascii_stl, [] { return asciiStl(part()); })->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, obj, [] { return objText(part()); })->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, ply_ascii, [] {
  return plyFile(part(), PlyEncoding::kAscii);
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, ply_binary, [] {
  return plyFile(part(), PlyEncoding::kLittleEndian);
})->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vdbdither::test

BENCHMARK_MAIN();
