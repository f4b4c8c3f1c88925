// glTF 2.0: ISO/IEC 12113:2022, section 3.6.2.

#include "io/mesh/gltf_accessors.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

using Type = GltfAccessor::Type;

std::uint64_t bytesOf(Type type) {
  switch (type) {
    case Type::int8:
    case Type::uint8:
      return 1;
    case Type::int16:
    case Type::uint16:
      return 2;
    case Type::uint32:
    case Type::float32:
      break;
  }
  return 4;
}

Type readType(const GltfValue& json) {
  const std::uint64_t code = json.count();
  constexpr std::array types{Type::int8,   Type::uint8,  Type::int16,
                             Type::uint16, Type::uint32, Type::float32};
  const auto found = std::find_if(types.begin(), types.end(), [&](Type type) {
    return static_cast<std::uint64_t>(type) == code;
  });
  if (found == types.end()) json.refuse("is not a component type");
  return *found;
}

std::uint32_t readComponents(const GltfValue& json) {
  if (json.text() == "MAT4") return 16;
  constexpr std::array<std::string_view, 4> names{"SCALAR", "VEC2", "VEC3", "VEC4"};
  const auto* const found = std::find(names.begin(), names.end(), json.text());
  if (found == names.end()) json.refuse("must be SCALAR, VEC2, VEC3, VEC4 or MAT4");
  return static_cast<std::uint32_t>(found - names.begin() + 1);
}

/// Refuses elements that do not fit into the bytes behind `offset`.
const char* dataOf(const GltfValue& json, std::string_view bytes, std::uint64_t offset,
                   std::uint64_t count, std::uint64_t stride, std::uint64_t element_bytes) {
  // The factors are below 2⁵³ and at most 2³², and the division rounds down.
  const bool fits = offset <= bytes.size() &&
                    (count == 0 || (element_bytes <= bytes.size() - offset &&
                                    count - 1 <= (bytes.size() - offset - element_bytes) / stride));
  if (!fits) json.refuse("reaches beyond its data");
  return bytes.data() + offset;
}

template <class Value>
double valueAt(const char* data, bool is_normalized) {
  Value value;
  std::memcpy(&value, data, sizeof(Value));
  if constexpr (std::is_integral_v<Value>) {
    if (is_normalized) {
      constexpr auto one = static_cast<double>(std::numeric_limits<Value>::max());
      return std::max(static_cast<double>(value) / one, -1.0);
    }
  }
  return static_cast<double>(value);
}

/// Where element `index` is, null if it is zero.
const char* placeOf(const GltfAccessor& accessor, std::uint32_t index,
                    std::uint64_t element_bytes) {
  if (!accessor.sparse_indices.empty()) {
    const auto& indices = accessor.sparse_indices;
    const auto found = std::lower_bound(indices.begin(), indices.end(), index);
    if (found != indices.end() && *found == index)
      return accessor.sparse_data +
             static_cast<std::uint64_t>(found - indices.begin()) * element_bytes;
  }
  return accessor.data == nullptr ? nullptr : accessor.data + index * accessor.stride;
}

template <class Value>
std::vector<double> elements(const GltfAccessor& accessor, std::span<const std::uint32_t> indices) {
  const std::uint64_t element_bytes = accessor.components * sizeof(Value);
  std::vector<double> values(indices.size() * accessor.components);
  double* to = values.data();
  for (const std::uint32_t index : indices) {
    const char* from = placeOf(accessor, index, element_bytes);
    for (std::uint32_t c = 0; c < accessor.components; ++c, ++to) {
      if (from != nullptr) *to = valueAt<Value>(from + c * sizeof(Value), accessor.is_normalized);
    }
  }
  return values;
}

template <class Value>
std::vector<std::uint32_t> indices(const GltfAccessor& accessor) {
  std::vector<std::uint32_t> values(accessor.count);
  for (std::uint32_t i = 0; i < accessor.count; ++i) {
    const char* from = placeOf(accessor, i, sizeof(Value));
    Value value = 0;
    if (from != nullptr) std::memcpy(&value, from, sizeof(Value));
    values[i] = value;
  }
  return values;
}

}  // namespace

