#pragma once

#include <array>

#include "ops/kernels/picture/channel.h"

namespace vdbdither {

/// Returns the structural similarity of two pictures at every pixel, 1 where they are equal (Wang
/// et al. 2004): a Gaussian window of 11 x 11 pixels, sigma 1.5, K1 = 0.01, K2 = 0.03, biased
/// covariance. Pictures are mirrored at their edges. The values of `a` and `b` are 0 to 1; they
/// must have the same size.
Channel structuralSimilarity(const Channel& a, const Channel& b);

/// Returns a picture as the eye perceives it: every frequency is multiplied by the contrast
/// sensitivity of Mannos and Sakrison (1974), A(f) = 2.6 (0.0192 + 0.114 f) exp(-(0.114 f)^1.1)
/// with f in cycles per degree, divided by its maximum. Frequencies below the most visible one are
/// kept unchanged, and so are means.
Channel seenByTheEye(const Channel& picture, double pixels_per_degree);

/// Returns the factor of a frequency in seenByTheEye, 0 … 1.
double contrastSensitivity(double cycles_per_degree);

/// Red, green and blue as in a file: sRGB-encoded, 0 to 1.
using ColourChannels = std::array<Channel, 3>;

/// Returns the visible difference between two alternating pictures at every pixel, 0 to 1: LDR-FLIP
/// (Andersson et al. 2020), as NVIDIA's published program computes it.
Channel flipDifference(const ColourChannels& reference, const ColourChannels& test,
                       double pixels_per_degree);

}  // namespace vdbdither
