// 3D Manufacturing Format: "Core Specification" 1.3.0, "Materials and Properties Extension" 1.2.1,
// "Production Extension" 1.1.2, 3MF Consortium.

#include "io/mesh/threemf_model_reader.h"

#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "io/mesh/text_cursor.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

constexpr std::string_view core_space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
constexpr std::string_view material_space =
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02";
constexpr std::string_view production_space =
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06";
constexpr std::string_view production_path =
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06 path";
constexpr std::string_view triangle_set_space =
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07";

/// A part has at most as many elements of each kind that takes much more memory than bytes of the
/// file.
constexpr std::size_t most_elements = std::size_t{1} << 18;

constexpr std::size_t longest_name = 200;  ///< of objects and materials that is kept, in bytes

struct ThreemfExtension {
  std::string_view word;  ///< of its namespace
  std::string_view name;
};

/// Extensions that change the shape and are not read.
constexpr std::array threemf_extensions{
    ThreemfExtension{"/beamlattice/", "beam lattices"},
    ThreemfExtension{"/slice/", "slices"},
    ThreemfExtension{"/securecontent/", "encrypted content"},
    ThreemfExtension{"/volumetric/", "volumetric content"},
    ThreemfExtension{"/implicit/", "implicit functions"},
    ThreemfExtension{"/booleanoperations/", "boolean operations"},
    ThreemfExtension{"/displacement/", "displacement"},
    ThreemfExtension{"/alternatives/", "alternative models"},
};

const ThreemfExtension* threemfExtensionOf(std::string_view space) {
  for (const ThreemfExtension& extension : threemf_extensions) {
    if (space.find(extension.word) != std::string_view::npos) return &extension;
  }
  return nullptr;
}

std::optional<double> mmPerUnit(std::string_view unit) {
  constexpr std::array<std::pair<std::string_view, double>, 6> units{{{"micron", 0.001},
                                                                      {"millimeter", 1},
                                                                      {"centimeter", 10},
                                                                      {"inch", 25.4},
                                                                      {"foot", 304.8},
                                                                      {"meter", 1000}}};
  for (const auto& [name, mm] : units) {
    if (name == unit) return mm;
  }
  return std::nullopt;
}

std::optional<TextureWrap> textureWrapOf(std::string_view style) {
  if (style == "wrap") return TextureWrap::repeat;
  if (style == "mirror") return TextureWrap::mirror;
  if (style == "clamp" || style == "none") return TextureWrap::clamp;
  return std::nullopt;
}

std::string inWords(const XmlElement& element, std::string_view attribute) {
  return std::string(element.name()) + ": its " + std::string(attribute);
}

}  // namespace

openvdb::Vec3d ThreemfTransform::of(const openvdb::Vec3d& p) const {
  return p.x() * rows[0] + p.y() * rows[1] + p.z() * rows[2] + rows[3];
}

ThreemfTransform ThreemfTransform::then(const ThreemfTransform& next) const {
  if (isIdentity()) return next;
  if (next.isIdentity()) return *this;
  ThreemfTransform both;
  for (std::size_t row = 0; row < 3; ++row) both.rows[row] = next.of(rows[row]) - next.rows[3];
  both.rows[3] = next.of(rows[3]);
  return both;
}

ThreemfModelReader::ThreemfModelReader(std::string shown, MeshColours colours,
                                       std::set<std::string>& unread)
    : XmlReader(std::move(shown)), colours_(colours), unread_(unread) {}

ThreemfPart ThreemfModelReader::take() { return std::move(part_); }

void ThreemfModelReader::declare(std::string_view prefix, std::string_view space) {
  if (open_.back() == Tag::document) space_of_prefix_.emplace(prefix, space);
}

