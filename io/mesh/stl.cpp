// STL as it is found in the wild: the binary and ASCII forms of the StereoLithography Interface
// Specification (3D Systems, 1988), several solids to a file, headers that lie.

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "io/mesh/mesh_format.h"
#include "io/mesh/text_cursor.h"

namespace vdbdither {

using openvdb::Vec3d;
using openvdb::Vec3s;

namespace {

constexpr std::size_t header_size = 84;
constexpr std::size_t facet_size = 50;
constexpr std::size_t normal_size = 12;

std::uint32_t littleEndian32(const char* at) {
  std::uint32_t value = 0;
  for (int byte = 3; byte >= 0; --byte) {
    value = value << 8 | static_cast<unsigned char>(at[byte]);
  }
  return value;
}

double littleEndianFloat(const char* at) { return std::bit_cast<float>(littleEndian32(at)); }

/// Gives corners at the same position one vertex, in the order of first appearance. An
/// open-addressing table of (hash, vertex), at most half full. Corners are looked up in batches, so
/// that the memory they need is on its way before it is touched.
class Welder {
 public:
  explicit Welder(const MeshFile& file) : file_(file), slots_(1024) {}

  void reserve(std::size_t triangles) { mesh_.triangles.reserve(triangles); }

  void addTriangle(const std::array<Vec3d, 3>& corners) {
    for (const Vec3d& corner : corners) {
      batch_[batched_] = corner + Vec3d(0.0);  // −0 becomes +0
      hashes_[batched_] = hashOf(batch_[batched_]);
      ++batched_;
    }
    if (batched_ == batch_.size()) weldBatch();
  }

  Mesh take() {
    weldBatch();
    return std::move(mesh_);
  }

 private:
  static constexpr auto none = std::numeric_limits<std::uint32_t>::max();
  struct Slot {
    std::uint32_t hash = 0;
    std::uint32_t vertex = none;
  };

  static std::uint32_t hashOf(const Vec3d& position) {
    std::uint64_t hash = std::bit_cast<std::uint64_t>(position.x()) * 0x9E3779B97F4A7C15 +
                         std::bit_cast<std::uint64_t>(position.y()) * 0xC2B2AE3D27D4EB4F +
                         std::bit_cast<std::uint64_t>(position.z()) * 0x165667B19E3779F9;
    hash ^= hash >> 32;
    hash *= 0xD6E8FEB86659FD93;
    return static_cast<std::uint32_t>(hash >> 32);
  }

  void weldBatch() {
    for (std::size_t i = 0; i < batched_; ++i) __builtin_prefetch(&slots_[home(hashes_[i])]);
    for (std::size_t i = 0; i < batched_; ++i) {
      const Slot& slot = slots_[home(hashes_[i])];
      if (slot.vertex != none) __builtin_prefetch(&mesh_.vertices[slot.vertex]);
    }
    for (std::size_t i = 0; i < batched_; i += 3) {
      const std::uint32_t a = vertexAt(i);
      const std::uint32_t b = vertexAt(i + 1);
      mesh_.triangles.push_back({a, b, vertexAt(i + 2)});
    }
    batched_ = 0;
  }

  /// The vertex of corner `i` of the batch.
  std::uint32_t vertexAt(std::size_t i) {
    std::size_t at = home(hashes_[i]);
    for (; slots_[at].vertex != none; at = next(at)) {
      if (slots_[at].hash == hashes_[i] && mesh_.vertices[slots_[at].vertex] == batch_[i]) {
        return slots_[at].vertex;
      }
    }
    if (mesh_.vertices.size() == none) {
      file_.refuse("more than 4294967295 vertices; split the part");
    }
    const auto vertex = static_cast<std::uint32_t>(mesh_.vertices.size());
    slots_[at] = {hashes_[i], vertex};
    mesh_.vertices.push_back(batch_[i]);
    if (mesh_.vertices.size() * 2 > slots_.size()) grow();
    return vertex;
  }

  void grow() {
    std::vector<Slot> before(slots_.size() * 2);
    slots_.swap(before);
    for (const Slot& slot : before) {
      if (slot.vertex == none) continue;
      std::size_t at = home(slot.hash);
      while (slots_[at].vertex != none) at = next(at);
      slots_[at] = slot;
    }
  }

  /// Where the search for a hash starts, and how it goes on.
  [[nodiscard]] std::size_t home(std::uint32_t hash) const { return hash & (slots_.size() - 1); }
  [[nodiscard]] std::size_t next(std::size_t at) const { return (at + 1) & (slots_.size() - 1); }

