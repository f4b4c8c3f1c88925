#include "io/image/colour_management.h"

#include <array>
#include <cmath>

namespace vdbdither {

namespace {

using Curve = std::unique_ptr<cmsToneCurve, CmsDeleter<cmsFreeToneCurve>>;

/// A power, or the encoding of sRGB.
Curve curveOf(cmsContext context, std::optional<double> exponent) {
  constexpr int power_with_line = 4;
  constexpr std::array<double, 5> srgb{2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
  return Curve(exponent ? cmsBuildGamma(context, *exponent)
                        : cmsBuildParametricToneCurve(context, power_with_line, srgb.data()));
}

}  // namespace

CmsContext quietContext() {
  CmsContext context(cmsCreateContext(nullptr, nullptr));
  if (context)
    cmsSetLogErrorHandlerTHR(context.get(), [](cmsContext, cmsUInt32Number, const char*) {});
  return context;
}

CmsProfile rgbProfile(cmsContext context, const ColourSpace::Chromaticities& chromaticities,
                      std::optional<double> exponent) {
  for (const auto& [x, y] : chromaticities) {
    if (!(std::abs(x) <= 2 && y > 1e-4 && y <= 2)) return nullptr;
  }
  const auto position = [&](std::size_t i) {
    return cmsCIExyY{chromaticities[i][0], chromaticities[i][1], 1};
  };
  const cmsCIExyY white = position(3);
  const cmsCIExyYTRIPLE primaries{position(0), position(1), position(2)};
  const Curve curve = curveOf(context, exponent);
  if (!curve) return nullptr;
  const std::array<cmsToneCurve*, 3> curves{curve.get(), curve.get(), curve.get()};
  return CmsProfile(cmsCreateRGBProfileTHR(context, &white, &primaries, curves.data()));
}

}  // namespace vdbdither
