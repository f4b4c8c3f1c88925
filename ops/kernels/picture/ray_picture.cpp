// Burley: "Practical Hash-based Owen Scrambling", Journal of Computer Graphics Techniques 9(4),
// 2020.

#include "ops/kernels/picture/ray_picture.h"

#include <algorithm>
#include <cmath>
#include <embree3/rtcore.h>
#include <limits>
#include <new>
#include <numbers>
#include <optional>
#include <string>

#include <tbb/parallel_for.h>

#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/mesh_placement.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

using openvdb::Vec3d;

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

std::uint32_t hashed(std::uint32_t x) {
  // The finalizer of MurmurHash3.
  x = (x ^ x >> 16) * 0x85ebca6bU;
  x = (x ^ x >> 13) * 0xc2b2ae35U;
  return x ^ x >> 16;
}

std::uint32_t reversed(std::uint32_t x) {
  x = (x & 0x55555555U) << 1 | (x >> 1 & 0x55555555U);
  x = (x & 0x33333333U) << 2 | (x >> 2 & 0x33333333U);
  x = (x & 0x0f0f0f0fU) << 4 | (x >> 4 & 0x0f0f0f0fU);
  x = (x & 0x00ff00ffU) << 8 | (x >> 8 & 0x00ff00ffU);
  return x << 16 | x >> 16;
}

/// Burley 2020, section 3.
std::uint32_t scrambled(std::uint32_t x, std::uint32_t seed) {
  x = reversed(x) + seed;
  x ^= x * 0x6c50b47cU;
  x ^= x * 0xb82f1e52U;
  x ^= x * 0xc7afe638U;
  x ^= x * 0x8d22f6e6U;
  return reversed(x);
}

/// Returns point `index` of the first two dimensions of the Sobol sequence, shuffled and scrambled:
/// two numbers in [0, 1).
std::array<double, 2> patternPoint(std::uint32_t index, std::uint32_t seed) {
  index = scrambled(index, seed);
  std::uint32_t second = 0;
  std::uint32_t direction = 0x80000000U;
  for (std::uint32_t rest = index; rest != 0; rest >>= 1) {
    if (rest & 1) second ^= direction;
    direction ^= direction >> 1;
  }
  constexpr double scale = 1.0 / 4294967296.0;
  return {scrambled(reversed(index), hashed(seed ^ 0x9e3779b9U)) * scale,
          scrambled(second, hashed(seed ^ 0x7f4a7c15U)) * scale};
}

/// A square lamp that shines to one side.
struct Lamp {
  Vec3d centre;
  Vec3d facing;         ///< unit
  Vec3d across, along;  ///< sides, mm
  double radiance = 0;  ///< scaled to the irradiance at the target

  [[nodiscard]] Vec3d at(const std::array<double, 2>& place) const {
    return centre + (place[0] - 0.5) * across + (place[1] - 0.5) * along;
  }

  /// Returns the irradiance of an unobstructed surface at `p` if all of the lamp were at `place`.
  [[nodiscard]] double given(const Vec3d& place, const Vec3d& p, const Vec3d& normal) const {
    const Vec3d way = place - p;
    const double distance_2 = way.lengthSqr();
    const double leaving = -facing.dot(way);
    const double coming = normal.dot(way);
    if (leaving <= 0 || coming <= 0) return 0;
    return radiance * leaving * coming / (distance_2 * distance_2) * across.length() *
           along.length();
  }
};

struct Lighting {
  std::optional<Lamp> lamp;
  double lamp_share = 0;  ///< of the irradiance of an unobstructed horizontal surface
  double sky_share = 0;
};

/// Returns a lamp scaled so that a horizontal surface at the target gets 1.
Lamp lampFrom(const Vec3d& target, double azimuth_degrees, double elevation_degrees, double side_mm,
              double distance_mm) {
  const double azimuth = radians(azimuth_degrees);
  const double elevation = radians(elevation_degrees);
  const Vec3d way(std::cos(elevation) * std::sin(azimuth), -std::cos(elevation) * std::cos(azimuth),
                  std::sin(elevation));
  const Vec3d across(std::cos(azimuth), std::sin(azimuth), 0);
  Lamp lamp{target + distance_mm * way, -way, side_mm * across, side_mm * way.cross(across), 1};
  constexpr int steps = 64;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    for (int j = 0; j < steps; ++j)
      sum += lamp.given(lamp.at({(i + 0.5) / steps, (j + 0.5) / steps}), target, Vec3d(0, 0, 1));
  }
  lamp.radiance = steps * steps / sum;
  return lamp;
}

