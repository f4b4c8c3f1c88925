#include "io/vdb/archive_check.h"

#include <array>
#include <cstdint>
#include <functional>
#include <random>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/io/DelayedLoadMetadata.h>
#include <openvdb/points/PointDataGrid.h>

#include "io/vdb/archive_digest.h"
#include "io/vdb/byte_cursor.h"
#include "io/vdb/tree_check.h"
#include "tests/support/archive_bytes.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using test::archiveHeader;
using test::bytesOf;
using test::count;
using test::metadataEntry;
using test::sized;
using test::streamOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::uint32_t plain = openvdb::io::COMPRESS_NONE;
constexpr std::uint32_t masked = openvdb::io::COMPRESS_ACTIVE_MASK;
constexpr std::uint32_t blosc = openvdb::io::COMPRESS_ACTIVE_MASK | openvdb::io::COMPRESS_BLOSC;
constexpr std::uint32_t zip = openvdb::io::COMPRESS_ACTIVE_MASK | openvdb::io::COMPRESS_ZIP;

template <typename GridT>
class ReadTypes : public testing::Test {
 protected:
  void SetUp() override { initializeVdb(); }

  using Value = typename GridT::ValueType;

  static Value value(int number) {
    if constexpr (openvdb::VecTraits<Value>::IsVec) {
      return Value(static_cast<typename Value::value_type>(number));
    } else if constexpr (std::is_same_v<Value, bool>) {
      return number % 2 != 0;
    } else {
      return static_cast<Value>(number);
    }
  }

  /// A grid with nodes and tiles at every level, in several branches, with inactive values of every
  /// kind of packing.
  static typename GridT::Ptr drawn(int inactive_values) {
    const auto grid = GridT::create(value(0));
    grid->setName("drawn");
    auto& tree = grid->tree();
    tree.addTile(3, {8192, 0, 0}, value(3), true);
    tree.addTile(2, {0, 512, 0}, value(5), true);
    tree.addTile(1, {64, 0, 8}, value(7), true);
    for (const Coord& origin : {Coord(0, 0, 0), Coord(-5000, 4096, 16), Coord(40000, -8, 0)}) {
      for (int n = 0; n < 90; ++n) {
        const Coord voxel = origin + Coord(n % 11, n % 5, n % 17);
        tree.setValue(voxel, value(n));
        if (n < inactive_values) tree.setValueOff(voxel + Coord(0, 6, 1), value(1 + 2 * n));
      }
    }
    return grid;
  }
};

using Types =
    testing::Types<openvdb::FloatGrid, openvdb::DoubleGrid, openvdb::Int32Grid, openvdb::Int64Grid,
                   openvdb::Vec3SGrid, openvdb::Vec3DGrid, openvdb::BoolGrid, openvdb::MaskGrid>;
TYPED_TEST_SUITE(ReadTypes, Types);

TYPED_TEST(ReadTypes, AreReadFromEveryPacking) {
  for (const std::uint32_t compression : {plain, masked, blosc, zip}) {
    for (const int inactive_values : {0, 1, 2, 60}) {
      for (const bool as_half : {false, true}) {
        const auto grid = this->drawn(inactive_values);
        grid->setSaveFloatAsHalf(as_half);
        const VdbContents contents =
            contentsOfBytes(streamOf({grid, grid->deepCopyGrid()}, {}, compression), "it");
        ASSERT_EQ(contents.grids.size(), 2U);
        for (const auto& [name, found] : contents.grids) {
          const auto read = openvdb::gridConstPtrCast<TypeParam>(found);
          ASSERT_TRUE(read);
          ASSERT_TRUE(read->tree().hasSameTopology(grid->tree()));
          for (auto entry = grid->cbeginValueAll(); entry; ++entry)
            ASSERT_EQ(read->tree().getValue(entry.getCoord()), *entry);
        }
      }
    }
  }
}

TYPED_TEST(ReadTypes, TakeTheMemoryThatIsForeseen) {
  const auto grid = this->drawn(2);
  const std::string bytes = streamOf({grid});
  std::istringstream stream(bytes);
  stream.exceptions(std::ios::badbit | std::ios::failbit);
  const auto layout = treeLayoutOf(grid->type());
  ASSERT_TRUE(layout);
  const std::string map = "UniformScaleMap";
  stream.seekg(static_cast<std::streamoff>(bytes.rfind(map) + map.size() + 15 * sizeof(double)));
  ByteCursor cursor(stream, bytes.size());
  const auto foreseen =
      static_cast<double>(passTree(cursor, stream, *layout, {.compression = blosc}));
  EXPECT_EQ(cursor.left(), 0U);
  const auto taken = static_cast<double>(grid->tree().memUsage());
  EXPECT_GE(foreseen, 0.98 * taken);
  EXPECT_LE(foreseen, 1.1 * taken);
}

