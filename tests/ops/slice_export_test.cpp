#include <filesystem>
#include <memory>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <tbb/global_control.h>

#include "io/file/digest.h"
#include "io/profile/material_table.h"
#include "tests/support/drawn_grids.h"
#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/slabs.h"
#include "tests/support/told.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {
namespace {

namespace fs = std::filesystem;
using openvdb::Coord;
using openvdb::CoordBBox;
using test::drawnMaterial;
using test::fileBytes;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

struct Job {
  Schema schema;
  Grids grids;
};

Job jobOf(const openvdb::Int32Grid::Ptr& material, const CoordBBox& box) {
  Job job;
  job.schema.lattice = {{0.042, 0.084, 0.022}, {0, 0, 0}, box};
  job.schema.grids["material"] = openvdb::Int32Grid::create(0);
  job.schema.metadata[materials_key] =
      toJson({{"white", {240, 240, 240, 255}}, {"black", {26, 26, 29, 255}}});
  job.schema.metadata["vdbdither:history"] = "drawn\nby hand";
  job.grids["material"] = material;
  return job;
}

Job smallJob() {
  return jobOf(drawnMaterial({{"..1", "221"}, {"...", "1.."}}, 4),
               CoordBBox(Coord(0, 0, 4), Coord(2, 1, 5)));
}

/// Balls of two materials over several leaves.
Job largeJob() {
  auto material = openvdb::Int32Grid::create(0);
  for (auto voxel = CoordBBox(Coord(-20, -3, -11), Coord(40, 30, 30)).begin(); voxel; ++voxel) {
    const openvdb::Vec3d at = (*voxel).asVec3d();
    if ((at - openvdb::Vec3d(10, 14, 9)).length() < 15)
      material->tree().setValue(*voxel, (*voxel).x() < 12 ? 1 : 2);
  }
  return jobOf(material, CoordBBox(Coord(-20, -3, -11), Coord(40, 30, 30)));
}

/// A sink ready to plan.
struct Export {
  explicit Export(std::vector<std::string> arguments) : made(findOperator("slice-export").make()) {
    Options options;
    made->declare(options);
    options.parse(arguments);
  }
  Sink& sink() { return static_cast<Sink&>(*made); }

  void run(const Job& job, int height = 8) {
    sink().plan(job.schema);
    for (const Slab& slab : test::cutIntoSlabs(job.grids, job.schema.lattice, height))
      sink().write(slab);
    sink().finish();
    sink().publish();
  }

