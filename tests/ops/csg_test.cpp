#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/vdb/vdb.h"
#include "ops/kernels/leaf/part_index.h"
#include "tests/support/filters.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/volumes.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Int32Grid;
using openvdb::Vec3d;
using testing::HasSubstr;
using testing::ThrowsMessage;

const Vec3d pitch_mm(0.042, 0.084, 0.022);

class CsgOperatorTest : public testing::Test {
 protected:
  CsgOperatorTest() { initializeVdb(); }

  static Lattice latticeAt(double z_mm) {
    Lattice lattice = test::latticeAround(pitch_mm, Vec3d(0.5), 0.15);
    const int steps = static_cast<int>(z_mm / pitch_mm.z());
    lattice.box.translate(Coord(0, 0, steps));
    return lattice;
  }
  static Schema ballAt(double z_mm) {
    const Lattice lattice = latticeAt(z_mm);
    return test::schemaOf(
        lattice, {{"surface", test::sampled(test::sphere({0, 0, z_mm}, 0.4), lattice, 0.12)}});
  }
  std::string write(const Schema& schema) {
    writeVdb(path, contentsOf(schema, schema.grids), VdbCodec::blosc, path);
    return path.string();
  }
  auto planning(const Schema& schema, const std::vector<std::string>& arguments) {
    return [schema, arguments] { test::filterCalled("csg", arguments)->plan(schema); };
  }

  /// What the planned filter makes of `in` over all layers of `out`.
  static Grids runOver(Filter& filter, const Schema& out, const Schema& in) {
    const ZRange all = out.lattice.layers();
    Slab slab{all, all, {{"surface", in.grids.at("surface")}}};
    test::addInputs(filter, slab);
    return filter.run(slab);
  }

  test::ScratchFolder folder;
  std::filesystem::path path = folder / "second.vdb";
};

TEST_F(CsgOperatorTest, AUnionHoldsBothAndNumbersThem) {
  const std::string second = write(ballAt(0.6));
  const auto filter = test::filterCalled("csg", {"--union", second});
  Schema in = ballAt(0);
  in.grids["N"] = openvdb::Vec3SGrid::create();
  const Schema out = filter->plan(in);
  EXPECT_FALSE(out.grids.contains("N"));
  EXPECT_EQ(out.lattice.box.min(), latticeAt(0).box.min());
  EXPECT_EQ(out.lattice.box.max(), latticeAt(0.6).box.max());
  EXPECT_EQ(out.grids.at("part")->getMetadata<openvdb::Int32Metadata>(part_count_key)->value(), 2);

  const Grids made = runOver(*filter, out, in);
  const auto surface = openvdb::gridConstPtrCast<FloatGrid>(made.at("surface"));
  const auto parts = openvdb::gridConstPtrCast<Int32Grid>(made.at("part"));
  EXPECT_LT(surface->tree().getValue({0, 0, 0}), 0);
  EXPECT_LT(surface->tree().getValue({0, 0, 27}), 0);
  EXPECT_EQ(parts->tree().getValue({0, 0, 0}), 1);
  EXPECT_EQ(parts->tree().getValue({0, 0, 36}), 2);
  EXPECT_EQ(parts->tree().getValue({0, 0, 14}), 1) << "in both";
  const auto other = test::filterCalled("csg", {"--union", second, "--priority", "second"});
  other->plan(in);
  const auto swapped = openvdb::gridConstPtrCast<Int32Grid>(runOver(*other, out, in).at("part"));
  EXPECT_EQ(swapped->tree().getValue({0, 0, 14}), 2);
}

TEST_F(CsgOperatorTest, ADifferenceAndAnIntersectionKeepTheBoxAndTheParts) {
  const std::string second = write(ballAt(0.6));
  Schema in = ballAt(0);
  in.grids["part"] = Int32Grid::create(0);
  for (const char* operation : {"--difference", "--intersection"}) {
    const auto filter = test::filterCalled("csg", {operation, second});
    const Schema out = filter->plan(in);
    EXPECT_EQ(out.lattice.box, in.lattice.box);
    EXPECT_TRUE(out.grids.contains("part"));
    const Grids made = runOver(*filter, out, in);
    EXPECT_EQ(made.size(), 1U);
    const auto surface = openvdb::gridConstPtrCast<FloatGrid>(made.at("surface"));
    EXPECT_EQ(surface->tree().getValue({0, 0, 0}) < 0, std::string(operation) == "--difference");
    EXPECT_EQ(surface->tree().getValue({0, 0, 15}) < 0, std::string(operation) == "--intersection");
  }
}

TEST_F(CsgOperatorTest, LeavesOfBothAreCountedAndUnknownOnesMakeTheSumUnknown) {
  const std::string second = write(ballAt(0.6));
  Schema in = ballAt(0);
  const auto footprint = [&] {
    return test::filterCalled("csg", {"--union", second})->plan(in).footprint;
  };
  EXPECT_FALSE(footprint().known());
  in.footprint = {10, 100, 50};
  const Footprint of_second = footprint();
  EXPECT_GT(of_second.total, 100);
  EXPECT_EQ(of_second.total - 100, of_second.at_surface - 50) << "a file does not tell them apart";
}

TEST_F(CsgOperatorTest, RefusesWhatDoesNotFit) {
  const Schema in = ballAt(0);
  EXPECT_THAT(planning(in, {}),
              ThrowsMessage<UsageError>("give one of --union, --intersection and --difference"));
  EXPECT_THAT(planning(in, {"--union", "a.vdb", "--difference", "b.vdb"}),
              ThrowsMessage<UsageError>(HasSubstr("give one of")));
  EXPECT_THAT(planning(in, {"--union", "nowhere.vdb"}),
              ThrowsMessage<DataError>(HasSubstr("no such file 'nowhere.vdb'")));

  Schema coarse = ballAt(0);
  coarse.lattice.pitch_mm = Vec3d(0.1);
  const auto cubes = FloatGrid::create(0.1F);
  cubes->setTransform(openvdb::math::Transform::createLinearTransform(0.1));
  coarse.grids["surface"] = cubes;
  EXPECT_THAT(planning(in, {"--union", write(coarse)}),
              ThrowsMessage<DataError>(HasSubstr(
                  "lies on a lattice of 0.1 x 0.1 x 0.1 mm, and what comes on one of 0.042 x 0.084 "
                  "x 0.022 mm; make both for one printer")));

  Schema nameless = ballAt(0);
  nameless.grids["other"] = nameless.grids["surface"];
  nameless.grids.erase("surface");
  EXPECT_THAT(planning(in, {"--union", write(nameless)}),
              ThrowsMessage<DataError>(HasSubstr("no grid 'surface'; there is 'other'")));

  Schema parted = ballAt(0);
  parted.grids["part"] = Int32Grid::create(0);
  parted.grids["surface"]->transform();
  EXPECT_THAT(planning(parted, {"--union", write(ballAt(0))}),
              ThrowsMessage<DataError>(HasSubstr("grid 'part' does not say how many there are")));
}

}  // namespace
}  // namespace vdbdither
