// OFF, the object file format of Geomview: S. Levy, T. Munzner, M. Phillips, "Geomview Manual", The
// Geometry Center, 1996, chapter "OOGL File Formats". Its text form: a keyword, the counts of
// vertices, faces and edges, a line for each vertex, and a line for each face.

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/mesh/mesh_format.h"
#include "io/mesh/polygon.h"
#include "io/mesh/text_cursor.h"

namespace vdbdither {

namespace {

/// Returns the keyword that `text` starts with, or nothing. Letters in front of OFF announce what
/// vertices have besides a position: texture coordinates, a colour, a normal, more coordinates.
std::string_view offKeyword(std::string_view text) {
  std::size_t length = 0;
  while (!text.substr(length).starts_with("OFF")) {
    const std::string_view rest = text.substr(length);
    if (rest.starts_with("ST")) {
      length += 2;
    } else if (!rest.empty() &&
               std::string_view("CN4n").find(rest.front()) != std::string_view::npos) {
      length += 1;
    } else {
      return {};
    }
  }
  length += 3;
  const bool is_longer =
      length < text.size() && std::isalpha(static_cast<unsigned char>(text[length]));
  return is_longer ? std::string_view() : text.substr(0, length);
}

MeshMatch matchOff(const MeshFile& file) {
  if (!offKeyword(file.start()).empty()) return MeshMatch::signature;
  return file.isText() && file.isNamed(".off") ? MeshMatch::name : MeshMatch::none;
}

class OffReader {
 public:
  explicit OffReader(const MeshFile& file)
      : file_(file), text_(file.text()), polygons_(file, mesh_) {}

  Mesh read() {
    readHeader();
    // What the header says is no reason to allocate: a vertex takes six bytes of text.
    mesh_.vertices.reserve(std::min(vertices_, bytesLeft() / 6 + 1));
    for (std::uint64_t i = 0; i < vertices_; ++i) {
      beginLine("vertex", i + 1);
      readVertex();
    }
    for (std::uint64_t i = 0; i < faces_; ++i) {
      beginLine("face", i + 1);
      readFace();
    }
    polygons_.finish();
    skipToWord();
    if (bytesLeft() > 0)
      file_.warn("ignored " + std::to_string(bytesLeft()) + " bytes after the last face");
    return std::move(mesh_);
  }

 private:
  /// The keyword may be missing, and the counts may follow it at once.
  void readHeader() {
    beginLine("the header", 0);
    const std::string_view rest(text_.position(), bytesLeft());
    const std::string_view keyword = offKeyword(rest);
    if (keyword.find_first_of("4n") != std::string_view::npos)
      refuse("announces vertices that do not have three coordinates");
    text_ = TextCursor(rest.substr(keyword.size()));
    beginLine("the header", 0);
    const auto vertices = wholeNumber();
    const auto faces = wholeNumber();
    if (!vertices || !faces) refuse("must count vertices and faces; binary OFF is not read");
    if (*vertices > 0xFFFFFFFE) refuse("counts more than 4294967294 vertices");
    vertices_ = *vertices;
    faces_ = *faces;
    text_.skipLine();
  }

  void readVertex() {
    const auto x = text_.number();
    const auto y = x ? text_.number() : x;
    const auto z = y ? text_.number() : y;
    if (!z) refuse("must have three coordinates");
    const openvdb::Vec3d position(*x, *y, *z);
    if (!isFinite(position)) refuse("is not finite (" + shown(position) + ")");
    mesh_.vertices.push_back(position);
    text_.skipLine();  // a normal, a colour, texture coordinates
  }

  void readFace() {
    const auto count = wholeNumber();
    if (!count) refuse("must count its corners");
    corners_.clear();
    for (std::uint64_t i = 0; i < *count; ++i) {
      const auto corner = wholeNumber();
      if (!corner) refuse("has fewer corners than it counts");
      if (*corner >= vertices_)
        refuse("has corner " + std::to_string(*corner) + ", but there are " +
               std::to_string(vertices_) + " vertices, counted from 0");
      corners_.push_back(static_cast<std::uint32_t>(*corner));
    }
    polygons_.add(corners_, line_);
    text_.skipLine();  // a colour
  }

  /// Goes to the line of an element, which messages then name.
  /// @param index  counted from 1, or 0 where there is only one
  void beginLine(const char* element, std::uint64_t index) {
    skipToWord();
    line_ = text_.position();
    element_ = element;
    index_ = index;
    if (text_.atEnd()) refuse("is missing: the file is cut off here");
  }

  /// Passes over white space and comments.
  void skipToWord() {
    for (text_.skipSpace(); !text_.atEnd() && *text_.position() == '#'; text_.skipSpace())
      text_.skipLine();
  }

  /// Returns the whole number that is the next word of the line, or nothing.
  std::optional<std::uint64_t> wholeNumber() {
    const std::string_view word = text_.word();
    std::uint64_t value = 0;
    const char* end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, value);
    if (word.empty() || error != std::errc() || stop != end) return std::nullopt;
    return value;
  }

  [[nodiscard]] std::size_t bytesLeft() const {
    return static_cast<std::size_t>(file_.bytes().data() + file_.bytes().size() - text_.position());
  }

  [[noreturn]] void refuse(const std::string& why) const {
    const std::string which = index_ > 0 ? " " + std::to_string(index_) : "";
    file_.refuseAtLine(line_,
                       std::string(element_) + which + " " + why + "; export or download it again");
  }

  const MeshFile& file_;
  TextCursor text_;
  Mesh mesh_;
  PolygonCollector polygons_;
  std::vector<std::uint32_t> corners_;
  std::uint64_t vertices_ = 0;
  std::uint64_t faces_ = 0;
  const char* line_ = nullptr;
  const char* element_ = "";
  std::uint64_t index_ = 0;
};

Mesh readOff(const MeshFile& file) { return OffReader(file).read(); }

class OffEncoder : public IndexedMeshEncoder {
 public:
  explicit OffEncoder(const std::filesystem::path& path) : IndexedMeshEncoder(path) {
    file_.append(header(0, 0));
  }

  void vertex(const MeshVertex& vertex) override {
    for (int axis = 0; axis < 3; ++axis) {
      file_.appendNumber(vertex.position[axis]);
      file_.append(axis < 2 ? " " : "\n");
    }
  }

  void triangle(const Mesh::Triangle& triangle) override {
    faces_.append("3");
    for (const std::uint32_t vertex : triangle) faces_.append(" " + std::to_string(vertex));
    faces_.append("\n");
  }

 protected:
  void finish(std::uint64_t vertices, std::uint64_t triangles) override {
    file_.appendAllOf(faces_);
    const std::string text = header(vertices, triangles);
    file_.patch(0, text.data(), text.size());
  }

 private:
  /// Has the same length for every count.
  static std::string header(std::uint64_t vertices, std::uint64_t triangles) {
    std::string counts = std::to_string(vertices) + " " + std::to_string(triangles) + " 0";
    counts.resize(44, ' ');
    return "OFF\n# vdbdither, mm\n" + counts + "\n";
  }
};

}  // namespace

extern const MeshFormat off;
const MeshFormat off{.name = "OFF",
                     .ending = ".off",
                     .match = matchOff,
                     .read = readOff,
                     .write = makeMeshEncoder<OffEncoder>,
                     .bytes_per_vertex = 72,
                     .us_per_vertex = 0.55};

}  // namespace vdbdither
