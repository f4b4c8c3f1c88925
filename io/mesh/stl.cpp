// STL as it is found in the wild: the binary and ASCII forms of the StereoLithography Interface
// Specification (3D Systems, 1988), several solids to a file, headers that lie.

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/mesh/mesh_format.h"
#include "io/mesh/stl_colours.h"
#include "io/mesh/text_cursor.h"
#include "io/mesh/unread_bytes.h"
#include "io/mesh/vertex_welder.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Vec3d;
using openvdb::Vec3s;

namespace {

constexpr std::size_t header_size = 84;
constexpr std::size_t facet_size = 50;
constexpr std::size_t normal_size = 12;
constexpr std::size_t triangles_per_look = 1 << 16;  ///< between looks at signals

std::uint32_t littleEndian32(const char* at) {
  std::uint32_t value = 0;
  for (int byte = 3; byte >= 0; --byte) {
    value = value << 8 | static_cast<unsigned char>(at[byte]);
  }
  return value;
}

std::size_t littleEndian16(const char* at) {
  return static_cast<std::size_t>(static_cast<unsigned char>(at[0]) |
                                  static_cast<unsigned char>(at[1]) << 8);
}

double littleEndianFloat(const char* at) { return std::bit_cast<float>(littleEndian32(at)); }

/// How the records of a binary STL may lie in its file.
struct RecordLayout {
  struct Block {
    std::size_t header;  ///< where its header begins
    std::size_t count;   ///< of its records
  };

  std::vector<Block> blocks;    ///< more than one in files that were written one behind another
  bool has_attributes = false;  ///< as many bytes as its last two say follow a record
  bool adds_up = false;         ///< all bytes of the file belong to it
  std::size_t end = 0;
  std::string warning{};  ///< where the header says something else
};

/// The ways to read a binary STL, the likeliest first; more than one where its size is not that of
/// the triangles that its header announces. Refuses what header and size show to be wrong before
/// the file is read.
class RecordLayouts {
 public:
  explicit RecordLayouts(const MeshFile& file) : file_(file), size_(file.size()) {
    if (size_ < header_size) {
      file.refuse("cut off: a binary STL has at least 84 bytes, this one has " +
                  std::to_string(size_) + "; export it again");
    }
    announced_ = littleEndian32(file.head().data() + header_size - 4);
    held_ = (size_ - header_size) / facet_size;
    fills_file_ = (size_ - header_size) % facet_size == 0;
    // Writers that cannot go back to fill in the count leave one of these.
    has_count_ = announced_ != 0 && announced_ != 0xFFFFFFFF;
    if (announced_ > held_ && (has_count_ || !fills_file_)) {
      file.refuseAtByte(file.head().data() + size_,
                        "cut off: " + counts() + "; export or download it again");
    }
    if (size_ > file.head().size() && isBlank(file.head().substr(header_size))) {
      file.refuse("holds no triangles but zeros, as far as " + std::to_string(file.head().size()) +
                  " bytes tell; export or download it again");
    }
  }

  [[nodiscard]] std::vector<RecordLayout> all() {
    if (announced_ == held_ && (fills_file_ || held_ == 0)) {
      return {{.blocks = {{0, held_}}, .adds_up = true, .end = size_}};
    }
    std::vector<RecordLayout> layouts;
    tryAttributes(layouts);
    tryBlocks(layouts);
    const std::size_t end = header_size + announced_ * facet_size;
    // A little too much is a remark of the writer, or a count that is a little too low.
    const bool is_near = size_ <= std::max(2 * end, file_.head().size());
    if (fills_file_ && (is_near || !has_count_)) {
      layouts.push_back({.blocks = {{0, held_}},
                         .adds_up = !has_count_,
                         .end = size_,
                         .warning = counts() + ": read all of them"});
    }
    if (has_count_ && is_near) layouts.push_back({.blocks = {{0, announced_}}, .end = end});
    if (layouts.empty()) {
      file_.refuse("its header announces " + (has_count_ ? std::to_string(announced_) : "no") +
                   " triangles, which are not what its " + std::to_string(size_) +
                   " bytes hold; export or download it again");
    }
    return layouts;
  }

