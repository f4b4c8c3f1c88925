// JSON: RFC 8259, "The JavaScript Object Notation (JSON) Data Interchange Format", 2017.

#include "io/mesh/gltf_json.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using nlohmann::json;

namespace {

/// glTF itself nests to a dozen.
constexpr int most_levels = 64;
/// Values take up to 112 bytes each.
constexpr std::uint64_t most_values = std::uint64_t{1} << 21;
constexpr std::uint64_t most_count = std::uint64_t{1} << 53;

}  // namespace

GltfJson::GltfJson(const MeshFile& file, std::string_view text) : file_(file) {
  std::uint64_t values = 0;
  const auto check = [&](int depth, json::parse_event_t /*event*/, const json& /*value*/) {
    constexpr std::uint64_t values_per_look = 1 << 16;
    if (++values % values_per_look == 0) throwIfInterrupted();
    if (depth > most_levels)
      file.refuse("its JSON nests deeper than " + std::to_string(most_levels) +
                  " levels; export it again");
    if (values > most_values)
      file.refuse("its JSON has more than " + std::to_string(most_values) +
                  " values; split the scene");
    return true;
  };
  try {
    json_ = std::make_unique<json>(json::parse(text.begin(), text.end(), check));
  } catch (const json::parse_error& error) {
    const std::size_t at = std::min(std::max<std::size_t>(error.byte, 1) - 1, text.size());
    file.refuseAtByte(text.data() + at,
                      "here the text is no JSON; export or download the file again");
  } catch (const json::exception&) {
    file.refuse("its JSON has a number that is too large; export it again");
  }
}

GltfJson::~GltfJson() = default;

GltfValue GltfJson::root() const { return {file_, json_.get(), ""}; }

GltfValue GltfValue::operator[](std::string_view key) const {
  const std::string path = (path_.empty() ? "" : path_ + ".") + std::string(key);
  if (json_ == nullptr) return {*file_, nullptr, path};
  if (!json_->is_object()) refuse("is no object");
  const auto found = json_->find(key);
  return {*file_, found == json_->end() ? nullptr : &*found, path};
}

std::size_t GltfValue::size() const {
  if (json_ == nullptr) return 0;
  if (!json_->is_array()) refuse("is no array");
  return json_->size();
}

GltfValue GltfValue::at(std::uint64_t index) const {
  const std::string path = path_ + "[" + std::to_string(index) + "]";
  if (index >= size()) {
    file_->refuse(path + " is named, but there are " + std::to_string(size()) +
                  "; export the file again");
  }
  return {*file_, &(*json_)[index], path};
}

std::uint64_t GltfValue::count() const {
  if (json_ == nullptr) refuse("is missing");
  if (json_->is_number_unsigned() && json_->get<std::uint64_t>() <= most_count)
    return json_->get<std::uint64_t>();
  const double value = json_->is_number_float() ? json_->get<double>() : -1;
  if (!(value >= 0 && value <= static_cast<double>(most_count)) || value != std::floor(value))
    refuse("is no count");
  return static_cast<std::uint64_t>(value);
}

std::uint64_t GltfValue::count(std::uint64_t otherwise) const {
  return exists() ? count() : otherwise;
}

double GltfValue::number(double otherwise) const {
  if (json_ == nullptr) return otherwise;
  if (!json_->is_number()) refuse("is no number");
  return json_->get<double>();
}

std::string_view GltfValue::text() const {
  if (json_ == nullptr) return {};
  if (!json_->is_string()) refuse("is no text");
  return json_->get_ref<const std::string&>();
}

bool GltfValue::flag() const {
  if (json_ == nullptr) return false;
  if (!json_->is_boolean()) refuse("is neither true nor false");
  return json_->get<bool>();
}

void GltfValue::refuse(const std::string& why) const {
  file_->refuse((path_.empty() ? "the JSON text" : path_) + " " + why + "; export the file again");
}

}  // namespace vdbdither
