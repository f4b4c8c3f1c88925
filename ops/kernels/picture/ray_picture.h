#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// From where a mesh is looked at. The picture lies in the plane through `target` that the line of
/// sight meets at a right angle; `left` and `top` count its pixels from `target`, rightwards and
/// upwards.
struct Camera {
  openvdb::Vec3d target{0, 0, 0};  ///< mm
  double azimuth_degrees = 0;      ///< 0 looks from the front, along +y; 90 from the right
  double elevation_degrees = 0;    ///< 90 looks from above
  double distance_mm = 0;          ///< from the eye to `target`; 0: infinite, orthographic
  double pixel_mm = 1;
  int left = 0, top = 0;
  int width = 0, height = 0;

  /// To the right, up, and towards the eye.
  [[nodiscard]] std::array<openvdb::Vec3d, 3> axes() const;
};

/// Places the picture so that all of `mesh` is in it, with `margin` pixels around: its centre
/// becomes the target, and `left`, `top`, `width` and `height` are set. Throws DataError where the
/// mesh reaches the eye, or the picture would be larger than 16384 pixels.
void frame(Camera& camera, const Mesh& mesh, int margin);

/// The lights that a picture can be made with. A horizontal, open place of the object gets the same
/// irradiance from each.
enum class Look {
  area,      ///< a lamp of 30 cm, 1 m above, and a quarter of `sky`
  large,     ///< a light of 2 m, 1 m above
  sky,       ///< a dome, alike from everywhere above the horizon
  staircase  ///< a lamp of 10 cm, 1 m away and 10 degrees high, from the left, and some `sky`
};

/// What a camera gets.
struct RayPicture {
  int width = 0, height = 0;
  /// Linear; of what the object covers of a pixel. A perfectly white horizontal place has 1.
  std::vector<float> light;
  std::vector<float> cover;  ///< the share of a pixel that the object covers
};

/// A mesh, ready for rays (Embree). White, matt (Lambert), facets as they are; direct light only.
class RayScene {
 public:
  /// `mesh` in mm. Throws DataError where Embree refuses.
  explicit RayScene(const Mesh& mesh);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// The picture. Depends on the mesh, the camera, the look and `samples` alone: every pixel has a
  /// pattern of its own, an Owen-scrambled Sobol sequence (Burley: "Practical Hash-based Owen
  /// Scrambling", 2020), scrambled by its place and `seed`; and where a ray meets an edge, the
  /// triangle of the least number counts.
  [[nodiscard]] RayPicture picture(const Camera& camera, Look look, int samples, std::uint32_t seed,
                                   const std::function<void(double)>& progress) const;

 private:
  struct Rays;
  std::unique_ptr<Rays> rays_;
};

}  // namespace vdbdither