Lighting lightingOf(Look look, const Camera& camera) {
  switch (look) {
    case Look::area:
      return {lampFrom(camera.target, camera.azimuth_degrees, 90, 300, 1000), 0.75, 0.25};
    case Look::large:
      return {lampFrom(camera.target, camera.azimuth_degrees, 90, 2000, 1000), 1, 0};
    case Look::sky:
      return {std::nullopt, 0, 1};
    case Look::staircase:
      return {lampFrom(camera.target, camera.azimuth_degrees - 90, 10, 100, 1000), 0.85, 0.15};
  }
  return {};
}

/// Returns a direction about `normal`, with a density proportional to its cosine.
Vec3d matt(const Vec3d& normal, const std::array<double, 2>& at) {
  const double angle = 2 * std::numbers::pi * at[0];
  const double radius = std::sqrt(at[1]);
  // One axis is horizontal, so that the horizon cuts the pattern similarly for similar normals.
  Vec3d first(-normal.y(), normal.x(), 0);
  if (!first.normalize(1e-12)) first = Vec3d(1, 0, 0);
  const Vec3d second = normal.cross(first);
  return radius * std::cos(angle) * first + radius * std::sin(angle) * second +
         std::sqrt(std::max(0.0, 1 - at[1])) * normal;
}

/// Keeps the nearest of all hits, and of equally near ones the lowest triangle.
struct NearestContext {
  RTCIntersectContext context;
  float distance;
  std::uint32_t triangle;
};

void keepNearest(const RTCFilterFunctionNArguments* arguments) {
  auto* best = reinterpret_cast<NearestContext*>(arguments->context);
  const float distance = RTCRayN_tfar(arguments->ray, arguments->N, 0);
  const std::uint32_t triangle = RTCHitN_primID(arguments->hit, arguments->N, 0);
  if (distance < best->distance || (distance == best->distance && triangle < best->triangle)) {
    best->distance = distance;
    best->triangle = triangle;
  }
  arguments->valid[0] = 0;
}

RTCRay rayFrom(const Vec3d& origin, const Vec3d& direction, float near, float far) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = near;
  ray.tfar = far;
  ray.mask = ~0U;
  return ray;
}

}  // namespace

std::array<Vec3d, 3> Camera::axes() const {
  const double azimuth = radians(azimuth_degrees);
  const double elevation = radians(elevation_degrees);
  const Vec3d right(std::cos(azimuth), std::sin(azimuth), 0);
  const Vec3d towards(std::cos(elevation) * std::sin(azimuth),
                      -std::cos(elevation) * std::cos(azimuth), std::sin(elevation));
  return {right, towards.cross(right), towards};
}

void fit(Camera& camera, const Mesh& mesh, int margin) {
  const MeshBounds bounds = boundsOf(mesh);
  camera.target = 0.5 * (bounds.min + bounds.max);
  const auto [right, up, towards] = camera.axes();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  double low_x = infinity, low_y = infinity, high_x = -infinity, high_y = -infinity;
  for (const Vec3d& vertex : mesh.vertices) {
    const Vec3d at = vertex - camera.target;
    double scale = 1;
    if (camera.distance_mm > 0) {
      const double depth = camera.distance_mm - towards.dot(at);
      if (!(depth > 0.01 * camera.distance_mm)) {
        throw DataError("the mesh reaches the eye, " +
                        std::to_string(static_cast<int>(camera.distance_mm)) +
                        " mm from its centre; look from further away");
      }
      scale = camera.distance_mm / depth;
    }
    const double x = scale * right.dot(at) / camera.pixel_mm;
    const double y = scale * up.dot(at) / camera.pixel_mm;
    low_x = std::min(low_x, x);
    high_x = std::max(high_x, x);
    low_y = std::min(low_y, y);
    high_y = std::max(high_y, y);
  }
  constexpr double maximum = 16384;
  const double columns = std::ceil(high_x) - std::floor(low_x) + 2.0 * margin;
  const double rows = std::ceil(high_y) - std::floor(low_y) + 2.0 * margin;
  if (!(columns <= maximum && rows <= maximum))
    throw DataError("the picture would have more than 16384 pixels on a side; take larger ones");
  camera.left = static_cast<int>(std::floor(low_x)) - margin;
  camera.top = static_cast<int>(std::ceil(high_y)) + margin;
  camera.width = static_cast<int>(columns);
  camera.height = static_cast<int>(rows);
}

struct RayScene::Rays {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Vec3d centre;          ///< of the mesh, the origin of the scene
  double radius_mm = 0;  ///< of a sphere around the mesh
  const float* vertices = nullptr;
  const std::uint32_t* triangles = nullptr;

