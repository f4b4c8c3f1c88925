#include "io/profile/printer_profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/profile/profile_parser.h"
#include "io/stack/slice_format.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using openvdb::Vec2d;
using openvdb::Vec2i;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::UnorderedElementsAreArray;

const std::string least = R"("name": "p", "pitch_mm": [0.04, 0.08, 0.05])";

/// A profile with some members besides those that it needs.
PrinterProfile profileWith(const std::string& members) {
  return printerProfileFromJson("{" + least + "," + members + "}");
}

void expectRefused(const std::string& members, const std::string& message) {
  EXPECT_THAT([&] { profileWith(members); },
              testing::ThrowsMessage<DataError>(
                  "the metadata vdbdither:printer is not a printer profile: " + message));
}

TEST(PrinterProfile, TellsHowThePrinterTakesSlices) {
  const PrinterProfile profile =
      profileWith(R"("technology": "resin", "layer_mm": ["10um", 0.2], "slice_px": [3840, 6480.0],
                     "origin": "centre", "mirror_x": true, "mirror_y": false, "minimum_slices": 30,
                     "maximum_colours": 6, "containers": ["gcvf", "png"],
                     "printer_notes": "FILEFORMAT_GOO\nX", "materials": [{"name": "cyan",
                     "rgba": [0, 1, 2, 255], "density_g_per_cm3": 1.1, "resin": "VeroCY-V"}])");
  EXPECT_EQ(profile.technology, "resin");
  EXPECT_EQ(profile.layer_mm, Vec2d(0.01, 0.2));
  EXPECT_EQ(profile.slice_px, Vec2i(3840, 6480));
  EXPECT_EQ(profile.origin, "centre");
  EXPECT_TRUE(profile.mirror_x);
  EXPECT_FALSE(profile.mirror_y);
  EXPECT_EQ(profile.minimum_slices, 30);
  EXPECT_EQ(profile.maximum_colours, 6);
  EXPECT_THAT(profile.containers, ElementsAre("gcvf", "png"));
  EXPECT_EQ(profile.printer_notes, "FILEFORMAT_GOO\\nX");
  EXPECT_EQ(profile.materials[0].density_g_per_cm3, 1.1);
  EXPECT_EQ(profile.materials[0].resin, "VeroCY-V");
  EXPECT_EQ(toJson(printerProfileFromJson(toJson(profile))), toJson(profile));
  EXPECT_THAT(toJson(profile),
              HasSubstr(R"("origin":"centre","mirror_x":true,"minimum_slices":30,)"));
}

TEST(PrinterProfile, StatesNothingThatIsUnknown) {
  const PrinterProfile profile = printerProfileFromJson("{" + least + "}");
  EXPECT_EQ(profile.technology, "");
  EXPECT_FALSE(profile.layer_mm);
  EXPECT_EQ(profile.slice_px, Vec2i(0, 0));
  EXPECT_EQ(profile.origin, "corner");
  EXPECT_EQ(profile.minimum_slices, 0);
  for (const char* key : {"technology", "layer_mm", "slice_px", "origin", "mirror",
                          "minimum_slices", "maximum_colours", "containers", "printer_notes"})
    EXPECT_THAT(toJson(profile), Not(HasSubstr(key)));
}

TEST(PrinterProfile, RefusesWrongFieldsOfSlices) {
  expectRefused(R"("technology": "laser")", "technology must be jetting or resin");
  expectRefused(R"("technology": 1)", "technology must be jetting or resin");
  expectRefused(R"("origin": "center")", "origin must be corner or centre");
  expectRefused(R"("mirror_x": 1)", "mirror_x must be true or false");
  expectRefused(R"("minimum_slices": 0)",
                "minimum_slices must be a whole number from 1 to 16777216");
  expectRefused(R"("maximum_colours": 2.5)",
                "maximum_colours must be a whole number from 1 to 16777216");
  expectRefused(R"("printer_notes": [])", "printer_notes is no text");
  for (const char* px : {"[0, 1]", "[1]", "[1, 16777217]", "[1.5, 1]", "5"})
    expectRefused(R"("slice_px": )" + std::string(px),
                  "slice_px must be two whole numbers from 1 to 16777216, columns and rows");
  for (const char* names : {R"(["png", "png"])", R"([""])", "[1]", R"("png")"})
    expectRefused(R"("containers": )" + std::string(names),
                  "containers must be a list of different names");
}