  std::unique_ptr<Operator> made;
};

TEST(SliceExport, SlicesAreSeenFromAboveInTheColoursOfTheMaterials) {
  const test::ScratchFolder scratch;
  Export({scratch / "out"}).run(smallJob());
  const test::PngImage image = test::readPng(fileBytes(scratch / "out/slice_00000.png"));
  EXPECT_EQ(image.width, 3U);
  EXPECT_EQ(image.height, 2U);
  EXPECT_EQ(image.colour_type, 6);
  EXPECT_EQ(image.dots_per_metre_x, 23810U);
  EXPECT_EQ(image.dots_per_metre_y, 11905U);
  EXPECT_THAT(image.rows, ElementsAre(0, 0, 0, 255, 0, 0, 0, 255, 240, 240, 240, 255,  //
                                      26, 26, 29, 255, 26, 26, 29, 255, 240, 240, 240, 255));
  EXPECT_TRUE(fs::exists(scratch / "out/slice_00001.png"));
}

TEST(SliceExport, CroppedSlicesShowWhatIsPrintedInAnyLayer) {
  const test::ScratchFolder scratch;
  Job job =
      jobOf(drawnMaterial({{"......", "..1...", "......"}, {"......", "......", "...2.."}}, 4),
            CoordBBox(Coord(-9, -5, 4), Coord(30, 8, 6)));
  const auto slice = [&](const char* name, const std::vector<std::string>& options) {
    std::vector<std::string> arguments{scratch / name, "--crop"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    Export(arguments).run(job);
    return test::readPng(fileBytes(scratch / name / "slice_00000.png"));
  };
  const test::PngImage image = slice("plain", {});
  EXPECT_EQ(image.width, 2U);
  EXPECT_EQ(image.height, 2U);
  EXPECT_THAT(image.rows, ElementsAre(240, 240, 240, 255, 0, 0, 0, 255,  //
                                      0, 0, 0, 255, 0, 0, 0, 255));
  const test::PngImage turned = slice("turned", {"--padding", "1", "--flip-x", "--flip-y"});
  EXPECT_EQ(turned.width, 4U);
  // The white voxel is in the third of four columns and rows.
  EXPECT_EQ(turned.rows[4 * (2 * 4 + 2)], 240);
  const auto manifest = nlohmann::json::parse(fileBytes(scratch / "plain/manifest.json"));
  EXPECT_EQ(manifest["frame"]["min"], (std::vector<int>{2, 0}));
  EXPECT_EQ(manifest["frame"]["max"], (std::vector<int>{3, 1}));
  EXPECT_EQ(manifest["box"]["min"], (std::vector<int>{-9, -5, 4}));
}

TEST(SliceExport, CroppedSlicesOfLargePartsAreThoseOfTheWhole) {
  const test::ScratchFolder scratch;
  const Job job = largeJob();
  Export({scratch / "whole"}).run(job);
  Export({scratch / "crop", "--crop"}).run(job);
  const auto manifest = nlohmann::json::parse(fileBytes(scratch / "crop/manifest.json"));
  const int left = static_cast<int>(manifest["frame"]["min"][0]) + 20;
  const int top = 30 - static_cast<int>(manifest["frame"]["max"][1]);
  EXPECT_EQ(left, 16);
  for (int i = 0; i < 29; ++i) {
    const std::string name = "slice_000" + std::string(i < 10 ? "0" : "") + std::to_string(i);
    const test::PngImage whole = test::readPng(fileBytes(scratch / "whole" / (name + ".png")));
    const test::PngImage crop = test::readPng(fileBytes(scratch / "crop" / (name + ".png")));
    for (std::uint32_t y = 0; y < crop.height; ++y) {
      for (std::uint32_t x = 0; x < 4 * crop.width; ++x) {
        ASSERT_EQ(crop.rows[y * 4 * crop.width + x],
                  whole.rows[(y + top) * 4 * whole.width + 4 * left + x]);
      }
    }
  }
}

TEST(SliceExport, ExrIsNotCropped) {
  const test::ScratchFolder scratch;
  Job job = smallJob();
  job.schema.grids["surface"] = openvdb::FloatGrid::create(1);
  EXPECT_THAT(
      [&] {
        Export({scratch / "out", "--format", "exr", "--crop"}).sink().plan(job.schema);
      },
      ThrowsMessage<UsageError>("--crop: exr shows more than what is printed; leave it out, or "
                                "take another format"));
}

TEST(SliceExport, APartThatReachesBeyondTheTrayIsRefused) {
  const test::ScratchFolder scratch;
  Job job = jobOf(drawnMaterial({{"1....."}}, 4), CoordBBox(Coord(-9, -5, 4), Coord(3, 4, 4)));
  job.schema.metadata["vdbdither:printer"] =
      R"({"name":"p","pitch_mm":[0.042,0.084,0.022],"slice_px":[8,8],"materials":[]})";
  EXPECT_NO_THROW(Export({scratch / "in", "--tray", "placed"}).run(job));
  // In the lowest slab, and only in one above it.
  job.schema.lattice.box.max().z() = 8;
  for (const auto& layers : {std::vector<std::vector<std::string>>{{"1........2"}},
                             {{"1....."}, {"1....."}, {"1....."}, {"1....."}, {"1........2"}}}) {
    job.grids["material"] = drawnMaterial(layers, 4);
    const auto refusalOf = [&](const std::string& tray, const std::string& remedy) {
      EXPECT_THAT(
          [&] {
            Export({scratch / "out", "--tray", tray}).run(job);
          },
          ThrowsMessage<DataError>("the part reaches beyond the display or tray; make it "
                                   "smaller, " +
                                   remedy));
    };
    refusalOf("placed", "or give --tray centred");
    refusalOf("centred", "turn it, or give --tray none");
  }
}

TEST(SliceExport, AJobForAPrinterHasItsMinimumOfSlices) {
  const test::ScratchFolder scratch;
  Job job = jobOf(drawnMaterial({{"1"}, {"1"}}, 4), CoordBBox(Coord(0, 0, 0), Coord(0, 0, 40)));
  job.schema.metadata["vdbdither:printer"] =
      R"({"name":"p","pitch_mm":[0.042,0.084,0.022],"minimum_slices":30,"materials":[]})";
  for (const std::string format : {"png", "png1", "png8", "tiff"}) {
    Export({scratch / format, "--format", format}).run(job);
    const auto manifest = nlohmann::json::parse(fileBytes(scratch / format / "manifest.json"));
    EXPECT_EQ(manifest["size"][2], 30) << format;
    EXPECT_EQ(manifest["first_layer"], 4) << format;
    EXPECT_EQ(manifest["cropped"]["above"], 7) << format;
  }
}

TEST(SliceExport, NamesOrientationPaddingAndBackgroundAreOptions) {
  const test::ScratchFolder scratch;
  Export({scratch / "out", "--prefix", "p", "--digits", "1", "--first", "9", "--flip-x", "--flip-y",
          "--padding", "1", "--background", "#01020304"})
      .run(smallJob());
  const test::PngImage image = test::readPng(fileBytes(scratch / "out/p10.png"));
  EXPECT_TRUE(fs::exists(scratch / "out/p9.png"));
  ASSERT_EQ(image.width, 5U);
  ASSERT_EQ(image.height, 4U);
  for (std::uint32_t y = 0; y < 4; ++y) {
    for (std::uint32_t x = 0; x < 5; ++x) {
      const bool white = x == 3 && y == 1;
      EXPECT_EQ(image.rows[(y * 5 + x) * 4], white ? 240 : 1) << x << " " << y;
    }
  }
}

TEST(SliceExport, GreyShowsWhatIsPrinted) {
  const test::ScratchFolder scratch;
  Export({scratch / "out", "--format", "png8"}).run(smallJob());
  const test::PngImage image = test::readPng(fileBytes(scratch / "out/slice_00000.png"));
  EXPECT_EQ(image.colour_type, 0);
  EXPECT_EQ(image.bit_depth, 8);
  EXPECT_THAT(image.rows, ElementsAre(0, 0, 255, 255, 255, 255));
}

TEST(SliceExport, OneBitMakesAStackForEachMaterial) {
  const test::ScratchFolder scratch;
  Export({scratch / "out", "--format", "png1"}).run(smallJob());
  const test::PngImage white = test::readPng(fileBytes(scratch / "out/white/slice_00000.png"));
  EXPECT_EQ(white.bit_depth, 1);
  EXPECT_THAT(white.rows, ElementsAre(0b00100000, 0b00100000));
  EXPECT_THAT(test::readPng(fileBytes(scratch / "out/black/slice_00000.png")).rows,
              ElementsAre(0, 0b11000000));
}

TEST(SliceExport, SolidAloneIsOneMaterial) {
  const test::ScratchFolder scratch;
  Job job = smallJob();
  job.grids = {{"solid", test::solidOf(*drawnMaterial({{"12"}}, 4))}};
  job.schema.grids = {{"solid", openvdb::BoolGrid::create(false)}};
  Export({scratch / "out", "--format", "png8"}).run(job);
  EXPECT_THAT(test::readPng(fileBytes(scratch / "out/slice_00000.png")).rows,
              ElementsAre(0, 0, 0, 255, 255, 0));
}

TEST(SliceExport, ExrHoldsMaterialDistanceAndNormal) {
  const test::ScratchFolder scratch;
  Job job = smallJob();
  auto surface = openvdb::FloatGrid::create(0.5F);
  surface->tree().setValue(Coord(1, 0, 4), -0.125F);
  auto normals = openvdb::Vec3SGrid::create();
  normals->tree().setValue(Coord(2, 1, 4), openvdb::Vec3s(0.5F, -0.25F, 1));
  job.grids["surface"] = surface;
  job.grids["N"] = normals;
  job.schema.grids["surface"] = openvdb::FloatGrid::create(0.5F);
  job.schema.grids["N"] = openvdb::Vec3SGrid::create();
  Export({scratch / "out", "--format", "exr"}).run(job);

  Imf::InputFile file((scratch / "out/slice_00000.exr").c_str());
  EXPECT_FLOAT_EQ(file.header().pixelAspectRatio(), 0.5F);
  EXPECT_EQ(file.header().channels()["distance"].type, Imf::FLOAT);
  EXPECT_EQ(file.header().channels()["material"].type, Imf::HALF);
  std::map<std::string, std::array<float, 6>> channels;
  Imf::FrameBuffer buffer;
  for (const char* name : {"material", "distance", "N.x", "N.y", "N.z"}) {
    buffer.insert(name,
                  Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(channels[name].data()), 4, 12));
  }
  file.setFrameBuffer(buffer);
  file.readPixels(0, 1);
  EXPECT_THAT(channels["material"], ElementsAre(0, 0, 1, 2, 2, 1));
  EXPECT_THAT(channels["distance"], ElementsAre(0.5F, 0.5F, 0.5F, 0.5F, -0.125F, 0.5F));
  EXPECT_THAT(channels["N.x"], ElementsAre(0, 0, 0.5F, 0, 0, 0));
  EXPECT_THAT(channels["N.y"], ElementsAre(0, 0, -0.25F, 0, 0, 0));
  EXPECT_THAT(channels["N.z"], ElementsAre(0, 0, 1, 0, 0, 0));
}

TEST(SliceExport, ManifestTellsWhatIsThere) {
  const test::ScratchFolder scratch;
  Export({scratch / "out", "--padding", "2"}).run(smallJob());
  const std::vector<std::uint8_t> bytes = fileBytes(scratch / "out/manifest.json");
  const auto manifest = nlohmann::json::parse(bytes);
  EXPECT_EQ(manifest["format"], "png");
  EXPECT_EQ(manifest["pitch_mm"], (nlohmann::json{0.042, 0.084, 0.022}));
  EXPECT_EQ(manifest["size"], (nlohmann::json{7, 6, 2}));
  EXPECT_EQ(manifest["first_layer"], 4);
  EXPECT_EQ(manifest["history"], (nlohmann::json{"drawn", "by hand"}));
  EXPECT_EQ(manifest["materials"][0]["name"], "white");
  EXPECT_EQ(manifest["materials"][0]["voxels"], 3);
  EXPECT_EQ(manifest["materials"][1]["voxels"], 2);
  ASSERT_EQ(manifest["slices"].size(), 2U);
  for (const auto& slice : manifest["slices"]) {
    const std::vector<std::uint8_t> file =
        fileBytes(scratch / ("out/" + slice["file"].get<std::string>()));
    Digest digest;
    digest.update(file.data(), file.size());
    EXPECT_EQ(slice["sha256"], hexText(digest.finish()));
  }
}

TEST(SliceExport, PreviewFitsAScreenAndShowsEveryMaterial) {
  const test::ScratchFolder scratch;
  Export({scratch / "out"}).run(largeJob());
  const test::PngImage image = test::readPng(fileBytes(scratch / "out/preview.png"));
  EXPECT_LE(image.width, 1200U);
  EXPECT_LE(image.height, 1000U);
  // The slice, on the right, holds both colours as they are.
  int white = 0;
  int black = 0;
  for (std::size_t i = 0; i < image.rows.size(); i += 4) {
    white += image.rows[i] == 240 && image.rows[i + 2] == 240;
    black += image.rows[i] == 26 && image.rows[i + 2] == 29;
  }
  EXPECT_GT(white, 1000);
  EXPECT_GT(black, 1000);
}

TEST(SliceExport, SlabHeightsAndThreadsGiveTheSameFiles) {
  for (const char* format : {"png", "png1", "exr"}) {
    const test::ScratchFolder scratch;
    Export({scratch / "8", "--format", format, "--keep-blank"}).run(largeJob(), 8);
    Export({scratch / "16", "--format", format, "--keep-blank"}).run(largeJob(), 16);
    {
      const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
      Export({scratch / "64", "--format", format, "--keep-blank"}).run(largeJob(), 64);
    }
    const auto files = test::filesUnder(scratch / "8");
    EXPECT_EQ(files.size(), (std::string(format) == "png1" ? 84U : 42U) + 2);
    EXPECT_TRUE(files == test::filesUnder(scratch / "16")) << format;
    EXPECT_TRUE(files == test::filesUnder(scratch / "64")) << format;
  }
}

TEST(SliceExport, NothingExistsBeforeFinishNorAfterAFailure) {
  const test::ScratchFolder scratch;
  {
    Export unfinished({scratch / "out"});
    const Job job = largeJob();
    unfinished.sink().plan(job.schema);
    for (const Slab& slab : test::cutIntoSlabs(job.grids, job.schema.lattice, 16))
      unfinished.sink().write(slab);
    EXPECT_FALSE(fs::exists(scratch / "out"));
  }
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(SliceExport, AStackWithoutAVoxelIsTold) {
  const test::ScratchFolder folder;
  Job empty = smallJob();
  empty.grids = empty.schema.grids;
  int number = 0;
  for (const auto& [job, warnings] : {std::pair{smallJob(), 0}, std::pair{empty, 1}}) {
    Export to({folder / std::to_string(number++)});
    test::Listener listener;
    to.made->setReporter(&listener);
    to.run(job);
    ASSERT_EQ(static_cast<int>(listener.warnings.size()), warnings);
    if (warnings > 0) {
      EXPECT_THAT(listener.warnings[0], HasSubstr("no voxel is printed"));
    }
  }
}

TEST(SliceExport, OverwritingReplacesAStackAndNothingElse) {
  const test::ScratchFolder scratch;
  Export({scratch / "out", "--prefix", "old"}).run(smallJob());
  EXPECT_THAT([&] { Export({scratch / "out"}).run(smallJob()); },
              ThrowsMessage<UsageError>("'" + (scratch / "out").string() +
                                        "' exists; --overwrite replaces it"));
  Export({scratch / "out", "--overwrite"}).run(smallJob());
  EXPECT_FALSE(fs::exists(scratch / "out/old00000.png"));
  EXPECT_TRUE(fs::exists(scratch / "out/slice_00000.png"));
  scratch.write("out/notes.txt", "mine");
  EXPECT_THAT(
      [&] {
        Export({scratch / "out", "--overwrite"}).run(smallJob());
      },
      ThrowsMessage<UsageError>("'" + (scratch / "out").string() +
                                "' holds 'notes.txt', which was not written with the rest; move it "
                                "elsewhere, or name another folder"));
  fs::remove(scratch / "out/notes.txt");
  scratch.write("out/manifest.json", "no JSON");
  EXPECT_THAT(
      [&] {
        Export({scratch / "out", "--overwrite"}).run(smallJob());
      },
      ThrowsMessage<UsageError>(HasSubstr("; which files are the stack's is unknown, so delete the "
                                          "folder or name another one")));
  fs::remove(scratch / "out/manifest.json");
  EXPECT_THAT(
      [&] {
        Export({scratch / "out", "--overwrite"}).run(smallJob());
      },
      ThrowsMessage<UsageError>("'" + (scratch / "out").string() +
                                "' holds no manifest.json, so it is not a stack of slices to "
                                "overwrite; name another folder"));
}

TEST(SliceExport, RefusesWhatItCannotSlice) {
  const test::ScratchFolder scratch;
  const auto planned = [&](const Job& job, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {scratch / "out"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return [job, arguments] { Export(arguments).sink().plan(job.schema); };
  };
  Job job = smallJob();
  job.schema.grids.clear();
  EXPECT_THAT(planned(job, {}),
              ThrowsMessage<UsageError>("needs a grid 'material' or 'solid'; put dither, and "
                                        "material-assign where there are materials, before it"));
  job = smallJob();
  job.schema.metadata.clear();
  EXPECT_THAT(
      planned(job, {}),
      ThrowsMessage<DataError>("the grid 'material' comes without its table of materials; make "
                               "it with material-assign"));
  job = smallJob();
  job.schema.grids["material"] = openvdb::FloatGrid::create();
  EXPECT_THAT(planned(job, {}),
              ThrowsMessage<DataError>("grid 'material' is of float, not of int32"));
  job = smallJob();
  job.schema.lattice.box = CoordBBox();
  EXPECT_THAT(planned(job, {}),
              ThrowsMessage<DataError>("there is nothing to slice: the lattice has no voxels"));
  EXPECT_THAT(planned(smallJob(), {"--background", "26,26,29"}),
              ThrowsMessage<UsageError>(
                  "--background: the material 'black' has the colour 26,26,29; choose another"));
  EXPECT_THAT(planned(smallJob(), {"--background", "grey"}),
              ThrowsMessage<UsageError>(
                  "--background: 'grey' is not a colour; give #rrggbb or r,g,b of 0 to 255"));
  EXPECT_THAT(
      planned(smallJob(), {"--prefix", "a/b"}),
      ThrowsMessage<UsageError>("--prefix: the name of a slice, 'a/b00000.png', contains '/'"));
  EXPECT_THAT(planned(smallJob(), {"--prefix", std::string(247, 'p')}),
              ThrowsMessage<UsageError>(HasSubstr("has 256 bytes; the maximum is 255")));
}

TEST(SliceExport, MaterialsOfOneColourAreRefusedWhereSlicesTellThemApartByColour) {
  const test::ScratchFolder scratch;
  Job job = smallJob();
  const MaterialTable alike = {{"white", {255, 255, 255, 255}}, {"clear", {255, 255, 255, 255}}};
  const auto planned = [&](const std::vector<std::string>& arguments) {
    return [&job, arguments] { Export(arguments).sink().plan(job.schema); };
  };
  job.schema.metadata[materials_key] = toJson(alike);
  for (const char* name : {"out", "out.gcvf"}) {
    const std::string format = name == std::string("out") ? "png" : "gcvf";
    EXPECT_THAT(planned({scratch / name}),
                ThrowsMessage<UsageError>(
                    "--format: " + format +
                    " tells materials apart by colour, and 'white' and 'clear' both have "
                    "255,255,255,255; give one another colour where materials are assigned, as in "
                    "clear=#rrggbb, or in the profile of the printer, or take exr, objet, png1, "
                    "tiff or tiff1"));
  }
  for (const char* format : {"objet", "png1", "png8", "tiff", "tiff1"})
    EXPECT_NO_THROW(planned({scratch / "out", "--format", format})()) << format;
  job.schema.metadata[materials_key] =
      toJson({{"white", {255, 255, 255, 255}}, {"clear", {255, 255, 255, 254}}});
  EXPECT_NO_THROW(planned({scratch / "out"})());
}

TEST(SliceExport, AMaterialThatIsInTheTableTwiceIsRefused) {
  const test::ScratchFolder scratch;
  Job job = smallJob();
  job.schema.metadata[materials_key] =
      toJson({{"white", {255, 255, 255, 255}}, {"white", {255, 255, 255, 255}}});
  for (const char* format : {"png", "tiff"}) {
    EXPECT_THAT(([&] {
                  Export({scratch / "out", "--format", format}).sink().plan(job.schema);
                }),
                ThrowsMessage<DataError>("the table of materials has 'white' twice; assign the "
                                         "materials again"));
  }
}

TEST(SliceExport, ATiffHasAtMost255Materials) {
  const auto planning = [](std::size_t count) {
    return [count] {
      const test::ScratchFolder scratch;
      Job job = smallJob();
      MaterialTable materials;
      for (std::size_t i = 0; i < count; ++i)
        materials.push_back(
            {"m" + std::to_string(i),
             {1, static_cast<std::uint8_t>(i % 256), static_cast<std::uint8_t>(i / 256), 255}});
      job.schema.metadata[materials_key] = toJson(materials);
      Export({scratch / "out", "--format", "tiff"}).sink().plan(job.schema);
    };
  };
  EXPECT_NO_THROW(planning(255)());
  EXPECT_THAT(planning(256), ThrowsMessage<UsageError>(
                                 HasSubstr("tiff has room for 255 materials, and there are 256")));
}

TEST(SliceExport, NamesOfFilesMayBeAsLongAsTheFileSystemAllows) {
  const test::ScratchFolder scratch;
  const std::string prefix(246, 'p');
  const std::string folder(255, 'f');
  Export({scratch / folder, "--prefix", prefix}).run(smallJob());
  EXPECT_TRUE(fs::exists(scratch / (folder + "/" + prefix + "00000.png")));
}

Job named(const std::string& first, const std::string& second) {
  Job job = smallJob();
  job.schema.metadata[materials_key] =
      toJson({{first, {240, 240, 240, 255}}, {second, {26, 26, 29, 255}}});
  return job;
}

TEST(SliceExport, NamesOfMaterialsDoNotLeaveTheStack) {
  const test::ScratchFolder scratch;
  const std::vector<std::pair<std::string, std::string>> problems{
      {"../xx", "contains '/'"},
      {(scratch / "xx").string(), "contains '/'"},
      {"..", "is '..'"},
      {"", "is empty"},
      {"a\\b", "contains '\\'"},
      {"a\nb", "contains '\\'"},
      {std::string(256, 'a'), "has 256 bytes; the maximum is 255"},
      {"black", "is that of another one, or of a file of the stack"},
      {"BLACK", "is that of another one, or of a file of the stack"},
      {"manifest.json", "is that of another one, or of a file of the stack"},
      {"preview.png", "is that of another one, or of a file of the stack"}};
  for (const auto& problem : problems) {
    for (const std::string format : {"png1", "tiff1"}) {
      for (const char* target : {"out", "out.zip"}) {
        const std::string& name = problem.first;
        const Job job = named("black", name);
        EXPECT_THAT(
            [&] {
              Export({scratch / target, "--format", format}).sink().plan(job.schema);
            },
            ThrowsMessage<DataError>(
                format + " has a folder for each material, and the name of the material '" +
                printable(name) + "' " + problem.second +
                "; give it another one with material-assign, or take exr, png, png8 or tiff"));
      }
    }
  }
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(SliceExport, FormatsWithoutFoldersOfMaterialsTakeAnyName) {
  const test::ScratchFolder scratch;
  for (const char* format : {"png", "png8", "tiff", "exr"}) {
    Export({scratch / format, "--format", format}).run(named("../xx", "a/b"));
    for (const auto& [name, bytes] : test::filesUnder(scratch / format))
      EXPECT_EQ(name.find('/'), name.npos) << name;
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch.path()), {}), 4);
}

TEST(SliceExport, AnArchiveIsNamedInAnyCase) {
  const test::ScratchFolder scratch;
  Export({scratch / "out.ZIP"}).run(smallJob());
  EXPECT_TRUE(fs::is_regular_file(scratch / "out.ZIP"));
}

TEST(SliceExport, AnUnknownMaterialOrAMissingLayerIsAnError) {
  const test::ScratchFolder scratch;
  Job job = smallJob();
  job.grids["material"] = drawnMaterial({{"7"}}, 4);
  EXPECT_THAT(
      [&] { Export({scratch / "out"}).run(job); },
      ThrowsMessage<DataError>("layer 4 holds material 7, but the table of materials ends at 2"));
  Export gap({scratch / "out"});
  const Job large = largeJob();
  gap.sink().plan(large.schema);
  const std::vector<Slab> slabs = test::cutIntoSlabs(large.grids, large.schema.lattice, 8);
  gap.sink().write(slabs[0]);
  EXPECT_THAT([&] { gap.sink().write(slabs[2]); },
              ThrowsMessage<DataError>("layers -8 to -1 are missing"));
}

}  // namespace
}  // namespace vdbdither
