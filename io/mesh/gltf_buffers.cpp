// glTF 2.0: ISO/IEC 12113:2022, section 3.6.1. Its extension EXT_meshopt_compression:
// https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_meshopt_compression

#include "io/mesh/gltf_buffers.h"

#include <meshoptimizer.h>
#include <utility>

#include "io/mesh/gltf_uri.h"
#include "io/mesh/side_file.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

constexpr std::uint64_t most_buffer_bytes = std::uint64_t{1} << 32;

struct Compression {
  std::uint64_t count = 0;
  std::uint64_t stride = 0;
  std::string_view mode;
  std::string_view filter;
};

/// Refuses what the codec does not hold, and counts that the compressed data cannot have: the
/// codecs need a bit for four bytes of vertices, a byte for a triangle or an index.
Compression readCompression(const GltfValue& json, std::uint64_t compressed_bytes) {
  Compression result{json["count"].count(), json["byteStride"].count(), json["mode"].text(),
                     json["filter"].text()};
  if (result.filter.empty()) result.filter = "NONE";
  const bool is_attributes = result.mode == "ATTRIBUTES";
  if (!is_attributes && result.mode != "TRIANGLES" && result.mode != "INDICES")
    json["mode"].refuse("is not a mode of the extension");
  const std::uint64_t stride = result.stride;
  if (is_attributes ? stride == 0 || stride > 256 || stride % 4 != 0 : stride != 2 && stride != 4)
    json["byteStride"].refuse("is not possible");
  const bool is_filtered = result.filter != "NONE";
  if ((is_filtered && !is_attributes) ||
      (result.filter == "OCTAHEDRAL" && stride != 4 && stride != 8) ||
      (result.filter == "QUATERNION" && stride != 8) ||
      (is_filtered && result.filter != "OCTAHEDRAL" && result.filter != "QUATERNION" &&
       result.filter != "EXPONENTIAL")) {
    json["filter"].refuse("is not possible");
  }
  const std::uint64_t most = is_attributes
                                 ? 64 * compressed_bytes / stride
                                 : (result.mode == "TRIANGLES" ? 3 : 1) * compressed_bytes;
  if (result.count > most || (result.mode == "TRIANGLES" && result.count % 3 != 0))
    json["count"].refuse("does not fit the size of the compressed data");
  return result;
}

bool decompress(const Compression& compression, std::string_view from,
                std::vector<std::uint8_t>& to) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(from.data());
  const std::size_t count = compression.count;
  const std::size_t stride = compression.stride;
  if (compression.mode == "TRIANGLES")
    return meshopt_decodeIndexBuffer(to.data(), count, stride, bytes, from.size()) == 0;
  if (compression.mode == "INDICES")
    return meshopt_decodeIndexSequence(to.data(), count, stride, bytes, from.size()) == 0;
  if (meshopt_decodeVertexBuffer(to.data(), count, stride, bytes, from.size()) != 0) return false;
  if (compression.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(to.data(), count, stride);
  if (compression.filter == "QUATERNION") meshopt_decodeFilterQuat(to.data(), count, stride);
  if (compression.filter == "EXPONENTIAL") meshopt_decodeFilterExp(to.data(), count, stride);
  return true;
}

}  // namespace

GltfBuffers::View GltfBuffers::view(std::uint64_t index) {
  const GltfValue json = root_["bufferViews"].at(index);
  const GltfValue compression = json["extensions"]["EXT_meshopt_compression"];
  if (compression.exists()) return decompressed(index, compression);
  const std::uint64_t stride = json["byteStride"].count(0);
  return {bytesOf(json), stride};
}

GltfBuffers::View GltfBuffers::decompressed(std::uint64_t index, const GltfValue& json) {
  const auto found = decompressed_.find(index);
  if (found != decompressed_.end()) return found->second;
  const std::string_view from = bytesOf(json);
  const Compression compression = readCompression(json, from.size());
  const std::uint64_t size = compression.count * compression.stride;
  takeMemory(size);
  throwIfInterrupted();
  std::vector<std::uint8_t> bytes(size);
  if (size > 0 && !decompress(compression, from, bytes))
    json.refuse("cannot be decompressed: its data are damaged");
  return decompressed_[index] = {keep(std::move(bytes)), compression.stride};
}

std::string_view GltfBuffers::bytesOf(const GltfValue& range) {
  const std::string_view whole = buffer(range["buffer"].count());
  const std::uint64_t offset = range["byteOffset"].count(0);
  const std::uint64_t length = range["byteLength"].count();
  if (offset > whole.size() || length > whole.size() - offset)
    range.refuse("lies outside of its buffer of " + std::to_string(whole.size()) + " bytes");
  return whole.substr(offset, length);
}

std::string_view GltfBuffers::buffer(std::uint64_t index) {
  const auto found = buffers_.find(index);
  if (found != buffers_.end()) return found->second;
  const GltfValue json = root_["buffers"].at(index);
  const std::uint64_t length = json["byteLength"].count();
  std::string_view bytes;
  if (json.has("uri")) {
    bytes = resource("buffer", json["uri"], most_buffer_bytes).bytes;
  } else if (index == 0 && binary_chunk_) {
    bytes = *binary_chunk_;
  } else {
    json.refuse("has no data");
  }
  if (bytes.size() < length)
    json.refuse("has " + std::to_string(bytes.size()) + " bytes of the " + std::to_string(length) +
                " that it should have");
  // A chunk is filled up to a multiple of four bytes.
  return buffers_[index] = bytes.substr(0, length);
}

GltfBytes GltfBuffers::resource(std::string_view kind, const GltfValue& json,
                                std::uint64_t most_bytes) {
  const std::string_view uri = json.text();
  const std::string shown = std::string(kind) + " " + json.path();
  if (auto bytes = decodeDataUri(file_, shown, uri)) return {keep(std::move(*bytes)), shown};
  const std::string path = pathOfUri(file_, kind, uri);
  const auto found = files_.find(path);
  if (found != files_.end()) return found->second;
  SideFile side = readSideFile(file_, kind, path, most_bytes);
  bytes_read_ += side.bytes.size();
  return files_[path] = {keep(std::move(side.bytes)), std::move(side.shown)};
}

void GltfBuffers::takeMemory(std::uint64_t bytes) {
  memory_ += bytes;
  const std::uint64_t read = file_.size() + bytes_read_;
  if (memory_ > (std::uint64_t{384} << 20) + 256 * read) {
    file_.refuse("takes more than " + std::to_string(memory_ >> 20) +
                 " MiB of memory, too much for its size; use its meshes less often, or split it");
  }
}

std::string_view GltfBuffers::keep(std::vector<std::uint8_t> bytes) {
  const std::vector<std::uint8_t>& kept = kept_.emplace_back(std::move(bytes));
  return {reinterpret_cast<const char*>(kept.data()), kept.size()};
}

}  // namespace vdbdither
