#include "io/mesh/mesh_file.h"

#include <array>
#include <charconv>
#include <cmath>

#include "io/mesh/text_cursor.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

std::string_view withoutMark(std::string_view text) {
  return text.substr(text.starts_with("\xEF\xBB\xBF") ? 3 : 0);
}

}  // namespace

std::string_view MeshFile::text() const {
  std::string_view text = withoutMark(bytes());
  while (!text.empty() && (text.back() == '\0' || text.back() == '\x1A')) text.remove_suffix(1);
  const std::size_t zero = text.find('\0');
  if (zero != std::string_view::npos)
    refuseAtByte(text.data() + zero, "a zero, so this is not a text; export it again");
  return text;
}

std::string_view MeshFile::start() const {
  TextCursor text(withoutMark(head()));
  text.skipSpace();
  return {text.position(), head().data() + head().size()};
}

bool MeshFile::isText() const {
  return head().substr(0, 1024).find('\0') == std::string_view::npos;
}

bool MeshFile::isNamed(std::string_view ending) const {
  const std::size_t dot = name_.rfind('.');
  return dot != std::string::npos &&
         equalsIgnoringCase(std::string_view(name_).substr(dot), ending);
}

void MeshFile::warn(const std::string& what) const {
  if (warn_) warn_(inQuotes(name_) + ": " + what);
}

void MeshFile::warnAtLine(const char* position, const std::string& what) const {
  if (warn_) warn_(inQuotes(name_) + ", line " + lineOf(position) + ": " + what);
}

void MeshFile::refuse(const std::string& why) const {
  throw DataError(inQuotes(name_) + ": " + why);
}

void MeshFile::refuseAtLine(const char* position, const std::string& why) const {
  throw DataError(inQuotes(name_) + ", line " + lineOf(position) + ": " + why);
}

void MeshFile::refuseAtByte(const char* position, const std::string& why) const {
  throw DataError(inQuotes(name_) + ", byte " + std::to_string(position - bytes_.data()) + ": " +
                  why);
}

std::string MeshFile::lineOf(const char* position) const {
  std::size_t line = 1;
  for (const char* at = bytes_.data(); at != position; ++at) {
    line += *at == '\n' || (*at == '\r' && at + 1 != position && at[1] != '\n');
  }
  return std::to_string(line);
}

std::string inQuotes(std::string_view text) {
  constexpr std::size_t longest = 200;
  std::string result = "'";
  for (const char c : text.substr(0, longest)) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
    result += control ? '?' : c;
  }
  return result + (text.size() > longest ? "...'" : "'");
}

std::string shown(const openvdb::Vec3d& position) {
  const auto word = [](double value) {
    if (std::isnan(value)) return std::string("nan");
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.begin(), digits.end(), value).ptr;
    return std::string(digits.begin(), end);
  };
  return word(position.x()) + " " + word(position.y()) + " " + word(position.z());
}

bool isFinite(const openvdb::Vec3d& position) {
  return std::isfinite(position.x()) && std::isfinite(position.y()) && std::isfinite(position.z());
}

}  // namespace vdbdither
