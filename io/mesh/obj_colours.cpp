#include "io/mesh/obj_colours.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "io/image/srgb.h"
#include "io/mesh/side_file.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Vec2f;
using openvdb::Vec4f;

namespace {

constexpr std::size_t triangles_per_look = 1 << 16;

float finiteOrZero(double value) {
  const auto rounded = static_cast<float>(value);
  return std::isfinite(rounded) ? rounded : 0;
}

}  // namespace

ObjColours::ObjColours(const MeshFile& file) : file_(file), textures_(file), material_names_{""} {}

void ObjColours::addVertex(std::size_t vertex, TextCursor& text) {
  std::array<double, 4> values{};
  std::size_t count = 0;
  for (; count < values.size(); ++count) {
    const auto number = text.number();
    if (!number) break;
    values[count] = *number;
  }
  if (count < 3) {
    if (!vertex_colours_.isEmpty()) vertex_colours_.padTo(vertex + 1);
    return;
  }
  vertex_colours_.padTo(vertex);
  const std::array<double, 3> colour{values[0], values[1], values[2]};
  if (count == 4) {
    vertex_colours_.add(colour, values[3]);
  } else {
    vertex_colours_.add(colour);
  }
}

void ObjColours::addCoordinates(const char* line, TextCursor& text) {
  const auto u = text.number();
  const auto v = u ? text.number() : u;
  const openvdb::Vec2d at(u.value_or(0), v.value_or(0));
  if (!std::isfinite(at.x()) || !std::isfinite(at.y()))
    file_.refuseAtLine(line, "texture coordinates are not finite; export it again");
  coordinates_.push_back(at);
}

std::uint32_t ObjColours::materialNamed(std::string_view name) {
  const auto index = static_cast<std::uint32_t>(material_names_.size());
  const auto [at, is_new] = material_indices_.emplace(name, index);
  if (is_new) material_names_.push_back(name);
  return at->second;
}

std::uint32_t ObjColours::coordinatesOf(std::string_view corner) const {
  const std::size_t slash = corner.find('/');
  if (slash == corner.npos) return none;
  std::int64_t index = 0;
  const char* end = corner.data() + corner.size();
  const auto [stop, error] = std::from_chars(corner.data() + slash + 1, end, index);
  if (error == std::errc::invalid_argument || (stop != end && *stop != '/')) return none;
  const auto count = static_cast<std::int64_t>(coordinates_.size());
  constexpr std::int64_t beyond = std::int64_t{none} - 1;
  if (error != std::errc() || index == 0 || index < -count || index > beyond) return none - 1;
  return static_cast<std::uint32_t>(index > 0 ? index - 1 : index + count);
}

void ObjColours::addFace(std::span<const Mesh::Triangle> places,
                         std::span<const std::uint32_t> coordinates, std::uint32_t material) {
  for (const Mesh::Triangle& place : places) {
    corners_.push_back({coordinates[place[0]], coordinates[place[1]], coordinates[place[2]]});
    material_.push_back(material);
  }
}

bool ObjColours::hasColours(const Mesh::Triangle& triangle) const {
  return std::all_of(triangle.begin(), triangle.end(),
                     [&](std::uint32_t vertex) { return vertex_colours_.has(vertex); });
}

bool ObjColours::hasCoordinates(std::size_t triangle, const std::string& texture) const {
  for (const std::uint32_t corner : corners_[triangle]) {
    if (corner == none) return false;
    if (corner < coordinates_.size()) continue;
    if (texture.empty()) return false;
    file_.refuse("a face with the texture " + inQuotes(texture) +
                 " has texture coordinates that are out of range: the file has " +
                 std::to_string(coordinates_.size()) + "; export it again");
  }
  return true;
}

void ObjColours::readLibraries() {
  std::set<std::string_view> named;
  for (const std::string_view line : libraries_) readNamedLibraries(unquoted(mtlName(line)), named);
  if (missing_libraries_ == 1) {
    file_.warn("the material library " + inQuotes(first_missing_library_) +
               " is not in the folder of the mesh; its materials are white");
  } else if (missing_libraries_ > 0) {
    file_.warn(std::to_string(missing_libraries_) + " material libraries, the first " +
               inQuotes(first_missing_library_) +
               ", are not in the folder of the mesh; their materials are white");
  }
}

/// The rest of a line is one name, which may have blanks, or several.
void ObjColours::readNamedLibraries(std::string_view line, std::set<std::string_view>& named) {
  constexpr std::size_t most_libraries = 1000;
  const auto isNew = [&](std::string_view name) {
    if (!named.insert(name).second) return false;
    if (named.size() > most_libraries)
      file_.refuse("it names more than 1000 material libraries; export it again");
    return true;
  };
  if (line.empty() || !isNew(line)) return;
  if (hasSideFile(file_, line)) return readLibrary(line);
  TextCursor text(line);
  for (auto word = text.word(); !word.empty(); word = text.word()) {
    if (word != line && !isNew(word)) continue;
    if (word != line && hasSideFile(file_, word)) {
      readLibrary(word);
    } else if (missing_libraries_++ == 0) {
      first_missing_library_ = word;
    }
  }
}

