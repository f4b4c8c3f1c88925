#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "io/profile/material_table.h"
#include "io/stack/slice_spans.h"
#include "io/stack/stack_files.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// What `manifest.json` says of a stack of slices.
struct Manifest {
  /// A file of the stack.
  struct Slice {
    int layer = 0;
    std::string file;
    std::string sha256;    ///< of its bytes, hexadecimal; empty in a container
    std::string material;  ///< whose voxels it shows; empty: all
  };

  std::string format;                ///< name of a SliceFormat
  std::string grid = material_grid;  ///< whose voxels the slices show
  std::string printer;               ///< the profile as JSON, or empty
  std::vector<std::string> history;  ///< one command line per step
  Lattice lattice;                   ///< of the job
  SliceLayout layout;                ///< of every slice; its box is the lattice's
  std::array<std::uint8_t, 4> background{};
  MaterialTable materials;
  std::vector<std::uint64_t> voxels;  ///< of each material; not read back
  ZRange layers;                      ///< the ones that the stack holds
  int cropped_below = 0;              ///< blank layers below these that were left out
  int cropped_above = 0;              ///< and above
  std::vector<Slice> slices;          ///< in rising layers

  /// The layers whose voxels are known.
  [[nodiscard]] ZRange knownLayers() const {
    return {layers.begin - cropped_below, layers.end + cropped_above};
  }

  /// The maximum size of the file of a slice, in bytes: that of its pixels with all channels that a
  /// format has, uncompressed.
  [[nodiscard]] std::uint64_t mostBytesOfSlice() const {
    constexpr std::uint64_t header = 1 << 20;
    constexpr std::uint64_t pixel = 32;
    return header + pixel * layout.width() * layout.height();
  }
};

/// The end of a refusal that names the remedy.
inline constexpr const char* make_stack_again = "; make the stack again with slice-export";

/// The end of a refusal that a user who edited a stack can get past.
inline constexpr const char* make_stack_again_or_take_edited =
    "; make the stack again with slice-export, or give --edited to take it as it is";

/// Whether a stack is taken that differs from what slice-export wrote.
enum class EditedStack { refused, taken };

/// Returns the text of `manifest.json`, which ends with a digest of the rest.
std::string textOf(const Manifest& manifest);

/// Reads the manifest of a stack. Throws DataError where it is missing or malformed, where its
/// lattice, layout and layers do not fit together, and where it is not as `textOf` made it.
/// @param edited  taken: warns of the last
Manifest readManifest(const StackInput& stack, EditedStack edited,
                      const std::function<void(const std::string&)>& warn);

/// Returns the files that the manifest of a stack names, whatever else it says. Throws DataError.
std::set<std::string> filesNamedBy(const StackInput& stack);

}  // namespace vdbdither