 private:
  [[nodiscard]] std::string counts() const {
    return "the header announces " + std::to_string(announced_) + " triangles, the file holds " +
           std::to_string(held_);
  }

  [[nodiscard]] const char* at(std::size_t offset) const {
    const bool is_in_head = offset + 4 <= file_.head().size();
    return (is_in_head ? file_.head() : file_.bytes()).data() + offset;
  }

  void tryAttributes(std::vector<RecordLayout>& layouts) const {
    constexpr std::size_t most_attributes = 0xFFFF;
    if (!has_count_ || size_ > header_size + announced_ * (facet_size + most_attributes)) return;
    std::size_t end = header_size;
    std::size_t count = 0;
    for (; count < announced_ && end + facet_size <= size_; ++count)
      end += facet_size + littleEndian16(at(end + facet_size - 2));
    if (end != size_ || count != announced_) return;
    layouts.push_back(
        {.blocks = {{0, count}}, .has_attributes = true, .adds_up = true, .end = size_});
  }

  void tryBlocks(std::vector<RecordLayout>& layouts) const {
    RecordLayout layout{.blocks = {}, .adds_up = true, .end = 0};
    while (layout.end + header_size <= size_) {
      const std::size_t count = littleEndian32(at(layout.end + header_size - 4));
      layout.blocks.push_back({layout.end, count});
      layout.end += header_size + count * facet_size;
      if (count == 0) return;
    }
    if (layout.end != size_) return;
    layout.warning = "read all of " + std::to_string(layout.blocks.size()) +
                     " binary STL files, one behind another";
    layouts.push_back(std::move(layout));
  }

  const MeshFile& file_;
  std::size_t size_;
  std::size_t announced_ = 0;
  std::size_t held_ = 0;
  bool fills_file_ = false;
  bool has_count_ = false;
};

Mesh readRecords(const MeshFile& file, const RecordLayout& layout) {
  VertexWelder welder(file);
  std::optional<StlColours> colours;
  if (file.wantsColours() && !layout.has_attributes) colours.emplace();
  std::size_t triangles = 0;
  for (const RecordLayout::Block& block : layout.blocks) {
    welder.reserve(block.count);
    const char* facet = file.bytes().data() + block.header + header_size;
    if (colours) colours->begin(file.bytes().substr(block.header, header_size - 4));
    for (std::size_t i = 0; i < block.count; ++i) {
      if (triangles++ % triangles_per_look == 0) throwIfInterrupted();
      std::array<Vec3d, 3> corners;
      const char* at = facet + normal_size;
      for (Vec3d& corner : corners) {
        corner = {littleEndianFloat(at), littleEndianFloat(at + 4), littleEndianFloat(at + 8)};
        if (!isFinite(corner)) {
          file.refuseAtByte(at, "triangle " + std::to_string(triangles) +
                                    " has a corner that is not finite (" + shown(corner) +
                                    "); repair the mesh");
        }
        at += 12;
      }
      welder.addTriangle(corners);
      if (colours) colours->add(static_cast<std::uint16_t>(littleEndian16(at)));
      facet += facet_size + (layout.has_attributes ? littleEndian16(at) : 0);
    }
  }
  Mesh mesh = welder.take();
  if (colours) mesh.appearance = colours->finish();
  return mesh;
}

/// Reads the layout that makes a closed mesh, or else the first into which all bytes fit.
Mesh readBinaryStl(const MeshFile& file) {
  const std::vector<RecordLayout> layouts = RecordLayouts(file).all();
  if (layouts.size() == 1 && layouts.front().adds_up) {
    if (!layouts.front().warning.empty()) file.warn(layouts.front().warning);
    return readRecords(file, layouts.front());
  }
  const RecordLayout* best = nullptr;
  std::optional<Mesh> mesh;
  for (const RecordLayout& layout : layouts) {
    const bool is_last = &layout == &layouts.back();
    try {
      Mesh made = readRecords(file, layout);
      const bool closed = isClosed(made);
      if (!closed && best != nullptr) continue;
      if (!closed && !layout.adds_up && !is_last) continue;
      best = &layout;
      mesh = std::move(made);
      if (closed) break;
    } catch (const DataError&) {
      if (is_last && best == nullptr) throw;
    }
  }
  judgeUnread(file, *mesh, file.bytes().substr(best->end), "the last triangle");
  if (!best->warning.empty()) file.warn(best->warning);
  return std::move(*mesh);
}

/// Whether the size is exactly that of a binary STL with as many triangles as its header announces.
bool hasSizeOfBinaryStl(const MeshFile& file) {
  return file.size() >= header_size &&
         file.size() - header_size ==
             littleEndian32(file.head().data() + header_size - 4) * facet_size;
}

/// Whether `word` begins with `lower`, case aside.
bool beginsWith(std::string_view word, std::string_view lower) {
  return equalsIgnoringCase(word.substr(0, lower.size()), lower);
}

/// Whether `word` begins a remark that lasts to the end of its line.
bool beginsRemark(std::string_view word) {
  return word.starts_with('#') || word.starts_with("//") || word.starts_with(';') ||
         beginsWith(word, "color") || beginsWith(word, "colour") ||
         equalsIgnoringCase(word, "comment");
}

/// Reads the text form by words, as lines have no meaning but to end names and remarks.
class AsciiStlReader {
 public:
  explicit AsciiStlReader(const MeshFile& file)
      : file_(file), welder_(file), all_(file.text()), text_(all_), at_(text_.position()) {}

