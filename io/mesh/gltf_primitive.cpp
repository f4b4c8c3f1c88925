// glTF 2.0: ISO/IEC 12113:2022, section 3.7.2, and the extension KHR_draco_mesh_compression:
// https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_draco_mesh_compression

#include "io/mesh/gltf_primitive.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "io/mesh/draco_mesh.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

constexpr std::uint64_t triangles_mode = 4;
constexpr std::uint64_t strip_mode = 5;
constexpr std::uint64_t fan_mode = 6;

std::vector<Mesh::Triangle> trianglesOf(const std::vector<std::uint32_t>& corners,
                                        std::uint64_t mode) {
  std::vector<Mesh::Triangle> triangles;
  if (corners.size() < 3) return triangles;
  triangles.reserve(mode == triangles_mode ? corners.size() / 3 : corners.size() - 2);
  const std::size_t step = mode == triangles_mode ? 3 : 1;
  for (std::size_t i = 0; i + 2 < corners.size(); i += step) {
    const std::uint32_t a = corners[mode == fan_mode ? 0 : i];
    std::uint32_t b = corners[i + 1];
    std::uint32_t c = corners[i + 2];
    if (mode == strip_mode && i % 2 == 1) std::swap(b, c);
    // Strips are joined by triangles without area.
    if (mode != triangles_mode && (a == b || b == c || c == a)) continue;
    triangles.push_back({a, b, c});
  }
  return triangles;
}

/// Names the vertices of the triangles anew, from 0, and returns those that are used: many
/// primitives may each take some vertices of the same large accessor.
std::vector<std::uint32_t> compact(std::vector<Mesh::Triangle>& triangles, std::uint64_t vertices) {
  std::vector<std::uint32_t> used;
  if (vertices <= 16 * triangles.size()) {
    constexpr std::uint32_t unused = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::uint32_t> renamed(vertices, unused);
    for (const Mesh::Triangle& triangle : triangles) {
      for (const std::uint32_t vertex : triangle) renamed[vertex] = 0;
    }
    for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
      if (renamed[vertex] == unused) continue;
      renamed[vertex] = static_cast<std::uint32_t>(used.size());
      used.push_back(vertex);
    }
    for (Mesh::Triangle& triangle : triangles) {
      for (std::uint32_t& vertex : triangle) vertex = renamed[vertex];
    }
    return used;
  }
  used.reserve(3 * triangles.size());
  for (const Mesh::Triangle& triangle : triangles)
    used.insert(used.end(), triangle.begin(), triangle.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (Mesh::Triangle& triangle : triangles) {
    for (std::uint32_t& vertex : triangle) {
      vertex = static_cast<std::uint32_t>(std::lower_bound(used.begin(), used.end(), vertex) -
                                          used.begin());
    }
  }
  return used;
}

std::optional<std::uint64_t> optionalIndex(const GltfValue& json) {
  if (!json.exists()) return std::nullopt;
  return json.count();
}

/// What reading a vertex and a triangle takes, at most.
constexpr std::uint64_t bytes_per_vertex = 104;
constexpr std::uint64_t bytes_per_triangle = sizeof(Mesh::Triangle);

}  // namespace

GltfPrimitive GltfPrimitives::read(const GltfValue& json) {
  throwIfInterrupted();
  const std::uint64_t mode = json["mode"].count(triangles_mode);
  if (mode > fan_mode) json["mode"].refuse("must be a whole number from 0 to 6");
  if (mode < triangles_mode) {
    ++omissions_.points_and_lines;
    return {};
  }
  if (json["targets"].size() > 0) ++omissions_.morph_targets;
  const GltfValue compression = json["extensions"]["KHR_draco_mesh_compression"];
  return compression.exists() ? readDraco(json, compression) : readPlain(json, mode);
}

GltfPrimitive GltfPrimitives::readPlain(const GltfValue& json, std::uint64_t mode) {
  const GltfValue attributes = json["attributes"];
  const std::uint64_t count = accessors_.at(attributes["POSITION"].count()).count;
  GltfPrimitive primitive;
  std::vector<std::uint32_t> used;
  {
    const std::vector<std::uint32_t> corners = cornersOf(json, count);
    buffers_.takeMemory(corners.size() * bytes_per_triangle);
    primitive.triangles = trianglesOf(corners, mode);
    used = compact(primitive.triangles, count);
  }
  buffers_.takeMemory(used.size() * bytes_per_vertex);
  readVertices(
      json,
      [&](const std::string& name, bool is_fraction) {
        return fromAccessor(attributes[name], used, count, is_fraction);
      },
      primitive);
  return primitive;
}

