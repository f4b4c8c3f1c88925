#include "io/stack/slice_format.h"

#include <algorithm>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/stack/stack_reader.h"
#include "io/stack/stack_writer.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

/// What every registered format promises.
class SliceFormats : public testing::TestWithParam<const SliceFormat*> {
 protected:
  static constexpr ZRange layers{-3, 14};

  [[nodiscard]] static Manifest planned() {
    Manifest stack;
    stack.format = GetParam()->name;
    stack.lattice = {{0.042, 0.084, 0.022},
                     {0, 0, 0},
                     CoordBBox(Coord(0, 0, layers.begin), Coord(18, 10, layers.end - 1))};
    stack.layout = {stack.lattice.box, 0, false, false};
    stack.background = {0, 0, 0, 255};
    stack.materials = {
        {"white", {240, 240, 240, 255}}, {"black", {26, 26, 29, 255}}, {"red", {255, 0, 0, 255}}};
    return stack;
  }

  /// A layer with voxels of all three materials and empty ones.
  /// @param most  the maximum of its values
  [[nodiscard]] static SpanImage image(int z, std::uint32_t most = 3) {
    return test::spanImage(19, 11, [&](int x, int y) {
      const int value = x * x + y * y > 200 ? 0 : (x / 3 + y / 2 + z * z) % 4;
      return std::min(static_cast<std::uint32_t>(value), most);
    });
  }

  /// An encoder with its options as they are, but for a shape that 3mf wants to be told.
  static std::unique_ptr<SliceEncoder> makeEncoder() {
    std::unique_ptr<SliceEncoder> encoder = GetParam()->encoder();
    Options options;
    encoder->declare(options);
    if (GetParam()->name == "3mf") options.parse(std::vector<std::string>{"--3mf-level-set"});
    return encoder;
  }

  /// Those that the format prescribes, or others.
  static SliceNames names() {
    return GetParam()->names != nullptr ? *GetParam()->names : SliceNames{"s", 3, 7};
  }

  /// Writes a stack of all layers.
  Manifest write(const std::filesystem::path& target) const {
    const Manifest stack = planned();
    const std::unique_ptr<SliceEncoder> encoder = makeEncoder();
    encoder->plan(stack, {});
    StackWriter writer(target, stack, names(), *encoder, {});
    for (int z = layers.begin; z < layers.end; z += 5) {
      const ZRange piece = intersection({z, z + 5}, layers);
      std::vector<SpanImage> images;
      for (int layer = piece.begin; layer < piece.end; ++layer) images.push_back(image(layer));
      writer.add(piece, images, {});
    }
    Manifest written = writer.finish();
    writer.commit();
    return written;
  }

  test::ScratchFolder scratch_;
};

TEST_P(SliceFormats, ReadsBackWhatItWrites) {
  for (const char* name : {"folder", "archive.zip"}) {
    write(scratch_ / name);
    std::vector<std::string> warnings;
    const StackReader reader(scratch_ / name, EditedStack::refused,
                             [&](const std::string& text) { warnings.push_back(text); });
    EXPECT_EQ(&reader.format(), GetParam());
    // Not every container says where the lattice has its origin.
    const int below =
        GetParam()->describe != nullptr ? layers.begin - reader.manifest().layers.begin : 0;
    EXPECT_EQ(reader.manifest().layers, (ZRange{layers.begin - below, layers.end - below}));
    for (int z = layers.begin; z < layers.end; ++z) {
      const bool tells_materials = GetParam()->pixel != SlicePixel::printed;
      const SpanImage expected = image(z, tells_materials ? 3 : 1);
      EXPECT_TRUE(reader.layer(z - below) == expected) << z;
    }
    EXPECT_THAT(warnings, IsEmpty());
  }
}

