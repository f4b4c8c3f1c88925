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
#include "io/mesh/unread_bytes.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

/// Returns the keyword that `text` starts with, or nothing. Letters in front of OFF announce what
/// vertices have besides a position: texture coordinates, a colour, a normal, more coordinates.
std::string_view offKeyword(std::string_view text) {
  std::size_t length = 0;
  while (!equalsIgnoringCase(text.substr(length, 3), "off")) {
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

/// The text behind the comments and blanks that it starts with.
std::string_view withoutComments(std::string_view text) {
  TextCursor cursor(text, TextCursor::Comments::hash);
  cursor.skipSpace();
  return text.substr(static_cast<std::size_t>(cursor.position() - text.data()));
}

MeshMatch matchOff(const MeshFile& file) {
  if (!offKeyword(withoutComments(file.start())).empty()) return MeshMatch::signature;
  return file.isText() && file.isNamed(".off") ? MeshMatch::name : MeshMatch::none;
}

/// Reads by lines where each line is a vertex or a face, and by words otherwise.
class OffReader {
 public:
  explicit OffReader(const MeshFile& file)
      : file_(file), text_(file.start(), TextCursor::Comments::hash), polygons_(file, mesh_) {}

  Mesh read() {
    readHeader();
    // The count of a header alone must not decide how much is allocated: a vertex takes six bytes.
    mesh_.vertices.reserve(std::min(vertices_, bytesLeft() / 6 + 1));
    by_lines_ = hasLines(vertices_ + faces_);
    for (std::uint64_t i = 0; i < vertices_; ++i) {
      begin("vertex", i + 1);
      readVertex();
    }
    by_lines_ = by_lines_ || hasLines(faces_);
    for (std::uint64_t i = 0; i < faces_; ++i) {
      begin("face", i + 1);
      readFace();
    }
    text_.skipSpace();
    judgeUnread(file_, mesh_, {text_.position(), bytesLeft()}, "the last face");
    polygons_.finish();
    return std::move(mesh_);
  }

 private:
  /// The keyword may be missing, and the counts may follow it at once.
  void readHeader() {
    begin("the header", 0);
    const std::string_view start = withoutComments(file_.start());
    const std::string_view keyword = offKeyword(start);
    if (keyword.find_first_of("4n") != std::string_view::npos)
      refuse("announces vertices that do not have three coordinates");
    const auto has = [&](char letter) { return keyword.find(letter) != std::string_view::npos; };
    more_numbers_ = (has('S') ? 2 : 0) + (has('C') ? 4 : 0) + (has('N') ? 3 : 0);
    text_ = TextCursor(start.substr(keyword.size()), TextCursor::Comments::hash);
    begin("the header", 0);
    by_lines_ = false;
    const auto vertices = wholeNumber();
    const auto faces = wholeNumber();
    by_lines_ = true;
    if (!vertices || !faces) refuse("must count vertices and faces; binary OFF is not read");
    wholeNumber();  // the edges, which may be missing
    vertices_ = *vertices;
    faces_ = *faces;
    if (vertices_ > 0xFFFFFFFE) refuse("counts more than 4294967294 vertices");
    // "0 0 0" and "0", each with a blank, which the last need not have. Of a short file the lines
    // tell better what is wrong.
    const std::uint64_t left = bytesLeft() + 1;
    if (file_.size() > file_.head().size() &&
        (vertices_ > left / 6 || faces_ > (left - 6 * vertices_) / 2))
      refuse("counts " + std::to_string(vertices_) + " vertices and " + std::to_string(faces_) +
             " faces, more than the file holds: it is cut off");
    const std::string_view bytes = file_.bytes();
    text_ = TextCursor(bytes.substr(static_cast<std::size_t>(text_.position() - bytes.data())),
                       TextCursor::Comments::hash);
  }

  void readVertex() {
    const auto x = number();
    const auto y = x ? number() : x;
    const auto z = y ? number() : y;
    if (!z) refuse("must have three coordinates");
    const openvdb::Vec3d position(*x, *y, *z);
    if (!isFinite(position)) refuse("is not finite (" + shown(position) + ")");
    mesh_.vertices.push_back(position);
    skipRest(more_numbers_);  // a normal, a colour, texture coordinates
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
    skipRest(0);  // a colour
  }

  /// Goes to the begin of an element, which messages then name.
  /// @param index  counted from 1, or 0 where there is only one
  void begin(const char* element, std::uint64_t index) {
    constexpr std::uint64_t elements_per_look = 1 << 16;
    if (index % elements_per_look == 0) throwIfInterrupted();
    text_.skipSpace();
    line_ = text_.position();
    element_ = element;
    index_ = index;
    if (text_.atEnd()) refuse("is missing: the file is cut off here");
  }

  /// Ends an element: passes over the rest of its line, or over as many numbers.
  void skipRest(int numbers) {
    if (by_lines_) return text_.skipLine();
    for (; numbers > 0; --numbers)
      if (!number()) refuse("must have what the keyword announces");
  }

  /// Whether the rest of the file has as many lines, without empty ones and comments.
  [[nodiscard]] bool hasLines(std::uint64_t count) const {
    TextCursor text = text_;
    std::uint64_t lines = 0;
    for (text.skipSpace(); !text.atEnd() && lines <= count; text.skipSpace()) {
      text.skipLine();
      ++lines;
    }
    return lines == count;
  }

  /// Returns the next number, of this line if lines matter, or nothing.
  std::optional<double> number() {
    if (!by_lines_) text_.skipSpace();
    return text_.number();
  }

  /// The same for a whole number.
  std::optional<std::uint64_t> wholeNumber() {
    if (!by_lines_) text_.skipSpace();
    TextCursor behind = text_;
    const std::string_view word = behind.word();
    std::uint64_t value = 0;
    const char* end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, value);
    if (word.empty() || error != std::errc() || stop != end) return std::nullopt;
    text_ = behind;
    return value;
  }

  [[nodiscard]] std::size_t bytesLeft() const {
    return static_cast<std::size_t>(file_.head().data() + file_.size() - text_.position());
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
  int more_numbers_ = 0;  ///< of a vertex, as the keyword announces them
  bool by_lines_ = true;
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
