#include "ops/kernels/mesh/winding_crossing.h"

#include <numeric>

#include <gtest/gtest.h>

#include "ops/kernels/mesh/winding_number.h"
#include "tests/support/shapes.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

/// A cube from 0 to 10 mm, and edges along z above its middle.
class WindingCrossing : public testing::Test {
 protected:
  explicit WindingCrossing(Mesh mesh = test::boxMesh(Vec3d(0.0), Vec3d(10.0)))
      : mesh_(std::move(mesh)),
        number_(mesh_),
        cells_(mesh_, number_, {Vec3d(0.0), Vec3d(10.0)}, 64),
        all_(mesh_.triangles.size()) {
    std::iota(all_.begin(), all_.end(), 0U);
  }

  /// The crossing of the edge from `low` to `high` mm, which lies in one cell.
  EdgeCrossing crossing(double low, double high, bool low_is_inside, bool high_is_inside) {
    const Vec3d from(4.1, 4.3, low);
    const openvdb::Coord cell = openvdb::Coord::floor((from - cells_.position(openvdb::Coord(0))) /
                                                      (WindingCells::units * cells_.unitMm()));
    const openvdb::Coord lowest(cell.x() * WindingCells::units, cell.y() * WindingCells::units,
                                cell.z() * WindingCells::units);
    return crossingOf(WindingSolid(cells_, 1), {from, 2, high - low, low_is_inside, high_is_inside,
                                                cells_.at({lowest}).front(), all_});
  }

  Mesh mesh_;
  WindingNumber number_;
  WindingCells cells_;
  std::vector<std::uint32_t> all_;
};

TEST_F(WindingCrossing, NamesTheTriangleThatTheEdgePierces) {
  const EdgeCrossing found = crossing(9.97, 10.02, true, false);
  EXPECT_EQ(found.passes, 1);
  EXPECT_FALSE(found.is_smooth);
  EXPECT_NEAR(found.at.z(), 10, 1e-9);
  EXPECT_NEAR(found.normal.z(), 1, 1e-12);
  ASSERT_NE(found.triangle, no_source);
  for (const std::uint32_t v : mesh_.triangles[found.triangle])
    EXPECT_EQ(mesh_.vertices[v].z(), 10);
}

TEST_F(WindingCrossing, AnEdgeInsideCrossesNothing) {
  const EdgeCrossing found = crossing(5.0, 5.05, true, true);
  EXPECT_EQ(found.passes, 0);
  EXPECT_EQ(found.triangle, no_source);
}

class OpenWindingCrossing : public WindingCrossing {
 protected:
  /// Without its upper face.
  OpenWindingCrossing()
      : WindingCrossing([] {
          Mesh mesh = test::boxMesh(Vec3d(0.0), Vec3d(10.0));
          std::erase_if(mesh.triangles, [&](const Mesh::Triangle& t) {
            return mesh.vertices[t[0]].z() == 10 && mesh.vertices[t[1]].z() == 10 &&
                   mesh.vertices[t[2]].z() == 10;
          });
          return mesh;
        }()) {}
};

TEST_F(OpenWindingCrossing, BetweenTrianglesItLiesWhereTheNumberIsAHalf) {
  // The plane of the missing face divides the directions from its points into equal halves.
  const EdgeCrossing found = crossing(9.95, 10.04, true, false);
  EXPECT_EQ(found.passes, 1);
  EXPECT_TRUE(found.is_smooth);
  EXPECT_EQ(found.triangle, no_source);
  EXPECT_NEAR(found.at.z(), 10, 0.01);
}

TEST(MeetingPoint, IsTheCornerOfThreePlanesAndTheMeanOfAFlatSurface) {
  const LeafCube cube{Vec3d(0.0), 1};
  std::vector<EdgeCrossing> crossings(3);
  for (int axis = 0; axis < 3; ++axis) {
    crossings[static_cast<std::size_t>(axis)].at[axis] = 0.25;
    crossings[static_cast<std::size_t>(axis)].normal[axis] = 1;
  }
  EXPECT_TRUE(meetingPoint(cube, crossings).eq(Vec3d(0.25), 1e-9));
  for (EdgeCrossing& crossing : crossings) crossing.normal = Vec3d(0, 0, 1);
  crossings[0].at = {0, 0, 0.5};
  crossings[1].at = {1, 0, 0.5};
  crossings[2].at = {0, 1, 0.5};
  EXPECT_TRUE(meetingPoint(cube, crossings).eq(Vec3d(1.0 / 3, 1.0 / 3, 0.5), 1e-9));
}

}  // namespace
}  // namespace vdbdither