ThreemfModelReader::Tag ThreemfModelReader::tagOf(const XmlElement& element) {
  struct Known {
    Tag parent;
    std::string_view name;
    Tag tag;
  };
  // The most frequent first.
  static constexpr std::array core{
      Known{Tag::triangles, "triangle", Tag::triangle},
      Known{Tag::vertices, "vertex", Tag::vertex},
      Known{Tag::document, "model", Tag::model},
      Known{Tag::model, "resources", Tag::resources},
      Known{Tag::model, "build", Tag::build},
      Known{Tag::resources, "object", Tag::object},
      Known{Tag::object, "mesh", Tag::mesh},
      Known{Tag::object, "components", Tag::components},
      Known{Tag::mesh, "vertices", Tag::vertices},
      Known{Tag::mesh, "triangles", Tag::triangles},
      Known{Tag::components, "component", Tag::component},
      Known{Tag::build, "item", Tag::item},
      Known{Tag::resources, "basematerials", Tag::base_materials},
      Known{Tag::base_materials, "base", Tag::base},
  };
  static constexpr std::array material{
      Known{Tag::texture_group, "tex2coord", Tag::coordinates},
      Known{Tag::colour_group, "color", Tag::colour},
      Known{Tag::resources, "colorgroup", Tag::colour_group},
      Known{Tag::resources, "texture2d", Tag::texture},
      Known{Tag::resources, "texture2dgroup", Tag::texture_group},
      Known{Tag::resources, "compositematerials", Tag::mixtures},
      Known{Tag::resources, "multiproperties", Tag::mixtures},
  };
  const auto look_up = [&](const auto& table) {
    for (const Known& known : table) {
      if (known.parent == open_.back() && known.name == element.name()) return known.tag;
    }
    return Tag::skipped;
  };
  if (element.space() == core_space) return look_up(core);
  if (element.space() == material_space) return look_up(material);
  noteUnread(element);
  return Tag::skipped;
}

void ThreemfModelReader::noteUnread(const XmlElement& element) {
  const Tag parent = open_.back();
  if (parent == Tag::skipped || parent == Tag::document) return;
  if (const ThreemfExtension* extension = threemfExtensionOf(element.space()))
    unread_.emplace(extension->name);
}

void ThreemfModelReader::begin(const XmlElement& element) {
  constexpr std::uint64_t records_per_look = 1 << 16;
  if (++records_ % records_per_look == 0) throwIfInterrupted();
  const Tag tag = tagOf(element);
  if (open_.back() == Tag::document && tag != Tag::model)
    refuse("begins with " + inQuotes(element.name()) + ", not with the model of a 3MF file");
  open(tag, element);
  open_.push_back(tag);
}

void ThreemfModelReader::end() { open_.pop_back(); }

void ThreemfModelReader::open(Tag tag, const XmlElement& element) {
  const bool wants_colours = colours_ == MeshColours::read;
  switch (tag) {
    case Tag::model:
      return readModel(element);
    case Tag::object:
      return readObject(element);
    case Tag::mesh:
      if (!part_.objects.back().vertices.empty()) refuse("has an object with two meshes");
      return;
    case Tag::vertex:
      return readVertex(element);
    case Tag::triangle:
      return readTriangle(element);
    case Tag::component:
      return readComponent(element);
    case Tag::item:
      return readItem(element);
    default:
      break;
  }
  if (!wants_colours) return;
  switch (tag) {
    case Tag::base_materials:
    case Tag::colour_group:
      addGroup(element);
      break;
    case Tag::mixtures:
      addGroup(element).is_read = false;
      break;
    case Tag::base:
      readBaseMaterial(element);
      break;
    case Tag::colour:
      group_->colours.push_back(colourOf(element, "color"));
      break;
    case Tag::texture:
      readTexture(element);
      break;
    case Tag::texture_group:
      addGroup(element).texture = index(element, "texid");
      break;
    case Tag::coordinates:
      readCoordinates(element);
      break;
    default:
      break;
  }
}

void ThreemfModelReader::readModel(const XmlElement& element) {
  const std::string_view unit = element.attribute("unit").value_or("millimeter");
  const auto mm = mmPerUnit(unit);
  if (!mm) {
    refuse("the unit " + inQuotes(unit) +
           " is not one of micron, millimeter, centimeter, inch, foot and meter");
  }
  mm_per_unit_ = *mm;
  refuseUnknownExtensions(element.attribute("requiredextensions").value_or(""));
}

