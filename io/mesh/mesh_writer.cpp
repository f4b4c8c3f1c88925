#include "io/mesh/mesh_writer.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fcntl.h>
#include <limits>
#include <system_error>
#include <type_traits>
#include <unistd.h>
#include <utility>

#include "io/file/staged_output.h"
#include "io/mesh/text_cursor.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace fs = std::filesystem;
using openvdb::Vec3d;
using openvdb::Vec3s;

namespace {

static_assert(std::endian::native == std::endian::little, "mesh files are little-endian");

/// A file that is written from its beginning to its end through a buffer.
class Output {
 public:
  Output(const fs::path& path, fs::path shown, int flags)
      : shown_(std::move(shown)), file_(::open(path.c_str(), O_RDWR | O_CLOEXEC | flags, 0666)) {
    if (file_ < 0) fail();
    buffer_.reserve(buffer_bytes);
  }
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;
  ~Output() {
    if (file_ >= 0) ::close(file_);
  }

  void append(const void* data, std::size_t size) {
    if (buffer_.size() + size > buffer_bytes) flush();
    const auto* bytes = static_cast<const char*>(data);
    buffer_.insert(buffer_.end(), bytes, bytes + size);
  }
  /// The bytes of a value.
  template <typename T>
  void appendValue(const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>);
    append(&value, sizeof(T));
  }
  void append(std::string_view text) { append(text.data(), text.size()); }

  /// Over what is there at `offset`.
  void patch(off_t offset, const void* data, std::size_t size) {
    flush();
    if (::pwrite(file_, data, size, offset) != static_cast<ssize_t>(size)) fail();
  }

  /// Appends everything that was written to `other`.
  void appendAllOf(Output& other) {
    other.flush();
    off_t at = 0;
    std::vector<char> block(buffer_bytes);
    for (;;) {
      const ssize_t got = ::pread(other.file_, block.data(), block.size(), at);
      if (got < 0) fail();
      if (got == 0) return;
      append(block.data(), static_cast<std::size_t>(got));
      at += got;
    }
  }

  void close() {
    flush();
    const int file = std::exchange(file_, -1);
    if (::close(file) != 0) fail();
  }

  [[noreturn]] void fail() const {
    throw DataError("cannot write '" + shown_.string() +
                    "': " + std::generic_category().message(errno));
  }
  [[nodiscard]] const fs::path& shown() const { return shown_; }

 private:
  static constexpr std::size_t buffer_bytes = std::size_t{1} << 20;

  void flush() {
    const char* at = buffer_.data();
    std::size_t left = buffer_.size();
    while (left > 0) {
      const ssize_t written = ::write(file_, at, left);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail();
      at += written;
      left -= static_cast<std::size_t>(written);
    }
    buffer_.clear();
  }

  fs::path shown_;
  int file_;
  std::vector<char> buffer_;
};

enum class Kind { stl, obj, ply };

Kind kindOf(const fs::path& path) {
  const std::string extension = path.extension().string();
  if (equalsIgnoringCase(extension, ".stl")) return Kind::stl;
  if (equalsIgnoringCase(extension, ".obj")) return Kind::obj;
  if (equalsIgnoringCase(extension, ".ply")) return Kind::ply;
  throw UsageError("'" + path.string() +
                   "' is no mesh file that is written; name a .stl, .obj or "
                   ".ply file");
}

/// The shortest text that reads back as the same float.
void appendNumber(Output& file, float value) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.begin(), digits.end(), value).ptr;
  file.append(digits.data(), static_cast<std::size_t>(end - digits.begin()));
}

}  // namespace

/// What a format makes of the pieces.
class MeshWriter::Format {
 public:
  explicit Format(const fs::path& path)
      : staged_(path, StagedOutput::Kind::file), file_(staged_.path(), path, O_CREAT | O_TRUNC) {}
  virtual ~Format() = default;

  virtual void vertex(const Vec3s& position, const std::array<std::uint8_t, 3>* colour,
                      const float* quality) = 0;
  virtual void triangle(const Mesh::Triangle& triangle) = 0;
  virtual void forgetBefore(std::uint32_t /*vertex*/) {}
  virtual void finish(std::uint64_t vertices, std::uint64_t triangles) = 0;
  /// How many vertices and triangles the format counts at most.
  [[nodiscard]] virtual std::uint64_t most() const { return ~std::uint64_t{0}; }

  void commit(std::uint64_t vertices, std::uint64_t triangles) {
    finish(vertices, triangles);
    file_.close();
    staged_.commit();
  }

 protected:
  StagedOutput staged_;
  Output file_;
};

/// All vertices stand before all faces, which wait in a file that has lost its name.
class MeshWriter::Indexed : public Format {
 public:
  explicit Indexed(const fs::path& path)
      : Format(path), faces_(facesPath(), path, O_CREAT | O_TRUNC) {
    fs::remove(facesPath());
  }

 protected:
  Output faces_;

 private:
  [[nodiscard]] fs::path facesPath() const { return staged_.path().string() + "-faces"; }
};

/// Header of 80 bytes, count, and 50 bytes a triangle.
class MeshWriter::Stl : public Format {
 public:
  explicit Stl(const fs::path& path) : Format(path) {
    std::array<char, header_bytes + 4> header{};
    constexpr std::string_view title = "vdbdither, mm";
    std::copy(title.begin(), title.end(), header.begin());
    file_.append(header.data(), header.size());
  }

  void vertex(const Vec3s& position, const std::array<std::uint8_t, 3>*, const float*) override {
    kept_.push_back(position);
  }

