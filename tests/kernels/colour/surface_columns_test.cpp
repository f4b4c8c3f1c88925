#include "ops/kernels/colour/surface_columns.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "tests/support/volumes.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using test::Distance;
using test::Voxels;

constexpr double depth_mm = 0.15;

/// A surface and voxels that are printed inside it.
struct Part {
  /// `shaken`: whether voxels next to the surface are printed or not by chance.
  Part(const Distance& distance, const Vec3d& pitch_mm, const Vec3d& extent_mm, bool shaken)
      : lattice(test::latticeAround(pitch_mm, extent_mm, 0.2)),
        surface(test::sampled(distance, lattice, 3 * pitch_mm[1])),
        solid(BoolGrid::create(false)) {
    std::mt19937 random(7);
    for (auto ijk = lattice.box.begin(); ijk; ++ijk) {
      const float d = surface->tree().getValue(*ijk);
      const bool near = shaken && std::abs(d) < pitch_mm[1];
      if (near ? random() % 2 == 0 : d < 0) solid->tree().setValueOn(*ijk, true);
    }
    solid->pruneGrid();
  }

  Lattice lattice;
  FloatGrid::Ptr surface;
  BoolGrid::Ptr solid;
};

/// The places of the columns, by their definition.
class Reference {
 public:
  Reference(const Part& part, ZRange valid)
      : part_(part), valid_(valid), solid_(test::dense(*part.solid, part.lattice.box)) {}

  [[nodiscard]] std::optional<Coord> place(const Coord& voxel) const {
    std::optional<Coord> found;
    double nearest_mm = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      const double pitch_mm = part_.lattice.pitch_mm[axis];
      for (const int outward : {1, -1}) {
        Coord at = voxel;
        for (int n = 0; n < std::ceil(depth_mm / pitch_mm) && isPrinted(at); ++n) {
          if (isBeginning(at, axis, outward) && n * pitch_mm < nearest_mm) {
            nearest_mm = n * pitch_mm;
            found = voxel;
            (*found)[axis] = -outward * n;
          }
          at[axis] += outward;
        }
      }
    }
    return found;
  }

 private:
  [[nodiscard]] bool isPrinted(const Coord& ijk) const {
    return valid_.contains(ijk.z()) && solid_.at(ijk, 0) != 0;
  }

  [[nodiscard]] bool isKnown(const Coord& ijk) const {
    return valid_.contains(ijk.z()) && part_.surface->tree().isValueOn(ijk);
  }

  [[nodiscard]] bool isBeginning(const Coord& ijk, int axis, int outward) const {
    Coord outer = ijk;
    outer[axis] += outward;
    if (isPrinted(outer) || !isKnown(ijk)) return false;
    const Vec3d normal = gradient(ijk);
    if (normal[axis] * outward <= 0) return false;
    // The last axis among those within a thousandth of the steepest.
    for (int other = 0; other < 3; ++other) {
      const double ratio = std::abs(normal[other]) / std::abs(normal[axis]);
      if (ratio > 1.001 || (ratio > 1 / 1.001 && other > axis)) return false;
    }
    return true;
  }

  [[nodiscard]] Vec3d gradient(const Coord& ijk) const {
    Vec3d result(0.0);
    const auto d = [&](const Coord& at) { return double{part_.surface->tree().getValue(at)}; };
    for (int axis = 0; axis < 3; ++axis) {
      Coord low = ijk;
      Coord high = ijk;
      --low[axis];
      ++high[axis];
      if (!isKnown(low)) low = ijk;
      if (!isKnown(high)) high = ijk;
      const int steps = high[axis] - low[axis];
      if (steps > 0) result[axis] = (d(high) - d(low)) / (steps * part_.lattice.pitch_mm[axis]);
    }
    return result;
  }

  const Part& part_;
  ZRange valid_;
  Voxels solid_;
};

/// Visits the leaves that hold printed voxels of `layers`.
template <typename Visit>
void forEachVoxel(const Part& part, const SurfaceColumns& columns, ZRange layers, Visit visit) {
  SurfaceColumns::Reader reader(columns);
  const auto first = [](int index) { return index & ~7; };
  const auto& box = part.lattice.box;
  for (int x = first(box.min().x()); x <= box.max().x(); x += 8)
    for (int y = first(box.min().y()); y <= box.max().y(); y += 8)
      for (int z = first(layers.begin); z < layers.end; z += 8) {
        const bool any = reader.visit({x, y, z});
        bool found = false;
        for (unsigned offset = 0; offset < 512; ++offset) {
          const Coord ijk =
              Coord(x, y, z) + openvdb::BoolTree::LeafNodeType::offsetToLocalCoord(offset);
          found = found || reader.isInColumn(offset);
          ASSERT_EQ(reader.rowHasColumns(offset / 8 * 8) || !reader.isInColumn(offset), true);
          if (layers.contains(ijk.z()))
            visit(ijk,
                  reader.isInColumn(offset) ? std::optional(reader.place(offset)) : std::nullopt);
        }
        ASSERT_EQ(any, found);
      }
}

