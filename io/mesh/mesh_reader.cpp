#include "io/mesh/mesh_reader.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <fcntl.h>
#include <limits>
#include <sys/mman.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>

#include "io/mesh/mesh_format.h"

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

/// What is met in the place of a mesh and can be named, told by its first bytes.
constexpr std::array foreign_formats{
    ForeignFormat{"PK\x03\x04", "3MF (or another zip archive)"},
    ForeignFormat{"glTF", "binary glTF (.glb)"},
    ForeignFormat{"{", "glTF (.gltf, or other JSON)"},
    ForeignFormat{"DRACO", "Draco (.drc)"},
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

const ForeignFormat* foreignFormatOf(const MeshFile& file) {
  const auto* const found =
      std::find_if(foreign_formats.begin(), foreign_formats.end(),
                   [&](const auto& foreign) { return file.start().starts_with(foreign.magic); });
  return found == foreign_formats.end() ? nullptr : found;
}

const MeshFormat& formatOf(const MeshFile& file) {
  if (file.bytes().empty()) file.refuse("the file is empty; export it again");
  const MeshFormat* best = nullptr;
  MeshMatch surest = MeshMatch::none;
  for (const MeshFormat* format : meshFormats()) {
    const MeshMatch match = format->match(file);
    if (match <= surest) continue;
    surest = match;
    best = format;
  }
  const ForeignFormat* foreign = surest < MeshMatch::signature ? foreignFormatOf(file) : nullptr;
  if (foreign != nullptr)
    file.refuse(std::string(foreign->name) + " is not read yet; export " + meshFormatNames());
  if (best != nullptr) return *best;
  if (file.isNamed(".vdb"))
    file.refuse("a .vdb is no mesh; read takes one of this lattice, resample any other");
  file.refuse("not a mesh in a format that is read; export " + meshFormatNames());
}

}  // namespace

Mesh parseMesh(const MeshFile& file) {
  Mesh mesh = formatOf(file).read(file);
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
