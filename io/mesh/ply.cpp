// PLY, the Stanford polygon file format: Greg Turk, "The PLY Polygon File Format", 1994.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/mesh/mesh_format.h"
#include "io/mesh/polygon.h"
#include "io/mesh/text_cursor.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

enum class Scalar { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };
enum class Encoding { kAscii, kLittleEndian, kBigEndian };

std::size_t sizeOf(Scalar type) {
  constexpr std::array<std::size_t, 8> sizes{1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<std::size_t>(type)];
}

struct Property {
  std::string name;
  Scalar type = Scalar::kFloat32;
  std::optional<Scalar> count_type;  ///< set for a list
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;

  /// The position of the property with one of these names, or −1.
  [[nodiscard]] int find(std::initializer_list<std::string_view> names) const {
    for (std::size_t i = 0; i < properties.size(); ++i) {
      if (std::find(names.begin(), names.end(), properties[i].name) != names.end()) {
        return static_cast<int>(i);
      }
    }
    return -1;
  }
};

struct Header {
  Encoding encoding = Encoding::kAscii;
  std::vector<Element> elements;
  std::string_view body;
};

class HeaderParser {
 public:
  explicit HeaderParser(const MeshFile& file) : file_(file), text_(file.bytes()) {}

  Header parse() {
    text_.skipLine();
    bool has_format = false;
    for (;; text_.skipLine()) {
      line_ = text_.position();
      if (text_.atEnd()) refuse("cut off: the header has no 'end_header'; export it again");
      const std::string_view keyword = text_.word();
      if (keyword == "format") {
        header_.encoding = parseEncoding();
        has_format = true;
      } else if (keyword == "element") {
        parseElement();
      } else if (keyword == "property") {
        parseProperty();
      } else if (keyword == "end_header") {
        break;
      } else if (!keyword.empty() && keyword != "comment" && keyword != "obj_info") {
        refuse(inQuotes(keyword) + " is no keyword of a PLY header; export it again");
      }
    }
    if (!has_format) refuse("the header has no 'format'; export it again");
    header_.body = file_.bytes().substr(bodyOffset());
    return std::move(header_);
  }

 private:
  [[noreturn]] void refuse(const std::string& why) const { file_.refuseAtLine(line_, why); }

  Encoding parseEncoding() {
    const std::string_view name = text_.word();
    if (text_.word() == "1.0") {
      if (name == "ascii") return Encoding::kAscii;
      if (name == "binary_little_endian") return Encoding::kLittleEndian;
      if (name == "binary_big_endian") return Encoding::kBigEndian;
    }
    refuse(
        "the format is not 'ascii 1.0', 'binary_little_endian 1.0' or 'binary_big_endian 1.0'; "
        "export it again");
  }

  void parseElement() {
    Element element;
    element.name = text_.word();
    const std::string_view count = text_.word();
    const char* end = count.data() + count.size();
    const auto [stop, error] = std::from_chars(count.data(), end, element.count);
    if (count.empty() || error != std::errc() || stop != end) {
      refuse("element " + inQuotes(element.name) + " has no count; export it again");
    }
    for (const Element& other : header_.elements) {
      if (other.name == element.name) {
        refuse("element " + inQuotes(element.name) + " is declared twice; export it again");
      }
    }
    header_.elements.push_back(std::move(element));
  }

  void parseProperty() {
    if (header_.elements.empty()) refuse("a property before any element; export it again");
    Property property;
    std::string_view type = text_.word();
    if (type == "list") {
      property.count_type = parseScalar(text_.word());
      type = text_.word();
    }
    property.type = parseScalar(type);
    property.name = text_.word();
    if (property.name.empty()) refuse("a property has no name; export it again");
    header_.elements.back().properties.push_back(std::move(property));
  }

  [[nodiscard]] Scalar parseScalar(std::string_view name) const {
    constexpr std::array<std::array<std::string_view, 2>, 8> names{{{"char", "int8"},
                                                                    {"uchar", "uint8"},
                                                                    {"short", "int16"},
                                                                    {"ushort", "uint16"},
                                                                    {"int", "int32"},
                                                                    {"uint", "uint32"},
                                                                    {"float", "float32"},
                                                                    {"double", "float64"}}};
    for (std::size_t type = 0; type < names.size(); ++type) {
      if (name == names[type][0] || name == names[type][1]) return static_cast<Scalar>(type);
    }
    refuse(inQuotes(name) + " is no scalar type of PLY; export it again");
  }