void ThreemfModelReader::refuseUnknownExtensions(std::string_view prefixes) const {
  TextCursor words(prefixes);
  for (words.skipSpace(); !words.atEnd(); words.skipSpace()) {
    const std::string_view prefix = words.word();
    const auto found = space_of_prefix_.find(prefix);
    const std::string_view space = found == space_of_prefix_.end() ? prefix : found->second;
    if (space == core_space || space == material_space || space == production_space ||
        space == triangle_set_space)
      continue;
    const ThreemfExtension* extension = threemfExtensionOf(space);
    refuse(
        "requires " +
        (extension != nullptr ? std::string(extension->name) : "the extension " + inQuotes(space)) +
        ", which is not read; export a mesh without");
  }
}

void ThreemfModelReader::readObject(const XmlElement& element) {
  limit(part_.objects.size(), "objects");
  ThreemfObject object;
  object.id = index(element, "id");
  object.name = shortened(printable(element.attribute("name").value_or("")), longest_name);
  const std::string_view type = element.attribute("type").value_or("model");
  object.is_printed = type == "model" || type == "surface";
  if (colours_ == MeshColours::read) {
    object.property.group = indexOr(element, "pid", ThreemfProperty::no_group);
    object.property.index.fill(indexOr(element, "pindex", 0));
  }
  if (!part_.object_of_id.emplace(object.id, part_.objects.size()).second)
    refuse("has a second object with the id " + std::to_string(object.id));
  part_.objects.push_back(std::move(object));
}

void ThreemfModelReader::readComponent(const XmlElement& element) {
  limit(components_++, "components");
  part_.objects.back().components.push_back(useOf(element));
}

void ThreemfModelReader::readBaseMaterial(const XmlElement& element) {
  limit(group_->materials.size(), "materials in a group");
  group_->materials.push_back(
      {shortened(printable(element.attribute("name").value_or("")), longest_name),
       colourOf(element, "displaycolor")});
}

void ThreemfModelReader::limit(std::size_t count, const std::string& what) const {
  if (count >= most_elements)
    refuse("has more than " + std::to_string(most_elements) + " " + what + "; split it");
}

void ThreemfModelReader::readVertex(const XmlElement& element) {
  const openvdb::Vec3d position =
      openvdb::Vec3d(number(element, "x"), number(element, "y"), number(element, "z")) *
      mm_per_unit_;
  std::vector<openvdb::Vec3d>& vertices = part_.objects.back().vertices;
  if (!isFinite(position)) {
    refuse("vertex " + std::to_string(vertices.size()) + " is not finite (" +
           vdbdither::shown(position) + "); export it again");
  }
  vertices.push_back(position);
}

void ThreemfModelReader::readTriangle(const XmlElement& element) {
  ThreemfObject& object = part_.objects.back();
  const Mesh::Triangle triangle{index(element, "v1"), index(element, "v2"), index(element, "v3")};
  for (const std::uint32_t vertex : triangle) {
    if (vertex >= object.vertices.size()) {
      refuse("triangle " + std::to_string(object.triangles.size()) + " has corner " +
             std::to_string(vertex) + ", but there are " + std::to_string(object.vertices.size()) +
             " vertices, counted from 0");
    }
  }
  object.triangles.push_back(triangle);
  if (colours_ == MeshColours::read) readProperty(element);
}

void ThreemfModelReader::readProperty(const XmlElement& element) {
  if (!element.attribute("p1")) return;
  ThreemfObject& object = part_.objects.back();
  const std::uint32_t first = index(element, "p1");
  object.properties.resize(object.triangles.size() - 1);
  object.properties.push_back(
      {indexOr(element, "pid", object.property.group),
       {first, indexOr(element, "p2", first), indexOr(element, "p3", first)}});
}

void ThreemfModelReader::readItem(const XmlElement& element) {
  limit(part_.items.size(), "items to print");
  ThreemfUse use = useOf(element);
  if (element.attribute("printable") == "0") {
    ++part_.left_out;
  } else {
    part_.items.push_back(std::move(use));
  }
}

ThreemfUse ThreemfModelReader::useOf(const XmlElement& element) const {
  return {std::string(element.attribute(production_path).value_or("")), index(element, "objectid"),
          transformOf(element.attribute("transform").value_or(""))};
}

