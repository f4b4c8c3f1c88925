#pragma once

#include <functional>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Taubin's smoothing (Taubin: "A Signal Processing Approach to Fair Surface Design", 1995): every
/// iteration moves each vertex by λ, then by μ of the way to the mean of its neighbours, all at
/// once. The same as MeshLab's filter.
struct Taubin {
  double lambda = 0.5;
  double mu = -0.53;
  int iterations = 160;
};

/// Smooths a closed mesh whose sides are each met by exactly one other in the opposite direction.
/// The same bits for any number of threads. `progress` is told how far it is, 0 … 1.
void smooth(Mesh& mesh, const Taubin& taubin, const std::function<void(double)>& progress = {});

}  // namespace vdbdither