TYPED_TEST(ReadTypes, AreReadOrRefusedWithAnyByteSpoiled) {
  std::minstd_rand random(1);
  int refused = 0;
  for (const std::uint32_t compression : {plain, blosc, zip}) {
    const std::string whole = streamOf({this->drawn(2)}, {}, compression);
    for (int i = 0; i < 150; ++i) {
      std::string spoiled = whole;
      // Most bytes are masks of inner nodes; the others are near the beginning and the end.
      const std::size_t range = i % 2 == 0 ? whole.size() : 400;
      const std::size_t at = random() % range;
      spoiled[i % 4 < 2 ? at : whole.size() - 1 - at] = static_cast<char>(random());
      try {
        contentsOfBytes(spoiled, "it");
      } catch (const DataError& error) {
        ++refused;
        EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      }
    }
    for (int i = 1; i < 40; ++i) {
      const std::string cut = whole.substr(0, whole.size() * i / 40);
      EXPECT_THROW(contentsOfBytes(cut, "it"), DataError);
    }
  }
  EXPECT_GT(refused, 20);
}

/// Bytes of one grid, of which any part can be spoiled.
struct GridBytes {
  std::string type = "Tree_float_5_4_3";
  std::uint32_t compression = masked;
  std::string metadata = count(0);
  std::string map = sized("ScaleMap") + numbers(15);
  std::string background = bytesOf(1.0F);
  std::string tiles;
  std::uint32_t tile_count = 0;
  std::uint32_t branch_count = 1;
  Coord origin{0, 0, 0};
  std::string upper_children = mask(4096, 0);  ///< the place of a child
  std::string upper_active = mask(4096);
  std::string upper_values = std::string(1, '\0');
  std::string lower_children = mask(512, 0);
  std::string lower_active = mask(512);
  std::string lower_values = std::string(1, '\0');
  std::string leaf_active = mask(64);
  std::string leaf = mask(64) + std::string(1, '\0');
  std::int64_t end = 0;

  static std::string numbers(int count) {
    std::string bytes;
    for (int i = 0; i < count; ++i) bytes += bytesOf(1.0);
    return bytes;
  }

  static std::string mask(std::size_t bytes, int on = -1) {
    std::string bits(bytes, '\0');
    if (on >= 0) bits[on / 8] = static_cast<char>(1 << (on % 8));
    return bits;
  }

  static std::string placeOf(const Coord& at) {
    return bytesOf(at.x()) + bytesOf(at.y()) + bytesOf(at.z());
  }

  [[nodiscard]] std::string branch(const Coord& at) const {
    return placeOf(at) + upper_children + upper_active + upper_values + lower_children +
           lower_active + lower_values + leaf_active;
  }

  [[nodiscard]] std::string topology() const {
    std::string bytes = count(1) + background + count(tile_count) + count(branch_count) + tiles;
    for (std::uint32_t i = 0; i < branch_count; ++i) bytes += branch(origin);
    return bytes;
  }

  [[nodiscard]] std::string archive(bool states_ends = false) const {
    return archiveHeader(openvdb::OPENVDB_FILE_VERSION, states_ends) + count(0) + count(1) +
           sized("a") + sized(type) + sized("") + std::string(16, '\0') + bytesOf(end) +
           count(compression) + metadata + map + topology() + leaf;
  }
};

class HostileArchives : public testing::Test {
 protected:
  void SetUp() override { initializeVdb(); }

  static std::string refusal(const GridBytes& grid) {
    try {
      contentsOfBytes(grid.archive(), "it");
    } catch (const DataError& error) {
      return error.what();
    }
    return "";
  }

  /// What is said of a grid that `spoil` has changed.
  static std::string refused(const std::function<void(GridBytes&)>& spoil) {
    GridBytes grid;
    spoil(grid);
    return refusal(grid);
  }

  static std::string refusedFlags(const std::function<void(GridBytes&)>& spoil) {
    GridBytes grid;
    grid.type = "Tree_bool_5_4_3";
    grid.background = std::string(1, '\0');
    grid.leaf = GridBytes::mask(64) + GridBytes::placeOf({0, 0, 0}) + GridBytes::mask(64);
    spoil(grid);
    return refusal(grid);
  }
};