  /// The body may itself start with a byte that looks like the end of a line, so the one that ends
  /// the header is taken to be of the kind that ends the first line.
  [[nodiscard]] std::size_t bodyOffset() const {
    const std::string_view bytes = file_.bytes();
    const auto end = static_cast<std::size_t>(text_.position() - bytes.data());
    const bool two_bytes = bytes.starts_with("ply\r\n") && bytes.substr(end, 2) == "\r\n";
    return std::min(end + (two_bytes ? 2 : 1), bytes.size());
  }

  const MeshFile& file_;
  TextCursor text_;
  const char* line_ = nullptr;
  Header header_;
};

/// Reads the scalars of the body one after another, whatever their encoding.
class Body {
 public:
  Body(const MeshFile& file, Encoding encoding, std::string_view bytes)
      : file_(file),
        encoding_(encoding),
        at_(bytes.data()),
        end_(bytes.data() + bytes.size()),
        text_(bytes) {}

  /// Starts with element number `index`, counted from 0; messages name it.
  void enter(const Element& element, std::uint64_t index) {
    element_ = &element;
    index_ = index;
  }

  double next(Scalar type) {
    if (encoding_ == Encoding::kAscii) return nextNumber();
    if (static_cast<std::size_t>(end_ - at_) < sizeOf(type)) refuseCutOff();
    switch (type) {
      case Scalar::kInt8:
        return take<std::int8_t, std::uint8_t>();
      case Scalar::kUint8:
        return take<std::uint8_t, std::uint8_t>();
      case Scalar::kInt16:
        return take<std::int16_t, std::uint16_t>();
      case Scalar::kUint16:
        return take<std::uint16_t, std::uint16_t>();
      case Scalar::kInt32:
        return take<std::int32_t, std::uint32_t>();
      case Scalar::kUint32:
        return take<std::uint32_t, std::uint32_t>();
      case Scalar::kFloat32:
        return take<float, std::uint32_t>();
      case Scalar::kFloat64:
        break;
    }
    return take<double, std::uint64_t>();
  }

  /// The length of the list that follows; its items are known to fit into what is left of the file.
  std::uint64_t nextCount(const Property& list) {
    const double count = next(*list.count_type);
    if (!(count >= 0) || count != std::floor(count)) {
      refuse("the list " + inQuotes(list.name) + " has a length that is no count");
    }
    const std::uint64_t held = left() / (encoding_ == Encoding::kAscii ? 1 : sizeOf(list.type));
    if (count > static_cast<double>(held)) refuseCutOff();
    return static_cast<std::uint64_t>(count);
  }

  void skip(const Property& property) {
    std::uint64_t count = property.count_type ? nextCount(property) : 1;
    if (encoding_ != Encoding::kAscii) {
      if (left() < count * sizeOf(property.type)) refuseCutOff();
      at_ += count * sizeOf(property.type);
      return;
    }
    for (; count > 0; --count) nextNumber();
  }

  /// Passes over all of `element`.
  void skipAll(const Element& element) {
    for (std::uint64_t i = 0; i < element.count && !element.properties.empty(); ++i) {
      enter(element, i);
      for (const Property& property : element.properties) skip(property);
    }
  }

  void warnOfRest() {
    if (encoding_ == Encoding::kAscii) text_.skipSpace();
    if (left() > 0) {
      file_.warn("ignored " + std::to_string(left()) + " bytes after the last element");
    }
  }

  [[nodiscard]] const char* position() const {
    return encoding_ == Encoding::kAscii ? text_.position() : at_;
  }

  /// How many of `element` there can be in the rest of the file: what a header says is no reason to
  /// allocate.
  [[nodiscard]] std::uint64_t atMost(const Element& element) const {
    std::uint64_t least = 0;
    for (const Property& property : element.properties) {
      least +=
          encoding_ == Encoding::kAscii ? 1 : sizeOf(property.count_type.value_or(property.type));
    }
    return std::min(element.count, left() / std::max<std::uint64_t>(least, 1));
  }

