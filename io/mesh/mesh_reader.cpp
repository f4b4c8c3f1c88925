#include "io/mesh/mesh_reader.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <fcntl.h>
#include <limits>
#include <sys/mman.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>

#include "io/mesh/mesh_formats.h"
#include "io/mesh/text_cursor.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// A file's bytes, mapped read-only: no copy, and a header that lies costs no memory.
class MappedFile {
 public:
  explicit MappedFile(const std::string& path) {
    // Without O_NONBLOCK a named pipe would block right here.
    const int file = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (file < 0) fail(path, errno == ENOENT ? "no such file" : "cannot be opened: " + reason());
    struct stat status {};
    const bool known = ::fstat(file, &status) == 0;
    size_ = static_cast<std::size_t>(status.st_size);
    if (known && S_ISREG(status.st_mode) && size_ > 0) {
      data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE | MAP_POPULATE, file, 0);
    }
    const std::string error = reason();
    ::close(file);
    if (!known) fail(path, "cannot be read: " + error);
    if (S_ISDIR(status.st_mode))
      fail(path, "a folder; name the meshes in it, as in " +
                     (std::filesystem::path(path) / "*.stl").string());
    if (!S_ISREG(status.st_mode)) {
      fail(path, "a pipe or device; mesh input needs a regular file, save it first");
    }
    if (data_ == MAP_FAILED) fail(path, "cannot be read: " + error);
  }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  ~MappedFile() {
    if (data_ != nullptr) ::munmap(data_, size_);
  }

  [[nodiscard]] std::string_view bytes() const { return {static_cast<const char*>(data_), size_}; }

 private:
  static std::string reason() { return std::generic_category().message(errno); }
  [[noreturn]] static void fail(const std::string& path, const std::string& why) {
    MeshFile(path, {}, {}).refuse(why);
  }

  void* data_ = nullptr;
  std::size_t size_ = 0;
};

struct ForeignFormat {
  std::string_view magic;
  std::string_view name;
};

/// What is met in the place of a mesh and can be named; told by the first bytes.
constexpr std::array foreign_formats{
    ForeignFormat{"PK\x03\x04", "3MF (or another zip archive)"},
    ForeignFormat{"glTF", "binary glTF (.glb)"},
    ForeignFormat{"{", "glTF (.gltf, or other JSON)"},
    ForeignFormat{"DRACO", "Draco (.drc)"},
    ForeignFormat{"OFF", "OFF"},
    ForeignFormat{"COFF", "OFF"},
    ForeignFormat{"NOFF", "OFF"},
    ForeignFormat{"STOFF", "OFF"},
    ForeignFormat{"ISO-10303-21", "STEP"},
};

void dropUnusedVertices(Mesh& mesh) {
  constexpr auto unused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> renamed(mesh.vertices.size(), unused);
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) renamed[vertex] = vertex;
  }
  std::uint32_t kept = 0;
  for (std::uint32_t& vertex : renamed) {
    if (vertex == unused) continue;
    mesh.vertices[kept] = mesh.vertices[vertex];
    vertex = kept++;
  }
  if (kept == mesh.vertices.size()) return;
  mesh.vertices.resize(kept);
  for (Mesh::Triangle& triangle : mesh.triangles) {
    for (std::uint32_t& vertex : triangle) vertex = renamed[vertex];
  }
}

Mesh parseByContent(const MeshFile& file) {
  const std::string_view bytes = file.bytes();
  if (bytes.empty()) file.refuse("the file is empty; export it again");
  if (hasSizeOfBinaryStl(bytes)) return parseBinaryStl(file);
  if (bytes.starts_with("ply\n") || bytes.starts_with("ply\r")) return parsePly(file);

  TextCursor text(bytes.substr(bytes.starts_with("\xEF\xBB\xBF") ? 3 : 0));
  text.skipSpace();
  const std::string_view start(text.position(), bytes.data() + bytes.size());
  for (const ForeignFormat& format : foreign_formats) {
    if (start.starts_with(format.magic)) {
      file.refuse(std::string(format.name) + " is not read yet; export STL, OBJ or PLY");
    }
  }

  const bool is_text = bytes.substr(0, 1024).find('\0') == std::string_view::npos;
  const std::size_t dot = file.name().rfind('.');
  const std::string_view extension =
      dot == std::string::npos ? "" : std::string_view(file.name()).substr(dot);
  if (equalsIgnoringCase(start.substr(0, 5), "solid")) {
    return is_text ? parseAsciiStl(file) : parseBinaryStl(file);
  }
  if (is_text && (looksLikeObj(start) || equalsIgnoringCase(extension, ".obj"))) {
    return parseObj(file);
  }
  if (!is_text && equalsIgnoringCase(extension, ".stl")) return parseBinaryStl(file);
  if (equalsIgnoringCase(extension, ".vdb"))
    file.refuse("a .vdb is no mesh; read takes one of this lattice, resample any other");
  file.refuse("not a mesh in a format that is read; export STL, OBJ or PLY");
}

}  // namespace

void MeshFile::warn(const std::string& what) const {
  if (warn_) warn_(inQuotes(name_) + ": " + what);
}

void MeshFile::warnAtLine(const char* position, const std::string& what) const {
  if (warn_) warn_(inQuotes(name_) + ", line " + lineOf(position) + ": " + what);
}

void MeshFile::refuse(const std::string& why) const {
  throw DataError(inQuotes(name_) + ": " + why);
}

void MeshFile::refuseAtLine(const char* position, const std::string& why) const {
  throw DataError(inQuotes(name_) + ", line " + lineOf(position) + ": " + why);
}

void MeshFile::refuseAtByte(const char* position, const std::string& why) const {
  throw DataError(inQuotes(name_) + ", byte " + std::to_string(position - bytes_.data()) + ": " +
                  why);
}

std::string MeshFile::lineOf(const char* position) const {
  std::size_t line = 1;
  for (const char* at = bytes_.data(); at != position; ++at) {
    line += *at == '\n' || (*at == '\r' && at + 1 != position && at[1] != '\n');
  }
  return std::to_string(line);
}

std::string inQuotes(std::string_view text) {
  constexpr std::size_t longest = 200;
  std::string result = "'";
  for (const char c : text.substr(0, longest)) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
    result += control ? '?' : c;
  }
  return result + (text.size() > longest ? "...'" : "'");
}

std::string shown(const openvdb::Vec3d& position) {
  const auto word = [](double value) {
    if (std::isnan(value)) return std::string("nan");
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.begin(), digits.end(), value).ptr;
    return std::string(digits.begin(), end);
  };
  return word(position.x()) + " " + word(position.y()) + " " + word(position.z());
}

bool isFinite(const openvdb::Vec3d& position) {
  return std::isfinite(position.x()) && std::isfinite(position.y()) && std::isfinite(position.z());
}

Mesh parseMesh(const MeshFile& file) {
  Mesh mesh = parseByContent(file);
  if (mesh.triangles.empty()) file.refuse("holds no triangles; export a surface mesh");
  dropUnusedVertices(mesh);
  return mesh;
}

Mesh readMesh(const std::filesystem::path& path,
              const std::function<void(const std::string&)>& warn) {
  const MappedFile file(path.string());
  return parseMesh(MeshFile(path.string(), file.bytes(), warn));
}

}  // namespace vdbdither
