#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include "ops/kernels/mask/void_and_cluster.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;

std::unique_ptr<Source> maskOf(const std::vector<std::string>& arguments) {
  std::unique_ptr<Operator> made = findOperator("mask").make();
  Options options;
  made->declare(options);
  options.parse(arguments);
  return std::unique_ptr<Source>(dynamic_cast<Source*>(made.release()));
}

FloatGrid::ConstPtr gridOf(const Grids& grids) {
  return openvdb::gridConstPtrCast<FloatGrid>(grids.at("mask"));
}

FloatGrid::ConstPtr wholeMask(const std::vector<std::string>& arguments) {
  const std::unique_ptr<Source> source = maskOf(arguments);
  return gridOf(source->run(source->plan().lattice.layers()));
}

TEST(Mask, EveryVoxelOfTheTileIsActiveAndTheValuesAreEvenlySpaced) {
  for (const std::string kind : {"void-and-cluster", "white", "bayer", "gradient-noise"}) {
    const FloatGrid::ConstPtr grid = wholeMask({"--size", "8,16,4", "--kind", kind});
    std::vector<float> values;
    for (auto voxel = grid->cbeginValueOn(); voxel; ++voxel) values.push_back(*voxel);
    ASSERT_EQ(values.size(), 512u);
    EXPECT_EQ(grid->evalActiveVoxelBoundingBox(),
              openvdb::CoordBBox(Coord(0, 0, 0), Coord(7, 15, 3)));
    std::sort(values.begin(), values.end());
    for (int i = 0; i < 512; ++i) EXPECT_FLOAT_EQ(values[i], (i + 0.5f) / 512);
  }
}

TEST(Mask, ValuesAreTheRanksOfTheKernel) {
  VoidAndCluster settings;
  settings.size = {8, 9, 10};
  settings.kernel.shape = MaskKernel::Shape::gauss;
  settings.kernel.sigma = {1.1, 0.9, 1.3};
  settings.seed = 5;
  const std::vector<std::uint32_t> ranks = voidAndCluster(settings);
  const FloatGrid::ConstPtr grid =
      wholeMask({"--size", "8,9,10", "--kernel", "gauss", "--sigma", "1.1,0.9,1.3", "--seed", "5"});
  FloatGrid::ConstAccessor voxels = grid->getConstAccessor();
  for (int z = 0; z < 10; ++z) {
    for (int y = 0; y < 9; ++y) {
      for (int x = 0; x < 8; ++x) {
        EXPECT_FLOAT_EQ(voxels.getValue({x, y, z}), (ranks[(z * 9 + y) * 8 + x] + 0.5f) / 720);
      }
    }
  }
}

TEST(Mask, SlabsInAnyOrderAreThePartsOfTheWhole) {
  const std::vector<std::string> arguments{"--size", "8,8,20"};
  const FloatGrid::ConstPtr whole = wholeMask(arguments);
  const std::unique_ptr<Source> source = maskOf(arguments);
  EXPECT_EQ(source->plan().lattice.layers(), (ZRange{0, 20}));
  for (const ZRange core : {ZRange{16, 20}, ZRange{0, 8}, ZRange{8, 16}}) {
    const FloatGrid::ConstPtr slab = gridOf(source->run(core));
    EXPECT_EQ(slab->activeVoxelCount(), 64u * core.size());
    for (auto voxel = slab->cbeginValueOn(); voxel; ++voxel) {
      EXPECT_TRUE(core.contains(voxel.getCoord().z()));
      EXPECT_EQ(*voxel, whole->tree().getValue(voxel.getCoord()));
    }
  }
}

TEST(Mask, MetadataSaysHowItWasMade) {
  const FloatGrid::ConstPtr grid =
      wholeMask({"--size", "8", "--sigma", "1.5", "--seed", "3", "--kernel", "axis-mix"});
  EXPECT_EQ(grid->getName(), "mask");
  EXPECT_EQ(grid->metaValue<openvdb::Vec3i>("mask:size"), openvdb::Vec3i(8));
  EXPECT_EQ(grid->metaValue<std::string>("mask:kind"), "void-and-cluster");
  EXPECT_EQ(grid->metaValue<std::string>("mask:kernel"), "axis-mix");
  EXPECT_EQ(grid->metaValue<openvdb::Vec3d>("mask:sigma"), openvdb::Vec3d(1.5));
  EXPECT_EQ(grid->metaValue<double>("mask:plane_sigma"), 2.3);
  EXPECT_EQ(grid->metaValue<double>("mask:space_weight"), 2.0);
  EXPECT_EQ(grid->metaValue<int>("mask:seed"), 3);
  EXPECT_EQ((*wholeMask({"--size", "8", "--kind", "bayer"}))["mask:seed"], nullptr);
}

TEST(Mask, BayerSplitsEveryCellOfTwoEvenlyAtEveryThreshold) {
  const FloatGrid::ConstPtr grid = wholeMask({"--size", "8", "--kind", "bayer"});
  FloatGrid::ConstAccessor voxels = grid->getConstAccessor();
  for (int z = 0; z < 8; z += 2) {
    for (int y = 0; y < 8; y += 2) {
      for (int x = 0; x < 8; x += 2) {
        std::vector<int> eighths;
        for (int i = 0; i < 8; ++i) {
          eighths.push_back(
              static_cast<int>(8 * voxels.getValue({x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)})));
        }
        EXPECT_THAT(eighths, testing::UnorderedElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
      }
    }
  }
}