  [[noreturn]] void refuse(const std::string& why) const {
    const std::string what = element_->name + " " + std::to_string(index_ + 1) + " of " +
                             std::to_string(element_->count) + ": " + why;
    if (encoding_ == Encoding::kAscii) file_.refuseAtLine(text_.position(), what);
    file_.refuseAtByte(at_, what);
  }

 private:
  [[nodiscard]] std::uint64_t left() const { return static_cast<std::uint64_t>(end_ - position()); }
  [[noreturn]] void refuseCutOff() const { refuse("cut off here; export or download it again"); }

  double nextNumber() {
    text_.skipSpace();
    if (text_.atEnd()) refuseCutOff();
    const auto value = text_.number();
    if (!value) refuse(inQuotes(text_.word()) + " is not a number; export it again");
    return *value;
  }

  template <class Value, class Bits>
  Value take() {
    std::uint64_t bits = 0;
    for (std::size_t byte = 0; byte < sizeof(Bits); ++byte) {
      const std::uint64_t value = static_cast<unsigned char>(at_[byte]);
      const std::size_t rank =
          encoding_ == Encoding::kLittleEndian ? byte : sizeof(Bits) - 1 - byte;
      bits |= value << 8 * rank;
    }
    at_ += sizeof(Bits);
    return std::bit_cast<Value>(static_cast<Bits>(bits));
  }

  const MeshFile& file_;
  Encoding encoding_;
  const char* at_;
  const char* end_;
  TextCursor text_;
  const Element* element_ = nullptr;
  std::uint64_t index_ = 0;
};

class BodyParser {
 public:
  BodyParser(const MeshFile& file, const Header& header)
      : body_(file, header.encoding, header.body), polygons_(file, mesh_) {}

  Mesh parse(const MeshFile& file, const Header& header) {
    for (const Element& element : header.elements) {
      if (element.name == "vertex") {
        parseVertices(file, element);
      } else if (element.name == "face") {
        parseLists(file, element,
                   [this](const char* position) { polygons_.add(corners_, position); });
      } else if (element.name == "tristrips") {
        parseLists(file, element, [this](const char*) { addStrips(); });
      } else {
        body_.skipAll(element);
      }
    }
    body_.warnOfRest();
    polygons_.finish();
    return std::move(mesh_);
  }

 private:
  static constexpr std::uint32_t restart = 0xFFFFFFFF;

  void parseVertices(const MeshFile& file, const Element& element) {
    const std::array<int, 3> axes{element.find({"x"}), element.find({"y"}), element.find({"z"})};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (axes[axis] < 0 || element.properties[static_cast<std::size_t>(axes[axis])].count_type) {
        file.refuse(std::string("the vertices have no scalar property '") + "xyz"[axis] +
                    "'; export it again");
      }
    }
    if (element.count >= restart) file.refuse("more than 4294967294 vertices; split the part");
    mesh_.vertices.reserve(body_.atMost(element));
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body_.enter(element, i);
      Vec3d position(0.0);
      for (int p = 0; p < static_cast<int>(element.properties.size()); ++p) {
        const auto axis = std::find(axes.begin(), axes.end(), p);
        const Property& property = element.properties[static_cast<std::size_t>(p)];
        if (axis == axes.end()) {
          body_.skip(property);
        } else {
          position[static_cast<int>(axis - axes.begin())] = body_.next(property.type);
        }
      }
      if (!isFinite(position)) {
        body_.refuse("the vertex is not finite (" + shown(position) + "); repair the mesh");
      }
      mesh_.vertices.push_back(position);
    }
  }

  template <class Add>
  void parseLists(const MeshFile& file, const Element& element, const Add& add) {
    if (element.count == 0) return;
    const int list = element.find({"vertex_indices", "vertex_index"});
    if (list < 0 || !element.properties[static_cast<std::size_t>(list)].count_type) {
      file.refuse("element '" + element.name + "' has no list 'vertex_indices'; export it again");
    }
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body_.enter(element, i);
      const char* position = body_.position();
      for (int p = 0; p < static_cast<int>(element.properties.size()); ++p) {
        const Property& property = element.properties[static_cast<std::size_t>(p)];
        if (p == list) {
          parseCorners(property, element.name == "tristrips");
        } else {
          body_.skip(property);
        }
      }
      add(position);
    }
  }

  void parseCorners(const Property& list, bool with_restarts) {
    corners_.clear();
    for (std::uint64_t count = body_.nextCount(list); count > 0; --count) {
      const double index = body_.next(list.type);
      if (with_restarts && index == -1) {
        corners_.push_back(restart);
        continue;
      }
      if (!(index >= 0) || index >= static_cast<double>(mesh_.vertices.size()) ||
          index != std::floor(index)) {
        body_.refuse("a vertex index is out of range: " + std::to_string(mesh_.vertices.size()) +
                     " vertices before the faces, counted from 0; export it again");
      }
      corners_.push_back(static_cast<std::uint32_t>(index));
    }
  }

  /// Every corner from the third of a strip on makes a triangle with the two before, every second
  /// one turned around.
  void addStrips() {
    std::size_t start = 0;
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      if (corners_[i] == restart) start = i + 1;
      if (i < start + 2) continue;
      const std::uint32_t a = corners_[i - 2];
      const std::uint32_t b = corners_[i - 1];
      const std::uint32_t c = corners_[i];
      if (a == b || b == c || c == a) continue;  // stitches, without area
      if ((i - start) % 2 == 0) {
        mesh_.triangles.push_back({a, b, c});
      } else {
        mesh_.triangles.push_back({b, a, c});
      }
    }
  }

  Body body_;
  Mesh mesh_;
  PolygonCollector polygons_;
  std::vector<std::uint32_t> corners_;
};