const GltfAccessor& GltfAccessors::at(std::uint64_t index) {
  const auto found = accessors_.find(index);
  if (found != accessors_.end()) return found->second;
  return accessors_[index] = read(index);
}

GltfAccessor GltfAccessors::read(std::uint64_t index) {
  const GltfValue json = root_["accessors"].at(index);
  GltfAccessor accessor;
  accessor.path = json.path();
  accessor.type = readType(json["componentType"]);
  accessor.components = readComponents(json["type"]);
  accessor.count = json["count"].count();
  accessor.is_normalized = json["normalized"].flag();
  if (accessor.count > std::numeric_limits<std::uint32_t>::max())
    json["count"].refuse("is more than 4294967295");
  const std::uint64_t element_bytes = accessor.components * bytesOf(accessor.type);
  if (json.has("bufferView")) {
    const GltfBuffers::View view = buffers_.view(json["bufferView"].count());
    accessor.stride = view.stride == 0 ? element_bytes : view.stride;
    accessor.data = dataOf(json, view.bytes, json["byteOffset"].count(0), accessor.count,
                           accessor.stride, element_bytes);
  }
  if (json.has("sparse")) readSparse(json["sparse"], accessor);
  return accessor;
}

void GltfAccessors::readSparse(const GltfValue& json, GltfAccessor& accessor) {
  const std::uint64_t count = json["count"].count();
  const GltfValue places = json["indices"];
  const GltfValue values = json["values"];
  GltfAccessor indices;
  indices.type = readType(places["componentType"]);
  if (indices.type != Type::uint8 && indices.type != Type::uint16 && indices.type != Type::uint32)
    places["componentType"].refuse("must be a type of unsigned integers");
  if (count > accessor.count) json["count"].refuse("is more than the accessor holds");
  indices.count = count;
  indices.stride = bytesOf(indices.type);
  indices.data = dataOf(places, buffers_.view(places["bufferView"].count()).bytes,
                        places["byteOffset"].count(0), count, indices.stride, indices.stride);
  const std::uint64_t element_bytes = accessor.components * bytesOf(accessor.type);
  accessor.sparse_data = dataOf(values, buffers_.view(values["bufferView"].count()).bytes,
                                values["byteOffset"].count(0), count, element_bytes, element_bytes);
  buffers_.takeMemory(count * sizeof(std::uint32_t));
  accessor.sparse_indices = indicesOf(indices);
  const auto& sorted = accessor.sparse_indices;
  if (std::adjacent_find(sorted.begin(), sorted.end(), std::greater_equal<>()) != sorted.end())
    places.refuse("does not ascend");
  if (!sorted.empty() && sorted.back() >= accessor.count)
    places.refuse("has an index out of range");
}

std::vector<double> elementsOf(const GltfAccessor& accessor,
                               std::span<const std::uint32_t> indices) {
  throwIfInterrupted();
  switch (accessor.type) {
    case Type::int8:
      return elements<std::int8_t>(accessor, indices);
    case Type::uint8:
      return elements<std::uint8_t>(accessor, indices);
    case Type::int16:
      return elements<std::int16_t>(accessor, indices);
    case Type::uint16:
      return elements<std::uint16_t>(accessor, indices);
    case Type::uint32:
      return elements<std::uint32_t>(accessor, indices);
    case Type::float32:
      break;
  }
  return elements<float>(accessor, indices);
}

std::vector<std::uint32_t> indicesOf(const GltfAccessor& accessor) {
  throwIfInterrupted();
  if (accessor.type == Type::uint8) return indices<std::uint8_t>(accessor);
  if (accessor.type == Type::uint16) return indices<std::uint16_t>(accessor);
  return indices<std::uint32_t>(accessor);
}

}  // namespace vdbdither