TEST_F(HostileArchives, TheirSoundLikeIsRead) {
  EXPECT_EQ(refused([](GridBytes&) {}), "");
  EXPECT_EQ(refusedFlags([](GridBytes&) {}), "");
}

TEST_F(HostileArchives, ThePlaceAndTheFaultAreTold) {
  const GridBytes sound;
  GridBytes spoiled = sound;
  spoiled.upper_values = std::string(1, '\7');
  const std::size_t at = sound.archive().size() - sound.leaf.size() - sound.leaf_active.size() -
                         sound.lower_values.size() - 2 * sound.lower_active.size();
  EXPECT_EQ(refusal(spoiled),
            "it is not a readable VDB archive: grid 'a' is damaged at byte " + std::to_string(at) +
                ": its values are packed in an unknown way; make it again in the tool that it "
                "comes from");
}

TEST_F(HostileArchives, NodesOutOfPlaceAreRefused) {
  const char* nowhere = "a node lies where none can lie";
  const char* twice = "two nodes lie at one place";
  EXPECT_THAT(refused([](GridBytes& grid) { grid.origin = {8, 0, 0}; }), HasSubstr(nowhere));
  EXPECT_THAT(refused([](GridBytes& grid) { grid.branch_count = 2; }), HasSubstr(twice));
  const auto tile = [](const Coord& at, char is_active = 0) {
    return [at, is_active](GridBytes& grid) {
      grid.tile_count = 1;
      grid.tiles = GridBytes::placeOf(at) + bytesOf(2.0F) + std::string(1, is_active);
    };
  };
  EXPECT_EQ(refused(tile({4096, 0, -4096}, 1)), "");
  EXPECT_THAT(refused(tile({0, 0, 0})), HasSubstr(twice));
  EXPECT_THAT(refused(tile({0, 1, 4096})), HasSubstr(nowhere));
  EXPECT_THAT(refused(tile({4096, 0, 0}, 2)), HasSubstr("neither true nor false"));
  const char* both = "a node is a child and a tile";
  EXPECT_THAT(refused([](GridBytes& grid) { grid.upper_active = grid.upper_children; }),
              HasSubstr(both));
  EXPECT_THAT(refused([](GridBytes& grid) { grid.lower_active = grid.lower_children; }),
              HasSubstr(both));
  EXPECT_THAT(
      refusedFlags([](GridBytes& grid) {
        grid.leaf = GridBytes::mask(64) + GridBytes::placeOf({0, 0, 8}) + GridBytes::mask(64);
      }),
      HasSubstr("a leaf lies elsewhere than its node"));
}

TEST_F(HostileArchives, CountsBeyondTheEndAreRefused) {
  const char* early = "it is not a readable VDB archive: it ends too early";
  // What follows is no tile.
  EXPECT_THAT(refused([](GridBytes& grid) { grid.tile_count = 0xFFFFFFFF; }),
              HasSubstr("two nodes lie at one place"));
  EXPECT_EQ(refused([](GridBytes& grid) { grid.lower_children = std::string(512, '\xff'); }),
            early);
  EXPECT_EQ(refused([](GridBytes& grid) { grid.upper_children = std::string(4096, '\xff'); }),
            early);
}

TEST_F(HostileArchives, PackedValuesOfAnotherSizeAreRefused) {
  const char* size = "packed values have another size than they state";
  for (const std::uint32_t compression : {blosc, zip}) {
    const auto leafOf = [&](std::int64_t stated, const std::string& packed) {
      return refused([&](GridBytes& grid) {
        grid.compression = compression;
        grid.upper_values += bytesOf(std::int64_t{0});
        grid.lower_values += bytesOf(std::int64_t{0});
        grid.leaf = GridBytes::mask(64, 9) + std::string(1, '\0') + bytesOf(stated) + packed;
      });
    };
    EXPECT_EQ(leafOf(-4, bytesOf(0.5F)), "");
    // OpenVDB would read these into a buffer of four bytes.
    EXPECT_THAT(leafOf(-4000, std::string(4000, '\1')), HasSubstr(size));
    EXPECT_THAT(leafOf(INT64_MIN, std::string(4000, '\1')), HasSubstr(size));
    EXPECT_THAT(leafOf(0, ""), HasSubstr(size));
    EXPECT_THAT(leafOf(INT64_MAX, "1234"), HasSubstr("it ends too early"));
    EXPECT_THAT(leafOf(5, "1234"), HasSubstr("it ends too early"));
  }
}

