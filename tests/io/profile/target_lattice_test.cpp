#include "io/profile/target_lattice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/profile/printer_profile.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {
namespace {

using openvdb::Vec3d;

class TargetPitch : public testing::Test {
 protected:
  /// A profile with layers of 50 µm and more members.
  std::string profile(const std::string& members) {
    return folder_
        .write("p.json", R"({"name": "p", "pitch_mm": [0.02, 0.03, 0.05])" + members + "}")
        .string();
  }

  static void expectRefused(const LatticeOptions& target, const std::string& message) {
    Schema schema;
    EXPECT_THAT([&] { targetPitchMm(target, schema); },
                testing::ThrowsMessage<UsageError>(message));
  }

  test::ScratchFolder folder_;
};

const std::string range = R"(, "layer_mm": ["10um", "200um"])";

TEST_F(TargetPitch, HasTheLayerOfTheOptionWithinTheRangeOfTheProfile) {
  for (const double layer_mm : {0.01, 0.1, 0.2}) {
    Schema schema;
    EXPECT_EQ(targetPitchMm({profile(range), layer_mm, {}}, schema), Vec3d(0.02, 0.03, layer_mm));
    EXPECT_EQ(printerProfileOf(schema).pitch_mm, Vec3d(0.02, 0.03, layer_mm));
    EXPECT_EQ(printerProfileOf(schema).layer_mm, openvdb::Vec2d(0.01, 0.2));
  }
  Schema schema;
  EXPECT_EQ(targetPitchMm({profile(range), {}, {}}, schema), Vec3d(0.02, 0.03, 0.05));
}

TEST_F(TargetPitch, RefusesLayersThatThePrinterDoesNotTake) {
  const std::string message = "--layer: the printer 'p' takes layers from 0.01 to 0.2 mm";
  for (const double layer_mm : {0.0099, 0.2001})
    expectRefused({profile(range), layer_mm, {}}, message);
  expectRefused({profile(""), 0.05, {}},
                "--layer: the printer 'p' has layers of 0.05 mm; its profile states no range "
                "(layer_mm)");
}

TEST_F(TargetPitch, RefusesALayerWithoutAPrinter) {
  expectRefused({"", 0.05, Vec3d(0.1)},
                "--layer goes with --printer; --pitch states the height of a layer itself");
  expectRefused({"", 0.05, {}},
                "give either --printer NAME (vdbdither printers lists them) or --pitch DX,DY,DZ");
}

}  // namespace
}  // namespace vdbdither