  Rays() = default;
  Rays(const Rays&) = delete;
  Rays& operator=(const Rays&) = delete;
  ~Rays() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }

  [[nodiscard]] Vec3d corner(std::uint32_t triangle, int which) const {
    const float* at = vertices + std::size_t{3} * triangles[std::size_t{3} * triangle + which];
    return {at[0], at[1], at[2]};
  }

  /// Returns the triangle that a ray meets first, or nothing. Embree finds the place; but which of
  /// several triangles there it reports depends on how its threads have built the tree, so that all
  /// hits in a thin shell are queried again.
  [[nodiscard]] std::optional<std::uint32_t> met(const Vec3d& origin, const Vec3d& direction,
                                                 float far) const {
    NearestContext context{};
    rtcInitIntersectContext(&context.context);
    RTCRayHit hit{};
    hit.ray = rayFrom(origin, direction, 0, far);
    hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context.context, &hit);
    if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
    constexpr float shell = 1e-6F;
    context.distance = std::numeric_limits<float>::infinity();
    context.triangle = hit.hit.primID;
    context.context.filter = keepNearest;
    RTCRayHit again{};
    again.ray = rayFrom(origin, direction, hit.ray.tfar * (1 - shell), hit.ray.tfar * (1 + shell));
    again.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context.context, &again);
    return context.triangle;
  }

  [[nodiscard]] bool isDark(const Vec3d& origin, const Vec3d& direction, float far) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay ray = rayFrom(origin, direction, 0, far);
    rtcOccluded1(scene, &context, &ray);
    return ray.tfar < 0;
  }
};

RayScene::RayScene(const Mesh& mesh) : rays_(std::make_unique<Rays>()) {
  const MeshBounds bounds = boundsOf(mesh);
  rays_->centre = 0.5 * (bounds.min + bounds.max);
  rays_->radius_mm = 0.5 * (bounds.max - bounds.min).length();
  rays_->device = rtcNewDevice(nullptr);
  const auto check = [&] {
    const RTCError error = rtcGetDeviceError(rays_->device);
    if (error == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    if (error != RTC_ERROR_NONE)
      throw DataError("the mesh cannot be prepared for rays: Embree's error " +
                      std::to_string(static_cast<int>(error)));
  };
  check();
  rays_->scene = rtcNewScene(rays_->device);
  rtcSetSceneFlags(
      rays_->scene,
      static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  RTCGeometry geometry = rtcNewGeometry(rays_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                               mesh.vertices.size()));
  auto* triangles = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), mesh.triangles.size()));
  check();
  for (const Vec3d& vertex : mesh.vertices) {
    const Vec3d at = vertex - rays_->centre;
    for (int axis = 0; axis < 3; ++axis) *vertices++ = static_cast<float>(at[axis]);
  }
  for (const Mesh::Triangle& triangle : mesh.triangles)
    triangles = std::copy(triangle.begin(), triangle.end(), triangles);
  rays_->vertices = vertices - 3 * mesh.vertices.size();
  rays_->triangles = triangles - 3 * mesh.triangles.size();
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(rays_->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(rays_->scene);
  check();
}

RayScene::~RayScene() = default;

/// Draws pixels of one picture. All positions are in the scene's own coordinates.
class RayScene::Painter {
 public:
  Painter(const Rays& rays, const Camera& camera, Look look, const SurfaceTint& tint)
      : rays_(rays),
        tint_(tint),
        camera_(camera),
        lighting_(lightingOf(look, camera)),
        target_(camera.target - rays.centre),
        axes_(camera.axes()),
        radius_(1.001 * rays.radius_mm) {
    if (lighting_.lamp) lighting_.lamp->centre -= rays.centre;
  }

  struct Pixel {
    Vec3d light{0, 0, 0};  ///< the sum over the samples that meet the mesh
    int covered = 0;       ///< their number
  };
  [[nodiscard]] Pixel pixel(int column, int row, int samples, std::uint32_t seed) const;

 private:
  struct Ray {
    Vec3d origin, direction;
  };

  [[nodiscard]] std::optional<Ray> rayThrough(int column, double dx, int row, double dy) const;
  [[nodiscard]] double lightAt(const Vec3d& p, const Vec3d& normal, std::uint32_t sample,
                               std::uint32_t pattern) const;

  const Rays& rays_;
  const SurfaceTint& tint_;
  const Camera& camera_;
  Lighting lighting_;
  Vec3d target_;
  std::array<Vec3d, 3> axes_;
  double radius_;
};