TEST_F(HostileArchives, HeadersOfBloscOfAnotherSizeAreRefused) {
  const auto leafOf = [](std::uint32_t unpacked, std::uint32_t packed) {
    return refused([&](GridBytes& grid) {
      grid.compression = blosc;
      grid.upper_values += bytesOf(std::int64_t{0});
      grid.lower_values += bytesOf(std::int64_t{0});
      // 20 bytes that are not packed, as Blosc stores them: format 2, flag 2.
      const std::string chunk = std::string("\2\1\2\4", 4) + count(unpacked) + count(4) +
                                count(packed) + std::string(4, '\0');
      grid.leaf = GridBytes::mask(64, 9) + std::string(1, '\0') + bytesOf(std::int64_t{20}) + chunk;
    });
  };
  const char* size = "packed values have another size than they state";
  EXPECT_EQ(leafOf(4, 20), "");
  EXPECT_THAT(leafOf(4000, 20), HasSubstr(size));
  EXPECT_THAT(leafOf(4, 2000), HasSubstr(size));
}

TEST_F(HostileArchives, FlagsThatAreNeitherTrueNorFalseAreRefused) {
  const char* neither = "it holds a value that is neither true nor false";
  EXPECT_THAT(refusedFlags([](GridBytes& grid) { grid.background = "\2"; }), HasSubstr(neither));
  EXPECT_THAT(refusedFlags([](GridBytes& grid) { grid.upper_values = std::string("\2\3", 2); }),
              HasSubstr(neither));
  EXPECT_THAT(refusedFlags([](GridBytes& grid) {
                grid.upper_active = GridBytes::mask(4096, 5);
                grid.upper_values = std::string("\0\3", 2);
              }),
              HasSubstr(neither));
  EXPECT_THAT(refusedFlags([](GridBytes& grid) {
                grid.metadata = count(1) + metadataEntry("on", "bool", "\2");
              }),
              HasSubstr("the metadata 'on' of grid 'a' is damaged"));
}

TEST_F(HostileArchives, HalfFloatsAreWhatTheMetadataSay) {
  // OpenVDB asks the metadata and not the type, which may say otherwise.
  const auto half = [](const std::string& metadata, const std::string& values) {
    return refused([&](GridBytes& grid) {
      grid.metadata = metadata;
      grid.leaf = GridBytes::mask(64, 9) + std::string(1, '\0') + values;
    });
  };
  const std::string key = "is_saved_as_half_float";
  EXPECT_EQ(half(count(1) + metadataEntry(key, "bool", "\1"), "12"), "");
  EXPECT_EQ(half(count(1) + metadataEntry(key, "bool", std::string(1, '\0')), "1234"), "");
  EXPECT_EQ(half(count(2) + metadataEntry(key, "bool", "\1") +
                     metadataEntry(key, "bool", std::string(1, '\0')),
                 "1234"),
            "");
  EXPECT_THAT(half(count(1) + metadataEntry(key, "string", "x"), "12"),
              HasSubstr("the metadata 'is_saved_as_half_float' of grid 'a' is damaged"));
}

TEST_F(HostileArchives, TransformsThatNobodyKnowsAreRefused) {
  EXPECT_THAT(refused([](GridBytes& grid) { grid.map = count(100000000); }),
              HasSubstr("grid 'a' has a transform with a name of 95 MiB; at most 4.0 KiB"));
  EXPECT_THAT(refused([](GridBytes& grid) { grid.map = sized("BentMap"); }),
              HasSubstr("grid 'a' has the transform 'BentMap', which OpenVDB "));
  // OpenVDB would go down as deep as the file says.
  EXPECT_THAT(refused([](GridBytes& grid) {
                grid.map.clear();
                for (int depth = 0; depth < 100000; ++depth)
                  grid.map += sized("NonlinearFrustumMap") + GridBytes::numbers(8);
              }),
              HasSubstr("grid 'a' has the transform 'NonlinearFrustumMap'"));
  EXPECT_EQ(refused([](GridBytes& grid) {
              grid.map = sized("NonlinearFrustumMap");
              for (const double number : {0., 0., 0., 9., 9., 9., 0.5, 2.})
                grid.map += bytesOf(number);
              grid.map += sized("AffineMap");
              for (int i = 0; i < 16; ++i) grid.map += bytesOf(i % 5 == 0 ? 1.0 : 0.0);
            }),
            "");
}

