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
#include "io/mesh/ply_colours.h"
#include "io/mesh/ply_header.h"
#include "io/mesh/polygon.h"
#include "io/mesh/text_cursor.h"
#include "io/mesh/unread_bytes.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// Reads the scalars of the body one after another, whatever their encoding. A text is read by
/// lines where each of its lines is an element, and by words otherwise.
class Body {
 public:
  Body(const MeshFile& file, const PlyHeader& header)
      : file_(&file),
        encoding_(header.encoding),
        at_(file.bytes().data() + header.body),
        end_(file.bytes().data() + file.size()),
        text_({at_, end_}),
        by_lines_(isByLines(header)) {}

  /// Starts with element number `index`, counted from 0; messages name it.
  void enter(const PlyElement& element, std::uint64_t index) {
    constexpr std::uint64_t elements_per_look = 1 << 16;
    if (index % elements_per_look == 0) throwIfInterrupted();
    element_ = &element;
    index_ = index;
    if (encoding_ == PlyEncoding::kAscii) skipRemarks(text_);
  }

  /// Ends with the element. Some writers put more on its line than the header declares.
  void leave() {
    if (!by_lines_) return;
    text_.skipBlanks();
    if (text_.atLineEnd()) return;
    if (longer_lines_++ == 0) first_longer_line_ = text_.position();
    text_.skipLine();
  }

  double next(PlyScalar type) {
    if (encoding_ == PlyEncoding::kAscii) return nextNumber();
    if (left() < sizeOf(type)) refuseCutOff();
    switch (type) {
      case PlyScalar::kInt8:
        return take<std::int8_t, std::uint8_t>();
      case PlyScalar::kUint8:
        return take<std::uint8_t, std::uint8_t>();
      case PlyScalar::kInt16:
        return take<std::int16_t, std::uint16_t>();
      case PlyScalar::kUint16:
        return take<std::uint16_t, std::uint16_t>();
      case PlyScalar::kInt32:
        return take<std::int32_t, std::uint32_t>();
      case PlyScalar::kUint32:
        return take<std::uint32_t, std::uint32_t>();
      case PlyScalar::kInt64:
        return static_cast<double>(take<std::int64_t, std::uint64_t>());
      case PlyScalar::kUint64:
        return static_cast<double>(take<std::uint64_t, std::uint64_t>());
      case PlyScalar::kFloat32:
        return take<float, std::uint32_t>();
      case PlyScalar::kFloat64:
        break;
    }
    return take<double, std::uint64_t>();
  }

  /// Reads the length of the list that follows. Throws unless the items fit into the rest of the
  /// file.
  std::uint64_t nextCount(const PlyProperty& list) {
    const double count = next(*list.count_type);
    if (!(count >= 0) || count != std::floor(count)) {
      refuse("the list " + inQuotes(list.name) + " has a length that is no count");
    }
    const std::uint64_t held = left() / (encoding_ == PlyEncoding::kAscii ? 1 : sizeOf(list.type));
    if (count > static_cast<double>(held)) refuseCutOff();
    return static_cast<std::uint64_t>(count);
  }

  void skip(const PlyProperty& property) {
    std::uint64_t count = property.count_type ? nextCount(property) : 1;
    if (encoding_ != PlyEncoding::kAscii) {
      if (left() < count * sizeOf(property.type)) refuseCutOff();
      at_ += count * sizeOf(property.type);
      return;
    }
    for (; count > 0; --count) nextNumber();
  }

  /// Passes over all of `element`.
  void skipAll(const PlyElement& element) {
    for (std::uint64_t i = 0; i < element.count && !element.properties.empty(); ++i) {
      enter(element, i);
      for (const PlyProperty& property : element.properties) skip(property);
      leave();
    }
  }

  /// What follows the last element.
  std::string_view rest() {
    if (encoding_ == PlyEncoding::kAscii) skipRemarks(text_);
    return {position(), end_};
  }

  void warnOfLongerLines() const {
    if (longer_lines_ == 0) return;
    file_->warnAtLine(first_longer_line_, "ignored what " + std::to_string(longer_lines_) +
                                              " lines, from here on, have behind the properties "
                                              "that the header declares");
  }