void ObjColours::readLibrary(std::string_view path) {
  const SideFile library = readSideFile(file_, "material library", path, library_bytes_left_);
  library_bytes_left_ -= library.bytes.size();
  const std::size_t slash = path.find_last_of("/\\");
  const std::string folder(path.substr(0, slash == path.npos ? 0 : slash + 1));
  for (MtlMaterial& material : parseMtl(file_, library.text(), library.shown)) {
    // Textures lie beside their library.
    if (!folder.empty() && !material.texture.empty() &&
        hasSideFile(file_, folder + material.texture))
      material.texture = folder + material.texture;
    std::string name = material.name;
    defined_.emplace(std::move(name), std::move(material));
  }
}

std::uint32_t ObjColours::variant(std::uint32_t material, Source source, Appearance& appearance) {
  const auto index = static_cast<std::uint32_t>(appearance.materials.size());
  const auto [at, is_new] = variants_.emplace(std::pair(material, source), index);
  if (!is_new) return at->second;
  SurfaceMaterial& made = appearance.materials.emplace_back();
  made.name = material_names_[material];
  const MtlMaterial* known = materials_[material];
  if (known == nullptr) return index;
  made.colour[3] = static_cast<float>(known->opacity);
  for (int i = 0; source != Source::vertices && i < 3; ++i)
    made.colour[i] = static_cast<float>(linearOfSrgb(known->diffuse[static_cast<std::size_t>(i)]));
  if (source == Source::texture) {
    made.texture = textures_.indexOf(known->texture);
    if (known->is_clamped) made.wrap = {TextureWrap::clamp, TextureWrap::clamp};
  }
  return index;
}

Appearance::Coordinates ObjColours::placed(std::size_t triangle,
                                           const MtlMaterial& material) const {
  Appearance::Coordinates result;
  for (std::size_t i = 0; i < 3; ++i) {
    const openvdb::Vec2d& at = coordinates_[corners_[triangle][i]];
    const double u = at.x() * material.scale[0] + material.offset[0];
    const double v = at.y() * material.scale[1] + material.offset[1];
    result[i] = Vec2f(finiteOrZero(u), finiteOrZero(1 - v));
  }
  return result;
}

void ObjColours::warnOfWhatIsMissing() const {
  std::size_t missing = 0;
  std::string_view first;
  for (std::size_t i = 1; i < material_names_.size(); ++i) {
    if (materials_[i] == nullptr && missing++ == 0) first = material_names_[i];
  }
  // Libraries that are missing have been told.
  if (missing > 0 && !defined_.empty()) {
    file_.warn(std::to_string(missing) + " materials, the first " + inQuotes(first) +
               ", are in no material library; they are white");
  }
  if (lost_textures_ > 0) {
    file_.warn(std::to_string(lost_textures_) +
               " triangles have a texture but no texture coordinates; their colour is that of "
               "their vertices or Kd");
  }
}

std::shared_ptr<const Appearance> ObjColours::finish(const Mesh& mesh) {
  readLibraries();
  materials_.push_back(nullptr);
  for (std::size_t i = 1; i < material_names_.size(); ++i) {
    const auto known = defined_.find(material_names_[i]);
    materials_.push_back(known == defined_.end() ? nullptr : &known->second);
  }
  vertex_colours_.decode(file_, "vertices");

  const auto appearance = std::make_shared<Appearance>();
  bool has_colours = false;
  appearance->material.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % triangles_per_look == 0) throwIfInterrupted();
    const MtlMaterial* material = materials_[material_[t]];
    Source source = hasColours(mesh.triangles[t]) ? Source::vertices : Source::material;
    if (material != nullptr && !material->texture.empty()) {
      if (hasCoordinates(t, material->texture)) {
        source = Source::texture;
      } else {
        ++lost_textures_;
      }
    }
    has_colours = has_colours || material != nullptr || source == Source::vertices;
    appearance->material.push_back(variant(material_[t], source, *appearance));
    if (source == Source::texture || hasCoordinates(t, "")) {
      appearance->coordinates.resize(mesh.triangles.size());
      appearance->coordinates[t] = placed(t, material != nullptr ? *material : MtlMaterial());
    }
    if (source == Source::vertices) {
      appearance->colours.resize(mesh.triangles.size(), {Vec4f(1), Vec4f(1), Vec4f(1)});
      for (std::size_t i = 0; i < 3; ++i)
        appearance->colours[t][i] = vertex_colours_[mesh.triangles[t][i]];
    }
  }
  warnOfWhatIsMissing();
  if (!has_colours && appearance->coordinates.empty()) return nullptr;
  appearance->textures = textures_.take();
  return appearance;
}

}  // namespace vdbdither