  void triangle(const Mesh::Triangle& t) override {
    const std::array<Vec3s, 3> corners{kept_[t[0] - first_], kept_[t[1] - first_],
                                       kept_[t[2] - first_]};
    const Vec3d across = Vec3d(corners[1] - corners[0]).cross(Vec3d(corners[2] - corners[0]));
    const double length = across.length();
    const Vec3s normal(length > 0 ? across / length : Vec3d(0));
    std::array<char, 50> record{};
    std::memcpy(record.data(), &normal, 12);
    for (std::size_t n = 0; n < 3; ++n) std::memcpy(record.data() + 12 + 12 * n, &corners[n], 12);
    file_.append(record.data(), record.size());
  }

  void forgetBefore(std::uint32_t vertex) override {
    if (vertex <= first_) return;
    kept_.erase(kept_.begin(), kept_.begin() + (vertex - first_));
    first_ = vertex;
  }

  void finish(std::uint64_t, std::uint64_t triangles) override {
    const auto count = static_cast<std::uint32_t>(triangles);
    file_.patch(header_bytes, &count, sizeof count);
  }

  [[nodiscard]] std::uint64_t most() const override {
    return std::numeric_limits<std::uint32_t>::max();
  }

 private:
  static constexpr std::size_t header_bytes = 80;
  std::vector<Vec3s> kept_;
  std::uint32_t first_ = 0;
};

class MeshWriter::Obj : public Indexed {
 public:
  explicit Obj(const fs::path& path) : Indexed(path) { file_.append("# vdbdither, mm\n"); }

  void vertex(const Vec3s& position, const std::array<std::uint8_t, 3>*, const float*) override {
    file_.append("v");
    for (int axis = 0; axis < 3; ++axis) {
      file_.append(" ");
      appendNumber(file_, position[axis]);
    }
    file_.append("\n");
  }
  void triangle(const Mesh::Triangle& triangle) override {
    faces_.append("f");
    for (const std::uint32_t vertex : triangle)
      faces_.append(" " + std::to_string(std::uint64_t{vertex} + 1));
    faces_.append("\n");
  }
  void finish(std::uint64_t, std::uint64_t) override { file_.appendAllOf(faces_); }
};

class MeshWriter::Ply : public Indexed {
 public:
  Ply(const fs::path& path, VertexExtras extras) : Indexed(path), extras_(std::move(extras)) {
    file_.append(header(0, 0));
  }

  void vertex(const Vec3s& position, const std::array<std::uint8_t, 3>* colour,
              const float* quality) override {
    file_.appendValue(position);
    if (extras_.colour) file_.appendValue(*colour);
    if (extras_.quality) file_.appendValue(*quality);
  }
  void triangle(const Mesh::Triangle& triangle) override {
    faces_.appendValue(std::uint8_t{3});
    faces_.appendValue(triangle);
  }
  void finish(std::uint64_t vertices, std::uint64_t triangles) override {
    file_.appendAllOf(faces_);
    const std::string text = header(vertices, triangles);
    file_.patch(0, text.data(), text.size());
  }
  [[nodiscard]] std::uint64_t most() const override {
    return std::numeric_limits<std::int32_t>::max();
  }

 private:
  /// Of the same length for every count.
  [[nodiscard]] std::string header(std::uint64_t vertices, std::uint64_t triangles) const {
    const std::string vertex_count = std::to_string(vertices);
    const std::string face_count = std::to_string(triangles);
    constexpr std::size_t digits = 20;
    std::string text = "ply\nformat binary_little_endian 1.0\ncomment vdbdither, mm";
    text.append(2 * digits - vertex_count.size() - face_count.size(), ' ');
    text += "\n";
    if (!extras_.comment.empty()) text += "comment " + extras_.comment + "\n";
    text += "element vertex " + vertex_count +
            "\nproperty float x\nproperty float y\nproperty float z\n";
    if (extras_.colour) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    if (extras_.quality) text += "property float quality\n";
    return text + "element face " + face_count +
           "\nproperty list uchar int vertex_indices\nend_header\n";
  }

  VertexExtras extras_;
};

void MeshWriter::check(const fs::path& path, bool overwrite) {
  kindOf(path);
  StagedOutput::check(path, StagedOutput::Kind::file, overwrite);
}

MeshWriter::MeshWriter(const fs::path& path, VertexExtras extras) {
  switch (kindOf(path)) {
    case Kind::stl:
      format_ = std::make_unique<Stl>(path);
      break;
    case Kind::obj:
      format_ = std::make_unique<Obj>(path);
      break;
    case Kind::ply:
      format_ = std::make_unique<Ply>(path, std::move(extras));
      break;
  }
}

MeshWriter::~MeshWriter() = default;

void MeshWriter::add(std::span<const Vec3d> vertices, std::span<const Mesh::Triangle> triangles,
                     std::uint32_t open_from, std::span<const std::array<std::uint8_t, 3>> colours,
                     std::span<const float> qualities) {
  vertices_ += vertices.size();
  triangles_ += triangles.size();
  if (std::max(vertices_, triangles_) > format_->most())
    throw DataError("the mesh has more vertices or triangles than the format counts, " +
                    std::to_string(format_->most()) + "; take fewer --layers, or write .obj");
  for (std::size_t n = 0; n < vertices.size(); ++n) {
    format_->vertex(Vec3s(vertices[n]), colours.empty() ? nullptr : &colours[n],
                    qualities.empty() ? nullptr : &qualities[n]);
  }
  for (const Mesh::Triangle& triangle : triangles) format_->triangle(triangle);
  format_->forgetBefore(open_from);
}

void MeshWriter::commit() { format_->commit(vertices_, triangles_); }

}  // namespace vdbdither
