#include "io/profile/material_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(MaterialTable, ComesBackFromItsJson) {
  const MaterialTable table = {{"white", {240, 240, 240, 255}}, {"mine", {1, 2, 3, 4}}};
  const std::string text = toJson(table);
  EXPECT_EQ(
      text,
      R"([{"index":1,"name":"white","rgba":[240,240,240,255]},{"index":2,"name":"mine","rgba":[1,2,3,4]}])");
  const MaterialTable back = materialTableFromJson(text);
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[1].name, "mine");
  EXPECT_THAT(back[1].rgba, ElementsAre(1, 2, 3, 4));
}

TEST(MaterialTable, BrokenJsonIsADataError) {
  for (const char* text : {"", "[", "[{}]", R"([{"index":2,"name":"a","rgba":[0,0,0,0]}])",
                           R"([{"index":1,"name":"a","rgba":[0,0,0]}])"}) {
    EXPECT_THAT([&] { materialTableFromJson(text); },
                ThrowsMessage<DataError>(
                    HasSubstr("metadata vdbdither:materials is not a table of materials")))
        << text;
  }
}

TEST(MaterialTable, ColoursOutOfRangeAndDeepTextsAreDataErrors) {
  for (const std::string& text :
       {std::string(R"([{"index":1,"name":"a","rgba":[0,0,0,256]}])"),
        std::string(R"([{"index":1,"name":"a","rgba":[0,0,-1,0]}])"),
        std::string(R"([{"index":1,"name":"a","rgba":[0,0,0.5,0]}])"),
        std::string(R"([{"index":1,"name":7,"rgba":[0,0,0,0]}])"), std::string("[7]"),
        std::string("{}"), std::string(1000000, '[')}) {
    EXPECT_THAT([&] { materialTableFromJson(text); },
                ThrowsMessage<DataError>(HasSubstr("; assign the materials again")))
        << text.substr(0, 80);
  }
}

TEST(MaterialTable, NamesBecomePrintable) {
  EXPECT_EQ(materialTableFromJson(R"([{"index":1,"name":"a\n\u001b","rgba":[0,0,0,0]}])")[0].name,
            "a\\n\\x1b");
}

TEST(MaterialTable, NamesAreThePrintersThenTheUsualInks) {
  const std::vector<Material> known = {{"Blue", {1, 2, 3, 255}}, {"white", {9, 9, 9, 255}}};
  EXPECT_THAT(parseMaterial("blue", known).rgba, ElementsAre(1, 2, 3, 255));
  EXPECT_EQ(parseMaterial("blue", known).name, "Blue");
  EXPECT_THAT(parseMaterial("white", known).rgba, ElementsAre(9, 9, 9, 255));
  EXPECT_THAT(parseMaterial("veroclear", known).rgba, ElementsAre(227, 233, 253, 255));
}

TEST(MaterialTable, TheExactNameIsFoundBeforeOneOfAnotherCase) {
  const std::vector<Material> known = {{"A", {1, 0, 0, 255}}, {"a", {2, 0, 0, 255}}};
  EXPECT_EQ(parseMaterial("a", known).name, "a");
  EXPECT_EQ(parseMaterial("A", known).name, "A");
  EXPECT_EQ(materialCalled("a", known), &known[1]);
  EXPECT_EQ(materialCalled("b", known), nullptr);
  EXPECT_EQ(materialCalled("a", std::span(known).first(1)), known.data());
}

TEST(MaterialTable, ColoursAreHexadecimalOrDecimal) {
  EXPECT_THAT(parseMaterial("a=#0aff10", {}).rgba, ElementsAre(10, 255, 16, 255));
  EXPECT_THAT(parseMaterial("a=#0aFF1080", {}).rgba, ElementsAre(10, 255, 16, 128));
  EXPECT_THAT(parseMaterial("a=10,255,16", {}).rgba, ElementsAre(10, 255, 16, 255));
  EXPECT_THAT(parseMaterial("a=10,255,16,0", {}).rgba, ElementsAre(10, 255, 16, 0));
  for (const char* text :
       {"a=", "a=#", "a=#12345", "a=#1234567", "a=#0aff10801", "a=1,2", "a=1,2,256", "a=1,2,3,4,5",
        "a=1,2,3,", "a=-1,2,3", "a=#gg0000", "a=1, 2,3"}) {
    EXPECT_THAT([&] { parseMaterial(text, {}); },
                ThrowsMessage<UsageError>("'" + std::string(text).substr(2) +
                                          "' is not a colour; give #rrggbb or r,g,b of 0 to 255"))
        << text;
  }
}

TEST(MaterialTable, RefusalsNameWhatThereIs) {
  EXPECT_THAT(
      [] {
        parseMaterial("pink", {{"white", {}}, {"Rubber", {}}});
      },
      ThrowsMessage<UsageError>(
          "no material 'pink'; there are white Rubber VeroPureWht black VeroBlack clear VeroClear "
          "cyan VeroCyan magenta VeroMgnt yellow VeroYellow, and any other with its colour, as in "
          "pink=#rrggbb"));
  for (const char* text :
       {"", "=#000000", "a/b=#000000", "..=#000000", "a b=#000000", "a:b=#000000", " a=#000000"}) {
    EXPECT_THAT([&] { parseMaterial(text, {}); },
                ThrowsMessage<UsageError>(HasSubstr("has no proper material name")))
        << text;
  }
}

}  // namespace
}  // namespace vdbdither
