#include "tests/bench/dither_quality/parts.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "ops/kernels/leaf/voxel_diameter.h"

namespace vdbdither::quality {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;

constexpr double pi = std::numbers::pi;

const std::vector<NamedLattice> lattices{{"mimaki", {0.042, 0.084, 0.022}},
                                         {"j750", {25.4 / 600, 25.4 / 300, 0.027}},
                                         {"cubic", {0.05, 0.05, 0.05}}};

std::vector<NamedLattice> latticesNamed(const std::string& only) {
  std::vector<NamedLattice> named = lattices;
  std::erase_if(named,
                [&](const NamedLattice& lattice) { return !only.empty() && lattice.name != only; });
  return named;
}

Vec3d normalOf(const Distance& distance, const Vec3d& at) {
  constexpr double h = 1e-5;
  Vec3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d step(0.0);
    step[axis] = h;
    gradient[axis] = distance(at + step) - distance(at - step);
  }
  return gradient.unit();
}

FloatGrid::Ptr surfaceOf(const Part& part) {
  // Enough for the constant 6.
  return test::sampled(part.distance, part.lattice, 1.6 * part.lattice.pitch_mm.length());
}

Lattice latticeOver(const Vec3d& pitch_mm, const Vec3d& min_mm, const Vec3d& max_mm) {
  return {pitch_mm, Vec3d(0.0),
          CoordBBox(Coord::floor(min_mm / pitch_mm), Coord::ceil(max_mm / pitch_mm))};
}

static constexpr double relief_mm = 0.12;
double reliefHeight(double x, double y) {
  return relief_mm * std::sin(2 * pi * x / 2.1 + 0.3) * std::cos(2 * pi * y / 1.7 + 0.1);
}

Vec3d reliefNormal(double x, double y) {
  const double u = 2 * pi * x / 2.1 + 0.3;
  const double w = 2 * pi * y / 1.7 + 0.1;
  return Vec3d(-relief_mm * 2 * pi / 2.1 * std::cos(u) * std::cos(w),
               relief_mm * 2 * pi / 1.7 * std::sin(u) * std::sin(w), 1)
      .unit();
}

/// By the foot point, which a few steps find.
double reliefDistance(const Vec3d& at) {
  const double rough = at.z() - reliefHeight(at.x(), at.y());
  if (std::abs(rough) > 0.4) return rough;
  Vec3d foot(at.x(), at.y(), 0);
  double d = 0;
  for (int n = 0; n < 8; ++n) {
    const Vec3d normal = reliefNormal(foot.x(), foot.y());
    const Vec3d on(foot.x(), foot.y(), reliefHeight(foot.x(), foot.y()));
    d = (at - on).dot(normal);
    const Vec3d lateral = at - on - d * normal;
    foot.x() += 0.8 * lateral.x();
    foot.y() += 0.8 * lateral.y();
  }
  return d;
}

