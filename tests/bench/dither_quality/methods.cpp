#include "tests/bench/dither_quality/methods.h"

#include <cmath>
#include <utility>

#include "ops/kernels/leaf/voxel_diameter.h"
#include "vdbdither/engine/options.h"

namespace vdbdither::quality {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;

namespace {

/// A rule that decides every voxel near the surface by itself.
template <typename Rule>
Method ruled(const std::string& name, Rule rule) {
  return {name, [rule](const Part& part, const FloatGrid& surface) {
            Voxels printed(part.lattice.box, 0);
            auto accessor = surface.getConstAccessor();
            for (auto v = part.lattice.box.begin(); v; ++v) {
              float d;
              printed[*v] = accessor.probeValue(*v, d) ? rule(part, *v, double{d}) : d < 0;
            }
            return printed;
          }};
}

Method triangular(const ThresholdMask& mask) {
  return ruled("triangular 2", [&mask](const Part& part, const Coord& v, double d) {
    const double M = mask(v);
    const double along = M < 0.5 ? std::sqrt(2 * M) - 1 : 1 - std::sqrt(2 * (1 - M));
    const openvdb::Vec3s normal(normalOf(part.distance, part.lattice.position(v)));
    return d + 2 * halfVoxelDiameter(normal, part.lattice.pitch_mm) * along < 0;
  });
}

Method control() {
  return ruled("control", [](const Part&, const Coord&, double d) { return d < 0; });
}

/// Eq. (11) of Morsy, Brunton, Urban 2022, ± a quarter voxel.
Method interlacing() {
  return ruled("interlacing", [](const Part& part, const Coord& v, double) {
    const double shift = part.lattice.pitch_mm.y() / 4 * ((v.z() & 1) != 0 ? 1 : -1);
    return part.distance(part.lattice.position(v) + Vec3d(0, shift, 0)) < 0;
  });
}

}  // namespace

Method dithered(const std::string& name, const ThresholdMask& mask, double amplitude, DitherAt at,
                bool guarded) {
  return {name, [=](const Part& part, const FloatGrid& surface) {
            ShapeDither dither{part.lattice.pitch_mm, amplitude, at, mask};
            dither.guarded = guarded;
            const ZRange layers = part.lattice.layers();
            return test::dense(*dither.run(surface, nullptr, layers, layers, false).solid,
                               part.lattice.box);
          }};
}

Method diffused(const std::string& name, bool guarded, double spread_mm) {
  return {name, [=](const Part& part, const FloatGrid& surface) {
            const ErrorDiffusion dither(part.lattice.pitch_mm, Vec3d(spread_mm), guarded);
            const ZRange layers = part.lattice.layers();
            return test::dense(*dither.run(surface, nullptr, layers, layers), part.lattice.box);
          }};
}

Method coverage(const ThresholdMask& mask) {
  return ruled("coverage", [&mask](const Part& part, const Coord& v, double d) {
    if (std::abs(d) > part.lattice.pitch_mm.length() / 2) return d < 0;
    constexpr int n = 6;
    int covered = 0;
    for (int at = 0; at < n * n * n; ++at) {
      const Vec3d inside((at % n + 0.5) / n - 0.5, (at / n % n + 0.5) / n - 0.5,
                         (at / n / n + 0.5) / n - 0.5);
      covered += part.distance(part.lattice.position(v) + inside * part.lattice.pitch_mm) < 0;
    }
    return static_cast<double>(covered) / (n * n * n) > double{mask(v)};
  });
}

std::vector<Method> methodsFor(const Masks& masks, bool every) {
  const ThresholdMask& mask = masks.ours;
  std::vector<Method> methods{control(), interlacing(),
                              dithered("paper", masks.papers, 4, DitherAt::closest),
                              diffused("best", true)};
  if (!every) return methods;
  methods.push_back(dithered("4 closest", mask, 4, DitherAt::closest));
  methods.push_back(dithered("2 voxel, paper's mask", masks.papers, 2, DitherAt::voxel));
  methods.push_back(dithered("4 foot", mask, 4, DitherAt::foot));
  methods.push_back(dithered("4 voxel", mask, 4, DitherAt::voxel));
  for (const double amplitude : {0.5, 1.0, 1.5, 2.0})
    methods.push_back(
        dithered(shortestText(amplitude) + " voxel", mask, amplitude, DitherAt::voxel));
  methods.push_back(dithered("2 closest", mask, 2, DitherAt::closest));
  for (const double amplitude : {2.5, 3.0, 5.0, 6.0})
    methods.push_back(dithered(shortestText(amplitude) + " foot", mask, amplitude, DitherAt::foot));
  methods.push_back(triangular(mask));
  methods.push_back(coverage(mask));
  methods.push_back(diffused("best 25", true, 0.025));
  methods.push_back(diffused("best 100", true, 0.1));
  methods.push_back(diffused("best unguarded", false));
  return methods;
}

std::vector<Method> chosen(std::vector<Method> methods, const std::string& only) {
  if (!only.empty())
    std::erase_if(methods, [&](const Method& method) { return method.name != only; });
  return methods;
}

}  // namespace vdbdither::quality
