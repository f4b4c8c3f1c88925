#include "io/vdb/frames.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <map>
#include <sstream>
#include <unistd.h>
#include <vector>

#include "io/file/descriptor_wait.h"
#include "io/vdb/archive_digest.h"
#include "io/vdb/archive_reader.h"
#include "io/vdb/grid_checks.h"
#include "io/vdb/pipe_input.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

/// The id of a run is the UUID of its head frame: the same run gives the same bytes, so that it is
/// a digest and not a random number.
std::string uuidOf(std::string_view archive) {
  return std::string(archive.substr(uuid_offset, uuid_size));
}

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

/// The next archive as bytes. `begun`: frames came before it.
std::string receive(int descriptor, const std::string& where, bool begun) {
  std::string bytes = take(descriptor, where, archive_head_size);
  if (bytes.empty()) {
    throw DataError(
        begun ? where + " ended before its closing frame: the run upstream failed or was stopped"
              : where + " is empty: the run upstream failed, or nothing was piped in");
  }
  // Archives of other tools do not say how long they are: such a pipe holds one.
  const std::size_t length = statedLength(bytes).value_or(std::numeric_limits<std::size_t>::max());
  if (length > bytes.size()) bytes += take(descriptor, where, length - bytes.size());
  return bytes;
}

/// Refuses a pipe on which something follows. `behind` says what was read last.
void requireEnd(int descriptor, const std::string& where, const std::string& behind) {
  // All of it is read, so that its writer is not stopped, but an endless pipe is left.
  constexpr std::uint64_t most = 1ULL << 30U;
  std::string begin = take(descriptor, where, sizeof(std::int64_t));
  if (begin.empty()) return;
  std::uint64_t size = begin.size();
  for (std::size_t count = 1; count > 0 && size < most; size += count)
    count = take(descriptor, where, 1 << 20).size();
  throw DataError(where + " goes on behind " + behind + ": " + whatFollows(begin, size) +
                  "; pipe in one run or one file at a time");
}

}  // namespace

void FrameWriter::head(const Schema& schema) {
  VdbContents contents = contentsOf(schema, schema.grids);
  contents.metadata[frame_key] = "head";
  run_ = send(contents);
}

void FrameWriter::slab(const Slab& slab) {
  layers_ += slab.core.size();
  send({slab.grids,
        {{frame_key,
          "slab " + std::to_string(slab.core.begin) + " " + std::to_string(slab.core.end)},
         {run_key, run_}}});
}

void FrameWriter::end() {
  send({{}, {{frame_key, "end " + std::to_string(layers_)}, {run_key, run_}}});
}

std::string FrameWriter::send(const VdbContents& contents) {
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
  return uuidOf(bytes);
}

FrameReader::FrameReader(int descriptor, const std::string& where)
    : FrameReader(descriptor, where, receive(descriptor, where, false)) {}

FrameReader::FrameReader(int descriptor, std::string where, const std::string& first)
    : descriptor_(descriptor), where_(std::move(where)) {
  VdbContents contents = contentsOfBytes(first, where_);
  const auto frame = contents.metadata.extract(frame_key);
  framed_ = !frame.empty();
  if (framed_ && frame.mapped() != "head")
    throw DataError(where_ + " does not begin with a head frame");
  if (!framed_) requireEnd(descriptor_, where_, "its archive");
  run_ = uuidOf(first);
  whole_ = std::move(contents);
}

const Schema& FrameReader::schema() {
  if (!schema_) {
    admitGrids(whole_.grids, where_);
    schema_ = schemaOf(whole_, where_);
    const ZRange layers = schema_->lattice.layers();
    if (!framed_) foreign_ = Slab{layers, layers, std::move(whole_.grids)};
  }
  return *schema_;
}

VdbContents FrameReader::readWhole(int descriptor, const std::string& where) {
  FrameReader frames(descriptor, where);
  if (!frames.framed_) return std::move(frames.whole_);
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
  const Schema& known = schema();
  if (!framed_) {
    ended_ = true;
    return std::exchange(foreign_, std::nullopt);
  }
  VdbContents contents = contentsOfBytes(receive(descriptor_, where_, true), where_);
  const std::string frame = contents.metadata[frame_key];
  if (frame == "head" || contents.metadata[run_key] != run_) {
    throw DataError(where_ +
                    " mixes the frames of two runs; give each run a pipe of its own, and "
                    "combine what they make by csg");
  }
  std::istringstream words(frame);
  std::string kind;
  words >> kind;
  if (kind == "slab") {
    Slab slab;
    words >> slab.core.begin >> slab.core.end;
    if (words && !slab.core.empty() && slab.core.begin == next_layer_.value_or(slab.core.begin) &&
        intersection(slab.core, known.lattice.layers()) == slab.core) {
      admitGrids(contents.grids, where_);
      slab.valid = slab.core;
      slab.grids = std::move(contents.grids);
      layers_ += slab.core.size();
      next_layer_ = slab.core.end;
      return slab;
    }
  } else if (kind == "end") {
    int layers = 0;
    words >> layers;
    if (words && layers == layers_) {
      requireEnd(descriptor_, where_, "its closing frame");
      ended_ = true;
      return std::nullopt;
    }
  }
  throw DataError(where_ + " has a frame out of place: '" + frame + "'; make it again");
}

}  // namespace vdbdither
