#include "io/profile/icc_coverages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <lcms2.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/profile/ink_set.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// Amounts of ink, 0 … 1, for a colour in CIELAB.
using Inks = std::function<std::vector<double>(const cmsCIELab&)>;

struct Sampler {
  Inks inks;
};

int sample(const cmsUInt16Number* in, cmsUInt16Number* out, void* cargo) {
  cmsCIELab lab;
  cmsLabEncoded2FloatV2(&lab, in);
  std::size_t channel = 0;
  for (const double amount : static_cast<Sampler*>(cargo)->inks(lab))
    out[channel++] =
        static_cast<cmsUInt16Number>(std::lround(std::clamp(amount, 0.0, 1.0) * 65535));
  return 1;
}

/// Writes an output profile with one table for all intents.
void writeProfile(const std::filesystem::path& path, cmsColorSpaceSignature space,
                  unsigned channels, Inks inks, const std::vector<std::string>& names = {},
                  cmsProfileClassSignature kind = cmsSigOutputClass) {
  cmsHPROFILE profile = cmsCreateProfilePlaceholder(nullptr);
  cmsSetProfileVersion(profile, 2.1);
  cmsSetDeviceClass(profile, kind);
  cmsSetColorSpace(profile, space);
  cmsSetPCS(profile, cmsSigLabData);
  cmsPipeline* pipeline = cmsPipelineAlloc(nullptr, 3, channels);
  cmsStage* table = cmsStageAllocCLut16bit(nullptr, 33, 3, channels, nullptr);
  Sampler sampler{std::move(inks)};
  cmsStageSampleCLut16bit(table, sample, &sampler, 0);
  cmsPipelineInsertStage(pipeline, cmsAT_END, table);
  for (const cmsTagSignature tag : {cmsSigBToA0Tag, cmsSigBToA1Tag, cmsSigBToA2Tag})
    cmsWriteTag(profile, tag, pipeline);
  cmsPipelineFree(pipeline);
  if (!names.empty()) {
    cmsNAMEDCOLORLIST* list =
        cmsAllocNamedColorList(nullptr, static_cast<cmsUInt32Number>(names.size()), 3, "", "");
    for (const std::string& name : names) cmsAppendNamedColor(list, name.c_str(), nullptr, nullptr);
    cmsWriteTag(profile, cmsSigColorantTableTag, list);
    cmsFreeNamedColorList(list);
  }
  ASSERT_TRUE(cmsSaveProfileToFile(profile, path.c_str()));
  cmsCloseProfile(profile);
}

InkSet cmykAndWhite() {
  InkSet set;
  set.inks = {{"VeroPureWht", {}}, {"VeroBlack", {}}, {"VeroClear", {}},
              {"VeroCyan", {}},    {"VeroMgnt", {}},  {"VeroYellow", {}}};
  set.linear_rgb.assign(6, openvdb::Vec3d(0.1));
  set.linear_rgb[0] = openvdb::Vec3d(0.9);
  set.clear = 2;
  return set;
}

std::vector<float> nodeOf(const CoverageTable& table, std::size_t red, std::size_t green,
                          std::size_t blue, std::size_t inks) {
  const auto edge = static_cast<std::size_t>(table.edge);
  const auto first = table.values.begin() +
                     static_cast<std::ptrdiff_t>(((red * edge + green) * edge + blue) * inks);
  return {first, first + static_cast<std::ptrdiff_t>(inks)};
}

class IccCoverages : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const {
    return (scratch_.path() / name).string();
  }
  CoverageTable read(const std::string& name, const std::string& channels = "") const {
    InkOptions options;
    options.icc = path(name);
    options.channels = channels;
    options.intent = Intent::relative;
    options.black_point = BlackPoint::kept;
    return readIccCoverages(options, set_);
  }

  test::ScratchFolder scratch_;
  InkSet set_ = cmykAndWhite();
};

TEST_F(IccCoverages, ChannelsAreInksByTheirNamesAndTheRestIsWhite) {
  writeProfile(path("cmyk.icc"), cmsSigCmykData, 4, [](const cmsCIELab& lab) {
    return std::vector<double>{0.1, 0.2, 0.05, 0.5 * (1 - lab.L / 100)};
  });
  const CoverageTable table = read("cmyk.icc");
  const auto last = static_cast<std::size_t>(table.edge) - 1;
  const std::vector<float> white = nodeOf(table, last, last, last, 6);
  EXPECT_THAT(white, testing::Pointwise(testing::FloatNear(2e-3F),
                                        std::vector<float>{0.65F, 0, 0, 0.1F, 0.2F, 0.05F}));
  const std::vector<float> black = nodeOf(table, 0, 0, 0, 6);
  EXPECT_THAT(black, testing::Pointwise(testing::FloatNear(2e-3F),
                                        std::vector<float>{0.15F, 0.5F, 0, 0.1F, 0.2F, 0.05F}));
  // A linear light of (n / last)² for the lightness of CIELAB.
  const float grey = nodeOf(table, 16, 16, 16, 6)[1];
  EXPECT_NEAR(grey, 0.5 * (1 - (1.16 * std::cbrt(0.25) - 0.16)), 3e-3);
}