TEST(PrinterProfile, ContainersAreFormatsOfSlices) {
  std::vector<std::string> formats;
  for (const SliceFormat* format : sliceFormats()) formats.emplace_back(format->name);
  EXPECT_THAT(containerNames(), UnorderedElementsAreArray(formats));
  expectRefused(R"("containers": ["png", "nonsense"])",
                "containers: 'nonsense' is not a slice format; give 3mf, exr, gcvf, objet, png, "
                "png1, png8, sl1, tiff, tiff1 or uvj");
}

TEST(PrinterProfile, RefusesNamesOfMaterialsThatOptionsCannotGive) {
  const auto named = [](const std::string& name) {
    return R"("materials": [{"name": ")" + name + R"(", "rgba": [0, 0, 0, 255]}])";
  };
  for (const char* name : {"a,b", "c:d", "e=f", " g ", "a b", ".a", "gr\u00fcn"})
    expectRefused(named(name),
                  "material 1: its name cannot be given in options; use letters, digits, '-', '_' "
                  "and '.'");
  expectRefused(named(std::string(256, 'a')),
                "material 1: its name has 256 bytes; the maximum is 255");
  EXPECT_EQ(profileWith(named("Vero-C_1.5")).materials[0].name, "Vero-C_1.5");
}

TEST(PrinterProfile, RefusesNamesOfMaterialsThatDifferByCaseOnly) {
  expectRefused(R"("materials": [{"name": "A", "rgba": [0, 0, 0, 255]},
                                 {"name": "a", "rgba": [9, 0, 0, 255]}])",
                "material 2: 'a' differs from 'A' by upper and lower case only");
}

TEST(PrinterProfile, MayHaveNoNameInMetadata) {
  EXPECT_EQ(printerProfileFromJson(R"({"name": "", "pitch_mm": [1, 1, 1]})").name, "");
  EXPECT_THAT([] { printerProfileFromJson(R"({"pitch_mm": [1, 1, 1]})"); },
              testing::ThrowsMessage<DataError>(HasSubstr(": there is no name")));
}

TEST(PrinterProfile, RefusesLayersOutOfTheirRange) {
  for (const char* range : {"[0.01]", "[0, 0.1]", "[0.01, 101]", "0.05", R"(["a", 1])"})
    expectRefused(R"("layer_mm": )" + std::string(range),
                  "layer_mm must be two lengths between 0.0001 and 100 mm");
  expectRefused(R"("layer_mm": [0.2, 0.01])", "layer_mm must begin with the lowest layer");
  expectRefused(R"("layer_mm": [0.06, 0.2])",
                "layer_mm must include the layer of pitch_mm, 0.05 mm");
  EXPECT_EQ(profileWith(R"("layer_mm": [0.05, 0.05])").layer_mm, Vec2d(0.05, 0.05));
}

TEST(PrinterProfile, RefusesSpreadsThatCannotBeReckonedWith) {
  for (const char* spread :
       {"[0, 0.05, 0.05]", "[0.05, 0.0009, 0.05]", "[0, 0, 0]", "[0.05, 0.05, 1.01]", "0.05"})
    expectRefused(R"("point_spread_mm": )" + std::string(spread),
                  "point_spread_mm must be three lengths between 0.001 and 1 mm");
  EXPECT_EQ(profileWith(R"("point_spread_mm": [0.001, "50um", 1])").point_spread_mm,
            openvdb::Vec3d(0.001, 0.05, 1));
}

TEST(PrinterProfile, RefusesWrongFieldsOfMaterials) {
  const auto material = [](const std::string& members) {
    return R"("materials": [{"name": "m", "rgba": [0, 0, 0, 255], )" + members + "}]";
  };
  for (const char* density : {"0", "-1", "101", R"("1")"})
    expectRefused(material(R"("density_g_per_cm3": )" + std::string(density)),
                  "material 1: density_g_per_cm3 must be a number above 0, up to 100");
  expectRefused(material(R"("resin": 1)"), "material 1: resin is no text");
  expectRefused(R"("materials": [{"name": "", "rgba": [0, 0, 0, 255]}])",
                "material 1: there is no name");
}

}  // namespace
}  // namespace vdbdither
