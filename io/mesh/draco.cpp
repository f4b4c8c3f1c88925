// Draco files: "Draco Bitstream Specification", version 2.2, Google, 2021.
// https://google.github.io/draco/spec/

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "io/image/srgb.h"
#include "io/mesh/draco_encoding.h"
#include "io/mesh/draco_mesh.h"
#include "io/mesh/mesh_format.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

std::vector<Vec3d> verticesOf(const MeshFile& file, const DracoValues& positions) {
  if (positions.components != 3)
    file.refuse("the Draco data have no positions with three coordinates; export it again");
  std::vector<Vec3d> vertices(positions.values.size() / 3);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    vertices[i] = Vec3d(&positions.values[3 * i]);
    if (!isFinite(vertices[i])) {
      file.refuse("vertex " + std::to_string(i + 1) + " is not finite (" + shown(vertices[i]) +
                  "); repair the mesh");
    }
  }
  return vertices;
}

/// The colours are encoded like sRGB, whether they are bytes or 0 … 1, as PLY has them.
float linearColour(const DracoValues& colours, double value) {
  if (colours.is_integer && colours.one == 255)
    return linearOfSrgbBytes()[static_cast<std::size_t>(value)];
  return static_cast<float>(linearOfSrgb(value / colours.one));
}

std::vector<openvdb::Vec4f> linearColours(const DracoValues& colours) {
  const auto components = static_cast<std::size_t>(colours.components);
  std::vector<openvdb::Vec4f> linear(colours.values.size() / components,
                                     openvdb::Vec4f(0, 0, 0, 1));
  // One or two components are a grey, and its opacity.
  const bool is_grey = components < 3;
  for (std::size_t i = 0; i < linear.size(); ++i) {
    const double* value = &colours.values[i * components];
    for (int c = 0; c < 3; ++c) linear[i][c] = linearColour(colours, value[is_grey ? 0 : c]);
    if (components % 2 != 0) continue;
    const double opacity = value[components - 1] / colours.one;
    linear[i][3] = opacity > 0 ? static_cast<float>(std::min(opacity, 1.0)) : 0;
  }
  return linear;
}

void addColours(const DracoValues& colours, const std::vector<Mesh::Triangle>& points,
                Appearance& appearance) {
  const std::vector<openvdb::Vec4f> linear = linearColours(colours);
  appearance.colours.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t corner = 0; corner < 3; ++corner)
      appearance.colours[i][corner] = linear[colours.of_point[points[i][corner]]];
  }
}

/// They are those of the OBJ or PLY from which the file was made: v grows upwards.
void addCoordinates(const DracoValues& coordinates, const std::vector<Mesh::Triangle>& points,
                    Appearance& appearance) {
  appearance.coordinates.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::size_t from = 2 * std::size_t{coordinates.of_point[points[i][corner]]};
      const openvdb::Vec2f at(static_cast<float>(coordinates.values[from]),
                              static_cast<float>(1 - coordinates.values[from + 1]));
      const bool is_finite = std::isfinite(at.x()) && std::isfinite(at.y());
      appearance.coordinates[i][corner] = is_finite ? at : openvdb::Vec2f(0, 0);
    }
  }
}

/// @param points  the triangles, as indices of points
void addLook(const MeshFile& file, const DracoMesh& draco,
             const std::vector<Mesh::Triangle>& points, Mesh& mesh) {
  const DracoValues colours = draco.values(DracoAttribute::colour);
  const DracoValues coordinates = draco.values(DracoAttribute::texture_coordinates);
  const bool has_colours = colours.components >= 1 && colours.components <= 4;
  const bool has_coordinates = coordinates.components == 2;
  if (colours.components > 4)
    file.warn("ignored colours with " + std::to_string(colours.components) + " components");
  if (!has_colours && !has_coordinates) return;
  auto appearance = std::make_shared<Appearance>();
  appearance->materials.emplace_back();
  appearance->material.assign(points.size(), 0);
  if (has_colours) addColours(colours, points, *appearance);
  if (has_coordinates) addCoordinates(coordinates, points, *appearance);
  mesh.appearance = std::move(appearance);
}

/// Points that differ only in other attributes share a vertex already: their value is the same.
Mesh readDraco(const MeshFile& file) {
  try {
    const DracoMesh draco(file.bytes());
    const DracoValues positions = draco.values(DracoAttribute::position);
    Mesh mesh;
    mesh.vertices = verticesOf(file, positions);
    mesh.triangles = draco.triangles();
    if (file.wantsColours()) addLook(file, draco, mesh.triangles, mesh);
    for (Mesh::Triangle& triangle : mesh.triangles) {
      for (std::uint32_t& vertex : triangle) vertex = positions.of_point[vertex];
    }
    return mesh;
  } catch (const DracoError& error) {
    file.refuse(std::string("the Draco data ") + error.what() + "; export or download it again");
  }
}

MeshMatch matchDraco(const MeshFile& file) {
  return file.head().starts_with("DRACO") ? MeshMatch::signature : MeshMatch::none;
}

class DracoEncoder : public DracoMeshEncoder {
 public:
  using DracoMeshEncoder::DracoMeshEncoder;

 protected:
  void finish(std::uint64_t vertices, std::uint64_t /*triangles*/) override {
    encoding_.positions(std::exchange(positions_, {}));
    if (extras_.colour) encoding_.colours(std::exchange(colours_, {}));
    if (extras_.quality) encoding_.numbers(std::exchange(qualities_, {}));
    file_.append(encoding_.encode(vertices));
  }
};

}  // namespace

extern const MeshFormat draco;
const MeshFormat draco{.name = "Draco",
                       .ending = ".drc",
                       .match = matchDraco,
                       .read = readDraco,
                       .write = makeMeshEncoder<DracoEncoder>,
                       .holds_extras = true,
                       .takes_draco = true,
                       .most = (std::uint64_t{1} << 31) / sizeof(openvdb::Vec3s),
                       .bytes_per_vertex = 17.5,
                       .us_per_vertex = 0.5};

}  // namespace vdbdither
