#include "io/vdb/archive_reader.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/vdb/archive_digest.h"
#include "tests/support/archive_bytes.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using openvdb::FloatGrid;
using test::archiveHeader;
using test::bytesOf;
using test::count;
using test::metadataEntry;
using test::sized;
using test::streamOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Key;
using testing::StartsWith;
using testing::ThrowsMessage;

VdbContents read(const std::string& bytes) { return contentsOfBytes(bytes, "it"); }

FloatGrid::Ptr named(const std::string& name, float value = 1) {
  const auto grid = FloatGrid::create(0);
  grid->tree().setValue({1, 2, 3}, value);
  grid->setName(name);
  return grid;
}

class ArchiveReading : public testing::Test {
 protected:
  void SetUp() override { initializeVdb(); }

  static auto reading(const std::string& bytes) {
    return [bytes] { read(bytes); };
  }
};

TEST_F(ArchiveReading, WhatOtherToolsWriteIsRead) {
  openvdb::MetaMap metadata;
  metadata.insertMeta("scene", openvdb::StringMetadata("a"));
  metadata.insertMeta("frame", openvdb::Int32Metadata(7));
  const auto shared = named("b", 5);
  const VdbContents contents =
      read(streamOf({named("a", 2), shared, shared->copyGrid()}, metadata));
  EXPECT_THAT(contents.grids, ElementsAre(Key("a"), Key("b"), Key("b_2")));
  EXPECT_EQ(contents.metadata.at("scene"), "a");
  EXPECT_EQ(contents.metadata.at("frame"), "7");
  for (const auto& [name, value] : {std::pair("a", 2), {"b", 5}, {"b_2", 5}}) {
    const auto grid = openvdb::gridConstPtrCast<FloatGrid>(contents.grids.at(name));
    EXPECT_EQ(grid->tree().getValue({1, 2, 3}), value);
    EXPECT_EQ(grid->getName(), name);
  }
}

TEST_F(ArchiveReading, NamesAndKeysBecomePrintable) {
  openvdb::MetaMap metadata;
  metadata.insertMeta("k\x1b[31m", openvdb::StringMetadata("raw\n\xff"));
  const VdbContents contents = read(streamOf(
      {named("\x1b[31mRED\x07"), named("a\nvdbdither: all is well"), named("\xe9")}, metadata));
  EXPECT_THAT(contents.grids, ElementsAre(Key("\\x1b[31mRED\\x07"), Key("\\xe9"),
                                          Key("a\\nvdbdither: all is well")));
  for (const auto& [name, grid] : contents.grids) EXPECT_EQ(grid->getName(), name);
  EXPECT_EQ(contents.metadata.at("k\\x1b[31m"), "raw\n\xff");
}

TEST_F(ArchiveReading, CountsAndSizesAreRefusedBeforeTheyAreRead) {
  EXPECT_THAT(reading(archiveHeader() + count(1000000)),
              ThrowsMessage<DataError>(
                  "it: its metadata has 1000000 entries of metadata; at most 10000 are read; "
                  "mend it in the tool that it comes from"));
  EXPECT_THAT(reading(archiveHeader() + count(1) + count(0xFFFFFFF0U)),
              ThrowsMessage<DataError>(HasSubstr(
                  "its metadata has a key of metadata of 4.0 GiB; at most 4.0 KiB are read")));
  EXPECT_THAT(
      reading(archiveHeader() + count(1) + sized("key") + sized("string") + count(0xFFFFFFF0U)),
      ThrowsMessage<DataError>(
          HasSubstr("has 4.0 GiB of metadata or more; at most 64 MiB are read")));
  EXPECT_THAT(reading(archiveHeader() + count(0) + count(2000000000)),
              ThrowsMessage<DataError>(HasSubstr("has 2000000000 grids; at most 10000 are read")));
  EXPECT_THAT(reading(archiveHeader() + count(0) + count(1) + count(100000000)),
              ThrowsMessage<DataError>(HasSubstr("grid 1 has a name of 95 MiB; at most 4.0 KiB")));
  const std::string grid =
      sized("a") + sized("Tree_float_5_4_3") + sized("") + std::string(24, '\0') + count(0);
  EXPECT_THAT(reading(archiveHeader() + count(0) + count(1) + grid + count(1000000)),
              ThrowsMessage<DataError>(HasSubstr("grid 'a' has 1000000 entries of metadata")));
}

TEST_F(ArchiveReading, SizesBeyondTheEndAreDamage) {
  EXPECT_THAT(reading(archiveHeader() + count(1) + sized("key") + sized("string") + count(5000)),
              ThrowsMessage<DataError>("it is not a readable VDB archive: it ends too early"));
  EXPECT_THAT(reading(archiveHeader() + count(1) + metadataEntry("key", "int32", "12345678")),
              ThrowsMessage<DataError>("it is not a readable VDB archive: the metadata 'key' of "
                                       "its metadata is damaged"));
  EXPECT_THAT(reading(archiveHeader()),
              ThrowsMessage<DataError>("it is not a readable VDB archive: it ends too early"));
}