/// Returns the light at a point of the surface, from one sample of the lamp and one of the sky.
double RayScene::Painter::lightAt(const Vec3d& p, const Vec3d& normal, std::uint32_t sample,
                                  std::uint32_t pattern) const {
  double light = 0;
  if (const std::optional<Lamp>& lamp = lighting_.lamp) {
    const Vec3d place = lamp->at(patternPoint(sample, hashed(pattern + 1)));
    const double given = lamp->given(place, p, normal);
    const Vec3d way = place - p;
    const double distance = way.length();
    if (given > 0 &&
        !rays_.isDark(p, way / distance, static_cast<float>(std::min(distance, 4 * radius_))))
      light += lighting_.lamp_share * given;
  }
  if (lighting_.sky_share > 0) {
    const Vec3d way = matt(normal, patternPoint(sample, hashed(pattern + 2)));
    if (way.z() > 0 && !rays_.isDark(p, way, static_cast<float>(4 * radius_)))
      light += lighting_.sky_share;
  }
  return light;
}

/// Returns the ray through a place of the picture, or nothing if it misses the sphere around the
/// mesh. It begins where it enters the sphere, so that coordinates are small.
std::optional<RayScene::Painter::Ray> RayScene::Painter::rayThrough(int column, double dx, int row,
                                                                    double dy) const {
  const auto& [right, up, towards] = axes_;
  const Vec3d on_plane = target_ + (camera_.left + column + dx) * camera_.pixel_mm * right +
                         (camera_.top - row - dy) * camera_.pixel_mm * up;
  const Vec3d direction = camera_.distance_mm > 0
                              ? (on_plane - (target_ + camera_.distance_mm * towards)).unit()
                              : Vec3d(-towards);
  const double middle = -on_plane.dot(direction);
  const double inside = radius_ * radius_ - (on_plane + middle * direction).lengthSqr();
  if (inside <= 0) return std::nullopt;
  double begin = middle - std::sqrt(inside);
  if (camera_.distance_mm > 0) {
    const double eye = -(on_plane - (target_ + camera_.distance_mm * towards)).length();
    begin = std::max(begin, eye);
  }
  return Ray{on_plane + begin * direction, direction};
}

RayScene::Painter::Pixel RayScene::Painter::pixel(int column, int row, int samples,
                                                  std::uint32_t seed) const {
  // Far more than the rounding of a point to float, far less than a voxel.
  const double lift = 2e-6 * radius_;
  const std::uint32_t place = hashed(static_cast<std::uint32_t>(column) +
                                     hashed(static_cast<std::uint32_t>(row) + hashed(seed)));
  Pixel pixel;
  for (int sample = 0; sample < samples; ++sample) {
    const auto index = static_cast<std::uint32_t>(sample);
    const auto [dx, dy] = patternPoint(index, place);
    const std::optional<Ray> ray = rayThrough(column, dx, row, dy);
    if (!ray) continue;
    const auto triangle = rays_.met(ray->origin, ray->direction, static_cast<float>(4 * radius_));
    if (!triangle) continue;
    ++pixel.covered;
    const Vec3d corner = rays_.corner(*triangle, 0);
    Vec3d normal = (rays_.corner(*triangle, 1) - corner).cross(rays_.corner(*triangle, 2) - corner);
    const double facing = normal.dot(ray->direction);
    if (facing == 0) continue;
    const double distance = normal.dot(corner - ray->origin) / facing;
    normal *= (facing > 0 ? -1 : 1) / normal.length();
    const Vec3d at = ray->origin + distance * ray->direction;
    const Vec3d light(lightAt(at + lift * normal, normal, index, place));
    pixel.light += tint_ ? light * Vec3d(tint_(*triangle, at + rays_.centre)) : light;
  }
  return pixel;
}

RayPicture RayScene::picture(const Camera& camera, Look look, int samples, std::uint32_t seed,
                             const std::function<void(double)>& progress,
                             const SurfaceTint& tint) const {
  const std::size_t pixels =
      static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  RayPicture picture{camera.width, camera.height,
                     std::vector<openvdb::Vec3f>(pixels, openvdb::Vec3f(0, 0, 0)),
                     std::vector<float>(pixels)};
  const Painter painter(*rays_, camera, look, tint);
  constexpr int rows_at_once = 16;
  for (int begin = 0; begin < camera.height; begin += rows_at_once) {
    progress(static_cast<double>(begin) / camera.height);
    tbb::parallel_for(begin, std::min(begin + rows_at_once, camera.height), [&](int row) {
      for (int column = 0; column < camera.width; ++column) {
        const auto [light, covered] = painter.pixel(column, row, samples, seed);
        const std::size_t at = static_cast<std::size_t>(row) * camera.width + column;
        picture.cover[at] = static_cast<float>(covered) / static_cast<float>(samples);
        if (covered > 0) picture.light[at] = openvdb::Vec3f(light / covered);
      }
    });
  }
  return picture;
}

}  // namespace vdbdither
