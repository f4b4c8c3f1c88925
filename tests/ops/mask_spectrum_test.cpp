#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/drawn_grids.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using testing::ElementsAre;

template <typename Kind>
std::unique_ptr<Kind> made(const std::string& verb, const std::vector<std::string>& arguments) {
  std::unique_ptr<Operator> made = findOperator(verb).make();
  Options options;
  made->declare(options);
  options.parse(arguments);
  return std::unique_ptr<Kind>(dynamic_cast<Kind*>(made.release()));
}

std::vector<std::string> quick(const std::string& file) {
  return {"--step", "30", "--plane-step", "45", "--levels", "3", file};
}

nlohmann::json spectrumOf(const std::vector<std::string>& mask, int slab_height = 256) {
  const test::ScratchFolder folder;
  const std::string file = folder.path() / "spectrum.json";
  const auto source = made<Source>("mask", mask);
  const Schema schema = source->plan();
  const auto sink = made<Sink>("mask-spectrum", quick(file));
  sink->plan(schema);
  for (int z = 0; z < schema.lattice.layers().end; z += slab_height) {
    const ZRange core = intersection({z, z + slab_height}, schema.lattice.layers());
    sink->write({core, core, source->run(core)});
  }
  sink->finish();
  EXPECT_FALSE(std::filesystem::exists(file));
  sink->publish();
  return nlohmann::json::parse(std::ifstream(file));
}

TEST(MaskSpectrum, SaysHowTheMaskWasMadeAndWhatItsFacetsSee) {
  const nlohmann::json spectrum = spectrumOf({"--size", "16", "--sigma", "1.1", "--seed", "4"});
  EXPECT_THAT(spectrum["size"], ElementsAre(16, 16, 16));
  EXPECT_EQ(spectrum["mask:kernel"], "peters");
  EXPECT_EQ(spectrum["mask:seed"], "4");
  ASSERT_EQ(spectrum["thresholded"].size(), 3u);
  EXPECT_DOUBLE_EQ(spectrum["thresholded"][0]["kappa"], 0.25);
  for (const char* model : {"projection", "voxel_plane", "voxel_plane_near_axes"}) {
    const nlohmann::json& grey = spectrum["grey"][model];
    EXPECT_EQ(grey["mean"].size(), 32u);
    EXPECT_LT(grey["low_mean"], 0.7) << model;
    EXPECT_GE(grey["low_worst"], grey["low_mean"]) << model;
  }
}

TEST(MaskSpectrum, WhiteNoiseIsOne) {
  const nlohmann::json spectrum = spectrumOf({"--size", "24", "--kind", "white"});
  EXPECT_NEAR(spectrum["grey"]["projection"]["low_mean"], 1, 0.15);
  EXPECT_NEAR(spectrum["grey"]["voxel_plane"]["low_mean"], 1, 0.15);
}

TEST(MaskSpectrum, IsTheSameForEverySlabHeight) {
  EXPECT_EQ(spectrumOf({"--size", "16"}), spectrumOf({"--size", "16"}, 8));
}

TEST(MaskSpectrum, RefusesWhatHasNoSpectrum) {
  const test::ScratchFolder folder;
  const std::string file = folder.path() / "spectrum.json";
  Schema schema;
  schema.lattice.box = openvdb::CoordBBox(Coord(0, 0, 0), Coord(7, 7, 7));
  const auto refusal = [&](std::vector<std::string> arguments) -> std::string {
    try {
      const auto sink = made<Sink>("mask-spectrum", arguments);
      sink->plan(schema);
      sink->write({{0, 8}, {0, 8}, {{"mask", openvdb::FloatGrid::create(0.5f)}}});
      sink->finish();
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal(quick(file)), "no grid 'mask'; there is none");
  schema.grids["mask"] = openvdb::FloatGrid::create(0.5f);
  EXPECT_EQ(refusal(quick(file)), "the mask is constant: it has no spectrum");
  EXPECT_EQ(refusal({"--pitch", "1,0,1", file}),
            "--pitch: '1,0,1' is not accepted; the value must be one length or three, separated by "
            "commas, each greater than 0 mm, up to 1000000 mm");
  schema.lattice.box = openvdb::CoordBBox(Coord(0, 0, 0), Coord(7, 300, 7));
  EXPECT_EQ(refusal(quick(file)), "the mask is 301 voxels long; tiles of up to 256 are looked at");
  schema.lattice.box = openvdb::CoordBBox();
  EXPECT_EQ(refusal(quick(file)), "there is no mask to look at: the lattice has no voxels");
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace
}  // namespace vdbdither
