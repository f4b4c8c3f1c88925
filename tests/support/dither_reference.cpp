#include "tests/support/dither_reference.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <tuple>

namespace vdbdither::test {

using openvdb::Coord;
using openvdb::Vec3d;

Voxels plainVoxels(const Volume<float>& d) {
  Voxels V(d.box(), 0);
  for (auto v = d.box().begin(); v; ++v) V[*v] = d[*v] < 0;
  return V;
}

Voxels surfaceVoxels(const Voxels& V) {
  Voxels surface(V.box(), 0);
  for (auto v = V.box().begin(); v; ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      Coord step(0);
      step[axis] = 1;
      if (V[*v] && (!V.at(*v - step, 0) || !V.at(*v + step, 0))) surface[*v] = 1;
    }
  }
  return surface;
}

std::vector<Coord> listed(const Voxels& voxels) {
  std::vector<Coord> list;
  for (auto v = voxels.box().begin(); v; ++v) {
    if (voxels[*v]) list.push_back(*v);
  }
  return list;
}

std::optional<Coord> closestSurfaceVoxel(const std::vector<Coord>& surface_voxels, const Coord& v,
                                         const Vec3d& pitch_mm, double radius_mm) {
  std::optional<Coord> best;
  double best2 = radius_mm * radius_mm;
  for (const Coord& u : surface_voxels) {
    const Vec3d apart = (u - v).asVec3d() * pitch_mm;
    const double distance2 = apart.x() * apart.x() + apart.y() * apart.y() + apart.z() * apart.z();
    const auto order = [](const Coord& c) { return std::tuple(c.z(), c.y(), c.x()); };
    if (distance2 < best2 || (distance2 == best2 && (!best || order(u) < order(*best)))) {
      best2 = distance2;
      best = u;
    }
  }
  return best;
}

Vec3d gradientNormal(const openvdb::FloatGrid& surface, const Coord& v, const Vec3d& pitch_mm) {
  auto accessor = surface.getConstAccessor();
  Vec3d gradient(0.0);
  for (int axis = 0; axis < 3; ++axis) {
    Coord step(0);
    step[axis] = 1;
    const Coord above = accessor.isValueOn(v + step) ? v + step : v;
    const Coord below = accessor.isValueOn(v - step) ? v - step : v;
    if (above == below) continue;
    const double rise = double{accessor.getValue(above)} - double{accessor.getValue(below)};
    gradient[axis] = rise / ((above - below)[axis] * pitch_mm[axis]);
  }
  return gradient.length() > 0 ? gradient / gradient.length() : gradient;
}

double halfDiameter(const Vec3d& n, const Vec3d& pitch_mm) {
  const double norm = std::max({std::abs(n.x()) / pitch_mm.x(), std::abs(n.y()) / pitch_mm.y(),
                                std::abs(n.z()) / pitch_mm.z()});
  return norm > 0 ? 1 / (2 * norm) : 0;
}

ThresholdMask permutationMask(int size) {
  std::vector<float> values(static_cast<std::size_t>(size * size * size));
  for (std::size_t n = 0; n < values.size(); ++n) {
    values[n] = (static_cast<float>(n) + 0.5F) / static_cast<float>(values.size());
  }
  std::shuffle(values.begin(), values.end(), std::mt19937(11));
  return {Coord(size), values};
}

double bandFor(const ShapeDither& dither) {
  return dither.largestDisplacementMm() + dither.pitch_mm.length();
}

ErrorDiffusion defaultDither(const Vec3d& pitch_mm, bool guarded) {
  return {pitch_mm, Vec3d(0.05), guarded};
}

namespace {

/// `print` makes the printed voxels of a surface on a lattice.
template <typename Print>
Printed printedOn(const Vec3d& pitch_mm, const TestShape& shape, double band_mm, Print print) {
  const Lattice lattice = latticeAround(pitch_mm, shape.extent_mm, 0.3);
  const auto surface = sampled(shape.distance, lattice, band_mm);
  return {plainVoxels(dense(*surface, lattice.box)),
          dense(*print(*surface, lattice.layers()), lattice.box)};
}

}  // namespace

Printed printed(const ShapeDither& dither, const TestShape& shape) {
  return printedOn(dither.pitch_mm, shape, bandFor(dither),
                   [&](const openvdb::FloatGrid& surface, ZRange layers) {
                     return dither.run(surface, nullptr, layers, layers, false).solid;
                   });
}

Printed printedByDefault(const Vec3d& pitch_mm, const TestShape& shape, bool guarded) {
  return printedOn(pitch_mm, shape, 1.5 * pitch_mm.length(),
                   [&](const openvdb::FloatGrid& surface, ZRange layers) {
                     return defaultDither(pitch_mm, guarded).run(surface, nullptr, layers, layers);
                   });
}

const TestShape& ballShape() {
  static const TestShape shape{"ball", sphere({0.013, -0.02, 0.007}, 1.2), Vec3d(1.2)};
  return shape;
}

const TestShape& ringShape() {
  static const TestShape shape{"ring", torus({0.01, 0.01, 0}, 0.8, 0.4), {1.2, 1.2, 0.4}};
  return shape;
}

}  // namespace vdbdither::test
