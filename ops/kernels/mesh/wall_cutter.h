#pragma once

#include <optional>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/mesh/line_winding.h"

namespace vdbdither {

/// Points nearer to a plane than this are in it: far above rounding, far below a voxel.
inline constexpr double in_plane_mm = 1e-7;

struct WallPlane {
  openvdb::Vec3d normal;  ///< unit, or zero for a triangle without area
  double offset = 0;

  [[nodiscard]] double at(const openvdb::Vec3d& p) const { return normal.dot(p) - offset; }
};

/// A convex polygon.
using WallPiece = std::vector<openvdb::Vec3d>;

/// A segment in the plane of a wall, on which another triangle meets it.
struct WallCut {
  openvdb::Vec3d from, to;
  WallPlane plane;  ///< that the segment lies in; cuts the wall there
  /// Whether the winding number in front of the wall changes there, and behind it: it is less by
  /// one above `plane`.
  bool in_front = false, behind = false;
  std::uint32_t body = 0;  ///< of the other triangle
};

/// Cuts a triangle where others meet it, into pieces that are surface of the solid or not. The
/// solid is where the winding number is not zero.
class WallCutter {
 public:
  /// How much of a wall is surface.
  enum class Surface { none, some, all };

  /// `lowest` are the lowest numbers of the bodies; `normal` is the unit normal of the triangle;
  /// `is_opposed` tells whether triangles in its plane may face the other way. `winding` and
  /// `lowest` must outlive the cutter.
  WallCutter(const LineWinding& winding, const std::vector<int>& lowest,
             const openvdb::Vec3d& normal, bool is_opposed)
      : winding_(winding), lowest_(lowest), normal_(normal), is_opposed_(is_opposed) {}

  /// Whether a place on the triangle is surface.
  [[nodiscard]] bool isSurface(const openvdb::Vec3d& p) const;

  /// Adds the pieces of `wall` that are surface: the wall itself if all of it is. `cuts` are all
  /// segments that may lie in it. Throws Interrupted.
  Surface cut(const WallPiece& wall, std::vector<WallCut> cuts,
              std::vector<WallPiece>& pieces) const;

 private:
  /// What is known of the winding numbers beside a part of the wall.
  struct Numbers {
    LineWinding::Sides settled;       ///< the sum of those that are the same all over the part
    LineWinding::Sides here;          ///< the sum of all at its middle
    std::vector<std::uint32_t> open;  ///< the bodies of the others, in rising order
    bool is_front_enough = false;     ///< whether the part is surface where there is none in front
  };

  Surface divide(const WallPiece& wall, std::vector<WallCut> cuts, Numbers numbers,
                 std::vector<WallPiece>& pieces) const;
  [[nodiscard]] std::optional<Surface> judge(const openvdb::Vec3d& middle,
                                             std::vector<WallCut>& cuts, Numbers& numbers) const;
  static Surface surfaceBy(const Numbers& numbers);

  const LineWinding& winding_;
  const std::vector<int>& lowest_;
  openvdb::Vec3d normal_;
  bool is_opposed_;
};

/// Returns the mean of the corners.
openvdb::Vec3d middleOf(const WallPiece& piece);

}  // namespace vdbdither