ThreemfTransform ThreemfModelReader::transformOf(std::string_view text) const {
  ThreemfTransform transform;
  TextCursor words(text);
  words.skipBlanks();
  if (words.atEnd()) return transform;
  for (openvdb::Vec3d& row : transform.rows) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto value = words.number();
      if (!value || !std::isfinite(*value))
        refuse("the transform " + inQuotes(text) + " is not 12 finite numbers");
      row[axis] = *value;
    }
  }
  words.skipBlanks();
  if (!words.atEnd()) refuse("the transform " + inQuotes(text) + " has more than 12 numbers");
  if (transform.determinant() == 0)
    refuse("the transform " + inQuotes(text) + " flattens the object; export it again");
  transform.rows[3] *= mm_per_unit_;
  return transform;
}

ThreemfGroup& ThreemfModelReader::addGroup(const XmlElement& element) {
  const std::uint32_t id = index(element, "id");
  limit(part_.groups.size(), "property groups");
  const auto [place, is_new] = part_.groups.try_emplace(id);
  if (!is_new) refuse("has a second property group with the id " + std::to_string(id));
  group_ = &place->second;
  return place->second;
}

ThreemfColour ThreemfModelReader::colourOf(const XmlElement& element, std::string_view name) const {
  const std::string_view text = element.attribute(name).value_or("");
  ThreemfColour colour{0, 0, 0, 255};
  bool is_fine = (text.size() == 7 || text.size() == 9) && text.front() == '#';
  for (std::size_t channel = 0; is_fine && 2 * channel + 1 < text.size(); ++channel) {
    const char* digits = text.data() + 2 * channel + 1;
    const auto [stop, error] = std::from_chars(digits, digits + 2, colour.at(channel), 16);
    is_fine = error == std::errc() && stop == digits + 2;
  }
  if (!is_fine) {
    refuse(inWords(element, name) + " " + inQuotes(text) +
           " is not a colour; #RRGGBB and #RRGGBBAA are read");
  }
  return colour;
}

void ThreemfModelReader::readTexture(const XmlElement& element) {
  const std::uint32_t id = index(element, "id");
  limit(part_.textures.size(), "textures");
  ThreemfTexture texture;
  texture.path = element.attribute("path").value_or("");
  constexpr std::array<std::string_view, 2> names{"tilestyleu", "tilestylev"};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const std::string_view style = element.attribute(names.at(axis)).value_or("wrap");
    const auto wrap = textureWrapOf(style);
    if (!wrap)
      refuse("the " + std::string(names.at(axis)) + " " + inQuotes(style) +
             " is not one of wrap, mirror, clamp and none");
    texture.wrap.at(axis) = *wrap;
    if (style == "none") unread_.emplace("the border of textures without tiles (it is stretched)");
  }
  texture.is_smooth = element.attribute("filter") != "nearest";
  if (!part_.textures.emplace(id, std::move(texture)).second)
    refuse("has a second texture with the id " + std::to_string(id));
}

void ThreemfModelReader::readCoordinates(const XmlElement& element) {
  const openvdb::Vec2f coordinates(static_cast<float>(number(element, "u")),
                                   static_cast<float>(1 - number(element, "v")));
  if (!std::isfinite(coordinates.x()) || !std::isfinite(coordinates.y()))
    refuse("tex2coord " + std::to_string(group_->coordinates.size()) + " is not finite");
  group_->coordinates.push_back(coordinates);
}

double ThreemfModelReader::number(const XmlElement& element, std::string_view name) const {
  const std::string_view text = element.attribute(name).value_or("");
  TextCursor words(text);
  const auto value = words.number();
  words.skipBlanks();
  if (!value || !words.atEnd())
    refuse(inWords(element, name) + " " + inQuotes(text) + " is not a number");
  return *value;
}

std::uint32_t ThreemfModelReader::index(const XmlElement& element, std::string_view name) const {
  const std::string_view text = trimmed(element.attribute(name).value_or(""));
  std::uint32_t value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (text.empty() || error != std::errc() || stop != end || value > 0x7FFFFFFF) {
    refuse(inWords(element, name) + " " + inQuotes(text) +
           " is not a whole number from 0 to 2147483647");
  }
  return value;
}

std::uint32_t ThreemfModelReader::indexOr(const XmlElement& element, std::string_view name,
                                          std::uint32_t otherwise) const {
  return element.attribute(name) ? index(element, name) : otherwise;
}

}  // namespace vdbdither
