#pragma once

#include <functional>
#include <string>
#include <vector>

#include "ops/kernels/dither/error_diffusion.h"
#include "ops/kernels/dither/shape_dither.h"
#include "tests/bench/dither_quality/parts.h"

/// The dithers that are compared.
namespace vdbdither::quality {

struct Method {
  std::string name;
  std::function<Voxels(const Part&, const openvdb::FloatGrid&)> print;
};

Method dithered(const std::string& name, const ThresholdMask& mask, double amplitude, DitherAt at,
                bool guarded = false);

/// Error diffusion.
Method diffused(const std::string& name, bool guarded, double spread_mm = 0.05);

/// The share of the voxel that the part covers, by sub-samples, against the threshold.
Method coverage(const ThresholdMask& mask);

/// Ours, and what the paper's rule takes.
struct Masks {
  ThresholdMask ours;
  ThresholdMask papers;
};

/// The methods of the tables, or every one. The masks must outlive them.
std::vector<Method> methodsFor(const Masks& masks, bool every);

/// Those named `only`; all if it is empty.
std::vector<Method> chosen(std::vector<Method> methods, const std::string& only);

}  // namespace vdbdither::quality
