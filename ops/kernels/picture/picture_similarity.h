#pragma once

#include <array>

#include "ops/kernels/picture/plane.h"

namespace vdbdither {

/// The structural similarity of two pictures at every pixel, 1 where they are alike (Wang, Bovik,
/// Sheikh, Simoncelli: "Image Quality Assessment: From Error Visibility to Structural Similarity",
/// 2004): a Gaussian window of 11 x 11 pixels, sigma 1.5, K1 = 0.01, K2 = 0.03, biased covariance.
/// Beyond its edges a picture is mirrored.
/// @param a, b  values from 0 to 1, of one size
Plane structuralSimilarity(const Plane& a, const Plane& b);

/// What the eye passes on of a picture: every frequency weakened by the contrast sensitivity of
/// Mannos and Sakrison ("The Effects of a Visual Fidelity Criterion on the Encoding of Images",
/// 1974), A(f) = 2.6 (0.0192 + 0.114 f) exp(-(0.114 f)^1.1) with f in cycles per degree, over its
/// greatest value. Frequencies below the most visible one pass whole, so that means are kept.
Plane seenByTheEye(const Plane& picture, double pixels_per_degree);

/// The share of a frequency that seenByTheEye lets pass, 0 ... 1.
double contrastSensitivity(double cycles_per_degree);

/// Red, green and blue as a file holds them: sRGB-coded, 0 to 1.
using ColourPlanes = std::array<Plane, 3>;

/// The difference that shows when two pictures are flipped between, at every pixel, 0 to 1:
/// LDR-FLIP (Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: "FLIP: A Difference
/// Evaluator for Alternating Images", 2020), as NVIDIA's published program computes it.
Plane flipDifference(const ColourPlanes& reference, const ColourPlanes& test,
                     double pixels_per_degree);

}  // namespace vdbdither
