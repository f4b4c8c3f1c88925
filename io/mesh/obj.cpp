// Wavefront OBJ: its vertices and polygonal faces, groups and materials, as in appendix B1 of the
// Advanced Visualizer manual (Wavefront Technologies, 1995). Colours behind the position of a
// vertex are not in it; many programs write them.

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "io/mesh/mesh_format.h"
#include "io/mesh/obj_colours.h"
#include "io/mesh/polygon.h"
#include "io/mesh/text_cursor.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// Statements whose argument is a name: a backslash at its end is part of it.
constexpr std::array<std::string_view, 4> naming{"g", "mtllib", "o", "usemtl"};

/// Statements that say nothing of the polygons' shape.
constexpr std::array<std::string_view, 13> immaterial{
    "bevel",      "c_interp",  "d_interp", "l",  "lod", "p", "s",
    "shadow_obj", "trace_obj", "usemap",   "vn", "vp",  "vt"};

/// "fo" is what a face was called before version 2.11.
bool isFace(std::string_view statement) { return statement == "f" || statement == "fo"; }

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

/// Whether the first statement is one of OBJ's, or there are only comments.
bool looksLikeObj(std::string_view bytes) {
  for (TextCursor text(bytes, TextCursor::Comments::hash); !text.atEnd(); text.skipLine()) {
    const std::string_view word = text.word();
    if (word.empty()) continue;
    return word == "v" || isFace(word) || contains(naming, word) || contains(immaterial, word);
  }
  return true;
}

/// The names under which triangles stand, as parts of a mesh.
class NamedRuns {
 public:
  /// The triangles from `triangle` on are called `name`, up to the next call.
  void begin(std::string_view name, std::size_t triangle) {
    if (!runs_.empty() && runs_.back().second == triangle) runs_.pop_back();
    if (!runs_.empty() && runs_.back().first == name) return;
    runs_.emplace_back(name, triangle);
  }

  /// The parts, if there are several and each has all triangles of its name.
  /// @param triangles  of the mesh
  [[nodiscard]] std::vector<MeshPart> parts(std::size_t triangles) const {
    std::set<std::string_view> names;
    std::vector<MeshPart> parts;
    for (const auto& [name, begin] : runs_) {
      if (begin == triangles) break;
      if (!names.insert(name).second) return {};
      parts.push_back({std::string(name), static_cast<std::uint32_t>(begin)});
    }
    if (parts.size() < 2) parts.clear();
    return parts;
  }

 private:
  std::vector<std::pair<std::string_view, std::size_t>> runs_;
};

class ObjReader {
 public:
  explicit ObjReader(const MeshFile& file)
      : file_(file), polygons_(file, mesh_), text_(file.text(), TextCursor::Comments::hash) {
    if (!file.wantsColours()) return;
    colours_.emplace(file);
    polygons_.keepPlaces();
  }

  Mesh read() {
    constexpr std::size_t lines_per_look = 1 << 16;
    for (std::size_t line = 0; !text_.atEnd(); text_.skipLine()) {
      if (++line % lines_per_look == 0) throwIfInterrupted();
      readStatement();
    }
    addWaitingFaces();
    polygons_.finish();
    if (ignored_ > 0) {
      file_.warnAtLine(first_ignored_, "ignored " + std::to_string(ignored_) +
                                           " statements that are not polygons, from here on");
    }
    mesh_.parts = objects_.parts(mesh_.triangles.size());
    if (mesh_.parts.empty()) mesh_.parts = groups_.parts(mesh_.triangles.size());
    if (colours_) mesh_.appearance = colours_->finish(mesh_);
    return std::move(mesh_);
  }

 private:
  /// What the statements before a face say of it.
  struct Look {
    std::string_view object = "default";
    std::string_view group = "default";
    std::uint32_t material = ObjColours::default_material;
    bool operator==(const Look&) const = default;
  };
  /// A face that names vertices which the file has further on.
  struct WaitingFace {
    const char* line;
    std::size_t end;  ///< of its corners, in waiting_corners_
    Look look;
  };

  void readStatement() {
    const char* line = text_.position();
    const std::string_view statement = text_.word();
    if (statement.empty()) return;
    if (contains(naming, statement)) return readName(statement);
    if (statement == "v") {
      mesh_.vertices.push_back(parseVertex(file_, line, text_));
      if (colours_) colours_->addVertex(mesh_.vertices.size() - 1, text_);
    } else if (isFace(statement)) {
      readFace(line);
    } else if (colours_ && statement == "vt") {
      colours_->addCoordinates(line, text_);
    } else if (!contains(immaterial, statement) && ignored_++ == 0) {
      first_ignored_ = line;
    }
    // What is left of the line may be continued on the next.
    while (!text_.word().empty()) continue;
  }

