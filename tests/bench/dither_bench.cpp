// What dithering costs: slabs of a 40 mm sphere on the lattice of a Mimaki 3DUJ-553, one thread.

#include <cmath>
#include <random>

#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include "ops/kernels/distance/closest_surface_voxel.h"
#include "ops/kernels/distance/gradient.h"
#include "ops/kernels/dither/error_diffusion.h"
#include "ops/kernels/dither/interlace.h"
#include "ops/kernels/dither/shape_dither.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;

const Vec3d pitch_mm(0.042, 0.084, 0.022);

/// The distances to a sphere of 20 mm about the origin, in 64 layers from `height_mm` on and a halo
/// of 16, in leaves where the surface is within two voxel diagonals.
struct SphereSlab {
  ZRange core, valid;
  FloatGrid::Ptr surface;
  openvdb::Vec3SGrid::Ptr normals;
};

const SphereSlab& sphereSlab(int height_mm) {
  static std::map<int, SphereSlab> slabs;
  auto [slab, missing] = slabs.try_emplace(height_mm);
  if (!missing) return slab->second;

  const double band_mm = 2 * pitch_mm.length();
  const auto distance = [](const Coord& ijk) { return (ijk.asVec3d() * pitch_mm).length() - 20; };
  const int bottom = static_cast<int>(height_mm / pitch_mm.z()) & ~7;
  SphereSlab& made = slab->second;
  made.core = {bottom, bottom + 64};
  made.valid = {bottom - 16, bottom + 80};
  made.surface = FloatGrid::create(static_cast<float>(band_mm));
  made.surface->setGridClass(openvdb::GRID_LEVEL_SET);
  auto& tree = made.surface->tree();
  const Coord reach(static_cast<int>(20.3 / pitch_mm.x()), static_cast<int>(20.3 / pitch_mm.y()),
                    0);
  for (int i = -reach.x() & ~7; i <= reach.x(); i += 8) {
    for (int j = -reach.y() & ~7; j <= reach.y(); j += 8) {
      for (int k = made.valid.begin; k < made.valid.end; k += 8) {
        const Coord origin(i, j, k);
        const double middle = distance(origin.offsetBy(4));
        if (std::abs(middle) > band_mm + 6 * pitch_mm.length()) {
          if (middle < 0) tree.addTile(1, origin, -made.surface->background(), false);
          continue;
        }
        auto* leaf = tree.touchLeaf(origin);
        for (openvdb::Index n = 0; n < 512; ++n) {
          const double d = distance(leaf->offsetToGlobalCoord(n));
          if (std::abs(d) <= band_mm) {
            leaf->setValueOn(n, static_cast<float>(d));
          } else {
            leaf->setValueOff(n, static_cast<float>(std::copysign(band_mm, d)));
          }
        }
      }
    }
  }
  made.normals = outwardNormals(*made.surface, pitch_mm, made.valid, made.valid);
  return made;
}

ThresholdMask randomMask() {
  std::mt19937 random(1);
  std::vector<float> values(128 * 128 * 128);
  for (float& value : values) value = static_cast<float>(2 * (random() >> 9U) + 1) * 0x1p-24F;
  return {Coord(128), values};
}

/// Time per active voxel, and per voxel that the largest displacement of any direction could
/// overturn.
void reportPerVoxel(benchmark::State& state, const SphereSlab& slab, double largest_mm) {
  std::int64_t active = 0;
  std::int64_t undecided = 0;
  for (const FloatLeaf* leaf : leavesIn(slab.surface->tree(), slab.core)) {
    for (auto voxel = leaf->cbeginValueOn(); voxel; ++voxel) {
      ++active;
      undecided += std::abs(*voxel) <= largest_mm;
    }
  }
  const auto per = [&](std::int64_t voxels) {
    return benchmark::Counter(
        1e-9 * static_cast<double>(voxels),
        benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  };
  state.counters["active"] = static_cast<double>(active);
  state.counters["undecided"] = static_cast<double>(undecided);
  state.counters["ns/active"] = per(active);
  state.counters["ns/undecided"] = per(undecided);
}

void dither(benchmark::State& state, DitherAt at, bool given_normals, bool with_displaced) {
  const SphereSlab& slab = sphereSlab(static_cast<int>(state.range(0)));
  const ShapeDither dither{pitch_mm, 4, at, randomMask()};
  for (auto _ : state) {
    benchmark::DoNotOptimize(dither.run(*slab.surface, given_normals ? slab.normals.get() : nullptr,
                                        slab.core, slab.valid, with_displaced));
  }
  reportPerVoxel(state, slab, dither.largestDisplacementMm());
}

/// The default.
void best(benchmark::State& state, bool given_normals, bool guarded) {
  const SphereSlab& slab = sphereSlab(static_cast<int>(state.range(0)));
  const ErrorDiffusion dither(pitch_mm, Vec3d(0.05), guarded);
  for (auto _ : state) {
    benchmark::DoNotOptimize(dither.run(*slab.surface, given_normals ? slab.normals.get() : nullptr,
                                        slab.core, slab.valid));
  }
  reportPerVoxel(state, slab, pitch_mm.length());
}

void normals(benchmark::State& state) {
  const SphereSlab& slab = sphereSlab(static_cast<int>(state.range(0)));
  for (auto _ : state)
    benchmark::DoNotOptimize(outwardNormals(*slab.surface, pitch_mm, slab.core, slab.valid));
  reportPerVoxel(state, slab, pitch_mm.length());
}

void surfaceVoxels(benchmark::State& state) {
  const SphereSlab& slab = sphereSlab(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    SurfaceVoxels surface_voxels(slab.surface->tree(), slab.valid);
    for (const FloatLeaf* leaf : leavesIn(slab.surface->tree(), slab.core)) {
      benchmark::DoNotOptimize(surface_voxels(*leaf));
    }
  }
  reportPerVoxel(state, slab, pitch_mm.length());
}

void interlaced(benchmark::State& state) {
  const SphereSlab& slab = sphereSlab(static_cast<int>(state.range(0)));
  for (auto _ : state)
    benchmark::DoNotOptimize(interlacedByInterpolation(*slab.surface, slab.core));
  reportPerVoxel(state, slab, pitch_mm.length());
}

// Equator, half way up, and cap: faces along x and y, oblique ones, faces along z.
#define AT_HEIGHTS ->Arg(0)->Arg(14)->Arg(19)->Unit(benchmark::kMillisecond)
BENCHMARK_CAPTURE(dither, closest, DitherAt::closest, true, false) AT_HEIGHTS;
BENCHMARK_CAPTURE(dither, closest_own_normals, DitherAt::closest, false, false) AT_HEIGHTS;
BENCHMARK_CAPTURE(dither, closest_displaced, DitherAt::closest, true, true) AT_HEIGHTS;
BENCHMARK_CAPTURE(dither, foot, DitherAt::foot, true, false) AT_HEIGHTS;
BENCHMARK_CAPTURE(dither, voxel, DitherAt::voxel, true, false) AT_HEIGHTS;
BENCHMARK_CAPTURE(best, best, true, true) AT_HEIGHTS;
BENCHMARK_CAPTURE(best, best_own_normals, false, true) AT_HEIGHTS;
BENCHMARK_CAPTURE(best, best_unguarded, true, false) AT_HEIGHTS;
BENCHMARK(normals) AT_HEIGHTS;
BENCHMARK(surfaceVoxels) AT_HEIGHTS;
BENCHMARK(interlaced) AT_HEIGHTS;

}  // namespace
}  // namespace vdbdither

int main(int argc, char** argv) {
  openvdb::initialize();
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