TEST_P(SliceFormats, ItsManifestNamesEverySliceOnce) {
  const Manifest stack = write(scratch_ / "out");
  const bool has_file_each = GetParam()->pixel == SlicePixel::one_material;
  // A container may have files of all materials too.
  const auto own = std::count_if(stack.slices.begin(), stack.slices.end(), [&](const auto& slice) {
    return slice.material.empty() != has_file_each;
  });
  EXPECT_EQ(static_cast<std::size_t>(own),
            static_cast<std::size_t>(layers.size()) * GetParam()->filesOfLayer(3));
  const auto there = test::filesUnder(scratch_ / "out");
  std::set<std::string> names;
  for (const Manifest::Slice& slice : stack.slices) {
    EXPECT_TRUE(names.insert(slice.file).second) << slice.file;
    EXPECT_TRUE(there.contains(slice.file)) << slice.file;
    EXPECT_TRUE(slice.file.ends_with(GetParam()->ending)) << slice.file;
    EXPECT_TRUE(namesSlice(slice.file)) << slice.file;
  }
  if (GetParam()->names == nullptr) {
    EXPECT_THAT(stack.slices.front().file, HasSubstr("s007."));
  }
}

/// Writes blank layers but for those of `printed`, out of the layers `given`.
Manifest writeCropped(const std::filesystem::path& target, const Manifest& stack,
                      const SliceEncoder& encoder, ZRange printed, ZRange given, bool keep_blank) {
  const SliceFormat& format = *findSliceFormat(stack.format);
  StackWriter writer(target, stack, format.names != nullptr ? *format.names : SliceNames{"s", 3, 7},
                     encoder, {.keep = keep_blank});
  for (int z = given.begin; z < given.end; z += 5) {
    const ZRange piece = intersection({z, z + 5}, given);
    std::vector<SpanImage> images;
    for (int layer = piece.begin; layer < piece.end; ++layer) {
      images.push_back(test::spanImage(19, 11, [&](int x, int) {
        return std::uint32_t{printed.contains(layer) && layer % 2 == 0 && x == 3};
      }));
    }
    writer.add(piece, images, {});
  }
  Manifest written = writer.finish();
  writer.commit();
  return written;
}

TEST_P(SliceFormats, LeavesOutTheBlankLayersBelowAndAboveThePart) {
  const Manifest stack = planned();
  const std::unique_ptr<SliceEncoder> encoder = makeEncoder();
  encoder->plan(stack, {});
  const bool keeps = !encoder->reads().empty();
  // Blank ones within the part stay.
  const ZRange printed{0, 7};
  const Manifest made = writeCropped(scratch_ / "out", stack, *encoder, printed, layers, false);
  EXPECT_EQ(made.layers, keeps ? layers : printed);
  EXPECT_EQ(made.knownLayers(), layers);
  const StackReader reader(scratch_ / "out", EditedStack::refused,
                           [](const std::string& text) { FAIL() << text; });
  if (GetParam()->describe != nullptr) {
    // A container begins at the part.
    const ZRange known = reader.manifest().knownLayers();
    EXPECT_EQ(known.size(), printed.size());
    for (int i = 0; i < printed.size(); ++i)
      EXPECT_EQ(isBlank(reader.layer(known.begin + i)), (printed.begin + i) % 2 != 0) << i;
    return;
  }
  if (GetParam()->names == nullptr) {
    EXPECT_THAT(made.slices.front().file, HasSubstr("s007."));
  }
  EXPECT_EQ(reader.manifest().cropped_below, keeps ? 0 : 3);
  EXPECT_EQ(reader.manifest().cropped_above, keeps ? 0 : 7);
  for (int z = layers.begin; z < layers.end; ++z)
    EXPECT_EQ(isBlank(reader.layer(z)), !(printed.contains(z) && z % 2 == 0)) << z;
}

TEST_P(SliceFormats, KeepsBlankLayersOnDemandOfPiecesAndWhereNothingIsPrinted) {
  const Manifest stack = planned();
  const std::unique_ptr<SliceEncoder> encoder = makeEncoder();
  encoder->plan(stack, {});
  const auto kept = [&](const char* name, ZRange printed, ZRange given, bool keep_blank) {
    return writeCropped(scratch_ / name, stack, *encoder, printed, given, keep_blank).layers;
  };
  EXPECT_EQ(kept("all", {0, 7}, layers, true), layers);
  EXPECT_EQ(kept("nothing", {0, 0}, layers, false), layers);
  const ZRange piece{-1, 10};
  EXPECT_EQ(kept("piece", {2, 5}, piece, false), piece);
}

