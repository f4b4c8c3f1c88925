#include "io/mesh/mesh_reader.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "io/mesh/file_bytes.h"
#include "io/mesh/mesh_format.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

struct ForeignFormat {
  std::string_view magic;
  std::string_view name;
};

/// Other kinds of files that can be recognized by their first bytes, for the message.
constexpr std::array foreign_formats{
    ForeignFormat{"\xFF\xFE", "text in UTF-16"},
    ForeignFormat{"\xFE\xFF", "text in UTF-16"},
    ForeignFormat{"\x1F\x8B", "a gzip archive"},
    ForeignFormat{"<?xml", "XML (AMF, COLLADA or X3D)"},
    ForeignFormat{"#VRML", "VRML"},
    ForeignFormat{"# vtk", "VTK"},
    ForeignFormat{"Kaydara FBX", "FBX"},
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
  if (file.size() == 0) file.refuse("the file is empty; export it again");
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
  const MeshFormat& format = formatOf(file);
  Mesh mesh = format.read(file);
  mesh.states_unit = format.states_unit;
  if (mesh.triangles.empty()) file.refuse("holds no triangles; export a surface mesh");
  dropUnusedVertices(mesh);
  return mesh;
}

void checkUnit(const Mesh& mesh, const std::filesystem::path& path,
               const MeshPlacementOptions& placement) {
  if (!mesh.states_unit || placement.unit == LengthUnit::mm || placement.fit_mm) return;
  throw UsageError("--unit: '" + path.string() +
                   "' states the unit of its numbers; leave it out, or give --scale");
}

Mesh readMesh(const std::filesystem::path& path,
              const std::function<void(const std::string&)>& warn, MeshColours colours) {
  FileBytes file(path.string());
  return parseMesh(MeshFile(file, warn, colours));
}

}  // namespace vdbdither
