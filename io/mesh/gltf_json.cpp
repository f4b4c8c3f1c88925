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

/// Reads the text without keeping it. (A parser with a callback could do both at once, but takes
/// time in the square of the length of an array.)
class Checker : public nlohmann::json_sax<json> {
 public:
  Checker(const MeshFile& file, std::string_view text) : file_(file), text_(text) {}

  bool null() override { return value(); }
  bool boolean(bool /*value*/) override { return value(); }
  bool number_integer(number_integer_t /*value*/) override { return value(); }
  bool number_unsigned(number_unsigned_t /*value*/) override { return value(); }
  bool number_float(number_float_t /*value*/, const string_t& /*text*/) override { return value(); }
  bool string(string_t& /*text*/) override { return value(); }
  bool binary(binary_t& /*bytes*/) override { return value(); }
  bool key(string_t& /*text*/) override { return true; }
  bool start_object(std::size_t /*size*/) override { return enter(); }
  bool start_array(std::size_t /*size*/) override { return enter(); }
  bool end_object() override { return leave(); }
  bool end_array() override { return leave(); }

  bool parse_error(std::size_t position, const std::string& /*token*/,
                   const json::exception& error) override {
    const std::size_t at = std::min(std::max<std::size_t>(position, 1) - 1, text_.size());
    constexpr int number_out_of_range = 406;
    if (error.id == number_out_of_range)
      file_.refuseAtByte(text_.data() + at, "here a number is too large; export the file again");
    file_.refuseAtByte(text_.data() + at,
                       "here the text is not JSON; export or download the file again");
  }

 private:
  bool value() {
    constexpr std::uint64_t values_per_look = 1 << 16;
    if (++values_ % values_per_look == 0) throwIfInterrupted();
    if (values_ > most_values)
      file_.refuse("its JSON has more than " + std::to_string(most_values) +
                   " values; split the scene");
    return true;
  }

  bool enter() {
    if (++level_ > most_levels)
      file_.refuse("its JSON nests deeper than " + std::to_string(most_levels) +
                   " levels; export it again");
    return value();
  }

  bool leave() {
    --level_;
    return true;
  }

  const MeshFile& file_;
  std::string_view text_;
  std::uint64_t values_ = 0;
  int level_ = 0;
};

}  // namespace

GltfJson::GltfJson(const MeshFile& file, std::string_view text) : file_(file) {
  Checker checker(file, text);
  json::sax_parse(text.begin(), text.end(), &checker);
  json_ = std::make_unique<json>(json::parse(text.begin(), text.end()));
}

GltfJson::~GltfJson() = default;

GltfValue GltfJson::root() const { return {file_, json_.get(), ""}; }

GltfValue GltfValue::operator[](std::string_view key) const {
  const std::string path = (path_.empty() ? "" : path_ + ".") + std::string(key);
  if (json_ == nullptr) return {*file_, nullptr, path};
  if (!json_->is_object()) refuse("must be an object");
  const auto found = json_->find(key);
  return {*file_, found == json_->end() ? nullptr : &*found, path};
}

std::size_t GltfValue::size() const {
  if (json_ == nullptr) return 0;
  if (!json_->is_array()) refuse("must be an array");
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
    refuse("must be a whole number from 0 on");
  return static_cast<std::uint64_t>(value);
}

std::uint64_t GltfValue::count(std::uint64_t otherwise) const {
  return exists() ? count() : otherwise;
}

double GltfValue::number(double otherwise) const {
  if (json_ == nullptr) return otherwise;
  if (!json_->is_number()) refuse("must be a number");
  return json_->get<double>();
}

std::string_view GltfValue::text() const {
  if (json_ == nullptr) return {};
  if (!json_->is_string()) refuse("must be a text");
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
