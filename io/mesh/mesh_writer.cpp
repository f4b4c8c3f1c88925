#include "io/mesh/mesh_writer.h"

#include <algorithm>

#include "io/file/staged_output.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace fs = std::filesystem;

namespace {

const MeshFormat& formatToWrite(const fs::path& path) {
  const MeshFormat* format = meshFormatNamedBy(path);
  if (format != nullptr && format->write != nullptr) return *format;
  throw UsageError("'" + path.string() + "' is no mesh file that is written; name a " +
                   meshEndings() + " file");
}

}  // namespace

void MeshWriter::check(const fs::path& path, bool overwrite) {
  formatToWrite(path);
  StagedOutput::check(path, StagedOutput::Kind::file, overwrite);
}

MeshWriter::MeshWriter(const fs::path& path, const MeshEncoding& how)
    : format_(formatToWrite(path)), encoder_(format_.write(path, how)) {}

void MeshWriter::add(std::span<const openvdb::Vec3d> vertices,
                     std::span<const Mesh::Triangle> triangles, std::uint32_t open_from,
                     std::span<const std::array<std::uint8_t, 3>> colours,
                     std::span<const float> qualities) {
  vertices_ += vertices.size();
  triangles_ += triangles.size();
  const std::uint64_t wanted = std::max(vertices_, triangles_);
  if (wanted > format_.most) {
    throw DataError("the mesh has more vertices or triangles than the format counts, " +
                    std::to_string(format_.most) + "; take fewer --layers, or write " +
                    meshEndings([&](const MeshFormat& other) { return wanted <= other.most; }));
  }
  for (std::size_t n = 0; n < vertices.size(); ++n) {
    MeshVertex vertex{openvdb::Vec3s(vertices[n])};
    if (!colours.empty()) vertex.colour = colours[n];
    if (!qualities.empty()) vertex.quality = qualities[n];
    encoder_->vertex(vertex);
  }
  for (const Mesh::Triangle& triangle : triangles) encoder_->triangle(triangle);
  encoder_->forgetBefore(open_from);
}

void MeshWriter::complete() {
  encoder_->complete(vertices_, triangles_);
  completed_ = true;
}

void MeshWriter::commit() {
  if (!completed_) complete();
  encoder_->commit();
}

}  // namespace vdbdither