  Mesh read() {
    while (const auto word = next()) readStatement(*word);
    if (in_loop_ || corner_count_ > 0) refuseCutOff();
    if (in_solid_) {
      file_.warnAtLine(text_.position(),
                       "the file ends without 'endsolid': it may have been cut off");
    }
    Mesh mesh = welder_.take();
    std::set<std::string_view> names;
    for (const MeshPart& part : parts_) names.insert(part.name);
    if (names.size() > 1) mesh.parts = std::move(parts_);
    return mesh;
  }

 private:
  /// The next word, on whatever line. The statement that it begins is named in messages.
  std::optional<std::string_view> next() {
    text_.skipBlanks();
    if (text_.atLineEnd()) {
      follows_end_ = false;
      text_.skipSpace();
    }
    at_ = text_.position();
    if (text_.atEnd()) return std::nullopt;
    return text_.word();
  }

  void readStatement(std::string_view word) {
    if (equalsIgnoringCase(word, "vertex")) {
      readVertex();
    } else if (equalsIgnoringCase(word, "endloop")) {
      endLoop();
    } else if (equalsIgnoringCase(word, "endfacet")) {
      endFacet();
    } else if (equalsIgnoringCase(word, "facet")) {
      beginFacet();
    } else if (equalsIgnoringCase(word, "outer")) {
      beginLoop();
    } else if (equalsIgnoringCase(word, "end")) {
      readEnd();
    } else if (beginsWith(word, "endsolid")) {
      endSolid();
    } else if (beginsWith(word, "solid")) {
      beginSolid(word.substr(5));
    } else if (beginsRemark(word)) {
      text_.skipLine();
      follows_end_ = false;
    } else if (!follows_end_) {
      refuse(inQuotes(word) + " is not a keyword of STL; repair the line or export again");
    }
  }

  void readVertex() {
    std::array<std::optional<double>, 3> numbers;
    for (std::optional<double>& number : numbers) {
      text_.skipSpace();
      if (text_.atEnd()) refuseCutOff();
      number = text_.number();
      if (!number) refuseNumbers();
    }
    TextCursor behind = text_;
    const std::string_view more = behind.word();
    if (!more.empty() && !isKeyword(more) && !beginsRemark(more)) refuseNumbers();
    const Vec3d corner(*numbers[0], *numbers[1], *numbers[2]);
    if (!isFinite(corner)) refuse("vertex is not finite (" + shown(corner) + "); repair the mesh");
    if (!in_loop_ && !in_facet_) refuse("vertex outside of a loop; export it again");
    if (corner_count_ < 3) corners_[corner_count_] = corner;
    ++corner_count_;
  }