TEST(Mask, FlatBayerIsTheClassicMatrix) {
  const FloatGrid::ConstPtr grid = wholeMask({"--size", "4,4,1", "--kind", "bayer"});
  const int expected[4][4] = {{0, 8, 2, 10}, {12, 4, 14, 6}, {3, 11, 1, 9}, {15, 7, 13, 5}};
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      EXPECT_FLOAT_EQ(grid->tree().getValue({x, y, 0}), (expected[y][x] + 0.5f) / 16)
          << x << ' ' << y;
    }
  }
}

TEST(Mask, GradientNoiseIsSmoothWithinItsCellsAndAcrossTheBorderOfTheTile) {
  const std::vector<std::string> arguments{"--size", "32", "--kind", "gradient-noise", "--cell"};
  const auto step = [&](const std::string& cell, int x) {
    std::vector<std::string> given = arguments;
    given.push_back(cell);
    const FloatGrid::ConstPtr grid = wholeMask(given);
    FloatGrid::ConstAccessor voxels = grid->getConstAccessor();
    double sum = 0;
    for (int z = 0; z < 32; ++z) {
      for (int y = 0; y < 32; ++y)
        sum += std::abs(voxels.getValue({x, y, z}) - voxels.getValue({(x + 1) % 32, y, z}));
    }
    return sum / (32 * 32);
  };
  // Independent thresholds differ by 1/3 in the mean.
  EXPECT_LT(step("16", 5), 0.1);
  EXPECT_LT(step("16", 15), 0.1);
  EXPECT_LT(step("16", 31), 0.1);
  EXPECT_GT(step("2", 5), 0.15);
}

TEST(Mask, GradientNoiseDependsOnItsSeed) {
  const auto mask = [](const char* seed) {
    return wholeMask({"--size", "8", "--kind", "gradient-noise", "--seed", seed});
  };
  const auto differing = [](const FloatGrid& a, const FloatGrid& b) {
    int count = 0;
    for (auto voxel = a.cbeginValueOn(); voxel; ++voxel)
      count += *voxel != b.tree().getValue(voxel.getCoord());
    return count;
  };
  EXPECT_EQ(differing(*mask("4"), *mask("4")), 0);
  EXPECT_GT(differing(*mask("4"), *mask("5")), 400);
}

TEST(Mask, ImpossibleSizesAndSigmasAreRefusedBeforeWork) {
  const auto refusal = [](const std::vector<std::string>& arguments) -> std::string {
    try {
      maskOf(arguments)->plan();
    } catch (const UsageError& error) {
      return error.what();
    }
    return "accepted";
  };
  for (const char* size : {"8,0,8", "257", "8.5"}) {
    EXPECT_EQ(refusal({"--size", size}),
              "--size: '" + std::string(size) +
                  "' is not accepted; the value must be one whole number or three, separated by "
                  "commas, each from 1 to 256");
  }
  EXPECT_EQ(refusal({"--size", "12", "--kind", "bayer"}),
            "--size: --kind bayer needs a power of two, not 12");
  EXPECT_EQ(refusal({"--size", "8,12,10", "--kind", "gradient-noise"}),
            "--size: --kind gradient-noise needs a multiple of --cell 4, not 10");
  EXPECT_EQ(refusal({"--sigma", "0.2"}),
            "--sigma: '0.2' is not accepted; the value must be one number or three, separated by "
            "commas, each from 0.3 to 16");
  EXPECT_EQ(refusal({"--size", "8"}), "accepted");
  EXPECT_EQ(refusal({"--size", "8", "--kind", "white", "--sigma", "2"}),
            "--sigma: belongs to --kind void-and-cluster; leave it out, or give that too");
  EXPECT_EQ(refusal({"--size", "8", "--kernel", "gauss", "--plane-sigma", "2"}),
            "--plane-sigma: belongs to --kernel axis-mix; leave it out, or give that too");
  EXPECT_EQ(refusal({"--size", "8", "--space-weight", "2"}),
            "--space-weight: belongs to --kernel axis-mix or exponential; leave it out, or give "
            "that too");
  EXPECT_EQ(refusal({"--size", "8", "--kernel", "exponential", "--space-weight", "2"}), "accepted");
  EXPECT_EQ(refusal({"--size", "8", "--cell", "2"}),
            "--cell: belongs to --kind gradient-noise; leave it out, or give that too");
}

class Stopping : public Reporter {
 public:
  void warn(const std::string&) override {}
  void count(const std::string&, double) override {}
  void progress(double) override { throw std::runtime_error("stopped"); }
};

TEST(Mask, CanBeStopped) {
  const std::unique_ptr<Source> source = maskOf({"--size", "32,32,4"});
  Stopping reporter;
  source->setReporter(&reporter);
  const Schema schema = source->plan();
  EXPECT_THROW(static_cast<void>(source->run(schema.lattice.layers())), std::runtime_error);
}

}  // namespace
}  // namespace vdbdither
