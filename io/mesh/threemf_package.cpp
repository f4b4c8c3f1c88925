// "3MF Core Specification" 1.3.0, section 2, 3MF Consortium; "Open Packaging Conventions", ECMA-376
// part 2.

#include "io/mesh/threemf_package.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "io/file/text_bytes.h"
#include "io/file/xml_reader.h"

namespace vdbdither {

namespace {

constexpr std::string_view root_relationships = "_rels/.rels";
constexpr std::string_view usual_root = "3D/3dmodel.model";
constexpr std::uint64_t most_relationship_bytes = std::uint64_t{16} << 20;

/// The model parts of an archive may have this many bytes, or that many for each of its own: those
/// of large meshes have 5 to 20.
constexpr std::uint64_t always_inflated = std::uint64_t{64} << 20;
constexpr std::uint64_t most_inflation = 64;

/// Finds the part that the relationships of a package start from.
class ThreemfRootReader : public XmlReader {
 public:
  using XmlReader::XmlReader;

  [[nodiscard]] const std::optional<std::string>& root() const { return root_; }

 protected:
  void begin(const XmlElement& element) override {
    if (element.name() != "Relationship") return;
    const std::string_view type = element.attribute("Type").value_or("");
    if (type == "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" && !root_)
      root_ = element.attribute("Target").value_or("");
  }
  void end() override {}

 private:
  std::optional<std::string> root_;
};

std::span<const std::uint8_t> bytesOf(const MeshFile& file) { return textBytes(file.bytes()); }

/// The path as names of parts are compared: from the root, in lower case, with the characters that
/// it writes as %xx.
std::string normalizedPath(std::string_view path) {
  while (path.starts_with('/')) path.remove_prefix(1);
  std::string result;
  for (std::size_t at = 0; at < path.size(); ++at) {
    char c = path[at];
    if (c == '%' && at + 2 < path.size()) {
      unsigned char code = 0;
      const char* end = path.data() + at + 3;
      if (std::from_chars(end - 2, end, code, 16).ptr == end && code != 0) {
        c = static_cast<char>(code);
        at += 2;
      }
    }
    result += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c == '\\' ? '/' : c;
  }
  return result;
}

}  // namespace

ThreemfPackage::ThreemfPackage(const MeshFile& file)
    : file_(file), zip_(bytesOf(file), inQuotes(file.name())) {
  for (const std::string& member : zip_.names())
    member_of_path_.emplace(normalizedPath(member), member);
}

std::string ThreemfPackage::root() {
  if (contains(root_relationships)) {
    const std::string member = find("part", root_relationships);
    ThreemfRootReader reader(shown(member));
    reader.read(read(member, most_relationship_bytes));
    reader.finish();
    if (reader.root()) return find("model", *reader.root());
  }
  if (contains(usual_root)) return find("model", usual_root);
  file_.refuse("a zip archive without a 3MF model; name the mesh that it holds, unpacked");
}

bool ThreemfPackage::contains(std::string_view path) const {
  return member_of_path_.contains(normalizedPath(path));
}

std::string ThreemfPackage::find(std::string_view kind, std::string_view path) const {
  const auto found = member_of_path_.find(normalizedPath(path));
  if (found == member_of_path_.end())
    file_.refuse("names the " + std::string(kind) + " " + inQuotes(path) +
                 ", but holds no such file; export it again");
  return found->second;
}

std::string ThreemfPackage::shown(const std::string& member) const {
  return inQuotes(file_.name()) + ": its file " + inQuotes(member);
}

void ThreemfPackage::readModel(const std::string& member,
                               const std::function<void(std::span<const std::uint8_t>)>& take) {
  inflated_ += zip_.size(member);
  if (inflated_ > always_inflated && inflated_ / most_inflation > file_.size()) {
    file_.refuse("its models inflate more than " + std::to_string(most_inflation) +
                 " to 1; pack it again with less compression if that is right");
  }
  bool is_first = true;
  zip_.read(member, inflated_, [&](std::span<const std::uint8_t> piece) {
    constexpr std::string_view encrypted = "%3McF";
    if (is_first && piece.size() >= encrypted.size() &&
        std::equal(encrypted.begin(), encrypted.end(), piece.begin()))
      file_.refuse("its file " + inQuotes(member) +
                   " is encrypted (secure content); export it without");
    is_first = false;
    take(piece);
  });
}

std::vector<std::uint8_t> ThreemfPackage::read(const std::string& member,
                                               std::uint64_t most_bytes) {
  return zip_.read(member, most_bytes);
}

}  // namespace vdbdither
