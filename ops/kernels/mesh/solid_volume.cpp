#include "ops/kernels/mesh/solid_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/winding_number.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// Lines along each edge of the box that they fill.
constexpr int lines_per_edge = 1024;

/// Returns the mesh turned so that lines along z are parallel to no face of common directions. How
/// much of the solid a line passes is then continuous from line to line, and the sum converges with
/// the square of their distance.
Mesh turned(const Mesh& mesh) {
  const Vec3d z = Vec3d(0.37, 0.53, 1).unit();
  const Vec3d x = z.cross(Vec3d(0.29, 1, 0.41)).unit();
  const Vec3d y = z.cross(x);
  Mesh made = mesh;
  for (Vec3d& p : made.vertices) p = Vec3d(x.dot(p), y.dot(p), z.dot(p));
  return made;
}

/// A place where a line passes a triangle.
struct Crossing {
  int line;
  double z;
  int step;  ///< of the winding number, upwards

  bool operator<(const Crossing& other) const {
    return line != other.line ? line < other.line : z < other.z;
  }
};

/// Adds the crossings of one row of lines, which lies at `y`, with a triangle. Line i lies at
/// `x0 + i * step`.
void addCrossings(const std::array<Vec3d, 3>& at, double y, double x0, double step,
                  std::vector<Crossing>& crossings) {
  // Where the row enters and leaves the triangle. A side counts at its lower end, not at its upper.
  std::array<double, 2> x;
  std::array<double, 2> z;
  std::array<int, 2> way;
  std::size_t count = 0;
  for (std::size_t side = 0; side < 3 && count < 2; ++side) {
    const Vec3d& a = at[side];
    const Vec3d& b = at[(side + 1) % 3];
    const bool upwards = a.y() <= y;
    if (upwards == (b.y() <= y)) continue;
    // From the lower end, the same for both triangles at the side.
    const Vec3d& low = upwards ? a : b;
    const Vec3d& high = upwards ? b : a;
    const double share = (y - low.y()) / (high.y() - low.y());
    x[count] = low.x() + share * (high.x() - low.x());
    z[count] = low.z() + share * (high.z() - low.z());
    way[count++] = upwards ? 1 : -1;
  }
  if (count < 2 || x[0] == x[1]) return;
  const std::size_t left = x[0] < x[1] ? 0 : 1;
  const std::size_t right = 1 - left;
  const auto first = static_cast<int>(std::ceil((x[left] - x0) / step));
  const auto end = static_cast<int>(std::ceil((x[right] - x0) / step));
  for (int line = first; line < end; ++line) {
    const double share = (x0 + line * step - x[left]) / (x[right] - x[left]);
    crossings.push_back({line, z[left] + share * (z[right] - z[left]), way[left]});
  }
}

/// Returns the length of the lines of a row within the solid.
double lengthWithin(std::vector<Crossing>& crossings) {
  std::sort(crossings.begin(), crossings.end());
  double sum = 0;
  int number = 0;
  for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
    number += crossings[i].step;
    if (crossings[i].line != crossings[i + 1].line)
      number = 0;
    else if (number != 0)
      sum += crossings[i + 1].z - crossings[i].z;
  }
  return sum;
}

double sumAlongLines(const Mesh& given) {
  const Mesh mesh = turned(given);
  const MeshBounds bounds = boundsOf(mesh);
  const Vec3d step = (bounds.max - bounds.min) / lines_per_edge;
  if (!(step.x() > 0 && step.y() > 0)) return 0;

  // The triangles by the row that they begin at.
  std::vector<std::vector<std::uint32_t>> beginning(lines_per_edge);
  const auto rowOf = [&](double y) {
    const double row = std::floor((y - bounds.min.y()) / step.y() - 0.5);
    return static_cast<int>(std::clamp(row, 0.0, lines_per_edge - 1.0));
  };
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = cornersOf(mesh, t);
    beginning[static_cast<std::size_t>(rowOf(std::min({a.y(), b.y(), c.y()})))].push_back(t);
  }
  std::vector<std::uint32_t> passed;
  std::vector<Crossing> crossings;
  double length = 0;
  for (int row = 0; row < lines_per_edge; ++row) {
    throwIfInterrupted();
    const double y = bounds.min.y() + (row + 0.5) * step.y();
    const std::vector<std::uint32_t>& next = beginning[static_cast<std::size_t>(row)];
    passed.insert(passed.end(), next.begin(), next.end());
    std::erase_if(passed, [&](std::uint32_t t) {
      const auto [a, b, c] = cornersOf(mesh, t);
      return std::max({a.y(), b.y(), c.y()}) < y;
    });
    crossings.clear();
    for (const std::uint32_t t : passed)
      addCrossings(cornersOf(mesh, t), y, bounds.min.x() + 0.5 * step.x(), step.x(), crossings);
    length += lengthWithin(crossings);
  }
  return length * step.x() * step.y();
}

}  // namespace

double volumeOf(const SolidMesh& solid) {
  return solid.walls.hidden.empty() ? volumeOf(solid.mesh) : sumAlongLines(solid.mesh);
}

}  // namespace vdbdither