  void beginFacet() {
    if (in_loop_ || corner_count_ > 0) refuse("the loop before is not closed; export it again");
    in_facet_ = true;
    skipNormal();
  }

  /// Passes over "normal" and three numbers, which may be nan in any spelling.
  void skipNormal() {
    for (int words = 0; words < 4; ++words) {
      TextCursor ahead = text_;
      ahead.skipSpace();
      const std::string_view word = ahead.word();
      if (isKeyword(word) || beginsRemark(word)) return;
      text_ = ahead;
    }
    follows_end_ = true;
  }

  void beginLoop() {
    if (in_loop_ || corner_count_ > 0) refuse("the loop before is not closed; export it again");
    in_loop_ = true;
    TextCursor ahead = text_;
    ahead.skipSpace();
    if (equalsIgnoringCase(ahead.word(), "loop")) text_ = ahead;
  }

  void endLoop() {
    if (!in_loop_ || corner_count_ != 3) refuseCorners();
    addTriangle();
  }

  /// Some writers leave out loops, or their ends.
  void endFacet() {
    if (in_loop_ || corner_count_ > 0) {
      if (corner_count_ != 3) refuseCorners();
      addTriangle();
    }
    in_facet_ = false;
    follows_end_ = true;
  }

  void addTriangle() {
    if (parts_.empty() || parts_.back().name != name_)
      parts_.push_back({std::string(name_), static_cast<std::uint32_t>(triangles_)});
    if (++triangles_ % triangles_per_look == 0) throwIfInterrupted();
    welder_.addTriangle(corners_);
    corner_count_ = 0;
    in_loop_ = false;
    follows_end_ = true;
  }

  void readEnd() {
    const std::string_view what = text_.word();
    if (equalsIgnoringCase(what, "loop")) return endLoop();
    if (equalsIgnoringCase(what, "facet")) return endFacet();
    if (equalsIgnoringCase(what, "solid")) return endSolid();
    refuse(inQuotes("end " + std::string(what)) +
           " is not a keyword of STL; repair the line or export again");
  }

  /// `name` is glued to the keyword, or empty.
  void beginSolid(std::string_view name) {
    if (in_loop_ || corner_count_ > 0) refuse("the loop before is not closed; export it again");
    in_solid_ = true;
    const std::string_view rest = readName();
    name_ = name.empty() ? rest : name;
  }

  void endSolid() {
    if (in_loop_ || corner_count_ > 0) refuse("the loop before is not closed; export it again");
    in_solid_ = false;
    in_facet_ = false;
    readName();
  }

  /// A name, of any words, ends with its line or before a facet.
  std::string_view readName() {
    TextCursor rest = text_;
    const std::string_view line = rest.line();
    TextCursor name(line);
    name.skipBlanks();
    const char* first = name.position();
    const char* last = first;
    for (;;) {
      name.skipBlanks();
      const char* begin = name.position();
      const std::string_view word = name.word();
      if (word.empty()) break;
      TextCursor facet = name;
      if (equalsIgnoringCase(word, "facet") && equalsIgnoringCase(facet.word(), "normal") &&
          facet.number()) {
        text_ = TextCursor(all_.substr(static_cast<std::size_t>(begin - all_.data())));
        return {first, last};
      }
      last = name.position();
    }
    text_ = rest;
    return {first, last};
  }

  static bool isKeyword(std::string_view word) {
    constexpr std::array<std::string_view, 6> keywords{"vertex", "endloop",  "outer",
                                                       "facet",  "endfacet", "end"};
    return beginsWith(word, "endsolid") ||
           std::any_of(keywords.begin(), keywords.end(),
                       [&](std::string_view keyword) { return equalsIgnoringCase(word, keyword); });
  }

