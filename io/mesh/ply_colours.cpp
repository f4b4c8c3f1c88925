#include "io/mesh/ply_colours.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <string_view>

#include "io/mesh/mesh_textures.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

using openvdb::Vec2f;
using openvdb::Vec4f;

namespace {

constexpr std::size_t triangles_per_look = 1 << 16;
const Vec2f no_coordinates(std::numeric_limits<float>::quiet_NaN());

/// The value that means 1.
double unitOf(PlyScalar type) {
  switch (type) {
    case PlyScalar::kFloat32:
    case PlyScalar::kFloat64:
      return 1;
    case PlyScalar::kInt16:
    case PlyScalar::kUint16:
      return 65535;
    default:
      return 255;
  }
}

/// From left to right, and, as the files have it, from bottom to top.
Vec2f textureCoordinates(double u, double v) {
  const Vec2f at(static_cast<float>(u), static_cast<float>(1 - v));
  return std::isfinite(at.x()) && std::isfinite(at.y()) ? at : no_coordinates;
}

bool isGiven(const Appearance::Coordinates& corners) {
  return std::none_of(corners.begin(), corners.end(),
                      [](const Vec2f& corner) { return std::isnan(corner.x()); });
}

}  // namespace

PlyColours::PlyColours(const MeshFile& file, const PlyHeader& header)
    : file_(file), texture_files_(header.texture_files) {}

PlyColours::Slot PlyColours::slotOf(const PlyProperty& property) {
  if (property.count_type) return property.name == "texcoord" ? Slot::coordinates : Slot::none;
  static const std::map<std::string_view, Slot> slots{{"red", Slot::red},
                                                      {"green", Slot::green},
                                                      {"blue", Slot::blue},
                                                      {"alpha", Slot::opacity},
                                                      {"r", Slot::red},
                                                      {"g", Slot::green},
                                                      {"b", Slot::blue},
                                                      {"a", Slot::opacity},
                                                      {"diffuse_red", Slot::red},
                                                      {"diffuse_green", Slot::green},
                                                      {"diffuse_blue", Slot::blue},
                                                      {"diffuse_alpha", Slot::opacity},
                                                      {"s", Slot::u},
                                                      {"t", Slot::v},
                                                      {"u", Slot::u},
                                                      {"v", Slot::v},
                                                      {"texture_u", Slot::u},
                                                      {"texture_v", Slot::v},
                                                      {"texture_s", Slot::u},
                                                      {"texture_t", Slot::v},
                                                      {"texcoord_u", Slot::u},
                                                      {"texcoord_v", Slot::v},
                                                      {"texcoord_s", Slot::u},
                                                      {"texcoord_t", Slot::v},
                                                      {"texnumber", Slot::texture}};
  const auto found = slots.find(lowerCase(property.name));
  return found == slots.end() ? Slot::none : found->second;
}

bool PlyColours::hasSlot(Slot slot) const {
  return std::find(slots_.begin(), slots_.end(), slot) != slots_.end();
}

void PlyColours::begin(const PlyElement& element) {
  slots_.clear();
  for (const PlyProperty& property : element.properties) {
    Slot slot = slotOf(property);
    // A second property of a kind is left alone.
    if (slot != Slot::none && hasSlot(slot)) slot = Slot::none;
    if (slot == Slot::red) unit_ = unitOf(property.type);
    if (slot == Slot::opacity) opacity_unit_ = unitOf(property.type);
    slots_.push_back(slot);
  }
  has_colours_ = hasSlot(Slot::red) && hasSlot(Slot::green) && hasSlot(Slot::blue);
  has_opacity_ = has_colours_ && hasSlot(Slot::opacity);
  has_coordinates_ = hasSlot(Slot::u) && hasSlot(Slot::v);
  record_ = {};
}

void PlyColours::take(std::size_t property, double value) {
  const Slot slot = slots_[property];
  if (slot == Slot::coordinates) {
    list_.push_back(value);
  } else {
    record_[static_cast<std::size_t>(slot)] = value;
  }
}

void PlyColours::addColour(std::optional<EncodedColours>& colours, std::size_t index) {
  if (!colours) colours.emplace(unit_);
  colours->padTo(index);
  const std::array<double, 3> colour{record_[0], record_[1], record_[2]};
  if (has_opacity_) {
    colours->add(colour, record_[3] / opacity_unit_ * unit_);
  } else {
    colours->add(colour);
  }
}

