#include "io/frames.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <istream>
#include <sstream>
#include <unistd.h>
#include <vector>

#include "io/archive_digest.h"
#include "vdbdither/errors.h"
#include "vdbdither/openvdb.h"

namespace vdbdither {

namespace {

constexpr const char* frame_key = "vdbdither:frame";

}  // namespace

void FrameWriter::head(const Schema& schema) {
  VdbContents contents = contentsOf(schema, schema.grids);
  contents.metadata[frame_key] = "head";
  send(contents);
}

void FrameWriter::slab(const Slab& slab) {
  layers_ += slab.core.size();
  send({slab.grids,
        {{frame_key,
          "slab " + std::to_string(slab.core.begin) + " " + std::to_string(slab.core.end)}}});
}

void FrameWriter::end() { send({{}, {{frame_key, "end " + std::to_string(layers_)}}}); }

void FrameWriter::send(const VdbContents& contents) {
  // The reader is at hand and the pipe is quick: packing the voxels would cost more than it saves.
  const std::string bytes = archiveBytes(contents, VdbCodec::mask);
  for (std::size_t sent = 0; sent < bytes.size();) {
    const ssize_t count = ::write(descriptor_, bytes.data() + sent, bytes.size() - sent);
    if (count >= 0) {
      sent += static_cast<std::size_t>(count);
    } else if (errno == EPIPE) {
      throw DataError("the reader of the pipe has gone");
    } else if (errno != EINTR) {
      throw DataError(std::string("cannot write to standard output: ") + std::strerror(errno));
    }
  }
}

/// Reads a descriptor.
class FrameReader::Buffer : public std::streambuf {
 public:
  Buffer(int descriptor, const std::string& where)
      : descriptor_(descriptor), where_(where), bytes_(1 << 20) {
    setg(bytes_.data(), bytes_.data(), bytes_.data());
  }

  /// The UUID of the archive that comes next, which is not taken off; less where the pipe ends
  /// before, and nothing at its end.
  std::optional<std::string_view> peekUuid() {
    // The unread rest moves to the front, so that the header lies in one piece.
    const std::size_t rest = egptr() - gptr();
    std::memmove(bytes_.data(), gptr(), rest);
    setg(bytes_.data(), bytes_.data(), bytes_.data() + rest);
    while (static_cast<std::size_t>(egptr() - gptr()) < uuid_offset + uuid_size) {
      const std::size_t count = fill(egptr());
      if (count == 0) break;
      setg(eback(), gptr(), egptr() + count);
    }
    if (gptr() == egptr()) return std::nullopt;
    const std::string_view header(gptr(), egptr() - gptr());
    return header.substr(std::min(uuid_offset, header.size()), uuid_size);
  }

  /// Takes `size` bytes; fewer where the pipe ends before.
  std::string take(std::uint64_t size) {
    std::string taken;
    while (taken.size() < size && sgetc() != traits_type::eof()) {
      const std::size_t count = std::min<std::uint64_t>(size - taken.size(), egptr() - gptr());
      taken.append(gptr(), count);
      setg(eback(), gptr() + count, egptr());
    }
    return taken;
  }

 protected:
  int_type underflow() override {
    const std::size_t count = fill(bytes_.data());
    setg(bytes_.data(), bytes_.data(), bytes_.data() + count);
    return count ? traits_type::to_int_type(*gptr()) : traits_type::eof();
  }

 private:
  std::size_t fill(char* target) {
    for (;;) {
      const ssize_t count = ::read(descriptor_, target, bytes_.data() + bytes_.size() - target);
      if (count >= 0) return static_cast<std::size_t>(count);
      if (errno != EINTR) throw DataError("cannot read " + where_ + ": " + std::strerror(errno));
    }
  }

  int descriptor_;
  std::string where_;
  std::vector<char> bytes_;
};

FrameReader::FrameReader(int descriptor, std::string where)
    : buffer_(std::make_unique<Buffer>(descriptor, where)), where_(std::move(where)) {
  VdbContents contents = receive();
  const auto frame = contents.metadata.extract(frame_key);
  framed_ = !frame.empty();
  if (framed_ && frame.mapped() != "head")
    throw DataError(where_ + " does not begin with a head frame");
  schema_ = schemaOf(contents, where_);
  if (!framed_) foreign_ = Slab{schema_.lattice.layers(), schema_.lattice.layers(), contents.grids};
}

FrameReader::~FrameReader() = default;

VdbContents FrameReader::receive() {
  const std::optional<std::string_view> uuid = buffer_->peekUuid();
  const bool digested = uuid && isDigestUuid(*uuid);
  if (!uuid) {
    throw DataError(
        framed_ ? where_ + " ended before its closing frame: the run upstream failed or was stopped"
                : where_ + " is empty: the run upstream failed, or nothing was piped in");
  }
  if (framed_ && !digested) throw DataError(where_ + " is damaged: what follows is no frame");
  try {
    if (!digested) {
      std::istream stream(buffer_.get());
      return readArchive(stream);
    }
    const std::string expected(*uuid);
    std::string bytes = buffer_->take(sizeIn(expected));
    if (bytes.size() < sizeIn(expected)) {
      throw DataError("it ends within a frame: the run upstream failed or was stopped");
    }
    if (uuidOf(bytes) != expected) throw DataError("the checksum of a frame does not match");
    std::istringstream stream(std::move(bytes), std::ios::binary);
    return readArchive(stream);
  } catch (const DataError& error) {
    throw DataError(where_ + " is not a readable VDB stream: " + error.what());
  }
}

std::optional<Slab> FrameReader::next() {
  if (ended_) return std::nullopt;
  if (!framed_) {
    ended_ = true;
    return std::exchange(foreign_, std::nullopt);
  }
  VdbContents contents = receive();
  std::istringstream words(contents.metadata[frame_key]);
  std::string kind;
  words >> kind;
  if (kind == "slab") {
    Slab slab;
    words >> slab.core.begin >> slab.core.end;
    slab.valid = slab.core;
    slab.grids = std::move(contents.grids);
    layers_ += slab.core.size();
    if (words) return slab;
  } else if (kind == "end") {
    int layers = 0;
    words >> layers;
    if (words && layers == layers_) {
      ended_ = true;
      return std::nullopt;
    }
  }
  throw DataError(where_ + " has a frame out of place: '" + contents.metadata[frame_key] + "'");
}

}  // namespace vdbdither
