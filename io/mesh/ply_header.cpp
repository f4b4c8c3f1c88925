#include "io/mesh/ply_header.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <system_error>
#include <utility>

#include "io/mesh/text_cursor.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

std::size_t sizeOf(PlyScalar type) {
  constexpr std::array<std::size_t, 10> sizes{1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return sizes[static_cast<std::size_t>(type)];
}

std::uint64_t bitsAt(const char* at, std::size_t size, PlyEncoding encoding) {
  std::uint64_t bits = 0;
  for (std::size_t byte = 0; byte < size; ++byte) {
    const std::uint64_t value = static_cast<unsigned char>(at[byte]);
    bits |= value << 8 * (encoding == PlyEncoding::kLittleEndian ? byte : size - 1 - byte);
  }
  return bits;
}

int PlyElement::find(std::initializer_list<std::string_view> names) const {
  for (std::size_t i = 0; i < properties.size(); ++i) {
    if (std::find(names.begin(), names.end(), properties[i].name) != names.end()) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

std::uint64_t PlyElement::leastBytes(PlyEncoding encoding) const {
  if (encoding == PlyEncoding::kAscii) return 2 * properties.size();
  std::uint64_t least = 0;
  for (const PlyProperty& property : properties)
    least += sizeOf(property.count_type.value_or(property.type));
  return least;
}

namespace {

class HeaderParser {
 public:
  explicit HeaderParser(const MeshFile& file)
      : file_(file), bytes_(headerIn(file)), text_(bytes_) {}

  PlyHeader parse() {
    text_.skipLine();
    bool has_format = false;
    for (;; text_.skipLine()) {
      line_ = text_.position();
      if (text_.atEnd()) refuse("cut off: the header has no 'end_header'; export it again");
      const std::string_view keyword = text_.word();
      if (keyword == "format") {
        header_.encoding = parseEncoding();
        has_format = true;
      } else if (keyword == "element") {
        parseElement();
      } else if (keyword == "property") {
        parseProperty();
      } else if (keyword == "end_header") {
        break;
      } else if (keyword == "comment") {
        parseComment();
      } else if (!keyword.empty() && keyword != "obj_info") {
        refuse(inQuotes(keyword) + " is not a keyword of a PLY header; export it again");
      }
    }
    if (!has_format) refuse("the header has no 'format'; export it again");
    text_.skipBlanks();
    header_.body =
        std::min(static_cast<std::size_t>(text_.position() - bytes_.data()) + 1, file_.size());
    refuseCountsBeyondTheFile();
    if (header_.encoding != PlyEncoding::kAscii) findBody();
    return std::move(header_);
  }

 private:
  /// The head of the file, or all of it where the header is longer.
  static std::string_view headerIn(const MeshFile& file) {
    const std::string_view head = file.head();
    const bool is_whole = head.find("end_header") != std::string_view::npos;
    return is_whole || head.size() == file.size() ? head : file.bytes();
  }

  [[noreturn]] void refuse(const std::string& why) const { file_.refuseAtLine(line_, why); }

  PlyEncoding parseEncoding() {
    const std::string_view name = text_.word();
    if (text_.word() == "1.0") {
      if (name == "ascii") return PlyEncoding::kAscii;
      if (name == "binary_little_endian") return PlyEncoding::kLittleEndian;
      if (name == "binary_big_endian") return PlyEncoding::kBigEndian;
    }
    refuse(
        "the format is not 'ascii 1.0', 'binary_little_endian 1.0' or 'binary_big_endian 1.0'; "
        "export it again");
  }

  void parseComment() {
    if (!equalsIgnoringCase(text_.word(), "texturefile")) return;
    text_.skipBlanks();
    std::string_view name = text_.line();
    while (name.ends_with(' ') || name.ends_with('\t')) name.remove_suffix(1);
    if (!name.empty()) header_.texture_files.emplace_back(name);
  }

  void parseElement() {
    PlyElement element;
    element.line = line_;
    element.name = text_.word();
    const std::string_view count = text_.word();
    const char* end = count.data() + count.size();
    const auto [stop, error] = std::from_chars(count.data(), end, element.count);
    if (count.empty())
      refuse("element " + inQuotes(element.name) + " has no count; export it again");
    if (error != std::errc() || stop != end) {
      refuse("element " + inQuotes(element.name) + " has the count " + inQuotes(count) +
             ", which must be a whole number from 0 on; export it again");
    }
    for (const PlyElement& other : header_.elements) {
      if (other.name == element.name) {
        refuse("element " + inQuotes(element.name) + " is declared twice; export it again");
      }
    }
    header_.elements.push_back(std::move(element));
  }

  void parseProperty() {
    if (header_.elements.empty()) refuse("a property before any element; export it again");
    PlyProperty property;
    std::string_view type = text_.word();
    if (type == "list") {
      property.count_type = parseScalar(text_.word());
      type = text_.word();
    }
    property.type = parseScalar(type);
    property.name = text_.word();
    if (property.name.empty()) refuse("a property has no name; export it again");
    header_.elements.back().properties.push_back(std::move(property));
  }

  [[nodiscard]] PlyScalar parseScalar(std::string_view name) const {
    constexpr std::array<std::array<std::string_view, 2>, 10> names{{{"char", "int8"},
                                                                     {"uchar", "uint8"},
                                                                     {"short", "int16"},
                                                                     {"ushort", "uint16"},
                                                                     {"int", "int32"},
                                                                     {"uint", "uint32"},
                                                                     {"int64", "int64"},
                                                                     {"uint64", "uint64"},
                                                                     {"float", "float32"},
                                                                     {"double", "float64"}}};
    for (std::size_t type = 0; type < names.size(); ++type) {
      if (name == names[type][0] || name == names[type][1]) return static_cast<PlyScalar>(type);
    }
    refuse(inQuotes(name) + " is no scalar type of PLY; export it again");
  }

  /// The body may itself begin with a byte that looks like the end of a line, so where "\r\n" ends
  /// the header, the size of the body tells whether "\n" is already of it.
  void findBody() {
    const std::size_t other = header_.body + 1;
    if (bytes_.substr(header_.body - 1, 2) != "\r\n") return;
    const bool ends_with_return = bytes_.starts_with("ply\r") && !bytes_.starts_with("ply\r\n");
    if (ends_with_return ? !fillsFile(header_.body) && fillsFile(other)
                         : fillsFile(other) || !fillsFile(header_.body)) {
      header_.body = other;
    }
  }

  /// Whether a binary body that begins at `at` ends with the file.
  [[nodiscard]] bool fillsFile(std::size_t at) const;

  /// Before the file is read. Of a short text the lines tell better what is wrong.
  void refuseCountsBeyondTheFile() const {
    const bool is_text = header_.encoding == PlyEncoding::kAscii;
    if (is_text && file_.size() == file_.head().size()) return;
    std::uint64_t left = file_.size() - header_.body;
    if (is_text) ++left;  // no blank follows the last number
    for (const PlyElement& element : header_.elements) {
      const std::uint64_t least = element.leastBytes(header_.encoding);
      if (least == 0) continue;
      if (element.count > left / least) {
        file_.refuseAtLine(element.line, "cut off: element " + inQuotes(element.name) +
                                             " counts more than the file holds, " +
                                             std::to_string(element.count) +
                                             "; export or download it again");
      }
      left -= least * element.count;
    }
  }

  const MeshFile& file_;
  std::string_view bytes_;
  TextCursor text_;
  const char* line_ = nullptr;
  PlyHeader header_;
};

bool HeaderParser::fillsFile(std::size_t at) const {
  const std::string_view bytes = file_.bytes();
  std::uint64_t left = bytes.size() - at;
  const auto take = [&](std::uint64_t count, std::size_t size) {
    if (count > left / size) return false;
    left -= count * size;
    return true;
  };
  for (const PlyElement& element : header_.elements) {
    for (std::uint64_t i = 0; i < element.count && !element.properties.empty(); ++i) {
      for (const PlyProperty& property : element.properties) {
        std::uint64_t items = 1;
        if (property.count_type) {
          const char* count = bytes.data() + bytes.size() - left;
          const std::size_t size = sizeOf(*property.count_type);
          if (!take(1, size)) return false;
          items = bitsAt(count, size, header_.encoding);
        }
        if (!take(items, sizeOf(property.type))) return false;
      }
    }
  }
  return left == 0;
}

}  // namespace

PlyHeader parsePlyHeader(const MeshFile& file) { return HeaderParser(file).parse(); }

}  // namespace vdbdither