void PlyColours::endVertex() {
  if (has_colours_) addColour(vertex_colours_, vertices_);
  if (has_coordinates_) {
    vertex_coordinates_.push_back(textureCoordinates(record_[static_cast<std::size_t>(Slot::u)],
                                                     record_[static_cast<std::size_t>(Slot::v)]));
  }
  ++vertices_;
}

void PlyColours::endFace(std::span<const Mesh::Triangle> places, std::size_t corners,
                         std::size_t triangles) {
  const bool has_list = list_.size() == 2 * corners && !list_.empty();
  const double number = record_[static_cast<std::size_t>(Slot::texture)];
  const bool is_known = number >= 0 && number < static_cast<double>(texture_files_.size()) &&
                        number == std::floor(number);
  for (std::size_t i = 0; i < triangles; ++i) {
    if (has_colours_) addColour(face_colours_, texture_.size());
    if (has_list && !places.empty()) {
      corners_.resize(texture_.size(), {no_coordinates, no_coordinates, no_coordinates});
      Appearance::Coordinates& added = corners_.emplace_back();
      for (std::size_t c = 0; c < 3; ++c)
        added[c] = textureCoordinates(list_[2 * places[i][c]], list_[2 * places[i][c] + 1]);
    }
    texture_.push_back(is_known ? static_cast<std::uint32_t>(number) : no_texture);
  }
  list_.clear();
}

std::optional<Appearance::Coordinates> PlyColours::coordinatesOf(const Mesh& mesh,
                                                                 std::size_t triangle) const {
  Appearance::Coordinates corners;
  if (triangle < corners_.size() && isGiven(corners_[triangle])) return corners_[triangle];
  if (vertex_coordinates_.size() < vertices_ || vertex_coordinates_.empty()) return std::nullopt;
  for (std::size_t c = 0; c < 3; ++c) corners[c] = vertex_coordinates_[mesh.triangles[triangle][c]];
  if (!isGiven(corners)) return std::nullopt;
  return corners;
}

std::shared_ptr<const Appearance> PlyColours::finish(const Mesh& mesh) {
  const bool has_coordinates = !corners_.empty() || !vertex_coordinates_.empty();
  const bool has_textures = !texture_files_.empty() && has_coordinates;
  if (!texture_files_.empty() && !has_textures)
    file_.warn("names a texture, but has no texture coordinates; the texture is not read");
  if (!has_coordinates && !vertex_colours_ && !face_colours_) return nullptr;
  if (vertex_colours_) vertex_colours_->decode(file_, "vertices");
  if (face_colours_) face_colours_->decode(file_, "faces");

  const auto appearance = std::make_shared<Appearance>();
  appearance->materials.emplace_back();
  appearance->material.resize(mesh.triangles.size());
  MeshTextures textures(file_);
  std::map<std::uint32_t, std::uint32_t> materials;
  const auto materialOf = [&](std::uint32_t number) {
    const auto index = static_cast<std::uint32_t>(appearance->materials.size());
    const auto [at, is_new] = materials.emplace(number, index);
    if (!is_new) return at->second;
    SurfaceMaterial& made = appearance->materials.emplace_back();
    made.name = texture_files_[number];
    made.texture = textures.indexOf(texture_files_[number]);
    return index;
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % triangles_per_look == 0) throwIfInterrupted();
    const bool is_textured = has_textures && texture_[t] != no_texture;
    // Without a texture that the file names, the user may give one.
    const auto coordinates = is_textured || texture_files_.empty()
                                 ? coordinatesOf(mesh, t)
                                 : std::optional<Appearance::Coordinates>();
    if (coordinates) {
      appearance->coordinates.resize(mesh.triangles.size());
      appearance->coordinates[t] = *coordinates;
    }
    if (coordinates && is_textured) {
      appearance->material[t] = materialOf(texture_[t]);
      continue;
    }
    if (has_textures) ++lost_textures_;
    if (!vertex_colours_ && (!face_colours_ || !face_colours_->has(t))) continue;
    appearance->colours.resize(mesh.triangles.size(), {Vec4f(1), Vec4f(1), Vec4f(1)});
    for (std::size_t c = 0; c < 3; ++c) {
      appearance->colours[t][c] =
          vertex_colours_ ? (*vertex_colours_)[mesh.triangles[t][c]] : (*face_colours_)[t];
    }
  }
  if (lost_textures_ > 0) {
    file_.warn(std::to_string(lost_textures_) +
               " triangles have no texture coordinates, or a texture that the header does not "
               "name; they are not textured");
  }
  appearance->textures = textures.take();
  return appearance;
}

}  // namespace vdbdither