namespace {

Distance joined(std::vector<Distance> parts) {
  return [parts = std::move(parts)](const Vec3d& at) {
    double nearest = 1e9;
    for (const Distance& part : parts) nearest = std::min(nearest, part(at));
    return nearest;
  };
}

Distance cut(Distance from, Distance what) {
  return [from = std::move(from), what = std::move(what)](const Vec3d& at) {
    return std::max(from(at), -what(at));
  };
}

Distance capsule(const Vec3d& from, const Vec3d& to, double radius) {
  return [=](const Vec3d& at) {
    const double share = std::clamp((at - from).dot(to - from) / (to - from).lengthSqr(), 0.0, 1.0);
    return (at - from - share * (to - from)).length() - radius;
  };
}

/// The strokes of E, H and A, `width` wide and as high as the box, in the plane, turned by 7°.
Distance letters(double width, double half_height) {
  const double size = std::max(0.5, 4 * width);
  std::vector<Distance> strokes;
  const auto stroke = [&](Vec3d from, Vec3d to) {
    const Vec3d middle = (from + to) / 2;
    const Vec3d along = to - from;
    const double turn = std::atan2(along.y(), along.x()) * 180 / pi;
    const double angle = 7 * pi / 180;
    const Vec3d turned(middle.x() * std::cos(angle) - middle.y() * std::sin(angle),
                       middle.x() * std::sin(angle) + middle.y() * std::cos(angle), 0);
    strokes.push_back(test::box(turned, {(along.length() + width) / 2, width / 2, half_height},
                                {0, 0, turn + 7}));
  };
  const double gap = 1.3 * size;
  stroke({-gap, 0, 0}, {-gap, size, 0});
  for (const double y : {0.0, 0.5, 1.0})
    stroke({-gap, y * size, 0}, {-gap + 0.6 * size, y * size, 0});
  stroke({0, 0, 0}, {0, size, 0});
  stroke({0.6 * size, 0, 0}, {0.6 * size, size, 0});
  stroke({0, 0.5 * size, 0}, {0.6 * size, 0.5 * size, 0});
  stroke({gap, 0, 0}, {gap + 0.3 * size, size, 0});
  stroke({gap + 0.6 * size, 0, 0}, {gap + 0.3 * size, size, 0});
  return joined(strokes);
}

void addWires(const Vec3d& pitch, std::vector<Detail>& details) {
  for (const double um : {80.0, 120.0, 180.0, 250.0}) {
    const double r = um / 2000;
    const Distance wires = joined({capsule({-0.9, -0.5, 0.1}, {0.9, -0.4, 0.2}, r),
                                   capsule({-0.9, 0.1, -0.5}, {0.9, 0.2, 0.4}, r),
                                   capsule({0.1, -0.9, -0.9}, {-0.2, 0.8, -0.7}, r),
                                   capsule({0.7, 0.7, -0.8}, {0.6, 0.75, 0.9}, r)});
    details.push_back(
        {"wires", um, {wires, latticeOver(pitch, Vec3d(-1.5), Vec3d(1.5))}, [=](const Vec3d& x) {
           return wires(x) - 0.15;
         }});
  }
}

void addLetters(const Vec3d& pitch, std::vector<Detail>& details) {
  for (const double um : {76.0, 120.0, 180.0, 280.0}) {
    const double w = um / 1000;
    const double size = std::max(0.5, 4 * w);
    const Vec3d min(-1.9 * size, -0.7 * size, -0.5);
    const Vec3d max(2.3 * size, 1.7 * size, 0.7);
    const Lattice lattice = latticeOver(pitch, min - 0.4, max + 0.4);
    const Distance slab =
        test::box({0.2 * size, 0.5 * size, -0.25}, {1.9 * size, size, 0.25}, Vec3d(0.0));
    const Distance raised = letters(w, 0.2);
    const Distance sunk = letters(w, 0.15);
    details.push_back({"embossed", um, {joined({slab, raised}), lattice}, [=](const Vec3d& x) {
                         return std::max(0.03 - x.z(), raised(x) - 0.08);
                       }});
    details.push_back({"engraved", um, {cut(slab, sunk), lattice}, [=](const Vec3d& x) {
                         return std::max(x.z() + 0.0, sunk(x) - 0.08);
                       }});
  }
}

/// The normal of the wide faces of a plate turned by `tilt` degrees.
Vec3d plateNormal(const Vec3d& tilt) {
  const Vec3d half(0.8, 0.7, 1);
  return normalOf(test::box(Vec3d(0.0), half, tilt), [&] {
    // A point above the middle of the wide face.
    const double a = tilt.x() * pi / 180;
    const double b = tilt.y() * pi / 180;
    const double c = tilt.z() * pi / 180;
    Vec3d n(0, -std::sin(a), std::cos(a));
    n = {n.x() * std::cos(b) + n.z() * std::sin(b), n.y(),
         -n.x() * std::sin(b) + n.z() * std::cos(b)};
    n = {n.x() * std::cos(c) - n.y() * std::sin(c), n.x() * std::sin(c) + n.y() * std::cos(c),
         n.z()};
    return 1.2 * n;
  }());
}

void addPlatesAndCombs(const Vec3d& tilt, const Vec3d& pitch, std::vector<Detail>& details) {
  const Vec3d normal = plateNormal(tilt);
  const double diameter = 2 * halfVoxelDiameter(openvdb::Vec3s(normal), pitch);
  for (const double voxels : {1.0, 1.5, 2.0, 3.0, 4.0}) {
    const double thickness = voxels * diameter;
    const Distance plate = test::box({0.003, 0.007, 0.002}, {0.8, 0.7, thickness / 2}, tilt);
    details.push_back({"plate", voxels, {plate, latticeOver(pitch, Vec3d(-1.4), Vec3d(1.4))}, {}});
  }
  for (const double voxels : {1.0, 2.0, 3.0}) {
    std::vector<Distance> bars;
    const double step = (3 + voxels) * diameter;
    for (int n = -2; n <= 2; ++n)
      bars.push_back(test::box(Vec3d(0.003, 0.007, 0.002) + n * step * normal,
                               {0.6, 0.5, 1.5 * diameter}, tilt));
    details.push_back(
        {"comb", voxels, {joined(bars), latticeOver(pitch, Vec3d(-1.6), Vec3d(1.6))}, {}});
  }
}

}  // namespace

std::vector<Detail> detailsOn(const Vec3d& pitch) {
  std::vector<Detail> details;
  addWires(pitch, details);
  addLetters(pitch, details);
  for (const Vec3d& tilt :
       std::vector<Vec3d>{{3, 4, 0}, {20, 11, 0}, {40, 5, 30}, {88, 0, 2}, {3, 87, 10}})
    addPlatesAndCombs(tilt, pitch, details);
  return details;
}

}  // namespace vdbdither::quality
