#include "ops/kernels/mesh/derived_mesh.h"

#include <numeric>
#include <utility>

#include "ops/kernels/mesh/mesh_placement.h"

namespace vdbdither {

DerivedMesh derived(Mesh mesh, std::uint32_t first) {
  DerivedMesh made{std::move(mesh), {}};
  made.source.resize(made.mesh.triangles.size());
  std::iota(made.source.begin(), made.source.end(), first);
  return made;
}

DerivedMesh joined(std::vector<DerivedMesh> meshes) {
  DerivedMesh all;
  std::vector<Mesh> parts;
  for (DerivedMesh& mesh : meshes) {
    all.source.insert(all.source.end(), mesh.source.begin(), mesh.source.end());
    parts.push_back(std::move(mesh.mesh));
  }
  all.mesh = joined(std::move(parts));
  return all;
}

}  // namespace vdbdither
