// Wavefront OBJ: its vertices and polygonal faces, as in appendix B1 of the Advanced Visualizer
// manual (Wavefront Technologies, 1995).

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>

#include "io/mesh/mesh_format.h"
#include "io/mesh/polygon.h"
#include "io/mesh/text_cursor.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// Statements whose argument is a name: a backslash at its end is part of it.
constexpr std::array<std::string_view, 4> naming{"g", "mtllib", "o", "usemtl"};

/// Statements that say nothing of the polygons' shape.
constexpr std::array<std::string_view, 13> immaterial{
    "bevel",      "c_interp",  "d_interp", "l",  "lod", "p", "s",
    "shadow_obj", "trace_obj", "usemap",   "vn", "vp",  "vt"};

template <class Words>
bool contains(const Words& words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

Vec3d parseVertex(const MeshFile& file, const char* line, TextCursor& text) {
  const auto x = text.number();
  const auto y = x ? text.number() : x;
  const auto z = y ? text.number() : y;
  if (!z) {
    const std::string_view word = text.word();
    file.refuseAtLine(line, (word.empty() ? "a vertex has fewer than 3 coordinates"
                                          : inQuotes(word) + " is not a coordinate") +
                                "; repair the line or export again");
  }
  const Vec3d position(*x, *y, *z);
  if (!isFinite(position)) {
    file.refuseAtLine(line, "vertex is not finite (" + shown(position) + "); repair the mesh");
  }
  return position;
}

/// A corner "v", "v/vt", "v//vn" or "v/vt/vn" as the index of its vertex: from 1 up, or from −1
/// down from the latest.
std::uint32_t parseCorner(const MeshFile& file, const char* line, std::string_view corner,
                          std::size_t vertices) {
  std::int64_t index = 0;
  const char* end = corner.data() + corner.size();
  const auto [stop, error] = std::from_chars(corner.data(), end, index);
  if (error == std::errc::invalid_argument || (stop != end && *stop != '/')) {
    file.refuseAtLine(line, inQuotes(corner) + " is not a face corner (v, v/vt, v//vn or v/vt/vn)" +
                                "; repair the line or export again");
  }
  const auto count = static_cast<std::int64_t>(vertices);
  const bool in_range = error == std::errc() && index != 0 && index <= count && index >= -count;
  if (!in_range) {
    file.refuseAtLine(line, "face corner " + inQuotes(corner) +
                                " is out of range: " + std::to_string(vertices) +
                                " vertices so far, counted from 1; export it again");
  }
  return static_cast<std::uint32_t>(index > 0 ? index - 1 : index + count);
}

/// Whether the first statement is one of OBJ's, or there are only comments.
bool looksLikeObj(std::string_view bytes) {
  for (TextCursor text(bytes); !text.atEnd(); text.skipLine()) {
    const std::string_view word = text.word();
    if (word.empty() || word.starts_with('#')) continue;
    return word == "v" || word == "f" || contains(naming, word) || contains(immaterial, word);
  }
  return true;
}

Mesh readObj(const MeshFile& file) {
  Mesh mesh;
  PolygonCollector polygons(file, mesh);
  std::vector<std::uint32_t> corners;
  std::size_t ignored = 0;
  const char* first_ignored = nullptr;
  TextCursor text(file.text());
  for (; !text.atEnd(); text.skipLine()) {
    const char* line = text.position();
    const std::string_view statement = text.word();
    if (statement.empty() || statement.starts_with('#') || contains(naming, statement)) continue;
    if (statement == "v") {
      mesh.vertices.push_back(parseVertex(file, line, text));
    } else if (statement == "f") {
      corners.clear();
      for (auto corner = text.word(); !corner.empty(); corner = text.word()) {
        corners.push_back(parseCorner(file, line, corner, mesh.vertices.size()));
      }
      polygons.add(corners, line);
    } else if (!contains(immaterial, statement) && ignored++ == 0) {
      first_ignored = line;
    }
    // What is left of the line may be continued on the next.
    while (!text.word().empty()) continue;
  }
  polygons.finish();
  if (ignored > 0) {
    file.warnAtLine(first_ignored, "ignored " + std::to_string(ignored) +
                                       " statements that are not polygons, from here on");
  }
  return mesh;
}

MeshMatch matchObj(const MeshFile& file) {
  if (!file.isText()) return MeshMatch::none;
  if (looksLikeObj(file.start())) return MeshMatch::likely;
  return file.isNamed(".obj") ? MeshMatch::name : MeshMatch::none;
}

class ObjEncoder : public IndexedMeshEncoder {
 public:
  explicit ObjEncoder(const std::filesystem::path& path) : IndexedMeshEncoder(path) {
    file_.append("# vdbdither, mm\n");
  }

  void vertex(const MeshVertex& vertex) override {
    file_.append("v");
    for (int axis = 0; axis < 3; ++axis) {
      file_.append(" ");
      file_.appendNumber(vertex.position[axis]);
    }
    file_.append("\n");
  }

  void triangle(const Mesh::Triangle& triangle) override {
    faces_.append("f");
    for (const std::uint32_t vertex : triangle)
      faces_.append(" " + std::to_string(std::uint64_t{vertex} + 1));
    faces_.append("\n");
  }

 protected:
  void finish(std::uint64_t, std::uint64_t) override { file_.appendAllOf(faces_); }
};

}  // namespace

extern const MeshFormat obj;
const MeshFormat obj{.name = "OBJ",
                     .ending = ".obj",
                     .match = matchObj,
                     .read = readObj,
                     .write = makeMeshEncoder<ObjEncoder>,
                     .bytes_per_vertex = 74,
                     .us_per_vertex = 0.55};

}  // namespace vdbdither