Mesh readPly(const MeshFile& file) {
  const Header header = HeaderParser(file).parse();
  return BodyParser(file, header).parse(file, header);
}

MeshMatch matchPly(const MeshFile& file) {
  const std::string_view bytes = file.bytes();
  const bool is_ply = bytes.starts_with("ply\n") || bytes.starts_with("ply\r");
  return is_ply ? MeshMatch::signature : MeshMatch::none;
}

/// Binary and little-endian.
class PlyEncoder : public IndexedMeshEncoder {
 public:
  PlyEncoder(const std::filesystem::path& path, VertexExtras extras)
      : IndexedMeshEncoder(path), extras_(std::move(extras)) {
    file_.append(header(0, 0));
  }

  void vertex(const MeshVertex& vertex) override {
    file_.appendValue(vertex.position);
    if (extras_.colour) file_.appendValue(vertex.colour);
    if (extras_.quality) file_.appendValue(vertex.quality);
  }

  void triangle(const Mesh::Triangle& triangle) override {
    faces_.appendValue(std::uint8_t{3});
    faces_.appendValue(triangle);
  }

 protected:
  void finish(std::uint64_t vertices, std::uint64_t triangles) override {
    file_.appendAllOf(faces_);
    const std::string text = header(vertices, triangles);
    file_.patch(0, text.data(), text.size());
  }

 private:
  /// Of the same length for every count.
  [[nodiscard]] std::string header(std::uint64_t vertices, std::uint64_t triangles) const {
    const std::string vertex_count = std::to_string(vertices);
    const std::string face_count = std::to_string(triangles);
    constexpr std::size_t digits = 20;
    std::string text = "ply\nformat binary_little_endian 1.0\ncomment vdbdither, mm";
    text.append(2 * digits - vertex_count.size() - face_count.size(), ' ');
    text += "\n";
    if (!extras_.comment.empty()) text += "comment " + extras_.comment + "\n";
    text += "element vertex " + vertex_count +
            "\nproperty float x\nproperty float y\nproperty float z\n";
    if (extras_.colour) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    if (extras_.quality) text += "property float quality\n";
    return text + "element face " + face_count +
           "\nproperty list uchar int vertex_indices\nend_header\n";
  }

  VertexExtras extras_;
};

}  // namespace

extern const MeshFormat ply;
const MeshFormat ply{.name = "PLY",
                     .ending = ".ply",
                     .match = matchPly,
                     .read = readPly,
                     .write = makeMeshEncoder<PlyEncoder>,
                     .holds_extras = true,
                     .most = std::numeric_limits<std::int32_t>::max(),
                     .bytes_per_vertex = 38,
                     .us_per_vertex = 0.2};

}  // namespace vdbdither
