#include "io/mesh/mesh_encoder.h"

namespace vdbdither {

namespace fs = std::filesystem;

MeshEncoder::MeshEncoder(const fs::path& path)
    : staged_(path, StagedOutput::Kind::file), file_(staged_.path(), path) {}

void MeshEncoder::complete(std::uint64_t vertices, std::uint64_t triangles) {
  finish(vertices, triangles);
  file_.close();
  staged_.complete();
}

IndexedMeshEncoder::IndexedMeshEncoder(const fs::path& path)
    : MeshEncoder(path), faces_(facesPath(), path) {
  fs::remove(facesPath());
}

fs::path IndexedMeshEncoder::facesPath() const { return staged_.path().string() + "-faces"; }

}  // namespace vdbdither