GltfPrimitive GltfPrimitives::readDraco(const GltfValue& json, const GltfValue& compression) {
  const GltfBuffers::View view = buffers_.view(compression["bufferView"].count());
  const GltfValue attributes = json["attributes"];
  try {
    const DracoMesh draco(view.bytes);
    GltfPrimitive primitive;
    buffers_.takeMemory(draco.points() * bytes_per_vertex);
    primitive.triangles = draco.triangles();
    buffers_.takeMemory(primitive.triangles.size() * bytes_per_triangle);
    std::vector<std::uint32_t> points(draco.points());
    std::iota(points.begin(), points.end(), std::uint32_t{0});
    readVertices(
        json,
        [&](const std::string& name, bool is_fraction) {
          const GltfValue id = compression["attributes"][name];
          if (!id.exists())
            return fromAccessor(attributes[name], points, points.size(), is_fraction);
          if (id.count() > std::numeric_limits<std::uint32_t>::max())
            id.refuse("must be a whole number of 32 bits");
          const DracoValues from = draco.valuesOf(static_cast<std::uint32_t>(id.count()));
          const GltfValue accessor = attributes[name].exists()
                                         ? attributes[name]
                                         : GltfValue(file_, nullptr, "attributes");
          const bool is_normalized =
              from.is_integer &&
              (is_fraction || (accessor.exists() && accessors_.at(accessor.count()).is_normalized));
          Values values{static_cast<std::uint32_t>(from.components), {}};
          const double one = is_normalized ? from.one : 1;
          values.values.reserve(points.size() * values.components);
          for (const std::uint32_t value : from.of_point) {
            const double* components = &from.values[std::size_t{value} * values.components];
            for (std::uint32_t c = 0; c < values.components; ++c)
              values.values.push_back(components[c] / one);
          }
          return values;
        },
        primitive);
    return primitive;
  } catch (const DracoError& error) {
    compression.refuse(std::string("is refused: the Draco data ") + error.what());
  }
}

std::vector<std::uint32_t> GltfPrimitives::cornersOf(const GltfValue& json,
                                                     std::uint64_t vertices) {
  const GltfValue place = json["indices"];
  if (!place.exists()) {
    buffers_.takeMemory(vertices * sizeof(std::uint32_t));
    std::vector<std::uint32_t> corners(vertices);
    std::iota(corners.begin(), corners.end(), std::uint32_t{0});
    return corners;
  }
  const GltfAccessor& accessor = accessors_.at(place.count());
  using Type = GltfAccessor::Type;
  if (accessor.components != 1 || (accessor.type != Type::uint8 && accessor.type != Type::uint16 &&
                                   accessor.type != Type::uint32)) {
    place.refuse("leads to an accessor that is none of indices");
  }
  buffers_.takeMemory(accessor.count * sizeof(std::uint32_t));
  std::vector<std::uint32_t> corners = indicesOf(accessor);
  const auto wild = std::find_if(corners.begin(), corners.end(),
                                 [&](std::uint32_t corner) { return corner >= vertices; });
  if (wild != corners.end())
    place.refuse("name vertex " + std::to_string(*wild) + ", but there are " +
                 std::to_string(vertices) + ", counted from 0");
  return corners;
}

GltfPrimitives::Values GltfPrimitives::fromAccessor(const GltfValue& attribute,
                                                    std::span<const std::uint32_t> vertices,
                                                    std::uint64_t count, bool is_fraction) {
  if (!attribute.exists()) return {};
  const GltfAccessor& accessor = accessors_.at(attribute.count());
  if (accessor.count != count)
    attribute.refuse("leads to an accessor of " + std::to_string(accessor.count) + " for " +
                     std::to_string(count) + " vertices");
  if (!is_fraction || accessor.is_normalized)
    return {accessor.components, elementsOf(accessor, vertices)};
  GltfAccessor normalized = accessor;
  normalized.is_normalized = true;
  return {accessor.components, elementsOf(normalized, vertices)};
}

