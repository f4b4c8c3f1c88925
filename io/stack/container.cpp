#include "io/stack/container.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "io/file/file_name.h"
#include "io/file/text_bytes.h"
#include "io/image/png_spans.h"
#include "io/image/srgb.h"
#include "io/profile/printer_profile.h"
#include "vdbdither/engine/option_values.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

DescribedStack describedBy(const ContainerContents& contents, const StackInput& files) {
  constexpr std::int64_t widest = 1 << 24;
  constexpr double finest_mm = 1e-6;
  constexpr double coarsest_mm = 1e3;
  for (const std::int64_t size : {contents.width, contents.height, contents.layers}) {
    if (size < 1 || size > widest) {
      throw DataError(contents.shown + " says that the slices have " +
                      std::to_string(contents.width) + " x " + std::to_string(contents.height) +
                      " pixels and " + std::to_string(contents.layers) +
                      " layers; each must be from 1 to 16777216");
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (!(contents.pitch_mm[axis] >= finest_mm && contents.pitch_mm[axis] <= coarsest_mm)) {
      throw DataError(contents.shown + " says that a voxel is " +
                      shortestText(contents.pitch_mm[axis]) +
                      " mm long; it must be from 0.000001 to 1000");
    }
  }
  const std::size_t there = files.names().size();
  if (static_cast<std::size_t>(contents.layers) > there) {
    throw DataError(contents.shown + " says that there are " + std::to_string(contents.layers) +
                    " layers, and there are " + std::to_string(there) + " files");
  }
  Manifest manifest;
  manifest.format = contents.format;
  manifest.grid = contents.materials.empty() ? solid_grid : material_grid;
  manifest.lattice.pitch_mm = contents.pitch_mm;
  manifest.lattice.origin_mm = contents.origin_mm;
  const openvdb::Coord size(static_cast<int>(contents.width), static_cast<int>(contents.height),
                            static_cast<int>(contents.layers));
  manifest.lattice.box = {contents.corner, contents.corner + size - openvdb::Coord(1, 1, 1)};
  manifest.layout = {manifest.lattice.box, 0, contents.flip_x, contents.flip_y};
  manifest.background = contents.background;
  manifest.materials = contents.materials;
  manifest.layers = manifest.lattice.layers();
  const bool has_file_each = findSliceFormat(contents.format)->pixel == SlicePixel::one_material;
  const std::size_t files_of_layer = has_file_each ? contents.materials.size() : 1;
  for (int layer = 0; layer < manifest.layers.size(); ++layer) {
    for (std::size_t i = 0; i < files_of_layer; ++i) {
      const std::string name = contents.file_name(layer, i);
      if (const auto problem = relativePathProblem(name))
        throw DataError(contents.shown + ": the name of the slice '" + name + "' " + *problem);
      manifest.slices.push_back({manifest.layers.begin + layer, name, "",
                                 has_file_each ? contents.materials[i].name : ""});
    }
  }
  return {contents.configuration, std::move(manifest)};
}

PrinterProfile printerOf(const Manifest& stack) {
  return stack.printer.empty() ? PrinterProfile() : printerProfileFromJson(stack.printer);
}

void checkPitch(std::string_view format, const Manifest& stack, const PrinterProfile& printer) {
  constexpr double tolerance = 1e-6;
  const openvdb::Vec3d& pitch_mm = stack.lattice.pitch_mm;
  for (int axis = 0; axis < 3 && !printer.name.empty(); ++axis) {
    if (std::abs(pitch_mm[axis] / printer.pitch_mm[axis] - 1) <= tolerance) continue;
    throw UsageError("--format: " + std::string(format) + " is for the printer, and along " +
                     "xyz"[axis] + " its voxels are " + shortestText(printer.pitch_mm[axis]) +
                     " mm long, those of the grid " + shortestText(pitch_mm[axis]) +
                     "; bring the part to the lattice of the printer with resample or interlace");
  }
}

std::string resinOf(const Material& material, const PrinterProfile& printer) {
  for (const Material& known : printer.materials) {
    if (known.name == material.name && !known.resin.empty()) return known.resin;
  }
  return material.name;
}

void writeText(StackOutput& output, const std::string& name, std::string_view text) {
  output.write(name, textBytes(text));
}

Picture thumbnailOf(const SpanImage& image, std::uint32_t width, std::uint32_t height) {
  const double scale = std::max(
      {1.0, static_cast<double>(image.width) / width, static_cast<double>(image.height) / height});
  const auto inner_width = std::max(1U, static_cast<std::uint32_t>(image.width / scale));
  const auto inner_height = std::max(1U, static_cast<std::uint32_t>(image.height / scale));
  // Sums of linear light, each pixel of the image in one pixel of the thumbnail.
  std::vector<std::array<double, 4>> sums(std::size_t{inner_width} * inner_height);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    const auto row = static_cast<std::uint32_t>(std::uint64_t{y} * inner_height / image.height);
    std::uint32_t x = 0;
    for (const Span& span : image.row(y)) {
      std::array<double, 3> light{};
      for (int channel = 0; channel < 3; ++channel)
        light[channel] = linearOfSrgbBytes()[span.value >> 8 * channel & 255];
      for (; x < span.end; ++x) {
        const auto column =
            static_cast<std::uint32_t>(std::uint64_t{x} * inner_width / image.width);
        std::array<double, 4>& sum = sums[std::size_t{row} * inner_width + column];
        for (int channel = 0; channel < 3; ++channel) sum[channel] += light[channel];
        sum[3] += 1;
      }
    }
  }
  Picture picture{width, height,
                  std::vector<std::uint32_t>(std::size_t{width} * height, rgba(0, 0, 0))};
  const std::uint32_t left = (width - inner_width) / 2;
  const std::uint32_t top = (height - inner_height) / 2;
  for (std::uint32_t y = 0; y < inner_height; ++y) {
    for (std::uint32_t x = 0; x < inner_width; ++x) {
      const std::array<double, 4>& sum = sums[std::size_t{y} * inner_width + x];
      const double count = std::max(1.0, sum[3]);
      picture.pixels[std::size_t{top + y} * width + left + x] =
          rgba(srgbByteOf(sum[0] / count), srgbByteOf(sum[1] / count), srgbByteOf(sum[2] / count));
    }
  }
  return picture;
}

}  // namespace vdbdither
