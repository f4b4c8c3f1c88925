#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "ops/kernels/leaf/leaf_bits.h"

namespace vdbdither {

/// What is known of a box of leaves while their nearest features are sought: distances, and items
/// that were noted. The distances of a leaf come into being where a feature first reaches it.
class LeafDistances {
 public:
  /// The most leaves that a box may hold along z, and along y.
  static constexpr int depth = 8;
  static constexpr int max_rows = 4;
  static constexpr int voxels = 512;

  /// Empties it, for other leaves. `leaves`: coordinates of leaves, inclusive. `track`: whether the
  /// nearest features' names are kept too.
  void begin(const openvdb::CoordBBox& leaves, bool track);

  [[nodiscard]] const openvdb::CoordBBox& leaves() const { return leaves_; }
  /// Where a leaf of the box is kept; those along z follow each other.
  [[nodiscard]] std::size_t slot(const openvdb::Coord& leaf) const {
    const openvdb::Coord at = leaf - leaves_.min();
    return (static_cast<std::size_t>(at.x()) * rows_ + static_cast<std::size_t>(at.y())) * depth +
           static_cast<std::size_t>(at.z());
  }
  /// From a leaf to the next along x.
  [[nodiscard]] std::size_t stride() const { return rows_ * depth; }
  [[nodiscard]] std::size_t slots() const { return distances_.size(); }

  /// In mm, in OpenVDB's order, the smallest so far; null where nothing reached.
  [[nodiscard]] float* distances(std::size_t slot) const { return distances_[slot]; }
  /// The names of the features that gave them, if kept.
  [[nodiscard]] std::uint32_t* names(std::size_t slot) const { return names_[slot]; }
  /// Makes the leaf at `slot`, all of it infinitely far.
  float* make(std::size_t slot);

  /// Keeps `item` at `slot`.
  void note(std::size_t slot, std::uint32_t item) {
    occupy(slot);
    notes_.push_back({item, last_note_[slot]});
    last_note_[slot] = static_cast<std::uint32_t>(notes_.size() - 1);
  }
  /// Calls visit(item) for what was noted at `slot`, the last first.
  template <class Visit>
  void visitNotes(std::size_t slot, const Visit& visit) const {
    for (std::uint32_t at = last_note_[slot]; at != none; at = notes_[at].before)
      visit(notes_[at].item);
  }
  [[nodiscard]] bool noted(std::size_t slot) const { return last_note_[slot] != none; }

  /// Bit depth · y + z for the leaves at the coordinate x where there are distances or notes.
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

/// A linear function of the offset of a voxel from some other.
struct LatticeForm {
  double x, y, z, constant;
};

/// A side of a triangle, for the distance to it within the triangle's plane.
struct LatticeSide {
  LatticeForm outward, along;  ///< in mm, from the side's beginning
  double length_mm;
};

/// What a feature gives to the voxels of its region.
struct LatticeRegion {
  static constexpr int max_bounds = 20;

  openvdb::Coord base;       ///< where offsets begin, multiples of 8
  openvdb::CoordBBox reach;  ///< the voxels looked at, all of them in the leaves at hand
  int rank;                  ///< the distance is the root of the sum of so many squared forms
  int bounds;                ///< voxels where one of so many forms is below zero are left out
  std::array<LatticeForm, 3> distance;  ///< in mm
  /// Of rank 1 the first three are those of `side`, each `spread_mm` further out.
  std::array<LatticeForm, max_bounds> bound;
  /// Of rank 1, which is a triangle: beyond its sides the distance is that to the triangle itself;
  /// further than `spread_mm` beyond them voxels are left out.
  std::array<LatticeSide, 3> side;
  double spread_mm;
};

/// The leaves between two planes, a box of them at most.
struct LatticeSheet {
  openvdb::Coord base;        ///< a leaf, where offsets begin
  openvdb::CoordBBox leaves;  ///< coordinates of leaves, of those at hand
  LatticeForm form;           ///< of the offset of a leaf
  double limit;               ///< leaves where |form| is above it are left out
};

/// What runs in the innermost loops, compiled for one instruction set. All give the same bits, and
/// these do not depend on what else `reach` holds.
struct LeafKernels {
  /// Lowers distances to those of a feature; of equal ones the one met first stays.
  void (*lower)(const LatticeRegion& region, std::uint32_t name, bool track, LeafDistances& leaves);

  /// Raises `values`, one for each slot of `at`, to `value` at the leaves of a sheet.
  void (*raise)(const LatticeSheet& sheet, float value, const LeafDistances& at, float* values);

  /// Values in mm: −distance where `inside`, else +distance; ±background where not below `limit_mm`
  /// or not in `exists`. Distances below `tie_mm` become `tied_mm`. Returns the bits of the voxels
  /// that are below the limit.
  LeafBits (*finish)(const float* distances, const LeafBits& inside, const LeafBits& exists,
                     float tie_mm, float limit_mm, float background_mm, float* values);
};

/// The kernels for this processor.
const LeafKernels& leafKernels();

/// The same for any processor, to compare with.
const LeafKernels& portableLeafKernels();

}  // namespace vdbdither
