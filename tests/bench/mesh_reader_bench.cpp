#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>

#include <benchmark/benchmark.h>

#include "io/mesh_reader.h"
#include "tests/support/mesh_files.h"
#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

/// A sphere of 1,002,528 triangles, or the same in random order: then no vertex is met again soon.
Mesh part(bool shuffled) {
  Mesh mesh = sphereMesh({10.0, 20.0, 30.0}, 25.0, 502);
  for (openvdb::Vec3d& vertex : mesh.vertices) vertex = openvdb::Vec3d(openvdb::Vec3s(vertex));
  if (shuffled) std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), std::mt19937(1));
  return mesh;
}

void read(benchmark::State& state, const std::string& bytes) {
  const auto path = std::filesystem::temp_directory_path() / "vdbdither_mesh_reader_bench";
  std::ofstream(path, std::ios::binary) << bytes;
  std::size_t triangles = 0;
  for (auto run : state) triangles = readMesh(path, {}).triangles.size();
  std::filesystem::remove(path);
  state.counters["MB"] = static_cast<double>(bytes.size()) * 1e-6;
  state.counters["triangles"] = static_cast<double>(triangles);
}

BENCHMARK_CAPTURE(read, binary_stl, binaryStl(part(false)))->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, binary_stl_shuffled, binaryStl(part(true)))->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, ascii_stl, asciiStl(part(false)))->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, obj, objText(part(false)))->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, ply_ascii, plyFile(part(false), PlyEncoding::kAscii))
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, ply_binary, plyFile(part(false), PlyEncoding::kLittleEndian))
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace vdbdither::test

BENCHMARK_MAIN();
