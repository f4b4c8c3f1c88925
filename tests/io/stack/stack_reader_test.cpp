#include "io/stack/stack_reader.h"

#include <filesystem>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/file/staging_name.h"
#include "io/image/png_spans.h"
#include "io/stack/stack_writer.h"
#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using openvdb::Coord;
using openvdb::CoordBBox;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr const char* again = "; make the stack again with slice-export";
constexpr const char* take = ", or give --edited to take it as it is";

/// A stack of five layers with 6 x 4 pixels, out/s0.png to out/s4.png or a folder for each of its
/// two materials.
class Stack : public testing::Test {
 protected:
  void SetUp() override { write("png"); }

  void write(const std::string& format, const std::string& name = "out") {
    Manifest stack;
    stack.format = format;
    stack.lattice = {{0.1, 0.1, 0.1}, {0, 0, 0}, CoordBBox(Coord(0), Coord(5, 3, 4))};
    stack.layout = {stack.lattice.box, 0, false, false};
    stack.background = {0, 0, 0, 255};
    stack.materials = {{"white", {240, 240, 240, 255}}, {"black", {26, 26, 29, 255}}};
    const std::unique_ptr<SliceEncoder> encoder = findSliceFormat(format)->encoder();
    encoder->plan(stack, {});
    fs::remove_all(scratch_ / name);
    StackWriter writer(scratch_ / name, stack, {"s", 1, 0}, *encoder, {.keep = true});
    std::vector<SpanImage> images;
    for (int z = 0; z < 5; ++z) {
      images.push_back(test::spanImage(
          6, 4, [&](int x, int y) { return static_cast<std::uint32_t>((x + y * z) % 3); }));
    }
    writer.add({0, 5}, std::move(images), {});
    writer.finish();
    writer.commit();
  }

  [[nodiscard]] fs::path out(const std::string& name) const { return scratch_ / ("out/" + name); }

  /// Writes `change` of the manifest.
  template <class Change>
  void edit(const Change& change) const {
    const std::vector<std::uint8_t> bytes = test::fileBytes(out("manifest.json"));
    ordered_json json = ordered_json::parse(bytes);
    change(json);
    scratch_.write("out/manifest.json", json.dump(1));
  }

  /// What reading the whole stack is refused for, with OUT for its folder, or an empty text.
  std::string refusal(EditedStack edited = EditedStack::refused, const std::string& name = "out") {
    warnings_.clear();
    const auto shortened = [&](std::string text) {
      const std::string folder = (scratch_ / name).string();
      for (std::size_t at; (at = text.find(folder)) != text.npos;)
        text.replace(at, folder.size(), "OUT");
      return text;
    };
    try {
      const StackReader reader(scratch_ / name, edited, [&](const std::string& text) {
        warnings_.push_back(shortened(text));
      });
      for (int z = 0; z < 5; ++z) static_cast<void>(reader.layer(z));
    } catch (const DataError& error) {
      return shortened(error.what());
    }
    return "";
  }
  std::string refusalOfEdited() { return refusal(EditedStack::taken); }

  test::ScratchFolder scratch_;
  std::vector<std::string> warnings_;
};

