// Draco: "Draco Bitstream Specification", version 2.2, Google, 2021.
// https://google.github.io/draco/spec/

#include "io/mesh/draco_mesh.h"

#include <draco/compression/config/compression_shared.h>
#include <draco/compression/config/decoder_options.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/decoder_buffer.h>
#include <draco/core/varint_decoding.h>
#include <draco/mesh/mesh.h>
#include <exception>
#include <limits>
#include <string>
#include <type_traits>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

/// What the decoder takes for a triangle and its vertices, with a margin: a scan of a million
/// triangles takes 56, with its positions.
constexpr std::uint64_t bytes_per_triangle = 128;
/// For each set of attributes that has seams of its own.
constexpr std::uint64_t bytes_per_triangle_of_seams = 48;

/// That scan, of 0.7 bytes per triangle, takes 76 times its size. The first part is for small data.
std::uint64_t mostMemory(std::uint64_t encoded_bytes) {
  return (std::uint64_t{128} << 20) + 256 * encoded_bytes;
}

void checkMemory(std::uint64_t bytes, std::uint64_t most_bytes) {
  if (bytes > most_bytes)
    throw DracoError("claim " + std::to_string(bytes >> 20) + " MiB, too much for their size");
}

/// Reads ahead in a copy of the decoder's buffer.
class Ahead {
 public:
  explicit Ahead(const draco::DecoderBuffer& buffer) : buffer_(buffer) {}

  /// A number whose coding changed with version `varint_since` of the data.
  std::uint32_t number(std::uint16_t varint_since) {
    std::uint32_t value = 0;
    const bool is_read = buffer_.bitstream_version() < varint_since
                             ? buffer_.Decode(&value)
                             : draco::DecodeVarint(&value, &buffer_);
    if (!is_read) refuse();
    return value;
  }

  std::uint8_t byte() {
    std::uint8_t value = 0;
    if (!buffer_.Decode(&value)) refuse();
    return value;
  }

 private:
  [[noreturn]] static void refuse() { throw DracoError("are cut off"); }

  draco::DecoderBuffer buffer_;
};

/// One of Draco's decoders, with checks before it takes memory: it believes the counts that it
/// reads.
template <class Decoder>
class CheckedDecoder : public Decoder {
 public:
  explicit CheckedDecoder(std::uint64_t encoded_bytes) : most_bytes_(mostMemory(encoded_bytes)) {}

 protected:
  bool DecodeConnectivity() override {
    Ahead ahead(*this->buffer());
    std::uint64_t seams = 0;
    std::uint32_t triangles = 0;
    if constexpr (std::is_base_of_v<draco::MeshEdgebreakerDecoder, Decoder>) {
      constexpr std::uint16_t v2_0 = DRACO_BITSTREAM_VERSION(2, 0);
      if (this->bitstream_version() < DRACO_BITSTREAM_VERSION(2, 2)) ahead.number(v2_0);
      ahead.number(v2_0);  // the vertices, of which Draco accepts three for each triangle
      triangles = ahead.number(v2_0);
      seams = ahead.byte();
    } else {
      triangles = ahead.number(DRACO_BITSTREAM_VERSION(2, 2));
    }
    used_bytes_ = triangles * (bytes_per_triangle + seams * bytes_per_triangle_of_seams);
    checkMemory(used_bytes_, most_bytes_);
    throwIfInterrupted();
    return Decoder::DecodeConnectivity();
  }

  bool DecodeAllAttributes() override {
    const draco::PointCloud& cloud = *this->point_cloud();
    std::uint64_t bytes_per_point = 0;
    for (int i = 0; i < cloud.num_attributes(); ++i) {
      const draco::PointAttribute& attribute = *cloud.attribute(i);
      // Values, integers that become the values, an index, and what predicts them.
      bytes_per_point += static_cast<std::uint64_t>(attribute.byte_stride()) +
                         16 * static_cast<std::uint64_t>(attribute.num_components()) + 8;
    }
    checkMemory(used_bytes_ + bytes_per_point * cloud.num_points(), most_bytes_);
    throwIfInterrupted();
    return Decoder::DecodeAllAttributes();
  }

 private:
  std::uint64_t most_bytes_;
  std::uint64_t used_bytes_ = 0;
};

template <class Decoder>
bool decode(std::string_view bytes, draco::DecoderBuffer& buffer, draco::Mesh& mesh) {
  const draco::DecoderOptions options;
  return CheckedDecoder<Decoder>(bytes.size()).Decode(options, &buffer, &mesh).ok();
}

bool decodeWith(std::uint8_t method, std::string_view bytes, draco::DecoderBuffer& buffer,
                draco::Mesh& mesh) {
  if (method == draco::MESH_SEQUENTIAL_ENCODING)
    return decode<draco::MeshSequentialDecoder>(bytes, buffer, mesh);
  if (method == draco::MESH_EDGEBREAKER_ENCODING)
    return decode<draco::MeshEdgebreakerDecoder>(bytes, buffer, mesh);
  throw DracoError("use an unknown method");
}

void checkTriangles(const draco::Mesh& mesh) {
  for (std::uint32_t i = 0; i < mesh.num_faces(); ++i) {
    for (const draco::PointIndex& point : mesh.face(draco::FaceIndex(i))) {
      if (point.value() >= mesh.num_points())
        throw DracoError("have a triangle with point " + std::to_string(point.value()) + " of " +
                         std::to_string(mesh.num_points()));
    }
  }
}

