#pragma once

#include <functional>
#include <vector>

#include <openvdb/openvdb.h>

#include "vdbdither/model/lattice.h"

namespace vdbdither::test {

/// Returns a signed distance in mm at a position in mm, < 0 inside.
using Distance = std::function<double(const openvdb::Vec3d&)>;

Distance sphere(const openvdb::Vec3d& centre, double radius);

/// A box with half edges `half`, rotated about x, then y, then z (degrees).
Distance box(const openvdb::Vec3d& centre, const openvdb::Vec3d& half,
             const openvdb::Vec3d& degrees = openvdb::Vec3d(0.0));

/// A torus around an axis parallel to z.
Distance torus(const openvdb::Vec3d& centre, double ring_radius, double tube_radius);

/// The pitches of a Mimaki 3DUJ-553, a Stratasys J750, and cubes.
const std::vector<openvdb::Vec3d>& testPitches();

/// A sphere, a tilted box, a torus and a thin plate.
struct TestShape {
  const char* name;
  Distance distance;
  openvdb::Vec3d extent_mm;  ///< half of its size, about the origin
};
const std::vector<TestShape>& testShapes();

/// Returns the lattice over the box from -extent_mm to extent_mm, plus `padding_mm`.
Lattice latticeAround(const openvdb::Vec3d& pitch_mm, const openvdb::Vec3d& extent_mm,
                      double padding_mm);

/// `layers` cut into slabs of `height` layers, at multiples of eight.
std::vector<ZRange> slabsOf(ZRange layers, int height = leaf_layers);

/// The voxels of `box` in a range of layers.
openvdb::CoordBBox inLayers(openvdb::CoordBBox box, ZRange layers);

/// `surface` on a lattice: active where |d| ≤ `band_mm`, ±`band_mm` elsewhere and in tiles.
openvdb::FloatGrid::Ptr sampled(const Distance& distance, const Lattice& lattice, double band_mm);

/// Expects that `grid` is active and holds `truth` where that is below `band_mm`, and is inactive
/// and holds ±`band_mm` elsewhere. Returns how many voxels are active.
int expectHolds(const openvdb::FloatGrid& grid, const Lattice& lattice, const Distance& truth,
                double band_mm);

/// A dense array over a box of voxels, for references that shall be plain.
template <typename T>
class Volume {
 public:
  Volume(const openvdb::CoordBBox& box, T value) : box_(box), values_(box.volume(), value) {}

  [[nodiscard]] const openvdb::CoordBBox& box() const { return box_; }
  T& operator[](const openvdb::Coord& ijk) { return values_[index(ijk)]; }
  const T& operator[](const openvdb::Coord& ijk) const { return values_[index(ijk)]; }
  [[nodiscard]] T at(const openvdb::Coord& ijk, T outside) const {
    return box_.isInside(ijk) ? (*this)[ijk] : outside;
  }
  friend bool operator==(const Volume&, const Volume&) = default;

 private:
  [[nodiscard]] std::size_t index(const openvdb::Coord& ijk) const {
    const openvdb::Coord at = ijk - box_.min();
    const openvdb::Coord size = box_.dim();
    return static_cast<std::size_t>((at.x() * size.y() + at.y()) * size.z() + at.z());
  }

  openvdb::CoordBBox box_;
  std::vector<T> values_;
};

/// A set of voxels: not 0 where a voxel belongs to it.
using Voxels = Volume<char>;

/// Return the values of `grid` over `box`.
Voxels dense(const openvdb::BoolGrid& grid, const openvdb::CoordBBox& box);
Volume<float> dense(const openvdb::FloatGrid& grid, const openvdb::CoordBBox& box);
Volume<openvdb::Vec3s> dense(const openvdb::Vec3SGrid& grid, const openvdb::CoordBBox& box);

/// Returns the number of voxels in which two volumes over one box differ.
int differences(const Voxels& a, const Voxels& b);

/// Returns the number of groups of voxels that touch by faces, or by faces, edges and corners.
enum class Touching { faces, corners };
int components(Voxels voxels, Touching touching);

}  // namespace vdbdither::test