TEST_F(Stack, AsItWasWrittenIsReadWithoutAWord) {
  EXPECT_EQ(refusal(), "");
  EXPECT_EQ(refusalOfEdited(), "");
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(Stack, WithSlicesThatChangedIsTakenOnDemand) {
  fs::rename(out("s1.png"), out("s"));
  fs::rename(out("s2.png"), out("s1.png"));
  fs::rename(out("s"), out("s2.png"));
  const std::string change =
      "the slice 'OUT/s1.png' of layer 1 was changed after slice-export wrote it: its digest "
      "differs";
  EXPECT_EQ(refusal(), change + again + take);
  EXPECT_EQ(refusalOfEdited(), "");
  EXPECT_THAT(warnings_, ElementsAre(change + "; it is taken as it is"));
}

TEST_F(Stack, WithAManifestThatChangedIsTakenOnDemand) {
  edit([](ordered_json& json) { std::swap(json["slices"][1]["file"], json["slices"][2]["file"]); });
  EXPECT_THAT(refusal(), HasSubstr("was changed after slice-export wrote it"));
  EXPECT_EQ(refusalOfEdited(), "");
  ASSERT_EQ(warnings_.size(), 2U);
  EXPECT_THAT(warnings_[0], HasSubstr("manifest.json' was changed after slice-export wrote it"));
  EXPECT_THAT(warnings_[1], HasSubstr("s2.png' of layer 1 was changed after slice-export wrote"));
}

TEST_F(Stack, WithTwoSlicesOfALayerIsRefused) {
  edit([](ordered_json& json) { json["slices"][1]["layer"] = 2; });
  EXPECT_EQ(refusalOfEdited(),
            "'OUT/manifest.json' names two slices of layer 2, 's1.png' and 's2.png'; remove one of "
            "them");
  EXPECT_THAT(refusal(), HasSubstr("was changed after slice-export wrote it"));
}

TEST_F(Stack, ThatNamesASliceTwiceIsTakenOnDemand) {
  edit([](ordered_json& json) { json["slices"].push_back(json["slices"][3]); });
  EXPECT_THAT(refusal(), HasSubstr("was changed after slice-export wrote it"));
  EXPECT_EQ(refusalOfEdited(), "");
  EXPECT_THAT(warnings_, testing::Contains(
                             "'OUT/manifest.json' names the slice of layer 3 twice; it is taken as "
                             "it is"));
}

TEST_F(Stack, WithASliceBeyondItsLayersIsTakenOnDemand) {
  edit([](ordered_json& json) {
    json["slices"].push_back(json["slices"][4]);
    json["slices"][5]["layer"] = 5;
  });
  EXPECT_EQ(refusalOfEdited(), "");
  EXPECT_THAT(warnings_, testing::Contains(
                             "'OUT/manifest.json' names the slice 's4.png' of layer 5, which the "
                             "stack does not have; it is taken as it is"));
}

TEST_F(Stack, WithoutASliceIsRefused) {
  fs::remove(out("s3.png"));
  const std::string missing = std::string("the slice 'OUT/s3.png' of layer 3 is missing") + again;
  EXPECT_EQ(refusal(), missing);
  EXPECT_EQ(refusalOfEdited(), missing);
  edit([](ordered_json& json) { json["slices"].erase(3); });
  EXPECT_EQ(refusalOfEdited(),
            std::string("'OUT/manifest.json' names no slice of layer 3") + again);
}

TEST_F(Stack, WithASliceThatItsManifestDoesNotNameIsTakenOnDemand) {
  const std::string change = "the slice 'OUT/s5.PNG' is not one that the manifest names";
  fs::copy(out("s4.png"), out("s5.PNG"));
  EXPECT_EQ(refusal(), change + again + take);
  EXPECT_EQ(refusalOfEdited(), "");
  EXPECT_THAT(warnings_, ElementsAre(change + "; it is left out, and so are others like it"));
}

TEST_F(Stack, MayHoldOtherFiles) {
  scratch_.write("out/notes.txt", "x");
  scratch_.write("out/._s0.png", "x");
  fs::create_directory(out("__MACOSX"));
  scratch_.write("out/__MACOSX/._s1.png", "x");
  EXPECT_EQ(refusal(), "");
}

TEST_F(Stack, IsPutBackWhereAKilledRunPutItAside) {
  fs::rename(scratch_ / "out", stagingPath(scratch_ / "out").string() + std::string(put_aside));
  EXPECT_EQ(refusal(), "");
  EXPECT_THAT(warnings_, ElementsAre("'OUT' was being replaced when a run was killed; the folder "
                                     "before it is put back"));
  EXPECT_EQ(refusal(), "");
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(Stack, IsReadThroughTheManifestThatIsNamed) {
  fs::rename(out("manifest.json"), out("other.JSON"));
  EXPECT_EQ(refusal(EditedStack::refused, "out/other.JSON"), "");
  EXPECT_EQ(refusal(), "'OUT' holds no manifest.json, so it is not a stack made by slice-export");
}

TEST_F(Stack, MayHoldLinksToItsOwnFilesOnly) {
  fs::create_symlink("out", scratch_ / "link");
  EXPECT_EQ(refusal(EditedStack::refused, "link"), "");
  fs::rename(out("s1.png"), out("real"));
  fs::create_symlink("real", out("s1.png"));
  EXPECT_EQ(refusal(), "");
  fs::remove(out("s1.png"));
  fs::rename(out("real"), scratch_ / "outside");
  fs::create_symlink("../outside", out("s1.png"));
  const std::string outside = (scratch_ / "outside").string();
  EXPECT_THAT(refusal(), HasSubstr("'OUT/s1.png' is a link to '"));
  EXPECT_THAT(refusal(),
              HasSubstr("side', which is outside the stack; copy the file into the stack"));
  fs::remove(out("s1.png"));
  fs::create_symlink("gone", out("s1.png"));
  EXPECT_EQ(refusal(), "cannot read 'OUT/s1.png': No such file or directory");
}

TEST_F(Stack, MayNotLieInLinkedFolders) {
  write("png1");
  EXPECT_EQ(refusal(), "");
  fs::rename(out("white"), scratch_ / "white");
  fs::create_directory_symlink("../white", out("white"));
  EXPECT_THAT(refusal(), HasSubstr("'OUT/white/s0.png' is a link to '"));
}

TEST_F(Stack, HoldsOrdinaryFiles) {
  fs::remove(out("s2.png"));
  ASSERT_EQ(mkfifo(out("s2.png").c_str(), 0600), 0);
  EXPECT_EQ(refusal(), "'OUT/s2.png' is not an ordinary file");
  fs::remove(out("s2.png"));
  fs::create_directory(out("s2.png"));
  EXPECT_EQ(refusal(), "'OUT/s2.png' is not an ordinary file");
  fs::remove(out("manifest.json"));
  ASSERT_EQ(mkfifo(out("manifest.json").c_str(), 0600), 0);
  EXPECT_EQ(refusal(), "'OUT/manifest.json' is not an ordinary file");
  EXPECT_EQ(refusal(EditedStack::refused, "out/manifest.json"), "'OUT' is not an ordinary file");
}

TEST_F(Stack, WithASliceOfAnotherSizeIsRefusedBeforeItsPixelsAreRead) {
  const std::vector<std::uint32_t> black{0xff000000};
  SpanImage wide{60000, 60000, {}, {}};
  for (std::uint32_t y = 0; y <= wide.height; ++y) wide.row_begin.push_back(y);
  wide.spans.assign(wide.height, {wide.width, 0});
  const std::vector<std::uint8_t> bytes = encodePng(wide, {PngPixels::grey1, black, 0, 0});
  ASSERT_LT(bytes.size(), std::size_t{1} << 20);
  scratch_.write("out/s2.png", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  EXPECT_EQ(refusalOfEdited(),
            std::string("the slice 'OUT/s2.png' of layer 2 has 60000 x 60000 pixels, not 6 x 4 as "
                        "the stack") +
                again);
}

TEST_F(Stack, WithAFileLargerThanASliceCanBeIsRefusedBeforeItIsRead) {
  fs::resize_file(out("s2.png"), std::uintmax_t{1} << 40);
  EXPECT_EQ(refusalOfEdited(), "'OUT/s2.png' has 1099511627776 bytes; at most 1049344 are read");
}

TEST_F(Stack, WithTwoMaterialsOfOneNameIsRefused) {
  write("png1");
  edit([](ordered_json& json) { json["materials"][1]["name"] = "white"; });
  EXPECT_EQ(refusalOfEdited(),
            std::string("'OUT/manifest.json' names two materials alike") + again);
}

}  // namespace
}  // namespace vdbdither
