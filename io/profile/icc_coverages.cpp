#include "io/profile/icc_coverages.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "io/file/whole_file.h"
#include "io/image/colour_management.h"
#include "io/profile/material_table.h"
#include "vdbdither/engine/comma_list.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

constexpr int table_edge = 33;

CmsProfile outputProfile(const std::string& path, cmsContext context) {
  const std::string shown = "'" + printable(path) + "'";
  std::error_code none;
  if (!std::filesystem::exists(path, none)) throw UsageError("--icc: no such file " + shown);
  if (!std::filesystem::is_regular_file(path, none))
    throw UsageError("--icc: " + shown + " is not a regular file");
  constexpr std::uint64_t most_bytes = std::uint64_t{1} << 26;
  const std::vector<std::uint8_t> bytes = readWholeFile(path, shown, most_bytes);
  CmsProfile profile(
      cmsOpenProfileFromMemTHR(context, bytes.data(), static_cast<cmsUInt32Number>(bytes.size())));
  if (!profile) throw DataError("--icc: " + shown + " is not an ICC profile, or it is damaged");
  if (cmsGetDeviceClass(profile.get()) != cmsSigOutputClass)
    throw DataError("--icc: " + shown +
                    " is not a profile of a printer (class 'prtr'); give an output profile");
  return profile;
}

/// The names of the channels: those of the profile, or those of CMYK.
std::vector<std::string> channelNames(cmsHPROFILE profile, std::size_t count) {
  std::vector<std::string> names;
  if (const auto* list =
          static_cast<const cmsNAMEDCOLORLIST*>(cmsReadTag(profile, cmsSigColorantTableTag));
      list != nullptr && cmsNamedColorCount(list) == count) {
    for (cmsUInt32Number n = 0; n < count; ++n) {
      std::array<char, cmsMAX_PATH> name{};
      cmsNamedColorInfo(list, n, name.data(), nullptr, nullptr, nullptr, nullptr);
      names.push_back(printable(name.data()));
    }
  } else if (cmsGetColorSpace(profile) == cmsSigCmykData) {
    names = {"cyan", "magenta", "yellow", "black"};
  }
  return names;
}

/// Whether a material is what a channel calls its ink: VeroMgnt and magenta, for example.
bool isCalled(const std::string& material, const std::string& channel) {
  static const std::vector<std::vector<std::string>> synonyms = {{"cyan", "verocy"},
                                                                 {"magenta", "mgnt", "veromgt"},
                                                                 {"yellow", "veroyl"},
                                                                 {"black", "key"},
                                                                 {"white", "wht"}};
  const std::string of_material = lowerCase(material);
  const std::string of_channel = lowerCase(channel);
  if (of_material == of_channel) return true;
  return std::any_of(synonyms.begin(), synonyms.end(), [&](const auto& words) {
    const auto has = [&](const std::string& name) {
      return std::any_of(words.begin(), words.end(), [&](const std::string& word) {
        return name.find(word) != std::string::npos;
      });
    };
    return has(of_material) && has(of_channel);
  });
}

std::string namesOf(const InkSet& set) {
  std::string names;
  for (const Material& ink : set.inks) names += " " + ink.name;
  return names;
}

/// The ink of every channel.
std::vector<std::size_t> inksOfChannels(const InkOptions& options, const InkSet& set,
                                        cmsHPROFILE profile, std::size_t count) {
  const bool given = !options.channels.empty();
  const std::vector<std::string> names =
      given ? commaList(options.channels) : channelNames(profile, count);
  if (names.size() != count)
    throw UsageError("--channels: the profile has " + std::to_string(count) + " channels" +
                     (given ? ", not " + std::to_string(names.size())
                            : std::string(" without names; name their inks")));
  std::vector<std::size_t> inks;
  for (const std::string& name : names) {
    const Material* ink = materialCalled(name, set.inks);
    for (auto other = set.inks.begin(); !given && ink == nullptr && other != set.inks.end();
         ++other) {
      if (isCalled(other->name, name)) ink = &*other;
    }
    if (ink == nullptr)
      throw UsageError("--channels: no ink '" + name + "' for a channel of the profile; there are" +
                       namesOf(set));
    const auto index = static_cast<std::size_t>(ink - set.inks.data());
    if (index == set.clear)
      throw UsageError("--channels: '" + ink->name +
                       "' is clear; a channel must be an ink with a colour");
    if (std::find(inks.begin(), inks.end(), index) != inks.end())
      throw UsageError("--channels: '" + ink->name + "' stands for two channels");
    inks.push_back(index);
  }
  return inks;
}