TEST_F(HostileArchives, SizesOfLeavesAreRefusedBeforeTheyTakeMemory) {
  const std::string type = openvdb::io::DelayedLoadMetadata::staticTypeName();
  const auto said = [&](const std::string& value) {
    return refused([&](GridBytes& grid) {
      grid.metadata = count(1) + metadataEntry("file_delayed_load", type, value);
    });
  };
  const char* damaged = "the metadata 'file_delayed_load' of grid 'a' is damaged";
  const std::string none = count(0xFFFFFFFF);
  EXPECT_EQ(said(count(2) + count(0) + "12" + none), "");
  EXPECT_EQ(said(count(2) + count(0) + "12" + count(0) + std::string(16, '\1')), "");
  EXPECT_THAT(said(count(0x7FFFFFFF) + count(0) + "12" + none), HasSubstr(damaged));
  EXPECT_THAT(said(count(2) + count(0) + "12" + count(0) + std::string(8, '\1')),
              HasSubstr(damaged));
  EXPECT_THAT(said(count(2) + count(400) + std::string(100, '\1') + none), HasSubstr(damaged));
  EXPECT_THAT(said(count(2) + count(20) + std::string(4, '\1') + count(70000) + count(2) +
                   count(20) + std::string(4, '\1') + none),
              HasSubstr(damaged));
  EXPECT_THAT(said(count(2)), HasSubstr(damaged));
}

TEST_F(HostileArchives, GridsThatDoNotFitIntoMemoryAreRefused) {
  const GridBytes leafless = [] {
    GridBytes empty;
    empty.upper_children = GridBytes::mask(4096);
    empty.lower_children = empty.lower_active = empty.lower_values = empty.leaf_active = "";
    return empty;
  }();
  // 300 nodes of 264 KiB, of 8 KiB in the archive.
  std::string branches;
  for (int n = 0; n < 300; ++n) branches += leafless.branch({4096 * n, 0, 0});
  GridBytes many = leafless;
  many.branch_count = 0;
  many.leaf = branches;
  std::string bytes = many.archive();
  bytes.replace(bytes.size() - branches.size() - sizeof(std::uint32_t), sizeof(std::uint32_t),
                count(300));
  std::istringstream stream(bytes);
  const auto reading = [&](double bytes_of_memory) {
    stream.clear();
    stream.seekg(0);
    ArchiveLimits limits;
    limits.memory_bytes = bytes_of_memory;
    return readArchive(stream, bytes.size(), "it", limits).grids.size();
  };
  EXPECT_EQ(reading(80 << 20), 1U);
  EXPECT_THAT([&] { reading(70 << 20); },
              ThrowsMessage<DataError>("it takes 77 MiB of memory up to grid 'a', and 70 MiB may "
                                       "be used; leave grids out, or read it where there is more "
                                       "memory"));
}

TEST_F(HostileArchives, PointsArePassedOver) {
  const auto points = openvdb::points::PointDataGrid::create();
  points->setName("points");
  points->tree().touchLeaf({1, 2, 3});
  const auto numbers = openvdb::FloatGrid::create(0);
  numbers->setName("surface");
  numbers->tree().setValue({1, 2, 3}, 4);
  const test::ScratchFolder scratch;
  const std::string path = scratch / "points.vdb";
  writeVdb(path, {{{"points", points}, {"surface", numbers}}, {}}, VdbCodec::blosc, path);
  const VdbContents contents = readVdb(path);
  EXPECT_TRUE(contents.grids.at("points")->baseTree().leafCount() == 0);
  EXPECT_EQ(contents.grids.at("surface")->activeVoxelCount(), 1U);
  EXPECT_THAT([&] { contentsOfBytes(streamOf({points}), "it"); },
              ThrowsMessage<DataError>(
                  "it is not a readable VDB archive: grid 'points' is of type "
                  "'Tree_ptdataidx32_5_4_3', of which no operator takes the voxels; leave it out"));
  GridBytes before;
  before.type = "Tree_ptdataidx32_5_4_3";
  before.end = 70;
  EXPECT_THAT([&] { contentsOfBytes(before.archive(true), "it"); },
              ThrowsMessage<DataError>(HasSubstr("it ends before it begins")));
  before.end = INT64_MAX;
  EXPECT_THAT([&] { contentsOfBytes(before.archive(true), "it"); },
              ThrowsMessage<DataError>(HasSubstr("it ends too early")));
}

}  // namespace
}  // namespace vdbdither