template <class Value>
double largest() {
  if constexpr (std::is_integral_v<Value>)
    return static_cast<double>(std::numeric_limits<Value>::max());
  return 1;
}

template <class Value>
void copyValues(const draco::PointAttribute& attribute, DracoValues& values) {
  const auto components = static_cast<std::size_t>(values.components);
  values.is_integer = std::is_integral_v<Value>;
  values.one = largest<Value>();
  values.values.resize(attribute.size() * components);
  std::vector<Value> value(components);
  for (std::size_t i = 0; i < attribute.size(); ++i) {
    attribute.GetValue(draco::AttributeValueIndex(static_cast<std::uint32_t>(i)), value.data());
    for (std::size_t c = 0; c < components; ++c)
      values.values[i * components + c] = static_cast<double>(value[c]);
  }
}

void copyValuesOfAnyType(const draco::PointAttribute& attribute, DracoValues& values) {
  switch (attribute.data_type()) {
    case draco::DT_INT8:
      return copyValues<std::int8_t>(attribute, values);
    case draco::DT_UINT8:
      return copyValues<std::uint8_t>(attribute, values);
    case draco::DT_INT16:
      return copyValues<std::int16_t>(attribute, values);
    case draco::DT_UINT16:
      return copyValues<std::uint16_t>(attribute, values);
    case draco::DT_INT32:
      return copyValues<std::int32_t>(attribute, values);
    case draco::DT_UINT32:
      return copyValues<std::uint32_t>(attribute, values);
    case draco::DT_FLOAT32:
      return copyValues<float>(attribute, values);
    case draco::DT_FLOAT64:
      return copyValues<double>(attribute, values);
    default:
      throw DracoError("have an attribute of a type that is not read");
  }
}

}  // namespace

DracoMesh::DracoMesh(std::string_view bytes) : mesh_(std::make_unique<draco::Mesh>()) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::DecoderBuffer ahead = buffer;
  draco::DracoHeader header{};
  if (!draco::PointCloudDecoder::DecodeHeader(&ahead, &header).ok())
    throw DracoError("have no Draco header");
  if (header.encoder_type == draco::POINT_CLOUD)
    throw DracoError("are a point cloud, without triangles");
  bool is_decoded = false;
  try {
    is_decoded = decodeWith(header.encoder_method, bytes, buffer, *mesh_);
  } catch (const std::bad_alloc&) {
    throw DracoError("do not fit into memory");
  } catch (const std::length_error&) {
    throw DracoError("are damaged");
  }
  if (!is_decoded) throw DracoError("are cut off, damaged, or of a newer version");
  checkTriangles(*mesh_);
}

DracoMesh::~DracoMesh() = default;

std::uint32_t DracoMesh::points() const { return mesh_->num_points(); }

std::vector<Mesh::Triangle> DracoMesh::triangles() const {
  std::vector<Mesh::Triangle> triangles(mesh_->num_faces());
  for (std::uint32_t i = 0; i < mesh_->num_faces(); ++i) {
    const draco::Mesh::Face& face = mesh_->face(draco::FaceIndex(i));
    triangles[i] = {face[0].value(), face[1].value(), face[2].value()};
  }
  return triangles;
}

DracoValues DracoMesh::values(DracoAttribute kind) const {
  const draco::GeometryAttribute::Type type =
      kind == DracoAttribute::position ? draco::GeometryAttribute::POSITION
      : kind == DracoAttribute::colour ? draco::GeometryAttribute::COLOR
                                       : draco::GeometryAttribute::TEX_COORD;
  const draco::PointAttribute* attribute = mesh_->GetNamedAttribute(type);
  return attribute == nullptr ? DracoValues{} : valuesOf(*attribute);
}

DracoValues DracoMesh::valuesOf(std::uint32_t unique_id) const {
  const draco::PointAttribute* attribute = mesh_->GetAttributeByUniqueId(unique_id);
  if (attribute == nullptr) throw DracoError("have no attribute " + std::to_string(unique_id));
  return valuesOf(*attribute);
}

DracoValues DracoMesh::valuesOf(const draco::PointAttribute& attribute) const {
  DracoValues values;
  values.components = attribute.num_components();
  const std::size_t count = attribute.size();
  const std::size_t stored = attribute.buffer() == nullptr ? 0 : attribute.buffer()->data_size();
  const std::uint32_t points = mesh_->num_points();
  // GetValue copies byte_stride bytes.
  const auto value_bytes =
      static_cast<std::size_t>(draco::DataTypeLength(attribute.data_type()) * values.components);
  const auto stride = static_cast<std::size_t>(attribute.byte_stride());
  const bool is_identity = attribute.is_mapping_identity();
  if (values.components < 1 || stride != value_bytes || attribute.byte_offset() < 0 ||
      static_cast<std::size_t>(attribute.byte_offset()) + count * stride > stored ||
      (is_identity ? count : attribute.indices_map_size()) < points) {
    throw DracoError("have an attribute without all of its values");
  }
  values.of_point.resize(points);
  for (std::uint32_t point = 0; point < points; ++point) {
    values.of_point[point] = attribute.mapped_index(draco::PointIndex(point)).value();
    if (values.of_point[point] >= count)
      throw DracoError("have a point with value " + std::to_string(values.of_point[point]) +
                       " of " + std::to_string(count));
  }
  copyValuesOfAnyType(attribute, values);
  return values;
}

}  // namespace vdbdither
