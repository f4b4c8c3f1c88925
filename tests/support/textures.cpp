#include "tests/support/textures.h"

#include <cmath>
#include <cstring>
#include <lcms2.h>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>
#include <png.h>

#include "vdbdither/model/errors.h"

namespace vdbdither::test {

double Samples::share(std::uint32_t x, std::uint32_t y, int channel) const {
  const std::size_t at = (std::size_t{y} * width + x) * static_cast<std::size_t>(channels) +
                         static_cast<std::size_t>(channel);
  return values[at] / static_cast<double>((1 << bits) - 1);
}

Bytes Samples::packed() const {
  if (bits == 8) return {values.begin(), values.end()};
  Bytes bytes(2 * values.size());
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

Samples pattern(std::uint32_t width, std::uint32_t height, int channels, int bits) {
  Samples samples{width, height, channels, bits};
  std::mt19937 random(width * 31 + height);
  const std::size_t count = std::size_t{width} * height * static_cast<std::size_t>(channels);
  for (std::size_t i = 0; i < count; ++i)
    samples.values.push_back(static_cast<std::uint16_t>(random() & ((1U << bits) - 1)));
  return samples;
}

Bytes pngOf(const Samples& samples, bool is_interlaced, const PngColours& colours) {
  Bytes bytes;
  png_structp png = png_create_write_struct(
      PNG_LIBPNG_VER_STRING, nullptr,
      [](png_structp, png_const_charp text) { throw std::runtime_error(text); },
      [](png_structp, png_const_charp) {});
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &bytes,
      [](png_structp writer, png_bytep data, std::size_t size) {
        auto& out = *static_cast<Bytes*>(png_get_io_ptr(writer));
        out.insert(out.end(), data, data + size);
      },
      [](png_structp) {});
  constexpr std::array<int, 5> kinds{0, PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA,
                                     PNG_COLOR_TYPE_RGB, PNG_COLOR_TYPE_RGB_ALPHA};
  png_set_IHDR(png, info, samples.width, samples.height, samples.bits,
               kinds[static_cast<std::size_t>(samples.channels)],
               is_interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (colours.gamma != 0) png_set_gAMA(png, info, colours.gamma);
  const auto& xy = colours.chromaticities;
  if (xy[0] != 0) png_set_cHRM(png, info, xy[0], xy[1], xy[2], xy[3], xy[4], xy[5], xy[6], xy[7]);
  if (colours.is_srgb) png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
  if (!colours.icc_profile.empty())
    png_set_iCCP(png, info, "made", 0, colours.icc_profile.data(),
                 static_cast<png_uint_32>(colours.icc_profile.size()));
  png_write_info(png, info);
  if (samples.bits == 16) png_set_swap(png);
  Bytes packed = samples.packed();
  std::vector<png_bytep> rows;
  rows.reserve(samples.height);
  for (std::size_t y = 0; y < samples.height; ++y)
    rows.push_back(packed.data() + y * (packed.size() / samples.height));
  png_write_image(png, rows.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

namespace {

Bytes bytesOf(cmsHPROFILE profile) {
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(profile, nullptr, &size);
  Bytes bytes(size);
  cmsSaveProfileToMem(profile, bytes.data(), &size);
  cmsCloseProfile(profile);
  return bytes;
}

constexpr cmsCIExyY d65{0.3127, 0.3290, 1};

}  // namespace

Bytes swappedProfile(double gamma) {
  cmsToneCurve* curve = cmsBuildGamma(nullptr, gamma);
  const std::array<cmsToneCurve*, 3> curves{curve, curve, curve};
  const cmsCIExyYTRIPLE primaries{{0.30, 0.60, 1}, {0.15, 0.06, 1}, {0.64, 0.33, 1}};
  Bytes bytes = bytesOf(cmsCreateRGBProfile(&d65, &primaries, curves.data()));
  cmsFreeToneCurve(curve);
  return bytes;
}

Bytes greyProfile(double gamma) {
  cmsToneCurve* curve = cmsBuildGamma(nullptr, gamma);
  Bytes bytes = bytesOf(cmsCreateGrayProfile(&d65, curve));
  cmsFreeToneCurve(curve);
  return bytes;
}

namespace {

struct TableSampler {
  cmsHTRANSFORM to_lab;
  int channels;
};

cmsInt32Number sampleTable(const cmsUInt16Number* in, cmsUInt16Number* out, void* cargo) {
  const auto& sampler = *static_cast<TableSampler*>(cargo);
  const auto share = [&](int i) { return in[i] / 65535.0; };
  std::array<double, 3> light{share(1), share(2), share(0)};
  for (int i = 0; sampler.channels == 4 && i < 3; ++i)
    light[static_cast<std::size_t>(i)] = (1 - share(i)) * (1 - share(3));
  cmsCIELab lab;
  cmsDoTransform(sampler.to_lab, light.data(), &lab, 1);
  cmsFloat2LabEncoded(out, &lab);
  return 1;
}

}  // namespace

Bytes tableProfile(int channels) {
  cmsToneCurve* curve = cmsBuildGamma(nullptr, 1);
  const std::array<cmsToneCurve*, 3> curves{curve, curve, curve};
  const cmsCIExyYTRIPLE primaries{{0.64, 0.33, 1}, {0.30, 0.60, 1}, {0.15, 0.06, 1}};
  cmsHPROFILE rgb = cmsCreateRGBProfile(&d65, &primaries, curves.data());
  cmsHPROFILE lab = cmsCreateLab4Profile(nullptr);
  TableSampler sampler{cmsCreateTransform(rgb, TYPE_RGB_DBL, lab, TYPE_Lab_DBL,
                                          INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOOPTIMIZE),
                       channels};
  const auto inputs = static_cast<cmsUInt32Number>(channels);
  cmsPipeline* pipeline = cmsPipelineAlloc(nullptr, inputs, 3);
  cmsStage* table = cmsStageAllocCLut16bit(nullptr, channels == 4 ? 13 : 33, inputs, 3, nullptr);
  cmsStageSampleCLut16bit(table, sampleTable, &sampler, 0);
  cmsPipelineInsertStage(pipeline, cmsAT_BEGIN, cmsStageAllocToneCurves(nullptr, inputs, nullptr));
  cmsPipelineInsertStage(pipeline, cmsAT_END, table);
  cmsPipelineInsertStage(pipeline, cmsAT_END, cmsStageAllocToneCurves(nullptr, 3, nullptr));

  cmsHPROFILE profile = cmsCreateProfilePlaceholder(nullptr);
  cmsSetProfileVersion(profile, 4.3);
  cmsSetDeviceClass(profile, cmsSigOutputClass);
  cmsSetColorSpace(profile, channels == 4 ? cmsSigCmykData : cmsSigRgbData);
  cmsSetPCS(profile, cmsSigLabData);
  cmsWriteTag(profile, cmsSigMediaWhitePointTag, cmsD50_XYZ());
  cmsWriteTag(profile, cmsSigAToB0Tag, pipeline);
  cmsWriteTag(profile, cmsSigAToB1Tag, pipeline);
  cmsPipelineFree(pipeline);
  cmsDeleteTransform(sampler.to_lab);
  cmsCloseProfile(rgb);
  cmsCloseProfile(lab);
  cmsFreeToneCurve(curve);
  return bytesOf(profile);
}

double srgbToLinear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

std::string textOf(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Texture decoded(const Bytes& bytes, TextureOpacity opacity) {
  return decodeTexture(textOf(bytes), "texture 'a'", opacity);
}

std::string textureRefusal(const Bytes& bytes) {
  try {
    decoded(bytes);
    return "read";
  } catch (const DataError& error) {
    return error.what();
  }
}

void expectTexels(const Texture& texture, std::uint32_t width, std::uint32_t height,
                  const std::function<Colour(std::uint32_t x, std::uint32_t y)>& expected,
                  double tolerance) {
  ASSERT_EQ(texture.width, width);
  ASSERT_EQ(texture.height, height);
  ASSERT_EQ(texture.texels.size(), std::size_t{width} * height);
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const Colour colour = expected(x, y);
      const Texture::Texel& texel = texture.texels[std::size_t{y} * width + x];
      for (std::size_t i = 0; i < 4; ++i) {
        const double wanted = i == 3 ? colour[3] : colour[i] * colour[3];
        ASSERT_NEAR(texel[i] / 65535.0, wanted, tolerance)
            << "channel " << i << " at " << x << ", " << y;
      }
    }
  }
}

namespace {

void expectOneLine(const std::string& message) {
  EXPECT_TRUE(message.starts_with("texture 'a' ")) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

}  // namespace

void expectPrefixesAreRefused(const Bytes& bytes, bool may_end_early) {
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const std::string message =
        textureRefusal({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)});
    if (message == "read" && may_end_early) continue;
    ASSERT_NE(message, "read") << size << " of " << bytes.size();
    expectOneLine(message);
  }
}

void expectSpoiltImagesAreReadOrRefused(const Bytes& bytes, int rounds) {
  std::mt19937 random(7);
  for (int round = 0; round < rounds; ++round) {
    Bytes spoilt = bytes;
    for (std::uint32_t i = 0; i <= random() % 4; ++i)
      spoilt[random() % spoilt.size()] = static_cast<std::uint8_t>(random());
    try {
      const Texture texture = decoded(spoilt);
      EXPECT_EQ(texture.texels.size(), std::size_t{texture.width} * texture.height);
      for (const Texture::Texel& texel : texture.texels) {
        for (std::size_t i = 0; i < 3; ++i) ASSERT_LE(texel[i], texel[3]);
      }
    } catch (const DataError& error) {
      expectOneLine(error.what());
    }
  }
}

}  // namespace vdbdither::test
