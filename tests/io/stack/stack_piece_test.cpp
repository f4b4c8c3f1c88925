#include "io/stack/stack_piece.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/png_spans.h"
#include "io/stack/stack_preview.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

using Bytes = std::vector<std::uint8_t>;

StackPiece small() { return {{-3, -1}, 2, {1, 2, 0, ~std::uint64_t{0}}, {7, 8, 9}}; }

TEST(StackPiece, IsReadBackAsItWas) {
  const StackPiece piece = stackPieceOf(bytesOf(small()));
  EXPECT_EQ(piece.layers, (ZRange{-3, -1}));
  EXPECT_THAT(piece.voxelsOf(-2), ElementsAre(0, ~std::uint64_t{0}));
  EXPECT_EQ(piece.voxels, small().voxels);
  EXPECT_EQ(piece.preview, small().preview);
}

TEST(StackPiece, IsRefusedWhereItIsCutShortOrClaimsMoreThanItHolds) {
  StackPiece bare = small();
  bare.preview.clear();
  const Bytes whole = bytesOf(bare);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THROW(stackPieceOf({whole.data(), size}), DataError) << size;
  }
  Bytes far = whole;
  far[24 + 5] = 1;
  EXPECT_THAT([&] { stackPieceOf(far); },
              ThrowsMessage<DataError>(HasSubstr("begins at a layer that none can be")));
  // The number of layers and of materials, each as large as can be.
  for (const std::size_t place : {std::size_t{32}, std::size_t{40}}) {
    Bytes wrong = whole;
    std::fill_n(wrong.begin() + static_cast<std::ptrdiff_t>(place), 8, 255);
    EXPECT_THAT([&] { stackPieceOf(wrong); }, ThrowsMessage<DataError>(HasSubstr("is cut short")));
  }
}

/// Slices of two materials: a stair of the first whose steps become wider, and a column of the
/// second behind it.
SpanImage slice(int z) {
  SpansBuilder image(40);
  for (std::uint32_t y = 0; y < 30; ++y) {
    image.pixel(0, 0);
    image.pixel(3, y < 8 ? 2 : y < static_cast<std::uint32_t>(10 + z) ? 1 : 0);
    image.pixel(3 + static_cast<std::uint32_t>(z), 0);
    image.endRow();
  }
  return image.finish();
}

StackPreview preview() {
  return {{0.04, 0.08, 0.02}, 40, 30, {0, 20}, {0, rgba(200, 60, 30), rgba(30, 200, 60)}};
}

void add(StackPreview& preview, ZRange layers) {
  for (int z = layers.begin; z < layers.end; ++z)
    preview.add(z, slice(z), static_cast<std::uint64_t>(z % 7) * 100);
}

TEST(StackPreviewParts, MakeTheWholePicture) {
  StackPreview whole = preview();
  add(whole, {0, 20});
  for (const std::vector<int>& cuts : {std::vector{0, 20}, {0, 7, 20}, {0, 1, 2, 13, 14, 20}}) {
    StackPreview joined = preview();
    for (std::size_t i = 1; i < cuts.size(); ++i) {
      StackPreview part = preview();
      add(part, {cuts[i - 1], cuts[i]});
      joined.addPart(part.part());
    }
    EXPECT_EQ(joined.picture(), whole.picture()) << cuts.size();
  }
}

TEST(StackPreviewParts, AreRefusedWhereTheyAreOfAnotherStackOrDamaged) {
  StackPreview part = preview();
  add(part, {5, 9});
  const Bytes whole = part.part();
  for (std::size_t size = 0; size < whole.size(); size += 97) {
    EXPECT_THROW(preview().addPart({whole.data(), size}), DataError) << size;
  }
  Bytes longer = whole;
  longer.push_back(0);
  EXPECT_THAT([&] { preview().addPart(longer); },
              ThrowsMessage<DataError>(HasSubstr("is not of a piece of this stack")));
  // Of fewer colours, of fewer rows, and of narrower slices.
  EXPECT_THROW(StackPreview({0.04, 0.08, 0.02}, 40, 30, {0, 20}, {0, 1}).addPart(whole), DataError);
  EXPECT_THROW(StackPreview({0.04, 0.08, 0.02}, 40, 30, {0, 2}, {0, 1, 2}).addPart(whole),
               DataError);
  EXPECT_THROW(StackPreview({0.04, 0.08, 0.02}, 20, 30, {0, 20}, {0, 1, 2}).addPart(whole),
               DataError);
}

}  // namespace
}  // namespace vdbdither
