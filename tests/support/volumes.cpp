#include "tests/support/volumes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <openvdb/tools/Prune.h>

namespace vdbdither::test {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using openvdb::Vec3s;
using openvdb::Vec3SGrid;

Distance sphere(const Vec3d& centre, double radius) {
  return [=](const Vec3d& at) { return (at - centre).length() - radius; };
}

Distance box(const Vec3d& centre, const Vec3d& half, const Vec3d& degrees) {
  openvdb::Mat3d turn = openvdb::Mat3d::identity();
  for (int axis = 0; axis < 3; ++axis) {
    const auto about = static_cast<openvdb::math::Axis>(axis);
    turn = openvdb::math::rotation<openvdb::Mat3d>(about, -degrees[axis] * std::numbers::pi / 180) *
           turn;
  }
  const openvdb::Mat3d back = turn.transpose();
  return [=](const Vec3d& at) {
    const Vec3d local = back * (at - centre);
    Vec3d beyond;
    for (int axis = 0; axis < 3; ++axis) beyond[axis] = std::abs(local[axis]) - half[axis];
    const double inside = std::min(0.0, std::max({beyond.x(), beyond.y(), beyond.z()}));
    return openvdb::math::maxComponent(beyond, Vec3d(0.0)).length() + inside;
  };
}

Distance torus(const Vec3d& centre, double ring_radius, double tube_radius) {
  return [=](const Vec3d& at) {
    const Vec3d local = at - centre;
    return std::hypot(std::hypot(local.x(), local.y()) - ring_radius, local.z()) - tube_radius;
  };
}

const std::vector<openvdb::Vec3d>& testPitches() {
  static const std::vector<openvdb::Vec3d> pitches{
      {0.042, 0.084, 0.022}, {0.04233, 0.08467, 0.027}, {0.05, 0.05, 0.05}};
  return pitches;
}

const std::vector<TestShape>& testShapes() {
  static const std::vector<TestShape> shapes{
      {"sphere", sphere({0.013, -0.02, 0.007}, 0.4), openvdb::Vec3d(0.43)},
      {"tilted box", box(openvdb::Vec3d(0.0), {0.35, 0.3, 0.2}, {12, 25, 31}), openvdb::Vec3d(0.5)},
      {"torus", torus({0.01, 0.01, 0}, 0.35, 0.15), {0.52, 0.52, 0.16}},
      {"thin plate", box({0.001, 0.002, 0.003}, {0.4, 0.4, 0.03}, {5, -4, 0}), {0.45, 0.45, 0.12}},
  };
  return shapes;
}

Lattice latticeAround(const Vec3d& pitch_mm, const Vec3d& extent_mm, double padding_mm) {
  Coord reach;
  for (int axis = 0; axis < 3; ++axis) {
    reach[axis] = static_cast<int>(std::ceil((extent_mm[axis] + padding_mm) / pitch_mm[axis]));
  }
  return {pitch_mm, Vec3d(0.0), CoordBBox(Coord(0) - reach, reach)};
}

std::vector<ZRange> slabsOf(ZRange layers, int height) {
  std::vector<ZRange> slabs;
  for (int begin = alignedToLeaves(layers).begin; begin < layers.end; begin += height)
    slabs.push_back(intersection({begin, begin + height}, layers));
  return slabs;
}

CoordBBox inLayers(CoordBBox box, ZRange layers) {
  box.min().z() = layers.begin;
  box.max().z() = layers.end - 1;
  return box;
}

FloatGrid::Ptr sampled(const Distance& distance, const Lattice& lattice, double band_mm) {
  const auto band = static_cast<float>(band_mm);
  auto grid = FloatGrid::create(band);
  grid->setName("surface");
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  grid->setTransform(transformOf(lattice));
  auto accessor = grid->getAccessor();
  for (auto ijk = lattice.box.begin(); ijk; ++ijk) {
    const auto d = static_cast<float>(distance(lattice.position(*ijk)));
    if (std::abs(d) <= band) {
      accessor.setValueOn(*ijk, d);
    } else {
      accessor.setValueOff(*ijk, d < 0 ? -band : band);
    }
  }
  openvdb::tools::prune(grid->tree());
  return grid;
}

int expectHolds(const FloatGrid& grid, const Lattice& lattice, const Distance& truth,
                double band_mm) {
  int active = 0;
  int wrong = 0;
  for (auto ijk = lattice.box.begin(); ijk && wrong < 5; ++ijk) {
    const double expected = truth(lattice.position(*ijk));
    float value = 0;
    const bool is_active = grid.tree().probeValue(*ijk, value);
    active += is_active;
    if (std::abs(std::abs(expected) - band_mm) < 1e-6) continue;
    const double held = is_active ? expected : std::copysign(band_mm, expected);
    if (is_active == (std::abs(expected) < band_mm) && std::abs(value - held) <= 1e-6) continue;
    ++wrong;
    ADD_FAILURE() << *ijk << (is_active ? " is active and" : " is inactive and") << " holds "
                  << value << " instead of " << expected;
  }
  return active;
}

namespace {

template <typename T, typename GridType>
Volume<T> denseOf(const GridType& grid, const CoordBBox& box) {
  Volume<T> volume(box, T(0));
  auto accessor = grid.getConstAccessor();
  for (auto ijk = box.begin(); ijk; ++ijk) volume[*ijk] = accessor.getValue(*ijk);
  return volume;
}

}  // namespace

Voxels dense(const openvdb::BoolGrid& grid, const CoordBBox& box) {
  return denseOf<char>(grid, box);
}
Volume<float> dense(const FloatGrid& grid, const CoordBBox& box) {
  return denseOf<float>(grid, box);
}
Volume<Vec3s> dense(const Vec3SGrid& grid, const CoordBBox& box) {
  return denseOf<Vec3s>(grid, box);
}

int differences(const Voxels& a, const Voxels& b) {
  int count = 0;
  for (auto ijk = a.box().begin(); ijk; ++ijk) count += a[*ijk] != b[*ijk];
  return count;
}

int components(Voxels voxels, Touching touching) {
  int count = 0;
  std::vector<Coord> open;
  for (auto start = voxels.box().begin(); start; ++start) {
    if (!voxels[*start]) continue;
    ++count;
    voxels[*start] = 0;
    open.push_back(*start);
    while (!open.empty()) {
      const Coord ijk = open.back();
      open.pop_back();
      for (auto near = CoordBBox(ijk.offsetBy(-1), ijk.offsetBy(1)).begin(); near; ++near) {
        const Coord step = *near - ijk;
        const bool by_face = std::abs(step.x()) + std::abs(step.y()) + std::abs(step.z()) == 1;
        if (!voxels.at(*near, 0) || (touching == Touching::faces && !by_face)) continue;
        voxels[*near] = 0;
        open.push_back(*near);
      }
    }
  }
  return count;
}

}  // namespace vdbdither::test
