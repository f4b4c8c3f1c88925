// ICC profiles: ICC.1 (ISO 15076-1), through LittleCMS.

#include "io/image/colour_space.h"

#include <cmath>
#include <lcms2.h>

namespace vdbdither {

struct ColourTransform::Handles {
  cmsContext context = nullptr;
  cmsHTRANSFORM transform = nullptr;

  Handles() = default;
  Handles(const Handles&) = delete;
  Handles& operator=(const Handles&) = delete;
  ~Handles() {
    if (transform != nullptr) cmsDeleteTransform(transform);
    if (context != nullptr) cmsDeleteContext(context);
  }
};

namespace {

/// Profiles of presses have up to some MB.
constexpr std::size_t most_profile_bytes = std::size_t{1} << 24;

class Profile {
 public:
  explicit Profile(cmsHPROFILE handle) : handle_(handle) {}
  Profile(const Profile&) = delete;
  Profile& operator=(const Profile&) = delete;
  ~Profile() {
    if (handle_ != nullptr) cmsCloseProfile(handle_);
  }
  [[nodiscard]] cmsHPROFILE get() const { return handle_; }

 private:
  cmsHPROFILE handle_;
};

class Curve {
 public:
  /// A power, or the encoding of sRGB.
  Curve(cmsContext context, std::optional<double> exponent) {
    constexpr int power_with_line = 4;
    constexpr std::array<double, 5> srgb{2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
    curve_ = exponent ? cmsBuildGamma(context, *exponent)
                      : cmsBuildParametricToneCurve(context, power_with_line, srgb.data());
  }
  Curve(const Curve&) = delete;
  Curve& operator=(const Curve&) = delete;
  ~Curve() {
    if (curve_ != nullptr) cmsFreeToneCurve(curve_);
  }
  [[nodiscard]] cmsToneCurve* get() const { return curve_; }

 private:
  cmsToneCurve* curve_ = nullptr;
};

constexpr ColourSpace::Chromaticities rec709{
    {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}}};

cmsHPROFILE rgbProfile(cmsContext context, const ColourSpace::Chromaticities& chromaticities,
                       std::optional<double> exponent) {
  for (const auto& [x, y] : chromaticities) {
    if (!(std::abs(x) <= 2 && y > 1e-4 && y <= 2)) return nullptr;
  }
  const auto position = [&](std::size_t i) {
    return cmsCIExyY{chromaticities[i][0], chromaticities[i][1], 1};
  };
  const cmsCIExyY white = position(3);
  const cmsCIExyYTRIPLE primaries{position(0), position(1), position(2)};
  const Curve curve(context, exponent);
  if (curve.get() == nullptr) return nullptr;
  const std::array<cmsToneCurve*, 3> curves{curve.get(), curve.get(), curve.get()};
  return cmsCreateRGBProfileTHR(context, &white, &primaries, curves.data());
}

cmsHPROFILE profileOf(cmsContext context, const ColourSpace& space) {
  if (!space.icc_profile.empty()) {
    if (space.icc_profile.size() > most_profile_bytes) return nullptr;
    return cmsOpenProfileFromMemTHR(context, space.icc_profile.data(),
                                    static_cast<cmsUInt32Number>(space.icc_profile.size()));
  }
  if (!space.chromaticities) return nullptr;
  return rgbProfile(context, *space.chromaticities, space.exponent);
}

}  // namespace

std::unique_ptr<ColourTransform> ColourTransform::make(const ColourSpace& space, int channels) {
  if (space.icc_profile.empty() && (!space.chromaticities || channels == 4)) return nullptr;
  auto handles = std::make_unique<Handles>();
  handles->context = cmsCreateContext(nullptr, nullptr);
  if (handles->context == nullptr) return nullptr;
  // A broken profile is passed over without a word to the error stream.
  cmsSetLogErrorHandlerTHR(handles->context, [](cmsContext, cmsUInt32Number, const char*) {});
  const Profile from(profileOf(handles->context, space));
  const Profile to(rgbProfile(handles->context, rec709, 1));
  if (from.get() == nullptr || to.get() == nullptr) return nullptr;

  const cmsColorSpaceSignature kind = cmsGetColorSpace(from.get());
  int taken = 0;
  cmsUInt32Number format = 0;
  if (kind == cmsSigGrayData && channels == 1) {
    taken = 1;
    format = TYPE_GRAY_FLT;
  } else if (kind == cmsSigRgbData && channels != 4) {
    taken = 3;
    format = TYPE_RGB_FLT;
  } else if (kind == cmsSigCmykData && channels == 4) {
    taken = 4;
    format = TYPE_CMYK_FLT;
  } else {
    return nullptr;
  }
  handles->transform =
      cmsCreateTransformTHR(handles->context, from.get(), format, to.get(), TYPE_RGB_FLT,
                            INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOCACHE | cmsFLAGS_NOOPTIMIZE);
  if (handles->transform == nullptr) return nullptr;
  return std::unique_ptr<ColourTransform>(new ColourTransform(std::move(handles), taken));
}

ColourTransform::ColourTransform(std::unique_ptr<Handles> handles, int channels)
    : handles_(std::move(handles)), channels_(channels) {}

ColourTransform::~ColourTransform() = default;

void ColourTransform::run(const float* samples, float* linear, std::size_t colours) const {
  cmsDoTransform(handles_->transform, samples, linear, static_cast<cmsUInt32Number>(colours));
}

}  // namespace vdbdither
