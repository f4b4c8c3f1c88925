#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "ops/kernels/leaf/leaf_bits.h"

namespace vdbdither {

/// The distances of a box of leaves while their nearest features are searched, and items noted for
/// leaves. The distances of a leaf are allocated when the first feature reaches it.
class LeafDistances {
 public:
  /// The maximum number of leaves of a box along z, and along y.
  static constexpr int depth = 8;
  static constexpr int max_rows = 4;
  static constexpr int voxels = 512;

  /// Clears everything, for other leaves. `leaves` are coordinates of leaves, inclusive. With
  /// `track`, the names of the nearest features are kept too.
  void begin(const openvdb::CoordBBox& leaves, bool track);

  [[nodiscard]] const openvdb::CoordBBox& leaves() const { return leaves_; }
  /// Returns the slot of a leaf of the box; those along z are consecutive.
  [[nodiscard]] std::size_t slot(const openvdb::Coord& leaf) const {
    const openvdb::Coord at = leaf - leaves_.min();
    return (static_cast<std::size_t>(at.x()) * rows_ + static_cast<std::size_t>(at.y())) * depth +
           static_cast<std::size_t>(at.z());
  }
  /// The number of slots from a leaf to the next along x.
  [[nodiscard]] std::size_t stride() const { return rows_ * depth; }
  [[nodiscard]] std::size_t slots() const { return distances_.size(); }

  /// Returns the smallest distances so far, mm, in OpenVDB's order; null if no feature has reached
  /// the leaf.
  [[nodiscard]] float* distances(std::size_t slot) const { return distances_[slot]; }
  /// Returns the names of the features of these distances, if kept.
  [[nodiscard]] std::uint32_t* names(std::size_t slot) const { return names_[slot]; }
  /// Makes the leaf at `slot`, with infinite distances.
  float* make(std::size_t slot);

  /// Notes `item` at `slot`.
  void note(std::size_t slot, std::uint32_t item) {
    occupy(slot);
    notes_.push_back({item, last_note_[slot]});
    last_note_[slot] = static_cast<std::uint32_t>(notes_.size() - 1);
  }
  /// Calls visit(item) for the items noted at `slot`, the last first.
  template <class Visit>
  void visitNotes(std::size_t slot, const Visit& visit) const {
    for (std::uint32_t at = last_note_[slot]; at != none; at = notes_[at].before)
      visit(notes_[at].item);
  }
  [[nodiscard]] bool noted(std::size_t slot) const { return last_note_[slot] != none; }

  /// Returns bit depth · y + z for the leaves at the coordinate x that have distances or notes.
  [[nodiscard]] std::uint64_t occupied(int x) const {
    return occupied_[static_cast<std::size_t>(x - leaves_.min().x())];
  }

 private:
  template <class Value>
  struct Pool {
    std::vector<std::unique_ptr<Value[]>> pages;
    std::size_t used = 0;  ///< leaves

    Value* take();
  };

  struct Note {
    std::uint32_t item, before;
  };
  static constexpr std::uint32_t none = 0xffffffffU;

  void occupy(std::size_t slot) { occupied_[slot / stride()] |= 1ULL << slot % stride(); }

  openvdb::CoordBBox leaves_;
  std::size_t rows_ = 0;
  bool track_ = false;
  std::vector<std::uint64_t> occupied_;
  std::vector<float*> distances_;
  std::vector<std::uint32_t*> names_;
  std::vector<std::uint32_t> last_note_;
  std::vector<Note> notes_;
  Pool<float> distance_pool_;
  Pool<std::uint32_t> name_pool_;
};

/// A linear function of the offset of a voxel from a base.
struct LatticeForm {
  double x, y, z, constant;
};

/// A side of a triangle, for distances within the triangle's plane.
struct LatticeSide {
  LatticeForm outward, along;  ///< in mm, from the beginning of the side
  double length_mm;
};

/// The distances of a feature to the voxels of its region.
struct LatticeRegion {
  static constexpr int max_bounds = 20;

  openvdb::Coord base;       ///< the base of offsets, multiples of 8
  openvdb::CoordBBox reach;  ///< the voxels to test, all in the box of leaves
  int rank;                  ///< the distance is the root of the sum of this many squared forms
  int bounds;                ///< voxels where one of this many forms is negative are left out
  std::array<LatticeForm, 3> distance;  ///< in mm
  /// For rank 1 the first three are those of `side`, each `spread_mm` further out.
  std::array<LatticeForm, max_bounds> bound;
  /// For rank 1, a triangle: beyond its sides the distance is that to the triangle itself, and
  /// voxels more than `spread_mm` beyond them are left out.
  std::array<LatticeSide, 3> side;
  double spread_mm;
};

/// The leaves of a box between two parallel planes.
struct LatticeSheet {
  openvdb::Coord base;        ///< a leaf, the base of offsets
  openvdb::CoordBBox leaves;  ///< coordinates of leaves, in the box of leaves
  LatticeForm form;           ///< of the offset of a leaf
  double limit;               ///< leaves where |form| is above it are left out
};

/// The innermost loops, compiled for one instruction set. All sets give the same bits, which do not
/// depend on the other voxels in `reach`.
struct LeafKernels {
  /// Lowers distances to those of a feature; of equal ones the first stays.
  void (*lower)(const LatticeRegion& region, std::uint32_t name, bool track, LeafDistances& leaves);

  /// Raises `values`, one for each slot of `at`, to at least `value` at the leaves of a sheet.
  void (*raise)(const LatticeSheet& sheet, float value, const LeafDistances& at, float* values);

  /// Writes values in mm: −distance for voxels in `inside`, +distance for others; ±background for
  /// voxels that are not in `exists` or not below `limit_mm`. Distances below `tie_mm` become
  /// `tied_mm`. Returns the bits of the voxels that exist and are below the limit.
  LeafBits (*finish)(const float* distances, const LeafBits& inside, const LeafBits& exists,
                     float tie_mm, float limit_mm, float background_mm, float* values);
};

/// Returns the kernels for the best instruction set.
const LeafKernels& leafKernels();

/// Returns the kernels for any processor, for comparison.
const LeafKernels& portableLeafKernels();

}  // namespace vdbdither
