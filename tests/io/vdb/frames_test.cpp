#include "io/vdb/frames.h"

#include <cmath>
#include <csignal>
#include <random>
#include <sys/mman.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

Schema schemaOfSample() {
  Schema schema;
  schema.lattice.pitch_mm = {0.042, 0.084, 0.022};
  schema.lattice.box = openvdb::CoordBBox({0, 0, -8}, {30, 30, 23});
  const auto surface = openvdb::FloatGrid::create(0.5F);
  surface->setTransform(openvdb::math::Transform::createLinearTransform(1));
  surface->transform().preScale(schema.lattice.pitch_mm);
  schema.grids["surface"] = surface;
  schema.metadata["vdbdither:history"] = "mesh2sdf part.stl";
  return schema;
}

Slab slabOf(const Schema& schema, ZRange core) {
  const auto grid =
      openvdb::gridPtrCast<openvdb::FloatGrid>(schema.grids.at("surface")->deepCopyGrid());
  for (int z = core.begin; z < core.end; ++z)
    grid->tree().setValue({z & 7, 3, z}, 0.01F * static_cast<float>(z));
  return {core, core, {{"surface", grid}}};
}

/// What a writer puts on a pipe for slabs of eight layers.
std::string recorded(const std::string& history = "mesh2sdf part.stl") {
  Schema schema = schemaOfSample();
  schema.metadata["vdbdither:history"] = history;
  const int file = ::memfd_create("frames", 0);
  FrameWriter writer(file);
  writer.head(schema);
  for (int z = -8; z < 24; z += 8) writer.slab(slabOf(schema, {z, z + 8}));
  writer.end();
  std::string bytes(::lseek(file, 0, SEEK_END), 0);
  EXPECT_EQ(::pread(file, bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
  ::close(file);
  return bytes;
}

/// Reads all frames of `bytes`; returns what it is refused with, or the number of slabs.
std::string outcome(const std::string& bytes) {
  const int file = ::memfd_create("frames", 0);
  EXPECT_EQ(::write(file, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  ::lseek(file, 0, SEEK_SET);
  std::string result;
  try {
    FrameReader reader(file, "the pipe");
    int slabs = 0;
    while (reader.next()) ++slabs;
    result = std::to_string(slabs);
  } catch (const DataError& error) {
    result = error.what();
  }
  ::close(file);
  return result;
}

class Frames : public testing::Test {
 protected:
  void SetUp() override { initializeVdb(); }
};

TEST_F(Frames, SlabsArriveAsTheyWereSent) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const Schema schema = schemaOfSample();
  std::thread upstream([&] {
    FrameWriter writer(ends[1]);
    writer.head(schema);
    for (int z = -8; z < 24; z += 8) writer.slab(slabOf(schema, {z, z + 8}));
    writer.end();
    ::close(ends[1]);
  });
  FrameReader reader(ends[0], "the pipe");
  EXPECT_EQ(reader.schema().lattice, schema.lattice);
  EXPECT_EQ(reader.schema().metadata, schema.metadata);
  for (int z = -8; z < 24; z += 8) {
    const std::optional<Slab> slab = reader.next();
    ASSERT_TRUE(slab);
    EXPECT_EQ(slab->core, (ZRange{z, z + 8}));
    EXPECT_EQ(archiveBytes({slab->grids, {}}, VdbCodec::none),
              archiveBytes({slabOf(schema, {z, z + 8}).grids, {}}, VdbCodec::none));
  }
  EXPECT_FALSE(reader.next());
  upstream.join();
  ::close(ends[0]);
}

TEST_F(Frames, EveryTruncationIsAnError) {
  const std::string bytes = recorded();
  ASSERT_EQ(outcome(bytes), "4");
  for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 40) {
    EXPECT_NE(outcome(bytes.substr(0, size)).size(), 1U) << size;
  }
  EXPECT_EQ(outcome(""), "the pipe is empty: the run upstream failed, or nothing was piped in");
}

TEST_F(Frames, AMissingSlabIsAnError) {
  const std::string bytes = recorded();
  const std::size_t second = bytes.find(" BDV", 4);
  const std::size_t third = bytes.find(" BDV", second + 4);
  ASSERT_NE(third, std::string::npos);
  EXPECT_EQ(outcome(bytes.substr(0, second) + bytes.substr(third)),
            "the pipe has a frame out of place: 'end 32'; make it again");
  EXPECT_EQ(outcome(bytes.substr(second)), "the pipe does not begin with a head frame");
  EXPECT_EQ(outcome(bytes.substr(0, third)),
            "the pipe ended before its closing frame: the run upstream failed or was stopped");
}

/// Where the archives of `bytes` begin.
std::vector<std::size_t> beginnings(const std::string& bytes) {
  std::vector<std::size_t> found;
  for (std::size_t at = bytes.find(" BDV"); at != std::string::npos;
       at = bytes.find(" BDV", at + 4))
    found.push_back(at);
  return found;
}

TEST_F(Frames, FramesOfAnotherRunAreRefused) {
  const std::string mixed =
      "the pipe mixes the frames of two runs; give each run a pipe of its own, "
      "and combine what they make by csg";
  const std::string ours = recorded();
  const std::string others = recorded("mesh2sdf other.stl");
  const std::vector<std::size_t> a = beginnings(ours);
  const std::vector<std::size_t> b = beginnings(others);
  ASSERT_EQ(a.size(), 6U);
  ASSERT_EQ(b.size(), 6U);
  // Each frame in turn is replaced by that of the other run, which fits otherwise.
  for (std::size_t frame = 1; frame < 6; ++frame) {
    const std::string replaced =
        others.substr(b[frame], frame < 5 ? b[frame + 1] - b[frame] : others.npos);
    const std::string rest = frame < 5 ? ours.substr(a[frame + 1]) : "";
    EXPECT_EQ(outcome(ours.substr(0, a[frame]) + replaced + rest), mixed) << frame;
  }
  EXPECT_EQ(outcome(ours.substr(0, a[1]) + others + ours.substr(a[1])), mixed);
  EXPECT_EQ(outcome(ours.substr(0, a[3]) + others.substr(0, b[1]) + ours.substr(a[3])), mixed);
  // Two runs of one command line begin alike.
  EXPECT_EQ(outcome(ours.substr(0, a[1]) + ours), mixed);
}

TEST_F(Frames, FramesThatRunIntoEachOtherAreDamage) {
  const std::string ours = recorded();
  const std::string others = recorded("mesh2sdf other.stl");
  const std::size_t slab = beginnings(ours)[1];
  EXPECT_EQ(outcome(ours.substr(0, slab + 200) + others + ours.substr(slab + 200)),
            "the pipe is damaged: its checksum does not match; make it again, and give each run a "
            "pipe of its own");
}

TEST_F(Frames, TheIdOfARunDependsOnItAlone) {
  EXPECT_EQ(recorded(), recorded());
  EXPECT_NE(recorded(), recorded("mesh2sdf other.stl"));
}

TEST_F(Frames, ADoubledOrSwappedSlabIsOutOfPlace) {
  const std::string bytes = recorded();
  const std::vector<std::size_t> at = beginnings(bytes);
  const auto frame = [&](std::size_t n) { return bytes.substr(at[n], at[n + 1] - at[n]); };
  EXPECT_EQ(outcome(frame(0) + frame(1) + frame(1) + frame(2) + frame(3) + frame(4) +
                    bytes.substr(at[5])),
            "the pipe has a frame out of place: 'slab -8 0'; make it again");
  EXPECT_EQ(outcome(frame(0) + frame(2) + frame(1) + frame(3) + frame(4) + bytes.substr(at[5])),
            "the pipe has a frame out of place: 'slab -8 0'; make it again");
}

TEST_F(Frames, WhatFollowsTheClosingFrameIsRefused) {
  const std::string bytes = recorded();
  EXPECT_EQ(outcome(bytes + bytes),
            "the pipe goes on behind its closing frame: another archive follows; pipe in one run "
            "or one file at a time");
  EXPECT_EQ(outcome(bytes + "\n"),
            "the pipe goes on behind its closing frame: 1 byte follows; pipe in one run or one "
            "file at a time");
  EXPECT_EQ(outcome(bytes + std::string(3 << 20, 'x')),
            "the pipe goes on behind its closing frame: 3145728 bytes follow; pipe in one run or "
            "one file at a time");
}

TEST_F(Frames, WhatFollowsASingleArchiveIsRefused) {
  const Schema schema = schemaOfSample();
  const std::string archive = archiveBytes({slabOf(schema, {0, 8}).grids, {}}, VdbCodec::none);
  EXPECT_EQ(outcome(archive + archive),
            "the pipe goes on behind its archive: another archive follows; pipe in one run or one "
            "file at a time");
  EXPECT_EQ(outcome(archive + recorded()),
            "the pipe goes on behind its archive: another archive follows; pipe in one run or one "
            "file at a time");
  EXPECT_EQ(outcome(archive + "12"),
            "the pipe goes on behind its archive: 2 bytes follow; pipe in one run or one file at a "
            "time");
}

TEST_F(Frames, GridsAreCheckedAsTheyCome) {
  const Schema schema = schemaOfSample();
  Grids grids = slabOf(schema, {0, 8}).grids;
  openvdb::gridPtrCast<openvdb::FloatGrid>(
      std::const_pointer_cast<openvdb::GridBase>(grids.at("surface")))
      ->tree()
      .setValue({1, 3, 5}, std::nanf(""));
  const std::string refused =
      "the pipe: grid 'surface' holds nan at voxel 1 3 5, which is not a finite number; mend it in "
      "the tool that it comes from";
  EXPECT_EQ(outcome(archiveBytes({grids, {}}, VdbCodec::none)), refused);
  const int file = ::memfd_create("frames", 0);
  FrameWriter writer(file);
  writer.head(schema);
  writer.slab({{0, 8}, {0, 8}, grids});
  writer.end();
  std::string bytes(::lseek(file, 0, SEEK_END), 0);
  EXPECT_EQ(::pread(file, bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
  ::close(file);
  EXPECT_EQ(outcome(bytes), refused);
}

TEST_F(Frames, AFlippedByteIsFound) {
  const std::string bytes = recorded();
  std::mt19937 random(5);
  for (int i = 0; i < 300; ++i) {
    std::string damaged = bytes;
    const std::size_t at = std::uniform_int_distribution<std::size_t>(60, bytes.size() - 1)(random);
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << (i % 8)));
    // The one digit that marks a UUID as a digest, and the bytes that nobody reads, may change
    // unseen.
    if (outcome(damaged) == "4") {
      const std::size_t frame = damaged.rfind(" BDV", at);
      EXPECT_TRUE(at - frame == 21 + 14 || at - frame == 21 + 19) << at - frame;
    }
  }
}

/// The whole of `bytes` as one archive, or what it is refused with.
std::string wholeOf(const std::string& bytes) {
  const int file = ::memfd_create("frames", 0);
  EXPECT_EQ(::write(file, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  ::lseek(file, 0, SEEK_SET);
  std::string result;
  try {
    result = archiveBytes(FrameReader::readWhole(file, "the pipe"), VdbCodec::none);
  } catch (const DataError& error) {
    result = error.what();
  }
  ::close(file);
  return result;
}

TEST_F(Frames, TheWholeOfThemIsWhatAFileHolds) {
  const Schema schema = schemaOfSample();
  const VdbContents file = contentsOf(schema, slabOf(schema, {-8, 24}).grids);
  const std::string archive = archiveBytes(file, VdbCodec::none);
  EXPECT_EQ(wholeOf(recorded()), archive);
  EXPECT_EQ(wholeOf(archive), archive);
  const int pipe = ::memfd_create("frames", 0);
  FrameWriter writer(pipe);
  writer.head(schema);
  writer.end();
  ::lseek(pipe, 0, SEEK_SET);
  EXPECT_TRUE(FrameReader::readWhole(pipe, "the pipe").grids.at("surface")->empty());
  ::close(pipe);
}

TEST_F(Frames, TheWholeIsRefusedWherePartOfItIsMissingOrMoreFollows) {
  const std::string bytes = recorded();
  const std::size_t end = bytes.rfind(" BDV");
  EXPECT_EQ(wholeOf(bytes.substr(0, end)),
            "the pipe ended before its closing frame: the run upstream failed or was stopped");
  const Schema schema = schemaOfSample();
  const std::string archive =
      archiveBytes(contentsOf(schema, slabOf(schema, {-8, 24}).grids), VdbCodec::none);
  EXPECT_EQ(wholeOf(archive + archive),
            "the pipe goes on behind its archive: another archive follows; pipe in one run or one "
            "file at a time");
}

TEST_F(Frames, AnArchiveOfAnotherToolIsOneSlab) {
  const Schema schema = schemaOfSample();
  EXPECT_EQ(outcome(archiveBytes({slabOf(schema, {0, 8}).grids, {}}, VdbCodec::none)), "1");
}

TEST_F(Frames, TextIsNoStream) {
  EXPECT_NE(outcome(std::string(500, 'x')).find("the pipe is not a readable VDB archive"),
            std::string::npos);
}

TEST_F(Frames, AReaderThatWentAwayIsAnError) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ::close(ends[0]);
  const auto old = ::signal(SIGPIPE, SIG_IGN);
  try {
    FrameWriter(ends[1]).head(schemaOfSample());
    ADD_FAILURE();
  } catch (const DataError& error) {
    EXPECT_STREQ(error.what(), "the reader of the pipe has gone");
  }
  ::signal(SIGPIPE, old);
  ::close(ends[1]);
}

}  // namespace
}  // namespace vdbdither
