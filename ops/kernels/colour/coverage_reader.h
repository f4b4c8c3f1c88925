#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "ops/kernels/colour/separation.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Coverages of materials, voxel by voxel. For one thread.
class CoverageReader {
 public:
  virtual ~CoverageReader() = default;

  /// Goes to the leaf at `origin`. Returns whether some of its voxels have coverages.
  virtual bool visit(const openvdb::Coord& origin) = 0;

  /// Returns a bit for each voxel of a column of the visited leaf, from below, that has coverages.
  /// @param column  the offset of the lowest voxel
  [[nodiscard]] virtual unsigned layersWith(unsigned column) const = 0;

  /// Sets `coverages`, one for each material, ≥ 0 and of sum 1 to 1e-6, to those of the lowest of
  /// some voxels of a column, and returns those of `layers` that are known to have the same, this
  /// one among them. Throws DataError for values that are no coverages.
  /// @param layers  one or more of layersWith(column)
  virtual unsigned read(unsigned column, unsigned layers, std::span<float> coverages) = 0;
};

/// Where coverages come from. Safe to use from many threads.
class CoverageSource {
 public:
  virtual ~CoverageSource() = default;
  [[nodiscard]] virtual std::unique_ptr<CoverageReader> reader() const = 0;
};

/// Coverages of the colours of a grid. What is not opaque is clear.
class ColourCoverages : public CoverageSource {
 public:
  /// All of them must outlive this.
  /// @param opacity     null: all is opaque; inactive voxels are opaque
  /// @param separation  into the inks of `set`
  ColourCoverages(const openvdb::Vec3SGrid& colour, const openvdb::FloatGrid* opacity,
                  const InkSet& set, const Separation& separation)
      : colour_(colour), opacity_(opacity), set_(set), separation_(separation) {}

  [[nodiscard]] std::unique_ptr<CoverageReader> reader() const override;

 private:
  const openvdb::Vec3SGrid& colour_;
  const openvdb::FloatGrid* opacity_;
  const InkSet& set_;
  const Separation& separation_;
};

/// Coverages that grids of float hold. Voxels that are active in no grid have none.
class GridCoverages : public CoverageSource {
 public:
  struct Grid {
    const openvdb::FloatGrid* grid;  ///< must outlive this
    std::string name;                ///< what messages call it
    std::size_t material;
  };
  /// @param rest  the material that what is missing to a sum of 1 goes to. Without one, the
  ///              coverages of a voxel are divided by their sum, which must not be 0. A sum above 1
  ///              is always divided.
  GridCoverages(std::vector<Grid> grids, std::optional<std::size_t> rest)
      : grids_(std::move(grids)), rest_(rest) {}

  [[nodiscard]] std::unique_ptr<CoverageReader> reader() const override;

 private:
  std::vector<Grid> grids_;
  std::optional<std::size_t> rest_;
};

}  // namespace vdbdither
