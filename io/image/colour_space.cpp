// ICC profiles: ICC.1 (ISO 15076-1), through LittleCMS.

#include "io/image/colour_space.h"

#include <algorithm>
#include <cmath>

#include "io/image/colour_management.h"

namespace vdbdither {

namespace {

/// Profiles of presses have up to some MB.
constexpr std::size_t most_profile_bytes = std::size_t{1} << 24;

CmsProfile profileOf(cmsContext context, const ColourSpace& space) {
  if (!space.icc_profile.empty()) {
    if (space.icc_profile.size() > most_profile_bytes) return nullptr;
    return CmsProfile(cmsOpenProfileFromMemTHR(
        context, space.icc_profile.data(), static_cast<cmsUInt32Number>(space.icc_profile.size())));
  }
  if (!space.chromaticities) return nullptr;
  return rgbProfile(context, *space.chromaticities, space.exponent);
}

}  // namespace

/// LittleCMS with a context of its own.
class ColourTransform::Engine {
 public:
  /// A broken profile leaves no transform.
  Engine(const ColourSpace& space, std::size_t channels) : context_(quietContext()) {
    if (!context_) return;
    const CmsProfile from = profileOf(context_.get(), space);
    const CmsProfile to = rgbProfile(context_.get(), rec709, 1);
    if (!from || !to) return;
    // A number, since a profile may hold one that is none of the enumeration's.
    const auto kind = static_cast<cmsUInt32Number>(cmsGetColorSpace(from.get()));
    cmsUInt32Number format = 0;
    if (kind == cmsSigGrayData && channels == 1) {
      channels_ = 1;
      format = TYPE_GRAY_FLT;
    } else if (kind == cmsSigRgbData && channels != 4) {
      channels_ = 3;
      format = TYPE_RGB_FLT;
    } else if (kind == cmsSigCmykData && channels == 4) {
      channels_ = 4;
      format = TYPE_CMYK_FLT;
    } else {
      return;
    }
    transform_.reset(cmsCreateTransformTHR(context_.get(), from.get(), format, to.get(),
                                           TYPE_RGB_FLT, INTENT_RELATIVE_COLORIMETRIC,
                                           cmsFLAGS_NOCACHE | cmsFLAGS_NOOPTIMIZE));
  }

  [[nodiscard]] bool isReady() const { return transform_ != nullptr; }
  [[nodiscard]] std::size_t channels() const { return channels_; }

  /// The light of one colour.
  [[nodiscard]] Linear at(std::array<float, 4> samples) const {
    constexpr float ink_unit = 100;
    for (std::size_t i = 0; channels_ == 4 && i < 4; ++i) samples[i] *= ink_unit;
    Linear linear{};
    cmsDoTransform(transform_.get(), samples.data(), linear.data(), 1);
    for (float& value : linear) {
      if (!std::isfinite(value)) value = 0;
    }
    return linear;
  }

 private:
  CmsContext context_;
  CmsTransform transform_;
  std::size_t channels_ = 0;
};

namespace {

constexpr std::size_t curve_steps = 4096;

struct Place {
  std::size_t step;
  float rest;
};

/// Where a sample lies on a scale of `steps` steps.
Place placeOf(double sample, std::size_t steps) {
  const double scaled = sample * static_cast<double>(steps);
  const auto step = std::min(static_cast<std::size_t>(scaled), steps - 1);
  return {step, static_cast<float>(scaled - static_cast<double>(step))};
}

}  // namespace

std::unique_ptr<ColourTransform> ColourTransform::make(const ColourSpace& space, int channels) {
  if (space.icc_profile.empty() && (!space.chromaticities || channels == 4)) return nullptr;
  const Engine engine(space, static_cast<std::size_t>(channels));
  if (!engine.isReady()) return nullptr;
  std::unique_ptr<ColourTransform> transform(new ColourTransform(engine.channels()));
  if (!transform->sampleCurves(engine)) transform->sampleGrid(engine);
  return transform;
}

bool ColourTransform::sampleCurves(const Engine& engine) {
  if (channels_ == 4) return false;
  const Linear black = engine.at({});
  for (std::size_t channel = 0; channel < channels_; ++channel) {
    for (std::size_t i = 0; i <= curve_steps; ++i) {
      std::array<float, 4> samples{};
      samples[channel] = static_cast<float>(i) / curve_steps;
      Linear linear = engine.at(samples);
      // The sum of the curves has black once.
      for (std::size_t c = 0; channel > 0 && c < 3; ++c) linear[c] -= black[c];
      curves_.push_back(linear);
    }
  }
  constexpr float most_error = 1e-5F;
  for (int probe = 0; channels_ == 3 && probe < 125; ++probe) {
    const std::array<int, 3> steps{probe % 5, probe / 5 % 5, probe / 25};
    const std::array<double, 3> samples{steps[0] / 4.0, steps[1] / 4.0, steps[2] / 4.0};
    const Linear exact = engine.at({static_cast<float>(samples[0]), static_cast<float>(samples[1]),
                                    static_cast<float>(samples[2])});
    const Linear sum = sumOfCurves(samples.data());
    for (std::size_t c = 0; c < 3; ++c) {
      if (std::abs(exact[c] - sum[c]) > most_error) return false;
    }
  }
  return true;
}

void ColourTransform::sampleGrid(const Engine& engine) {
  curves_.clear();
  edge_ = channels_ == 4 ? 23 : 65;
  std::size_t count = 1;
  for (std::size_t i = 0; i < channels_; ++i) count *= edge_;
  grid_.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::array<float, 4> samples{};
    std::size_t rest = i;
    for (std::size_t channel = 0; channel < channels_; ++channel, rest /= edge_)
      samples[channel] = static_cast<float>(rest % edge_) / static_cast<float>(edge_ - 1);
    grid_.push_back(engine.at(samples));
  }
}

ColourTransform::Linear ColourTransform::sumOfCurves(const double* samples) const {
  Linear sum{};
  for (std::size_t channel = 0; channel < channels_; ++channel) {
    const Place place = placeOf(samples[channel], curve_steps);
    const Linear* at = &curves_[channel * (curve_steps + 1) + place.step];
    for (std::size_t c = 0; c < 3; ++c) sum[c] += at[0][c] + (at[1][c] - at[0][c]) * place.rest;
  }
  return sum;
}

ColourTransform::Linear ColourTransform::interpolated(const double* samples) const {
  std::array<Place, 4> places{};
  for (std::size_t i = 0; i < channels_; ++i) places[i] = placeOf(samples[i], edge_ - 1);
  Linear sum{};
  for (std::size_t corner = 0; corner < std::size_t{1} << channels_; ++corner) {
    float weight = 1;
    std::size_t at = 0;
    std::size_t stride = 1;
    for (std::size_t i = 0; i < channels_; ++i, stride *= edge_) {
      const std::size_t upper = corner >> i & 1;
      weight *= upper == 1 ? places[i].rest : 1 - places[i].rest;
      at += (places[i].step + upper) * stride;
    }
    for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * grid_[at][c];
  }
  return sum;
}

}  // namespace vdbdither