  [[nodiscard]] const char* position() const {
    return encoding_ == PlyEncoding::kAscii ? text_.position() : at_;
  }

  /// Returns the maximum number of `element` in the rest of the file. The count of a header alone
  /// must not decide how much memory is allocated.
  [[nodiscard]] std::uint64_t atMost(const PlyElement& element) const {
    return std::min(element.count,
                    left() / std::max<std::uint64_t>(element.leastBytes(encoding_), 1) + 1);
  }

  [[noreturn]] void refuse(const std::string& why) const {
    const std::string what = element_->name + " " + std::to_string(index_ + 1) + " of " +
                             std::to_string(element_->count) + ": " + why;
    if (encoding_ == PlyEncoding::kAscii) file_->refuseAtLine(text_.position(), what);
    file_->refuseAtByte(at_, what);
  }

 private:
  /// Goes to the next line that is neither empty nor a comment.
  static void skipRemarks(TextCursor& text) {
    for (;;) {
      text.skipSpace();
      TextCursor ahead = text;
      const std::string_view word = ahead.word();
      if (word != "comment" && word != "obj_info" && !word.starts_with('#')) return;
      text.skipLine();
    }
  }

  /// Whether the text has as many such lines as there are elements.
  [[nodiscard]] bool isByLines(const PlyHeader& header) const {
    if (encoding_ != PlyEncoding::kAscii) return false;
    std::uint64_t elements = 0;
    for (const PlyElement& element : header.elements)
      if (!element.properties.empty()) elements += element.count;
    std::uint64_t lines = 0;
    TextCursor text({at_, end_});
    for (skipRemarks(text); !text.atEnd() && lines <= elements; skipRemarks(text)) {
      text.skipLine();
      ++lines;
    }
    return lines == elements;
  }

  [[nodiscard]] std::uint64_t left() const { return static_cast<std::uint64_t>(end_ - position()); }
  [[noreturn]] void refuseCutOff() const { refuse("cut off here; export or download it again"); }

  double nextNumber() {
    if (by_lines_) {
      text_.skipBlanks();
      if (text_.atLineEnd())
        refuse("its line has fewer numbers than it should; export or download it again");
    } else {
      text_.skipSpace();
      if (text_.atEnd()) refuseCutOff();
    }
    const auto value = text_.number();
    if (!value) refuse(inQuotes(text_.word()) + " is not a number; export it again");
    return *value;
  }

  template <class Value, class Bits>
  Value take() {
    const std::uint64_t bits = bitsAt(at_, sizeof(Bits), encoding_);
    at_ += sizeof(Bits);
    return std::bit_cast<Value>(static_cast<Bits>(bits));
  }

  const MeshFile* file_;
  PlyEncoding encoding_;
  const char* at_;
  const char* end_;
  TextCursor text_;
  bool by_lines_;
  const PlyElement* element_ = nullptr;
  std::uint64_t index_ = 0;
  std::uint64_t longer_lines_ = 0;
  const char* first_longer_line_ = nullptr;
};

class BodyParser {
 public:
  BodyParser(const MeshFile& file, const PlyHeader& header)
      : file_(file), body_(file, header), polygons_(file, mesh_) {
    if (!file.wantsColours()) return;
    colours_.emplace(file, header);
    polygons_.keepPlaces();
  }

  Mesh parse(const PlyHeader& header) {
    const auto vertices =
        std::find_if(header.elements.begin(), header.elements.end(),
                     [](const PlyElement& element) { return element.name == "vertex"; });
    std::vector<std::pair<const PlyElement*, Body>> waiting;  // faces before their vertices
    for (auto element = header.elements.begin(); element != header.elements.end(); ++element) {
      if (element == vertices) {
        parseVertices(*element);
        const Body after = body_;
        for (const auto& [faces, body] : waiting) {
          body_ = body;
          parseFaces(*faces);
        }
        body_ = after;
      } else if (isFaces(*element) && element < vertices && vertices != header.elements.end()) {
        waiting.emplace_back(&*element, body_);
        body_.skipAll(*element);
      } else if (isFaces(*element)) {
        parseFaces(*element);
      } else {
        body_.skipAll(*element);
      }
    }
    body_.warnOfLongerLines();
    judgeUnread(file_, mesh_, body_.rest(), "the last element");
    polygons_.finish();
    if (colours_) mesh_.appearance = colours_->finish(mesh_);
    return std::move(mesh_);
  }

