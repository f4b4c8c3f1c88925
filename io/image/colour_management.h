#pragma once

#include <lcms2.h>
#include <memory>
#include <optional>

#include "io/image/colour_space.h"

namespace vdbdither {

// Handles of LittleCMS, which end with their owner. A context outlives what was made in it.

template <auto destroy>
struct CmsDeleter {
  template <typename T>
  void operator()(T* handle) const {
    destroy(handle);
  }
};
using CmsContext = std::unique_ptr<_cmsContext_struct, CmsDeleter<cmsDeleteContext>>;
using CmsProfile = std::unique_ptr<void, CmsDeleter<cmsCloseProfile>>;
using CmsTransform = std::unique_ptr<void, CmsDeleter<cmsDeleteTransform>>;

/// The primaries and the white of Rec. 709.
inline constexpr ColourSpace::Chromaticities rec709{
    {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}}};

/// Returns a context that prints nothing; null if there is no memory for it.
CmsContext quietContext();

/// Returns the profile of these primaries and this white; null if they are none. `exponent` is that
/// of ColourSpace, or nothing for the encoding of sRGB.
CmsProfile rgbProfile(cmsContext context, const ColourSpace::Chromaticities& chromaticities,
                      std::optional<double> exponent);

}  // namespace vdbdither