TEST_F(ArchiveReading, MetadataOfUnknownTypesIsKept) {
  const VdbContents contents = read(archiveHeader() + count(1) +
                                    metadataEntry("key", "a_type_of_a_plug_in", "1234") + count(0));
  EXPECT_TRUE(contents.metadata.contains("key"));
}

TEST_F(ArchiveReading, OtherVersionsAndTypesAreNamed) {
  EXPECT_THAT(reading(archiveHeader(225)),
              ThrowsMessage<DataError>(HasSubstr(
                  "its format is 225, and those from 222 to 224 are read; save it again")));
  EXPECT_THAT(reading(archiveHeader(212)),
              ThrowsMessage<DataError>(HasSubstr("its format is 212,")));
  EXPECT_THAT(reading(archiveHeader() + count(0) + count(1) + sized("a") + sized("Tree_ax_1")),
              ThrowsMessage<DataError>(
                  HasSubstr("grid 'a' is of type 'Tree_ax_1', which OpenVDB does not know")));
}

/// Where the transform of the first grid ends: the name of its map and fifteen numbers.
std::size_t endOfTransform(const std::string& bytes) {
  const std::string name = "UniformScaleMap";
  return bytes.find(name) + name.size() + 15 * sizeof(double);
}

TEST_F(ArchiveReading, NoWordOfTheLibraryIsShown) {
  const std::string whole = streamOf({named("a")});
  const std::size_t end = endOfTransform(whole);
  ASSERT_LT(end, whole.size());
  int refused = 0;
  for (std::size_t at = 57; at < end; at += 2) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(~damaged[at]);
    try {
      read(damaged);
    } catch (const DataError& error) {
      const std::string said = error.what();
      EXPECT_EQ(said.find("Error"), std::string::npos) << said;
      EXPECT_EQ(said.find("::"), std::string::npos) << said;
      ++refused;
    }
  }
  EXPECT_GT(refused, 10);
}

TEST_F(ArchiveReading, ATransformWithoutVolumeIsNamed) {
  const auto grid = named("a");
  grid->setTransform(openvdb::math::Transform::createLinearTransform(
      openvdb::Mat4d(1., 0., 0., 0., 0., 1., 0., 0., 0.5, 0., 1., 0., 0., 0., 0., 1.)));
  const std::string bytes = streamOf({grid});
  const std::size_t matrix = bytes.find("AffineMap") + 9;
  ASSERT_LT(matrix, bytes.size());
  const std::string refused =
      "it is not a readable VDB archive: grid 'a' has a transform without volume, or of numbers "
      "that "
      "are not finite";
  std::string flat = bytes;
  flat.replace(matrix, 3 * sizeof(double), std::string(3 * sizeof(double), '\0'));
  EXPECT_THAT(reading(flat), ThrowsMessage<DataError>(refused));
  for (const double number : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    std::string shifted = bytes;
    shifted.replace(matrix + 12 * sizeof(double), sizeof(double), bytesOf(number));
    EXPECT_THAT(reading(shifted), ThrowsMessage<DataError>(refused));
  }
}

TEST_F(ArchiveReading, WhatFollowsTheArchiveIsRefused) {
  const std::string whole = streamOf({named("a")});
  EXPECT_THAT(reading(whole + "x"),
              ThrowsMessage<DataError>("it goes on behind its archive: 1 byte follows; give one "
                                       "archive at a time"));
  EXPECT_THAT(reading(whole + std::string(5000, '\0')),
              ThrowsMessage<DataError>(HasSubstr("5000 bytes follow")));
  EXPECT_THAT(reading(whole + whole),
              ThrowsMessage<DataError>(HasSubstr("another archive follows")));
}

TEST_F(ArchiveReading, TheSameIsRefusedInAFile) {
  const test::ScratchFolder scratch;
  const std::string foreign = streamOf({named("a")});
  EXPECT_THAT([&] { readVdb(scratch.write("two.vdb", foreign + foreign)); },
              ThrowsMessage<DataError>(HasSubstr("another archive follows")));
  const std::string ours = archiveBytes({{{"a", named("a")}}, {}}, VdbCodec::none);
  EXPECT_THAT([&] { readVdb(scratch.write("two.vdb", ours + ours)); },
              ThrowsMessage<DataError>(
                  HasSubstr("two.vdb' goes on behind its archive: another archive follows")));
  EXPECT_THAT([&] { readVdb(scratch.write("more.vdb", ours + "12")); },
              ThrowsMessage<DataError>(HasSubstr("2 bytes follow")));
  EXPECT_THAT([&] { readVdb(scratch.write("less.vdb", ours.substr(0, ours.size() - 1))); },
              ThrowsMessage<DataError>(HasSubstr("is cut short")));
}

}  // namespace
}  // namespace vdbdither
