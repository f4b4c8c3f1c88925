#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "ops/kernels/colour/surface_colours.h"
#include "ops/kernels/mesh/derived_mesh.h"

namespace vdbdither {

/// The colours of a mesh that was made from coloured triangles.
///
/// A triangle has the colours of its source. Triangles without one, as in filled holes, have the
/// colours of the vertices that they share with others; between them and at their other vertices
/// these are mixed.
class SolidColours {
 public:
  /// `solid` in mm; its sources are triangles of `surface`.
  SolidColours(std::shared_ptr<const SurfaceColours> surface, const DerivedMesh& solid);

  /// Returns linear red, green, blue and the opacity of the point of a triangle of `solid` nearest
  /// to `p_mm`.
  [[nodiscard]] openvdb::Vec4f at(std::uint32_t triangle, const openvdb::Vec3d& p_mm) const;

  [[nodiscard]] double memoryBytes() const;

 private:
  /// A triangle without a source.
  struct Filling {
    std::uint32_t triangle;
    std::array<openvdb::Vec3d, 3> corners_mm;
    std::array<openvdb::Vec4f, 3> colours;
  };

  void colourFillings(const DerivedMesh& solid);

  std::shared_ptr<const SurfaceColours> surface_;
  std::vector<std::uint32_t> source_;
  std::vector<Filling> fillings_;  ///< in the order of the triangles
};

}  // namespace vdbdither