/// The lightest ink that is neither a channel nor clear.
std::size_t restOf(const InkSet& set, const std::vector<std::size_t>& channels) {
  std::optional<std::size_t> lightest;
  for (std::size_t ink = 0; ink < set.inks.size(); ++ink) {
    if (ink == set.clear || std::find(channels.begin(), channels.end(), ink) != channels.end())
      continue;
    if (!lightest || luminanceOf(set.linear_rgb[ink]) >= luminanceOf(set.linear_rgb[*lightest]))
      lightest = ink;
  }
  if (!lightest)
    throw UsageError(
        "--inks: all of them are channels of --icc; there must be one for the rest, "
        "such as white");
  return *lightest;
}

cmsUInt32Number intentOf(Intent intent) {
  switch (intent) {
    case Intent::perceptual:
      return INTENT_PERCEPTUAL;
    case Intent::relative:
      return INTENT_RELATIVE_COLORIMETRIC;
    case Intent::saturation:
      return INTENT_SATURATION;
    case Intent::absolute:
      return INTENT_ABSOLUTE_COLORIMETRIC;
  }
  return INTENT_PERCEPTUAL;
}

CmsTransform transformTo(cmsContext context, cmsHPROFILE profile, const InkOptions& options) {
  const CmsProfile from = rgbProfile(context, rec709, 1);
  cmsUInt32Number flags = cmsFLAGS_NOCACHE | cmsFLAGS_NOOPTIMIZE;
  if (options.black_point == BlackPoint::compensated) flags |= cmsFLAGS_BLACKPOINTCOMPENSATION;
  const cmsUInt32Number sixteen_bits = cmsFormatterForColorspaceOfProfile(profile, 2, FALSE);
  CmsTransform transform(cmsCreateTransformTHR(context, from.get(), TYPE_RGB_FLT, profile,
                                               sixteen_bits, intentOf(options.intent), flags));
  if (!transform)
    throw DataError("--icc: the profile '" + printable(options.icc) +
                    "' has no table for --intent " + std::string(nameOf(intents, options.intent)) +
                    "; choose another intent");
  return transform;
}

}  // namespace

CoverageTable readIccCoverages(const InkOptions& options, const InkSet& set) {
  const CmsContext context = quietContext();
  const CmsProfile profile = outputProfile(options.icc, context.get());
  const auto count = static_cast<std::size_t>(cmsChannelsOf(cmsGetColorSpace(profile.get())));
  if (cmsGetColorSpace(profile.get()) == cmsSigRgbData || count == 1)
    throw DataError("--icc: the channels of '" + printable(options.icc) +
                    "' are not inks; give a profile of CMYK or of named inks");
  const std::vector<std::size_t> channels = inksOfChannels(options, set, profile.get(), count);
  const std::size_t rest = restOf(set, channels);
  const CmsTransform transform = transformTo(context.get(), profile.get(), options);

  CoverageTable table;
  table.edge = table_edge;
  const auto node = [](int n) {
    const float root = static_cast<float>(n) / (table_edge - 1);
    return root * root;
  };
  std::array<std::uint16_t, cmsMAXCHANNELS> amounts{};
  for (int red = 0; red < table_edge; ++red) {
    for (int green = 0; green < table_edge; ++green) {
      for (int blue = 0; blue < table_edge; ++blue) {
        const std::array<float, 3> linear_rgb{node(red), node(green), node(blue)};
        cmsDoTransform(transform.get(), linear_rgb.data(), amounts.data(), 1);
        std::vector<double> coverages(set.inks.size());
        double sum = 0;
        for (std::size_t channel = 0; channel < count; ++channel) {
          constexpr double full = 65535;
          sum += coverages[channels[channel]] = amounts[channel] / full;
        }
        if (sum < 1) coverages[rest] = 1 - sum;
        for (const double coverage : coverages)
          table.values.push_back(static_cast<float>(coverage / std::max(sum, 1.0)));
      }
    }
  }
  return table;
}

}  // namespace vdbdither
