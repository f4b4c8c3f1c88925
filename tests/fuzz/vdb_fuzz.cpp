// Feeds the readers of VDB archives with what a fuzzer thinks of: an archive of another tool as a
// file, the frames of a pipe, and a kept mask. They return sound grids or refuse in one line. The
// first byte of a unit chooses the reader; behind each line of `@@` begins an archive.
//
// A checksum would stop a fuzzer, so frames and masks get the right one, and the id of their run.

#include <cstddef>
#include <cstdint>
#include <fcntl.h>
#include <span>
#include <string>
#include <string_view>
#include <unistd.h>
#include <vector>

#include "io/vdb/archive_digest.h"
#include "io/vdb/frames.h"
#include "io/vdb/grid_checks.h"
#include "io/vdb/vdb.h"
#include "tests/fuzz/require.h"
#include "tests/fuzz/scratch_file.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

namespace {

constexpr std::string_view mark = "\n@@\n";

/// What an operator does first with a grid: it goes over every node.
void requireSound(const openvdb::GridBase& grid) {
  grid.apply<CarriedGrids>([](const auto& typed) {
    std::uint64_t active = 0;
    std::uint64_t leaves = 0;
    for (auto leaf = typed.tree().cbeginLeaf(); leaf; ++leaf, ++leaves) {
      require(leaf->origin() == (leaf->origin() & ~7));
      require(typed.tree().probeConstLeaf(leaf->origin()) == &*leaf);
      active += leaf->onVoxelCount();
    }
    require(leaves == typed.tree().leafCount());
    require(active == typed.tree().activeLeafVoxelCount());
  });
}

void requireSound(const Grids& grids) {
  for (const auto& [name, grid] : grids) {
    require(grid && isOneLine(name));
    requireSound(*grid);
    if (const auto fault = faultOf(*grid)) require(isOneLine(*fault));
  }
}

template <typename Function>
void readOrRefuse(const Function& read) {
  try {
    read();
  } catch (const Error& error) {
    require(isOneLine(error.what()));
  }
}

void useSchema(const VdbContents& contents) {
  readOrRefuse([&] {
    Schema schema = schemaOf(contents, "it");
    takeHeldLayers(schema, "it");
  });
}

/// An archive with the checksum that its bytes should have.
std::string withDigest(std::string_view given) {
  std::string bytes(given);
  if (bytes.size() < archive_head_size) return bytes;
  ArchiveDigest digest;
  digest.update(bytes.data(), bytes.size());
  digest.uuid().copy(bytes.data() + uuid_offset, uuid_size);
  return bytes;
}

std::vector<std::string> archivesIn(std::string_view text) {
  std::vector<std::string> archives;
  for (std::size_t at = 0; at != text.npos;) {
    const std::size_t next = text.find(mark, at);
    archives.emplace_back(text.substr(at, next == text.npos ? next : next - at));
    at = next == text.npos ? next : next + mark.size();
  }
  return archives;
}

void readFile(std::string_view bytes) {
  const ScratchFile file({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
  readOrRefuse([&] {
    const VdbContents contents = readVdb(file.path());
    requireSound(contents.grids);
    useSchema(contents);
  });
}

void readMask(std::string_view bytes) {
  const std::string archive = withDigest(bytes);
  const ScratchFile file({reinterpret_cast<const std::uint8_t*>(archive.data()), archive.size()});
  readOrRefuse([&] { requireSound(*readGrid(file.path(), mask_grid)); });
}

void readFrames(std::string_view bytes) {
  std::string pipe;
  std::string stated_run;
  std::string run;
  for (std::string frame : archivesIn(bytes)) {
    const std::string stated =
        frame.size() < archive_head_size ? "" : frame.substr(uuid_offset, uuid_size);
    // Each frame names the run by the checksum of the first.
    for (std::size_t at = 0; !run.empty() && (at = frame.find(stated_run, at)) != frame.npos; ++at)
      frame.replace(at, run.size(), run);
    frame = withDigest(frame);
    if (run.empty() && !stated.empty()) {
      stated_run = stated;
      run = frame.substr(uuid_offset, uuid_size);
    }
    pipe += frame;
  }
  const ScratchFile file({reinterpret_cast<const std::uint8_t*>(pipe.data()), pipe.size()});
  const int descriptor = ::open(file.path().c_str(), O_RDONLY | O_CLOEXEC);
  require(descriptor >= 0);
  readOrRefuse([&] {
    FrameReader reader(descriptor, "it");
    const ZRange layers = reader.schema().lattice.layers();
    while (const auto slab = reader.next()) {
      require(intersection(slab->core, layers) == slab->core);
      requireSound(slab->grids);
    }
  });
  ::close(descriptor);
}

void readUnit(std::string_view unit) {
  if (unit.empty()) return;
  const std::string_view bytes = unit.substr(1);
  switch (unit.front()) {
    case 'm':
      return readMask(bytes);
    case 'p':
      return readFrames(bytes);
    default:
      return readFile(bytes);
  }
}

}  // namespace

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerInitialize(int* /*count*/, char*** /*arguments*/) {
  vdbdither::initializeVdb();
  return 0;
}

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vdbdither::readUnit({reinterpret_cast<const char*>(data), size});
  return 0;
}