  [[noreturn]] void refuseNumbers() const {
    refuse("a vertex is not three numbers; repair the line or export again");
  }
  [[noreturn]] void refuseCorners() const {
    refuse("a facet has " + std::to_string(corner_count_) +
           " corners instead of 3; export triangles only");
  }
  [[noreturn]] void refuseCutOff() const {
    file_.refuseAtLine(text_.position(),
                       "cut off: the file ends within a facet; export or download it again");
  }
  [[noreturn]] void refuse(const std::string& why) const { file_.refuseAtLine(at_, why); }

  const MeshFile& file_;
  VertexWelder welder_;
  std::string_view all_;
  TextCursor text_;
  const char* at_;  ///< where the statement begins
  std::array<Vec3d, 3> corners_;
  std::size_t corner_count_ = 0;  ///< of the facet that is not yet a triangle
  std::size_t triangles_ = 0;
  std::string_view name_;  ///< of the solid
  std::vector<MeshPart> parts_;
  bool in_solid_ = false;
  bool in_facet_ = false;
  bool in_loop_ = false;
  bool follows_end_ = false;  ///< what is left of the line is a remark
};

bool startsLikeAscii(const MeshFile& file) {
  TextCursor text(file.start(), TextCursor::Comments::hash);
  text.skipSpace();
  const std::string_view word = text.word();
  return beginsWith(word, "solid") || equalsIgnoringCase(word, "facet");
}

MeshMatch matchStl(const MeshFile& file) {
  if (hasSizeOfBinaryStl(file)) return MeshMatch::proof;
  if (startsLikeAscii(file)) return MeshMatch::likely;
  return !file.isText() && file.isNamed(".stl") ? MeshMatch::name : MeshMatch::none;
}

Mesh readStl(const MeshFile& file) {
  const bool is_ascii = !hasSizeOfBinaryStl(file) && startsLikeAscii(file) && file.isText();
  return is_ascii ? AsciiStlReader(file).read() : readBinaryStl(file);
}

/// Header of 80 bytes, count, and 50 bytes a triangle.
class StlEncoder : public MeshEncoder {
 public:
  explicit StlEncoder(const std::filesystem::path& path) : MeshEncoder(path) {
    std::array<char, header_size> header{};
    constexpr std::string_view title = "vdbdither, mm";
    std::copy(title.begin(), title.end(), header.begin());
    file_.append(header.data(), header.size());
  }

  void vertex(const MeshVertex& vertex) override { kept_.push_back(vertex.position); }

  void triangle(const Mesh::Triangle& t) override {
    static_assert(std::endian::native == std::endian::little);
    const std::array<Vec3s, 3> corners{kept_[t[0] - first_], kept_[t[1] - first_],
                                       kept_[t[2] - first_]};
    const Vec3d across = Vec3d(corners[1] - corners[0]).cross(Vec3d(corners[2] - corners[0]));
    const double length = across.length();
    const Vec3s normal(length > 0 ? across / length : Vec3d(0));
    std::array<char, facet_size> record{};
    std::memcpy(record.data(), &normal, 12);
    for (std::size_t n = 0; n < 3; ++n) std::memcpy(record.data() + 12 + 12 * n, &corners[n], 12);
    file_.append(record.data(), record.size());
  }

  void forgetBefore(std::uint32_t vertex) override {
    if (vertex <= first_) return;
    kept_.erase(kept_.begin(), kept_.begin() + (vertex - first_));
    first_ = vertex;
  }

 protected:
  void finish(std::uint64_t, std::uint64_t triangles) override {
    const auto count = static_cast<std::uint32_t>(triangles);
    file_.patch(header_size - 4, &count, sizeof count);
  }

 private:
  std::vector<Vec3s> kept_;
  std::uint32_t first_ = 0;
};

}  // namespace

extern const MeshFormat stl;
const MeshFormat stl{.name = "STL",
                     .ending = ".stl",
                     .match = matchStl,
                     .read = readStl,
                     .write = makeMeshEncoder<StlEncoder>,
                     .most = std::numeric_limits<std::uint32_t>::max(),
                     .bytes_per_vertex = 100,
                     .us_per_vertex = 0.2};

}  // namespace vdbdither