TEST_P(SliceFormats, ASpoiltFileIsDecodedOrRefused) {
  const Manifest stack = write(scratch_ / "out");
  const std::vector<std::uint8_t> bytes =
      test::filesUnder(scratch_ / "out").at(stack.slices.front().file);
  const auto expect_decoded_or_refused = [&](std::span<const std::uint8_t> spoilt) {
    try {
      GetParam()->decode(spoilt, {});
    } catch (const DataError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  };
  for (std::size_t size = 0; size < bytes.size(); size += 7)
    expect_decoded_or_refused(std::span(bytes).first(size));
  std::mt19937 random(5);
  for (int round = 0; round < 100; ++round) {
    std::vector<std::uint8_t> spoilt = bytes;
    spoilt[random() % spoilt.size()] = static_cast<std::uint8_t>(random());
    expect_decoded_or_refused(spoilt);
  }
}

TEST_P(SliceFormats, ItsDecoderTellsTheSizeBeforeItReadsPixels) {
  const Manifest stack = write(scratch_ / "out");
  const std::vector<std::uint8_t> bytes =
      test::filesUnder(scratch_ / "out").at(stack.slices.front().file);
  // The pixels of a PNG are missing.
  constexpr std::size_t png_header = 66;
  const std::span<const std::uint8_t> given =
      std::span(bytes).first(GetParam()->ending == ".png" ? png_header : bytes.size());
  EXPECT_THAT(
      [&] {
        GetParam()->decode(given, [](std::uint32_t width, std::uint32_t height) {
          throw DataError(std::to_string(width) + " x " + std::to_string(height));
        });
      },
      ThrowsMessage<DataError>("19 x 11"));
}

TEST_P(SliceFormats, IsFoundByItsName) { EXPECT_EQ(findSliceFormat(GetParam()->name), GetParam()); }

INSTANTIATE_TEST_SUITE_P(Registered, SliceFormats, testing::ValuesIn(sliceFormats()),
                         [](const auto& format) { return std::string(format.param->name); });

TEST(SliceFormatTable, IsListedInMessages) {
  EXPECT_THAT(sliceFormatNames(), testing::ContainsRegex("exr, .*png1, .* or "));
  const std::string in_colours =
      sliceFormatNames([](const SliceFormat& format) { return format.showsColours(); });
  EXPECT_THAT(in_colours, testing::ContainsRegex("png.*tiff"));
  EXPECT_THAT(in_colours, testing::Not(HasSubstr("png8")));
  EXPECT_EQ(findSliceFormat("jpeg"), nullptr);
}

TEST(SliceFormatTable, KnowsTheEndingsOfSlices) {
  for (const char* name : {"a.png", "A.PNG", "a/b.tif", "a.Tiff", "a.exr"})
    EXPECT_TRUE(namesSlice(name)) << name;
  for (const char* name : {"png", ".png", "a.vdb", "a.png.vdb", "a", "a.", ""})
    EXPECT_FALSE(namesSlice(name)) << name;
}

TEST(StackReader, RefusesAFormatThatIsNotInTheTable) {
  const test::ScratchFolder scratch;
  Manifest stack;
  stack.format = "jpeg";
  stack.lattice.box = CoordBBox(Coord(0), Coord(1));
  stack.layout.box = stack.lattice.box;
  stack.layers = stack.lattice.layers();
  scratch.write("manifest.json", textOf(stack));
  EXPECT_THAT(
      [&] { StackReader(scratch.path(), EditedStack::refused, {}); },
      ThrowsMessage<DataError>(HasSubstr("there is no format 'jpeg'; make the stack again")));
}

}  // namespace
}  // namespace vdbdither