  const MeshFile& file_;
  std::vector<Slot> slots_;
  std::array<Vec3d, 96> batch_;
  std::array<std::uint32_t, 96> hashes_;
  std::size_t batched_ = 0;
  Mesh mesh_;
};

/// How many triangles to read: what the size holds, as long as the header does not promise more.
std::size_t countFacets(const MeshFile& file) {
  const std::string_view bytes = file.bytes();
  if (bytes.size() < header_size) {
    file.refuse("cut off: a binary STL has at least 84 bytes, this one has " +
                std::to_string(bytes.size()) + "; export it again");
  }
  const std::size_t announced = littleEndian32(bytes.data() + header_size - 4);
  const std::size_t held = (bytes.size() - header_size) / facet_size;
  const std::size_t rest = (bytes.size() - header_size) % facet_size;
  // Writers that cannot go back to fill in the count leave one of these.
  const bool placeholder = announced == 0 || announced == 0xFFFFFFFF;
  if (announced > held && !(placeholder && rest == 0)) {
    file.refuseAtByte(bytes.data() + bytes.size(),
                      "cut off: the header announces " + std::to_string(announced) +
                          " triangles, the file holds " + std::to_string(held) +
                          "; export or download it again");
  }
  if (rest == 0 && announced != held) {
    file.warn("the header announces " + std::to_string(announced) + " triangles, the file holds " +
              std::to_string(held) + ": read all of them");
    return held;
  }
  if (rest != 0) {
    file.warn("ignored " + std::to_string(bytes.size() - header_size - announced * facet_size) +
              " bytes after the last triangle");
  }
  return announced;
}

/// Whether the size is exactly that of a binary STL with as many triangles as its header announces.
bool hasSizeOfBinaryStl(std::string_view bytes) {
  return bytes.size() >= header_size &&
         bytes.size() - header_size == littleEndian32(bytes.data() + header_size - 4) * facet_size;
}

Mesh readBinaryStl(const MeshFile& file) {
  const std::size_t count = countFacets(file);
  Welder welder(file);
  welder.reserve(count);
  const char* facet = file.bytes().data() + header_size;
  for (std::size_t triangle = 0; triangle < count; ++triangle, facet += facet_size) {
    std::array<Vec3d, 3> corners;
    const char* at = facet + normal_size;
    for (Vec3d& corner : corners) {
      corner = {littleEndianFloat(at), littleEndianFloat(at + 4), littleEndianFloat(at + 8)};
      if (!isFinite(corner)) {
        file.refuseAtByte(at, "triangle " + std::to_string(triangle + 1) +
                                  " has a corner that is not finite (" + shown(corner) +
                                  "); repair the mesh");
      }
      at += 12;
    }
    welder.addTriangle(corners);
  }
  return welder.take();
}

Mesh readAsciiStl(const MeshFile& file) {
  Welder welder(file);
  TextCursor text(file.text());
  std::array<Vec3d, 3> corners;
  std::size_t corner_count = 0;
  bool in_loop = false;
  bool in_solid = false;
  for (; !text.atEnd(); text.skipLine()) {
    const char* line = text.position();
    const std::string_view keyword = text.word();
    if (keyword.empty()) continue;
    if (equalsIgnoringCase(keyword, "vertex")) {
      const auto x = text.number();
      const auto y = x ? text.number() : x;
      const auto z = y ? text.number() : y;
      if (!z || !text.word().empty()) {
        file.refuseAtLine(line, "a vertex is not three numbers; repair the line or export again");
      }
      const Vec3d corner(*x, *y, *z);
      if (!isFinite(corner)) {
        file.refuseAtLine(line, "vertex is not finite (" + shown(corner) + "); repair the mesh");
      }
      if (!in_loop) file.refuseAtLine(line, "vertex outside of a loop; export it again");
      if (corner_count < 3) corners[corner_count] = corner;
      ++corner_count;
    } else if (equalsIgnoringCase(keyword, "facet") || equalsIgnoringCase(keyword, "endfacet")) {
      if (in_loop) file.refuseAtLine(line, "the loop before is not closed; export it again");
    } else if (equalsIgnoringCase(keyword, "outer")) {
      if (in_loop) file.refuseAtLine(line, "the loop before is not closed; export it again");
      in_loop = true;
      corner_count = 0;
    } else if (equalsIgnoringCase(keyword, "endloop")) {
      if (!in_loop || corner_count != 3) {
        file.refuseAtLine(line, "a facet has " + std::to_string(corner_count) +
                                    " corners instead of 3; export triangles only");
      }
      welder.addTriangle(corners);
      in_loop = false;
    } else if (equalsIgnoringCase(keyword, "solid")) {
      in_solid = true;
    } else if (equalsIgnoringCase(keyword, "endsolid")) {
      in_solid = false;
    } else {
      file.refuseAtLine(
          line, inQuotes(keyword) + " is no keyword of STL; repair the line or export again");
    }
  }
  if (in_solid || in_loop) {
    file.refuseAtLine(text.position(),
                      "cut off: the file ends without 'endsolid'; export or download it again");
  }
  return welder.take();
}

bool startsLikeAscii(const MeshFile& file) {
  return equalsIgnoringCase(file.start().substr(0, 5), "solid");
}

MeshMatch matchStl(const MeshFile& file) {
  if (hasSizeOfBinaryStl(file.bytes())) return MeshMatch::proof;
  if (startsLikeAscii(file)) return MeshMatch::likely;
  return !file.isText() && file.isNamed(".stl") ? MeshMatch::name : MeshMatch::none;
}

Mesh readStl(const MeshFile& file) {
  const bool is_ascii = !hasSizeOfBinaryStl(file.bytes()) && startsLikeAscii(file) && file.isText();
  return is_ascii ? readAsciiStl(file) : readBinaryStl(file);
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