void GltfPrimitives::readVertices(const GltfValue& json, const Source& source,
                                  GltfPrimitive& primitive) {
  const Values values = source("POSITION", false);
  if (values.components != 3) json["attributes"].refuse("has no positions with three coordinates");
  primitive.positions.resize(values.values.size() / 3);
  for (std::size_t i = 0; i < primitive.positions.size(); ++i) {
    const openvdb::Vec3d position(&values.values[3 * i]);
    if (!isFinite(position)) {
      file_.refuse(json.path() + " has a vertex that is not finite (" + shown(position) +
                   "); repair the mesh");
    }
    primitive.positions[i] = position;
  }
  readBones(json, source, primitive);
  if (file_.wantsColours()) readLook(json, source, primitive);
}

/// Reads the first set of joints; others are passed over.
void GltfPrimitives::readBones(const GltfValue& json, const Source& source,
                               GltfPrimitive& primitive) {
  constexpr std::size_t per_vertex = 4;
  const Values joints = source("JOINTS_0", false);
  const Values weights = source("WEIGHTS_0", true);
  if (joints.components != per_vertex || weights.components != per_vertex) return;
  primitive.bones.resize(primitive.positions.size());
  for (std::size_t i = 0; i < primitive.bones.size(); ++i) {
    for (std::size_t b = 0; b < per_vertex; ++b) {
      const double joint = joints.values[per_vertex * i + b];
      const double weight = weights.values[per_vertex * i + b];
      if (!(joint >= 0 && joint <= std::numeric_limits<std::uint16_t>::max()) ||
          !(weight >= 0 && std::isfinite(weight)))
        json["attributes"].refuse("has joints or weights that are none");
      primitive.bones[i][b] = {static_cast<std::uint16_t>(joint), static_cast<float>(weight)};
    }
  }
}

void GltfPrimitives::readLook(const GltfValue& json, const Source& source,
                              GltfPrimitive& primitive) {
  const std::optional<std::uint64_t> material = optionalIndex(json["material"]);
  const auto texture = materials_.textureOf(material);
  const std::uint64_t set = texture ? texture->set : 0;
  const Values coordinates = source("TEXCOORD_" + std::to_string(set), false);
  const bool has_coordinates = coordinates.components == 2;
  // Also without a texture: one can be given to the mesh.
  if (has_coordinates)
    readCoordinates(coordinates, texture ? texture->transform : GltfTextureTransform{}, primitive);
  omissions_.missing_coordinates += texture && !has_coordinates ? 1 : 0;
  const Values colours = source("COLOR_0", true);
  if (colours.components == 3 || colours.components == 4)
    readColours(colours, materials_.hasOpacity(material), primitive);
  primitive.is_plain = !material && primitive.colours.empty() && primitive.coordinates.empty();
  primitive.material = materials_.use(material, has_coordinates && texture);
}

void GltfPrimitives::readCoordinates(const Values& values, const GltfTextureTransform& transform,
                                     GltfPrimitive& primitive) {
  primitive.coordinates.resize(primitive.positions.size());
  for (std::size_t i = 0; i < primitive.positions.size(); ++i) {
    const openvdb::Vec2f at = transform.of(values.values[2 * i], values.values[2 * i + 1]);
    const bool is_wild = !std::isfinite(at.x()) || !std::isfinite(at.y());
    omissions_.wild_coordinates += is_wild ? 1 : 0;
    primitive.coordinates[i] = is_wild ? openvdb::Vec2f(0, 0) : at;
  }
}

void GltfPrimitives::readColours(const Values& values, bool has_opacity, GltfPrimitive& primitive) {
  primitive.colours.resize(primitive.positions.size());
  for (std::size_t i = 0; i < primitive.positions.size(); ++i) {
    openvdb::Vec4f colour(1, 1, 1, 1);
    for (std::uint32_t c = 0; c < values.components; ++c) {
      if (c == 3 && !has_opacity) continue;
      const double value = values.values[i * values.components + c];
      omissions_.wild_coordinates += std::isfinite(value) ? 0 : 1;
      colour[static_cast<int>(c)] =
          std::isfinite(value) ? static_cast<float>(std::clamp(value, 0.0, 1.0)) : 0;
    }
    primitive.colours[i] = colour;
  }
}

}  // namespace vdbdither
