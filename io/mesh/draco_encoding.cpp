// Draco: "Draco Bitstream Specification", version 2.2, Google, 2021.
// https://google.github.io/draco/spec/

#include "io/mesh/draco_encoding.h"

#include <algorithm>
#include <cmath>
#include <draco/compression/expert_encode.h>
#include <draco/core/encoder_buffer.h>
#include <draco/mesh/mesh.h>

#include "vdbdither/engine/option_values.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Vec3s;

namespace {

/// With more, Draco's arithmetic of floats is off by more than a tenth of a step.
constexpr int most_bits = 20;

template <class Value>
std::uint32_t add(draco::Mesh& mesh, draco::GeometryAttribute::Type type, int components,
                  draco::DataType data_type, const std::vector<Value>& values) {
  auto attribute = std::make_unique<draco::PointAttribute>();
  attribute->Init(type, static_cast<std::int8_t>(components), data_type,
                  type == draco::GeometryAttribute::COLOR, values.size());
  attribute->buffer()->Write(0, values.data(), values.size() * sizeof(Value));
  return mesh.attribute(mesh.AddAttribute(std::move(attribute)))->unique_id();
}

}  // namespace

DracoEncoding::DracoEncoding(double precision_mm)
    : precision_mm_(precision_mm), mesh_(std::make_unique<draco::Mesh>()) {}

DracoEncoding::~DracoEncoding() = default;

void DracoEncoding::triangle(const Mesh::Triangle& triangle) {
  mesh_->AddFace({draco::PointIndex(triangle[0]), draco::PointIndex(triangle[1]),
                  draco::PointIndex(triangle[2])});
}

std::uint32_t DracoEncoding::positions(const std::vector<Vec3s>& values) {
  openvdb::math::BBox<Vec3s> box;
  for (const Vec3s& position : values) box.expand(position);
  if (!values.empty()) extent_mm_ = double{box.extents()[box.maxExtent()]};
  return add(*mesh_, draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32, values);
}

std::uint32_t DracoEncoding::colours(const std::vector<std::array<std::uint8_t, 3>>& values) {
  return add(*mesh_, draco::GeometryAttribute::COLOR, 3, draco::DT_UINT8, values);
}

std::uint32_t DracoEncoding::colours(const std::vector<std::array<std::uint16_t, 4>>& values) {
  return add(*mesh_, draco::GeometryAttribute::COLOR, 4, draco::DT_UINT16, values);
}

std::uint32_t DracoEncoding::numbers(const std::vector<float>& values) {
  return add(*mesh_, draco::GeometryAttribute::GENERIC, 1, draco::DT_FLOAT32, values);
}

std::string DracoEncoding::encode(std::uint64_t points) {
  mesh_->set_num_points(static_cast<std::uint32_t>(points));
  throwIfInterrupted();
  draco::ExpertEncoder encoder(*mesh_);
  if (precision_mm_ == 0) {
    encoder.SetEncodingMethod(draco::MESH_SEQUENTIAL_ENCODING);
    encoder.options().SetGlobalBool("compress_connectivity", true);
  } else {
    // Draco rounds to the nearest of 2^bits − 1 steps across the longest edge; so a step of twice
    // the precision would do, if its arithmetic were exact.
    const double steps = std::max(1.0, extent_mm_ / (1.75 * precision_mm_)) + 1;
    const int bits = static_cast<int>(std::ceil(std::log2(steps)));
    if (bits > most_bits) {
      throw DataError("--draco: " + shortestText(precision_mm_ * 1e3) +
                      " um is too fine for a mesh of " + shortestText(std::round(extent_mm_)) +
                      " mm; give a longer length, or 0, which keeps all coordinates exactly");
    }
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetAttributeQuantization(mesh_->GetNamedAttributeId(draco::GeometryAttribute::POSITION),
                                     bits);
  }
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeToBuffer(&buffer).ok())
    throw DataError("the mesh cannot be encoded by Draco; write another format");
  throwIfInterrupted();
  return {buffer.data(), buffer.size()};
}

}  // namespace vdbdither