/// Draws the places along z in columns of z, or along x in those of x, of a slice of a part across
/// y: `.` where nothing is printed, `o` in no column.
std::string drawn(const Part& part, int axis) {
  const SurfaceColumns columns(part.surface->tree(), part.solid->tree(), part.lattice.pitch_mm,
                               depth_mm, part.lattice.layers());
  std::ostringstream picture;
  const openvdb::CoordBBox printed = part.solid->evalActiveVoxelBoundingBox();
  SurfaceColumns::Reader reader(columns);
  for (int z = printed.max().z(); z >= printed.min().z(); --z) {
    for (int x = printed.min().x(); x <= printed.max().x(); ++x) {
      const Coord ijk(x, 0, z);
      reader.visit(ijk & ~7);
      const unsigned offset = openvdb::BoolTree::LeafNodeType::coordToOffset(ijk);
      const bool is_place = reader.isInColumn(offset);
      const Coord place = is_place ? reader.place(offset) : ijk;
      if (!part.solid->tree().isValueOn(ijk)) {
        picture << '.';
      } else if (is_place && place[axis == 2 ? 0 : 2] == ijk[axis == 2 ? 0 : 2]) {
        picture << std::abs(place[axis]);
      } else {
        picture << 'o';
      }
    }
    picture << '\n';
  }
  return "\n" + picture.str();
}

TEST(SurfaceColumns, CountFromTheNearestFace) {
  const Vec3d pitch_mm(0.05, 0.05, 0.05);
  const Part box(test::box(Vec3d(0.0), Vec3d(0.275, 1, 0.225)), pitch_mm, Vec3d(0.3, 1, 0.3),
                 false);
  EXPECT_EQ(drawn(box, 2), R"(
00000000000
oo1111111oo
ooo22222ooo
ooooooooooo
ooooooooooo
ooooooooooo
ooo22222ooo
oo1111111oo
00000000000
)");
  EXPECT_EQ(drawn(box, 0), R"(
ooooooooooo
01ooooooo10
012ooooo210
012ooooo210
012ooooo210
012ooooo210
012ooooo210
01ooooooo10
ooooooooooo
)");
}

TEST(SurfaceColumns, AreThoseOfTheDefinition) {
  for (const Vec3d& pitch_mm : test::testPitches())
    for (const test::TestShape& shape : test::testShapes()) {
      SCOPED_TRACE(shape.name);
      const Part part(shape.distance, pitch_mm, shape.extent_mm, true);
      const ZRange valid = part.lattice.layers();
      const SurfaceColumns columns(part.surface->tree(), part.solid->tree(), pitch_mm, depth_mm,
                                   valid);
      const Reference reference(part, valid);
      int counted = 0;
      forEachVoxel(part, columns, valid, [&](const Coord& ijk, std::optional<Coord> place) {
        ASSERT_EQ(place, reference.place(ijk)) << ijk;
        counted += place ? 1 : 0;
      });
      EXPECT_GT(counted, 400);
    }
}

TEST(SurfaceColumns, DependOnNoLayersBeyondTheirReach) {
  const Vec3d pitch_mm = test::testPitches().front();
  const test::TestShape& shape = test::testShapes().front();
  const Part part(shape.distance, pitch_mm, shape.extent_mm, true);
  const int reach = SurfaceColumns::reachLayers(pitch_mm, depth_mm);
  for (const ZRange core : test::slabsOf(part.lattice.layers(), 16)) {
    const ZRange valid = grownWithin(core, reach, part.lattice.layers());
    const SurfaceColumns columns(part.surface->tree(), part.solid->tree(), pitch_mm, depth_mm,
                                 valid);
    const Reference reference(part, part.lattice.layers());
    forEachVoxel(part, columns, core, [&](const Coord& ijk, std::optional<Coord> place) {
      ASSERT_EQ(place, reference.place(ijk)) << ijk;
    });
  }
}

TEST(SurfaceColumns, HaveAtMost42Voxels) {
  const Vec3d pitch_mm(0.002);
  const Part part(test::box(Vec3d(0.0), Vec3d(0.1, 0.1, 0.2)), pitch_mm, Vec3d(0.1, 0.1, 0.2),
                  false);
  EXPECT_EQ(SurfaceColumns::reachLayers(pitch_mm, depth_mm), 42);
  const SurfaceColumns columns(part.surface->tree(), part.solid->tree(), pitch_mm, depth_mm,
                               part.lattice.layers());
  const int top = part.solid->evalActiveVoxelBoundingBox().max().z();
  SurfaceColumns::Reader reader(columns);
  for (int depth = 0; depth < 45; ++depth) {
    const Coord ijk(0, 0, top - depth);
    reader.visit(ijk & ~7);
    const unsigned offset = openvdb::BoolTree::LeafNodeType::coordToOffset(ijk);
    ASSERT_EQ(reader.isInColumn(offset), depth < 42) << depth;
    if (depth < 42) {
      EXPECT_EQ(reader.place(offset), Coord(0, 0, -depth));
    }
  }
}

TEST(SurfaceColumns, BetweenTwoAxesAllRunAlongOne) {
  // Edges at 45 degrees, with the rounding of single precision in their normals.
  const Part part(test::box(Vec3d(0.01, 0, 0.003), Vec3d(0.8, 2, 0.8), Vec3d(0, 45, 0)),
                  Vec3d(0.05), Vec3d(1.2, 0.3, 1.2), false);
  const SurfaceColumns columns(part.surface->tree(), part.solid->tree(), part.lattice.pitch_mm,
                               depth_mm, part.lattice.layers());
  int counted = 0;
  forEachVoxel(part, columns, part.lattice.layers(),
               [&](const Coord& ijk, std::optional<Coord> place) {
                 if (!place || std::abs(ijk.x()) < 4 || std::abs(ijk.z()) < 4) return;
                 EXPECT_EQ(place->x(), ijk.x()) << ijk;
                 ++counted;
               });
  EXPECT_GT(counted, 1000);
}

}  // namespace
}  // namespace vdbdither
