#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "io/image/picture.h"
#include "io/stack/slice_format.h"
#include "vdbdither/model/printer.h"

namespace vdbdither {

// What containers of slices share.

/// What the configuration of a container says.
struct ContainerContents {
  std::string_view format;
  std::string configuration;  ///< the name of the file that says so
  std::string shown;          ///< the same for messages, in quotes
  openvdb::Vec3d pitch_mm;
  openvdb::Vec3d origin_mm{0.0};   ///< of the lattice
  openvdb::Coord corner{0, 0, 0};  ///< the voxel of the slices with the least coordinates
  std::int64_t width = 0;
  std::int64_t height = 0;
  std::int64_t layers = 0;
  bool flip_x = false;
  bool flip_y = false;
  std::array<std::uint8_t, 4> background{0, 0, 0, 255};
  MaterialTable materials;
  /// The name of the slice of a layer, from 0, and of a material, for formats with a file for each.
  std::function<std::string(int layer, std::size_t material)> file_name;
};

/// Returns the same as a stack. Throws DataError for a size or pitch that no container has, and for
/// more layers than `files`.
DescribedStack describedBy(const ContainerContents& contents, const StackInput& files);

/// The most bytes of a file that describes a container.
inline constexpr std::uint64_t most_configuration_bytes = std::uint64_t{16} << 20;

/// The profile in a manifest, or one that says nothing. Throws DataError.
PrinterProfile printerOf(const Manifest& stack);

/// Checks that a container can hold the stack: its voxels are as the printer's profile says.
/// Throws UsageError.
void checkPitch(std::string_view format, const Manifest& stack, const PrinterProfile& printer);

/// Returns what the maker of the printer calls the material, or its own name.
std::string resinOf(const Material& material, const PrinterProfile& printer);

/// Adds a text to the container.
void writeText(StackOutput& output, const std::string& name, std::string_view text);

/// Returns `image`, made smaller to fit into `width` x `height` pixels, in the middle of black.
Picture thumbnailOf(const SpanImage& image, std::uint32_t width, std::uint32_t height);

}  // namespace vdbdither
