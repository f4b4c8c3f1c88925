#include "io/vdb/frames.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <map>
#include <sstream>
#include <unistd.h>
#include <vector>

#include "io/file/standard_streams.h"
#include "io/vdb/archive_digest.h"
#include "io/vdb/pipe_input.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

constexpr const char* frame_key = "vdbdither:frame";

/// Up to `size` bytes; fewer where the pipe ends.
std::string take(int descriptor, const std::string& where, std::size_t size) {
  constexpr std::size_t chunk = 1 << 20;
  std::string bytes;
  // Room grows with what comes: a damaged length must not ask for all of memory.
  while (bytes.size() < size) {
    const std::size_t begin = bytes.size();
    bytes.resize(begin + std::min(chunk, size - begin));
    const std::size_t count =
        readSome(descriptor, bytes.data() + begin, bytes.size() - begin, where);
    bytes.resize(begin + count);
    if (count == 0) break;
  }
  return bytes;
}

/// The next archive. `begun`: frames came before it.
VdbContents receive(int descriptor, const std::string& where, bool begun) {
  std::string bytes = take(descriptor, where, archive_head_size);
  if (bytes.empty()) {
    throw DataError(
        begun ? where + " ended before its closing frame: the run upstream failed or was stopped"
              : where + " is empty: the run upstream failed, or nothing was piped in");
  }
  // Archives of other tools do not say how long they are: such a pipe holds one.
  const std::size_t length = statedLength(bytes).value_or(std::numeric_limits<std::size_t>::max());
  if (length > bytes.size()) bytes += take(descriptor, where, length - bytes.size());
  return contentsOfBytes(bytes, where);
}

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
    throwIfInterrupted();
    const ssize_t count = ::write(descriptor_, bytes.data() + sent, bytes.size() - sent);
    if (count >= 0) {
      sent += static_cast<std::size_t>(count);
    } else if (errno == EPIPE) {
      throw DataError("the reader of the pipe has gone");
    } else if (errno == EAGAIN) {
      waitForOutput(descriptor_);
    } else if (errno != EINTR) {
      throw DataError(std::string("cannot write to standard output: ") + std::strerror(errno));
    }
  }
}

FrameReader::FrameReader(int descriptor, const std::string& where)
    : FrameReader(descriptor, where, receive(descriptor, where, false)) {}

FrameReader::FrameReader(int descriptor, std::string where, VdbContents first)
    : descriptor_(descriptor), where_(std::move(where)) {
  const auto frame = first.metadata.extract(frame_key);
  framed_ = !frame.empty();
  if (framed_ && frame.mapped() != "head")
    throw DataError(where_ + " does not begin with a head frame");
  schema_ = schemaOf(first, where_);
  if (!framed_) foreign_ = Slab{schema_.lattice.layers(), schema_.lattice.layers(), first.grids};
}

VdbContents FrameReader::readWhole(int descriptor, const std::string& where) {
  VdbContents first = receive(descriptor, where, false);
  if (!first.metadata.contains(frame_key)) {
    if (!take(descriptor, where, 1).empty())
      throw DataError(where + " goes on behind its archive; pipe in one file at a time");
    return first;
  }
  FrameReader frames(descriptor, where, std::move(first));
  std::map<std::string, std::vector<GridLayers>, std::less<>> pieces;
  while (const std::optional<Slab> slab = frames.next())
    for (const auto& [name, grid] : slab->grids) pieces[name].push_back({grid, slab->core});
  VdbContents whole = contentsOf(frames.schema(), frames.schema().grids);
  for (const auto& [name, layers] : pieces)
    whole.grids[name] = pruned(joinLayers(layers, frames.schema().lattice.layers()));
  return whole;
}

std::optional<Slab> FrameReader::next() {
  if (ended_) return std::nullopt;
  if (!framed_) {
    ended_ = true;
    return std::exchange(foreign_, std::nullopt);
  }
  VdbContents contents = receive(descriptor_, where_, true);
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
