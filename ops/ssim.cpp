#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/file/staged_output.h"
#include "io/file/standard_streams.h"
#include "io/image/picture.h"
#include "io/image/png_spans.h"
#include "ops/kernels/picture/picture_similarity.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

// The names of the maps.
constexpr const char* plain_map = "ssim.png";
constexpr const char* seen_map = "ssim-seen.png";
constexpr const char* flip_map = "flip.png";

/// What this tool writes into any folder.
std::set<std::string> mapNames(const std::filesystem::path& /*folder*/) {
  return {plain_map, seen_map, flip_map};
}

/// The channels over a grey background, sRGB-coded, 0 to 1.
ColourChannels channelsOf(const Picture& picture, double background) {
  ColourChannels channels;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    channels[channel] = Channel(static_cast<int>(picture.width), static_cast<int>(picture.height));
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
      const double value = (picture.pixels[i] >> 8 * channel & 255) / 255.0;
      const double cover = (picture.pixels[i] >> 24) / 255.0;
      channels[channel].values[i] = cover * value + (1 - cover) * background;
    }
  }
  return channels;
}

/// The luma of ITU-R BT.601.
Channel greyOf(const ColourChannels& channels) {
  Channel grey(channels[0].width, channels[0].height);
  for (std::size_t i = 0; i < grey.values.size(); ++i)
    grey.values[i] = 0.299 * channels[0].values[i] + 0.587 * channels[1].values[i] +
                     0.114 * channels[2].values[i];
  return grey;
}

double meanOver(const Channel& map, const std::vector<std::size_t>& pixels) {
  double sum = 0;
  for (const std::size_t pixel : pixels) sum += map.values[pixel];
  return sum / static_cast<double>(pixels.size());
}

std::vector<std::uint8_t> greyPng(const Channel& map) {
  Picture picture{
      static_cast<std::uint32_t>(map.width), static_cast<std::uint32_t>(map.height), {}};
  for (const double value : map.values) {
    const auto grey = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 1.0) * 255));
    picture.pixels.push_back(rgba(grey, grey, grey));
  }
  return encodePicture(picture);
}

/// How much two pictures differ, by three measures.
class Ssim : public Tool {
 public:
  void declare(Options& options) override {
    options.positional("reference", reference_file_, "Picture that the other should be (.png)");
    options.positional("picture", picture_file_, "Picture to judge (.png), of the same size");
    view_.declare(options);
    options.number("background", background_, {0, 1}, "Grey behind transparent pixels, sRGB-coded");
    options.file("maps", maps_folder_, "FOLDER",
                 "Writes the maps ssim.png and ssim-seen.png (white where alike) and flip.png "
                 "(black where alike)");
    json_.declare(options);
    overwrite_.declare(options, "the folder");
  }

  void run() override {
    const double pixels_per_degree = view_.distance_mm / view_.pixel_mm * std::numbers::pi / 180;
    constexpr double least = 5;
    constexpr double most = 1000;
    if (!(pixels_per_degree >= least && pixels_per_degree <= most)) {
      throw UsageError("--pixel and --distance give " + shortestText(pixels_per_degree) +
                       " pixels per degree; the value must be from 5 to 1000");
    }
    if (!maps_folder_.empty())
      StagedOutput::checkFolder(maps_folder_, overwrite_.overwrite, mapNames,
                                [this](const std::string& text) { report().warn(text); });

    const Picture reference = readPicture(reference_file_);
    const Picture picture = readPicture(picture_file_);
    if (reference.width != picture.width || reference.height != picture.height) {
      throw DataError("'" + picture_file_ + "' has " + sizeText(picture) + " pixels and '" +
                      reference_file_ + "' " + sizeText(reference) +
                      "; only pictures of one size can be compared");
    }
    const std::vector<std::size_t> object = objectPixels(reference);
    const ColourChannels a = channelsOf(reference, background_);
    const ColourChannels b = channelsOf(picture, background_);
    const Channel grey_a = greyOf(a);
    const Channel grey_b = greyOf(b);
    const Channel plain = structuralSimilarity(grey_a, grey_b);
    const Channel seen = structuralSimilarity(seenByTheEye(grey_a, pixels_per_degree),
                                              seenByTheEye(grey_b, pixels_per_degree));
    const Channel flip = flipDifference(a, b, pixels_per_degree);
    const std::array<double, 3> means{meanOver(plain, object), meanOver(seen, object),
                                      meanOver(flip, object)};

    if (!maps_folder_.empty()) {
      StagedOutput staged(maps_folder_, StagedOutput::Kind::folder, mapNames);
      staged.write(plain_map, greyPng(plain));
      staged.write(seen_map, greyPng(seen));
      staged.write(flip_map, greyPng(flip));
      staged.commit();
    }
    printData(textOf(reference, object.size(), pixels_per_degree, means).c_str());
  }

