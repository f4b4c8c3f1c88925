#pragma once

#include <array>

#include <openvdb/Types.h>

namespace vdbdither {

/// Whether a triangle meets, or nearly meets, the cube that reaches `half` from `middle` along each
/// axis (Akenine-Möller 2001).
bool meetsCube(const std::array<openvdb::Vec3d, 3>& triangle, const openvdb::Vec3d& middle,
               double half);

}  // namespace vdbdither