  void readName(std::string_view statement) {
    const std::string_view rest = text_.line();
    if (statement == "mtllib") {
      if (colours_) colours_->addLibraries(rest);
      return;
    }
    const std::string_view name = mtlName(rest.substr(0, rest.find('#')));
    if (statement == "usemtl") {
      if (colours_) look_.material = colours_->materialNamed(name);
    } else if (statement == "o") {
      look_.object = name;
    } else {
      look_.group = name.empty() ? "default" : name;
    }
  }

  void readFace(const char* line) {
    corners_.clear();
    coordinates_.clear();
    bool waits = !waiting_.empty();
    for (auto word = text_.word(); !word.empty(); word = text_.word()) {
      corners_.push_back(parseCorner(line, word));
      if (colours_) coordinates_.push_back(colours_->coordinatesOf(word));
      waits = waits || corners_.back() >= mesh_.vertices.size();
    }
    if (!waits) return addFace(corners_, coordinates_, look_, line);
    waiting_corners_.insert(waiting_corners_.end(), corners_.begin(), corners_.end());
    waiting_coordinates_.insert(waiting_coordinates_.end(), coordinates_.begin(),
                                coordinates_.end());
    waiting_.push_back({line, waiting_corners_.size(), look_});
  }

  void addFace(std::span<const std::uint32_t> corners, std::span<const std::uint32_t> coordinates,
               const Look& look, const char* line) {
    if (look != begun_) {
      objects_.begin(look.object, mesh_.triangles.size());
      groups_.begin(look.group, mesh_.triangles.size());
      begun_ = look;
    }
    polygons_.add(corners, line);
    if (colours_) colours_->addFace(polygons_.places(), coordinates, look.material);
  }

  /// A corner "v", "v/vt", "v//vn" or "v/vt/vn" as the index of its vertex: from 1 up, or from −1
  /// down from the latest.
  [[nodiscard]] std::uint32_t parseCorner(const char* line, std::string_view corner) const {
    std::int64_t index = 0;
    const char* end = corner.data() + corner.size();
    const auto [stop, error] = std::from_chars(corner.data(), end, index);
    if (error == std::errc::invalid_argument || (stop != end && *stop != '/')) {
      file_.refuseAtLine(line, inQuotes(corner) +
                                   " is not a face corner (v, v/vt, v//vn or v/vt/vn)" +
                                   "; repair the line or export again");
    }
    constexpr std::int64_t maximum = 0xFFFFFFFF;
    const auto count = static_cast<std::int64_t>(mesh_.vertices.size());
    if (error != std::errc() || index == 0 || index > maximum || index < -count) {
      file_.refuseAtLine(line, "face corner " + inQuotes(corner) +
                                   " is out of range: " + std::to_string(mesh_.vertices.size()) +
                                   " vertices so far, counted from 1; export it again");
    }
    return static_cast<std::uint32_t>(index > 0 ? index - 1 : index + count);
  }

  void addWaitingFaces() {
    std::size_t begin = 0;
    for (const WaitingFace& face : waiting_) {
      const std::span corners(waiting_corners_.data() + begin, face.end - begin);
      for (const std::uint32_t corner : corners) {
        if (corner < mesh_.vertices.size()) continue;
        file_.refuseAtLine(face.line, "face corner '" + std::to_string(std::uint64_t{corner} + 1) +
                                          "' is out of range: the file has " +
                                          std::to_string(mesh_.vertices.size()) +
                                          " vertices, counted from 1; export it again");
      }
      const std::size_t count = colours_ ? corners.size() : 0;
      addFace(corners, {waiting_coordinates_.data() + (colours_ ? begin : 0), count}, face.look,
              face.line);
      begin = face.end;
    }
  }

  const MeshFile& file_;
  Mesh mesh_;
  PolygonCollector polygons_;
  TextCursor text_;
  std::vector<std::uint32_t> corners_;
  std::vector<WaitingFace> waiting_;
  std::vector<std::uint32_t> waiting_corners_;
  std::optional<ObjColours> colours_;               ///< where they are wanted
  std::vector<std::uint32_t> coordinates_;          ///< by corner, of textures
  std::vector<std::uint32_t> waiting_coordinates_;  ///< by waiting corner
  Look look_;
  std::optional<Look> begun_;  ///< of the triangle before
  NamedRuns objects_;
  NamedRuns groups_;
  std::size_t ignored_ = 0;
  const char* first_ignored_ = nullptr;
};

Mesh readObj(const MeshFile& file) { return ObjReader(file).read(); }

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