 private:
  static std::string sizeText(const Picture& picture) {
    return std::to_string(picture.width) + " x " + std::to_string(picture.height);
  }

  /// Those that the object covers by half; where nothing is transparent, those whose whole window
  /// lies in the picture.
  [[nodiscard]] std::vector<std::size_t> objectPixels(const Picture& picture) const {
    const bool opaque = std::all_of(picture.pixels.begin(), picture.pixels.end(),
                                    [](std::uint32_t pixel) { return pixel >> 24 == 255; });
    constexpr std::uint32_t radius = 5;
    std::vector<std::size_t> pixels;
    for (std::uint32_t y = 0; y < picture.height; ++y) {
      for (std::uint32_t x = 0; x < picture.width; ++x) {
        const std::size_t i = std::size_t{y} * picture.width + x;
        if (opaque ? std::min(x, y) >= radius && x + radius < picture.width &&
                         y + radius < picture.height
                   : picture.pixels[i] >> 24 >= 128)
          pixels.push_back(i);
      }
    }
    if (!pixels.empty()) return pixels;
    throw DataError(opaque ? "'" + reference_file_ + "' has " + sizeText(picture) +
                                 " pixels; the minimum is 11 x 11"
                           : "'" + reference_file_ + "' shows nothing: all of it is transparent");
  }

  [[nodiscard]] std::string textOf(const Picture& reference, std::size_t object,
                                   double pixels_per_degree,
                                   const std::array<double, 3>& means) const {
    if (json_.json) {
      return jsonText({{"reference", reference_file_},
                       {"picture", picture_file_},
                       {"width", reference.width},
                       {"height", reference.height},
                       {"pixels", object},
                       {"pixels_per_degree", pixels_per_degree},
                       {"ssim", means[0]},
                       {"ssim_seen", means[1]},
                       {"flip", means[2]}},
                      1) +
             "\n";
    }
    std::array<char, 256> text{};
    std::snprintf(text.data(), text.size(),
                  "ssim       %.6f\nssim seen  %.6f  at %.1f pixels per degree\nflip       %.6f\n"
                  "pixels     %zu of %zu\n",
                  means[0], means[1], pixels_per_degree, means[2], object, reference.pixels.size());
    return text.data();
  }

  std::string reference_file_;
  std::string picture_file_;
  ViewOptions view_;
  double background_ = 0.5;
  std::string maps_folder_;
  JsonOption json_;
  OverwriteOption overwrite_;
};

}  // namespace

extern const ToolInfo ssim;
const ToolInfo ssim{
    "ssim", "How alike two pictures are: SSIM, SSIM of what the eye sees of them, and FLIP",
    "render part.stl part.png\n"
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! simulate ! render print.png --frame "
    "part.stl\n"
    "ssim part.png print.png",
    []() -> std::unique_ptr<Tool> { return std::make_unique<Ssim>(); }};

}  // namespace vdbdither