 private:
  static constexpr std::uint32_t restart = 0xFFFFFFFF;

  static bool isFaces(const PlyElement& element) {
    return element.name == "face" || element.name == "tristrips";
  }

  void parseVertices(const PlyElement& element) {
    const std::array<int, 3> axes{element.find({"x"}), element.find({"y"}), element.find({"z"})};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (axes[axis] < 0 || element.properties[static_cast<std::size_t>(axes[axis])].count_type) {
        file_.refuse(std::string("the vertices have no scalar property '") + "xyz"[axis] +
                     "'; export it again");
      }
    }
    if (element.count >= restart) file_.refuse("more than 4294967294 vertices; split the part");
    mesh_.vertices.reserve(body_.atMost(element));
    if (colours_) colours_->begin(element);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body_.enter(element, i);
      Vec3d position(0.0);
      for (int p = 0; p < static_cast<int>(element.properties.size()); ++p) {
        const auto axis = std::find(axes.begin(), axes.end(), p);
        const PlyProperty& property = element.properties[static_cast<std::size_t>(p)];
        if (axis == axes.end()) {
          takeOrSkip(p, property);
        } else {
          position[static_cast<int>(axis - axes.begin())] = body_.next(property.type);
        }
      }
      if (!isFinite(position)) {
        body_.refuse("the vertex is not finite (" + shown(position) + "); repair the mesh");
      }
      mesh_.vertices.push_back(position);
      if (colours_) colours_->endVertex();
      body_.leave();
    }
  }

  void parseFaces(const PlyElement& element) {
    const bool are_strips = element.name == "tristrips";
    if (element.count == 0) return;
    const int list = element.find({"vertex_indices", "vertex_index"});
    if (list < 0 || !element.properties[static_cast<std::size_t>(list)].count_type) {
      file_.refuse("element '" + element.name + "' has no list 'vertex_indices'; export it again");
    }
    if (colours_) colours_->begin(element);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body_.enter(element, i);
      const char* position = body_.position();
      for (int p = 0; p < static_cast<int>(element.properties.size()); ++p) {
        const PlyProperty& property = element.properties[static_cast<std::size_t>(p)];
        if (p == list) {
          parseCorners(property, are_strips);
        } else {
          takeOrSkip(p, property);
        }
      }
      const std::size_t before = mesh_.triangles.size();
      if (are_strips) {
        addStrips();
      } else {
        polygons_.add(corners_, position);
      }
      if (colours_)
        colours_->endFace(polygons_.places(), corners_.size(), mesh_.triangles.size() - before);
      body_.leave();
    }
  }

  /// A property of number `p` that is not of the shape.
  void takeOrSkip(int p, const PlyProperty& property) {
    const auto number = static_cast<std::size_t>(p);
    if (!colours_ || !colours_->takes(number)) return body_.skip(property);
    std::uint64_t count = property.count_type ? body_.nextCount(property) : 1;
    for (; count > 0; --count) colours_->take(number, body_.next(property.type));
  }

  void parseCorners(const PlyProperty& list, bool with_restarts) {
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
                     " vertices, counted from 0; export it again");
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

  const MeshFile& file_;
  Body body_;
  Mesh mesh_;
  PolygonCollector polygons_;
  std::optional<PlyColours> colours_;  ///< where they are wanted
  std::vector<std::uint32_t> corners_;
};

Mesh readPly(const MeshFile& file) {
  const PlyHeader header = parsePlyHeader(file);
  return BodyParser(file, header).parse(header);
}

MeshMatch matchPly(const MeshFile& file) {
  TextCursor text(file.head());
  const bool is_ply = text.word() == "ply" && text.position() == file.head().data() + 3;
  text.skipBlanks();
  return is_ply && text.atLineEnd() && !text.atEnd() ? MeshMatch::signature : MeshMatch::none;
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
