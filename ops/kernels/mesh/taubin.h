#pragma once

#include <functional>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Taubin's smoothing (1995): each iteration moves all vertices by λ, then by μ of the way to the
/// mean of their neighbours. The same as MeshLab's filter.
struct Taubin {
  double lambda = 0.5;
  double mu = -0.53;
  int iterations = 160;
};

/// Smooths a closed mesh, each side of which must be met by exactly one other in the opposite
/// direction. The result is the same for any number of threads. `progress` receives fractions, 0 …
/// 1.
void smooth(Mesh& mesh, const Taubin& taubin, const std::function<void(double)>& progress = {});

}  // namespace vdbdither
