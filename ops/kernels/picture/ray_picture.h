#pragma once

// The picture family: kernels that draw meshes and compare pictures.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The view of a mesh. The picture lies in the plane through `target` perpendicular to the line of
/// sight; `left` and `top` count its pixels from `target`, rightwards and upwards.
struct Camera {
  openvdb::Vec3d target{0, 0, 0};  ///< mm
  double azimuth_degrees = 0;      ///< 0 looks from the front, along +y; 90 from the right
  double elevation_degrees = 0;    ///< 90 looks from above
  double distance_mm = 0;          ///< from the eye to `target`; 0 for an orthographic view
  double pixel_mm = 1;
  int left = 0, top = 0;
  int width = 0, height = 0;

  /// Returns the directions to the right, up, and towards the eye.
  [[nodiscard]] std::array<openvdb::Vec3d, 3> axes() const;
};

/// Sets the picture so that it holds all of `mesh` with a margin of `margin` pixels: the centre
/// becomes the target, and `left`, `top`, `width` and `height` are set. Throws DataError if the
/// mesh reaches the eye, or if the picture would be larger than 16384 pixels.
void fit(Camera& camera, const Mesh& mesh, int margin);

/// The lights of a picture. An unobstructed horizontal surface gets the same irradiance from each.
enum class Look {
  area,      ///< a lamp of 30 cm, 1 m above, and a quarter of `sky`
  large,     ///< a light of 2 m, 1 m above
  sky,       ///< a uniform dome above the horizon
  staircase  ///< a lamp of 10 cm, 1 m away and 10 degrees high, from the left, and some `sky`
};

/// A rendered picture.
struct RayPicture {
  int width = 0, height = 0;
  /// Linear red, green and blue light of the part of a pixel that the object covers; 1 for a
  /// perfectly white horizontal surface.
  std::vector<openvdb::Vec3f> light;
  std::vector<float> cover;  ///< the share of a pixel that the object covers
};

/// Returns the share of red, green and blue light that a point of a triangle of a mesh gives back.
/// Called by many threads at once.
using SurfaceTint = std::function<openvdb::Vec3f(std::uint32_t triangle, const openvdb::Vec3d& p)>;

/// A mesh prepared for ray tracing (Embree): matt (Lambert), flat facets, direct light only.
class RayScene {
 public:
  /// `mesh` in mm. Throws DataError if Embree fails.
  explicit RayScene(const Mesh& mesh);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// Returns the picture, which depends on the arguments and the mesh alone: every pixel has its
  /// own pattern, an Owen-scrambled Sobol sequence (Burley 2020), scrambled by its place and
  /// `seed`; and of triangles that a ray meets at the same place the one with the lowest index
  /// counts.
  /// @param tint  empty for a white surface
  [[nodiscard]] RayPicture picture(const Camera& camera, Look look, int samples, std::uint32_t seed,
                                   const std::function<void(double)>& progress,
                                   const SurfaceTint& tint = {}) const;

 private:
  struct Rays;
  class Painter;
  std::unique_ptr<Rays> rays_;
};

}  // namespace vdbdither
