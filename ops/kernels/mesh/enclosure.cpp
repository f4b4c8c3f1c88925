#include "ops/kernels/mesh/enclosure.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/mesh/mesh_edges.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/winding_number.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

std::string counted(std::size_t count, const char* what) {
  return std::to_string(count) + ' ' + what + (count == 1 ? "" : "s");
}

/// Points of triangles, evenly by area. The same for the same mesh.
class SurfacePoints {
 public:
  explicit SurfacePoints(const Mesh& mesh) : mesh_(mesh) {
    double sum_mm2 = 0;
    for (const Mesh::Triangle& t : mesh.triangles) {
      const Vec3d& a = mesh.vertices[t[0]];
      sum_mm2 += (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).length();
      sums_mm2_.push_back(sum_mm2);
    }
  }

  Vec3d next() {
    const double at_mm2 = fraction() * sums_mm2_.back();
    const auto found = std::lower_bound(sums_mm2_.begin(), sums_mm2_.end() - 1, at_mm2);
    const Mesh::Triangle& t = mesh_.triangles[static_cast<std::size_t>(found - sums_mm2_.begin())];
    double u = fraction();
    double v = fraction();
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const Vec3d& a = mesh_.vertices[t[0]];
    return a + u * (mesh_.vertices[t[1]] - a) + v * (mesh_.vertices[t[2]] - a);
  }

  /// A number from 0 to 1; the distributions of the library differ between compilers.
  double fraction() { return static_cast<double>(random_()) / 0x1p32; }

 private:
  const Mesh& mesh_;
  std::vector<double> sums_mm2_;
  std::mt19937 random_{1};  // NOLINT(cert-msc51-cpp): the same points in every run
};

/// Whether two triangles on a side go along it in the same direction.
bool hasSeam(const Mesh& mesh) {
  const MeshEdges edges(mesh);
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    const auto halves = edges.halves(e);
    if (halves.size() == 2 && mesh.triangles[halves[0] / 3][halves[0] % 3] ==
                                  mesh.triangles[halves[1] / 3][halves[1] % 3])
      return true;
  }
  return false;
}

/// The share of `given` in the winding number of `mesh`, on average over points inside, which lie
/// between points of the surface. Where hardly any point is inside, 1 or, without a volume, 0.
double shareOf(const Mesh& given, const Mesh& mesh) {
  constexpr int maximum_tries = 20'000;
  constexpr int wanted = 500;
  constexpr int minimum = 20;
  const WindingNumber of_given(given);
  const WindingNumber of_all(mesh);
  SurfacePoints surface(given);
  double sum = 0;
  int inside = 0;
  for (int i = 0; i < maximum_tries && inside < wanted; ++i) {
    throwIfInterrupted();
    const Vec3d from = surface.next();
    const Vec3d p = from + surface.fraction() * (surface.next() - from);
    const double all = of_all.at(p);
    if (std::abs(all) < 0.5) continue;
    sum += of_given.at(p) / all;
    ++inside;
  }
  if (inside >= minimum) return sum / inside;
  const double scale_mm = std::sqrt(areaOf(mesh));
  return std::abs(volumeOf(mesh)) > 1e-6 * scale_mm * scale_mm * scale_mm ? 1 : 0;
}

}  // namespace

std::string whyFlat(const Mesh& mesh) {
  const auto count =
      std::count_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const Mesh::Triangle& t) {
        const Vec3d& corner = mesh.vertices[t[0]];
        return !(mesh.vertices[t[1]] - corner).cross(mesh.vertices[t[2]] - corner).isZero();
      });
  if (count < 4)
    return "it has only " + counted(static_cast<std::size_t>(count), "triangle") +
           " with an area, and 4 are needed";
  constexpr double open = 0x1p-22;  // of the largest coordinate
  const auto farthest = [&](const auto& distance) {
    return *std::max_element(
        mesh.vertices.begin(), mesh.vertices.end(),
        [&](const Vec3d& a, const Vec3d& b) { return distance(a) < distance(b); });
  };
  const Vec3d largest = farthest([](const Vec3d& p) { return p.lengthSqr(); });
  const double tolerance = open * largest.length();
  const Vec3d& first = mesh.vertices.front();
  const Vec3d second = farthest([&](const Vec3d& p) { return (p - first).lengthSqr(); });
  if ((second - first).length() <= tolerance) return "all its corners lie in one point";
  const Vec3d along = (second - first).unit();
  const Vec3d third =
      farthest([&](const Vec3d& p) { return (p - first).cross(along).lengthSqr(); });
  const Vec3d across = (third - first).cross(along);
  if (across.length() <= tolerance) return "all its corners lie in one line";
  const Vec3d normal = across.unit();
  const Vec3d fourth = farthest([&](const Vec3d& p) { return std::abs((p - first).dot(normal)); });
  return std::abs((fourth - first).dot(normal)) <= tolerance ? "all its corners lie in one plane"
                                                             : "";
}

std::string Enclosure::text(std::size_t holes) const {
  const auto rounded = [](double mm2) {
    std::array<char, 32> digits{};
    const auto end =
        std::to_chars(digits.begin(), digits.end(), mm2, std::chars_format::general, 3).ptr;
    return std::string(digits.begin(), end) + " mm2";
  };
  return std::string(is_one_sided ? "they are one-sided, as a Moebius strip is, and " : "") +
         counted(holes, "hole") + " would be filled with " + rounded(filling_mm2) + " beside " +
         rounded(given_mm2) + " of surface";
}

Enclosure enclosureOf(const Mesh& mesh, std::size_t fillings) {
  constexpr double small = 0.25;
  Enclosure enclosure;
  if (fillings == 0) return enclosure;
  Mesh part{mesh.vertices,
            {mesh.triangles.end() - static_cast<std::ptrdiff_t>(fillings), mesh.triangles.end()}};
  enclosure.filling_mm2 = areaOf(part);
  part.triangles.assign(mesh.triangles.begin(),
                        mesh.triangles.end() - static_cast<std::ptrdiff_t>(fillings));
  enclosure.given_mm2 = areaOf(part);
  if (enclosure.filling_mm2 < small * enclosure.given_mm2) return enclosure;
  enclosure.is_one_sided = hasSeam(part);
  enclosure.share = shareOf(part, mesh);
  return enclosure;
}

}  // namespace vdbdither
