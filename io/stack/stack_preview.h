#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <openvdb/math/Vec3.h>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// A picture of a stack for people: on the left the part from the front (orthographic, shaded, in
/// the colours of its materials), on the right its fullest slice, both on one scale in mm, so that
/// voxels have their true shape. The front is the bottom edge of the slices. Gathered layer by
/// layer; memory is a few pictures and one slice.
class StackPreview {
 public:
  /// `pitch_mm` of the voxels, `width` and `height` of every slice in voxels, the `layers` to come,
  /// and the colour of each value of the slices (0 is empty).
  StackPreview(const openvdb::Vec3d& pitch_mm, std::uint32_t width, std::uint32_t height,
               ZRange layers, std::vector<std::uint32_t> palette);

  /// Adds layer `z`, of which `filled` voxels are not empty. Layers come in rising order; missing
  /// ones are empty.
  void add(int z, SpanImage&& slice, std::uint64_t filled);

  /// What the layers that were added show, as bytes for `addPart`.
  [[nodiscard]] std::vector<std::uint8_t> part() const;
  /// Adds the layers of a `part` of the same stack. Throws DataError in words that go on from the
  /// name of what holds it.
  void addPart(std::span<const std::uint8_t> bytes);

  /// The picture as colours, at most 1200 x 1000 pixels.
  [[nodiscard]] SpanImage picture() const;

 private:
  /// What a ray from the front meets first.
  struct Hit {
    float depth_mm;
    std::uint32_t value;  ///< 0: nothing
  };
  struct Pixel {
    float red, green, blue;
  };

  struct Surface;

  void look(const SpanImage& slice, Hit* hits);
  /// The longest edge of a voxel, at least a pixel.
  [[nodiscard]] double stepMm() const;
  [[nodiscard]] std::vector<Surface> surfaces() const;
  [[nodiscard]] Pixel shaded(const std::vector<Surface>& surface, int row, int column) const;
  [[nodiscard]] std::vector<Pixel> front() const;
  [[nodiscard]] std::vector<Pixel> slice() const;

  openvdb::Vec3d pitch_mm_;
  std::uint32_t width_, height_;
  ZRange layers_;
  std::vector<std::uint32_t> palette_;
  double pixel_mm_ = 1;
  int columns_ = 1, front_rows_ = 1, slice_rows_ = 1;
  std::vector<Hit>
      hits_;  ///< samples of the front view, twice as fine as its pixels, top row first
  std::vector<std::uint32_t> first_ray_;  ///< per column of a slice, the first ray at or after it
  std::vector<std::uint32_t>
      next_ray_;  ///< while a layer is looked at: the next ray that has met nothing
  SpanImage fullest_;
  std::uint64_t fullest_count_ = 0;
};

}  // namespace vdbdither