TEST_F(IccCoverages, ASumAboveOneIsDivided) {
  writeProfile(path("heavy.icc"), cmsSigCmykData, 4, [](const cmsCIELab&) {
    return std::vector<double>{1, 1, 0, 0.5};
  });
  const std::vector<float> node = nodeOf(read("heavy.icc"), 3, 5, 7, 6);
  EXPECT_THAT(node, testing::Pointwise(testing::FloatNear(1e-4F),
                                       std::vector<float>{0, 0.2F, 0, 0.4F, 0.4F, 0}));
}

TEST_F(IccCoverages, ChannelsWithNamesAreFound) {
  const auto inks = [](const cmsCIELab&) { return std::vector<double>{0.4, 0.1, 0, 0, 0.2}; };
  const std::vector<std::string> names = {"Yellow", "Magenta", "White", "Key", "Cyan"};
  writeProfile(path("five.icc"), cmsSig5colorData, 5, inks, names);
  set_.inks.push_back({"grey", {}});
  set_.linear_rgb.emplace_back(0.4);
  EXPECT_THAT(nodeOf(read("five.icc"), 1, 2, 3, 7),
              testing::Pointwise(testing::FloatNear(1e-4F),
                                 std::vector<float>{0, 0, 0, 0.2F, 0.1F, 0.4F, 0.3F}));
}

TEST_F(IccCoverages, ChannelsCanBeNamedByHand) {
  writeProfile(path("cmyk.icc"), cmsSigCmykData, 4, [](const cmsCIELab&) {
    return std::vector<double>{0.4, 0.1, 0, 0};
  });
  const auto node = nodeOf(read("cmyk.icc", "VeroYellow,veroblack,VeroCyan,VeroMgnt"), 1, 2, 3, 6);
  EXPECT_NEAR(node[5], 0.4, 1e-4);
  EXPECT_NEAR(node[1], 0.1, 1e-4);
}

TEST_F(IccCoverages, RefusesWhatDoesNotFit) {
  const auto inks = [](const cmsCIELab&) { return std::vector<double>{0, 0, 0, 0}; };
  writeProfile(path("cmyk.icc"), cmsSigCmykData, 4, inks);
  const auto refusal = [&](const std::string& name, const std::string& channels,
                           const std::string& message) {
    EXPECT_THAT([&] { read(name, channels); }, ThrowsMessage<Error>(HasSubstr(message)));
  };
  refusal("missing.icc", "", "--icc: no such file '" + path("missing.icc") + "'");
  std::ofstream(path("text.icc")) << "this is not a profile";
  refusal("text.icc", "", "is not an ICC profile, or it is damaged");
  std::ofstream(path("empty.icc"));
  refusal("empty.icc", "", "is not an ICC profile, or it is damaged");
  cmsHPROFILE srgb = cmsCreate_sRGBProfile();
  cmsSaveProfileToFile(srgb, path("srgb.icc").c_str());
  cmsCloseProfile(srgb);
  refusal("srgb.icc", "", "is not a profile of a printer (class 'prtr'); give an output profile");
  refusal("cmyk.icc", "VeroCyan,VeroMgnt", "--channels: the profile has 4 channels, not 2");
  refusal("cmyk.icc", "VeroCyan,VeroMgnt,VeroYellow,green",
          "--channels: no ink 'green' for a channel of the profile; there are VeroPureWht");
  refusal("cmyk.icc", "VeroCyan,VeroMgnt,VeroYellow,VeroCyan",
          "--channels: 'VeroCyan' stands for two channels");
  writeProfile(path("five.icc"), cmsSig5colorData, 5, [](const cmsCIELab&) {
    return std::vector<double>{0, 0, 0, 0, 0};
  });
  refusal("five.icc", "", "--channels: the profile has 5 channels without names; name their inks");
  set_.inks[0].name = "cream";
  set_.clear = 0;
  set_.inks[2].name = "VeroWht";
  set_.inks.erase(set_.inks.begin() + 2);
  set_.linear_rgb.pop_back();
  refusal(
      "cmyk.icc", "",
      "--inks: all of them are channels of --icc; there must be one for the rest, such as white");
}

}  // namespace
}  // namespace vdbdither
