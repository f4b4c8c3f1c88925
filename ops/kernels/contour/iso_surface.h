#pragma once

// The contour family: kernels that turn voxels and scalar fields into meshes.

#include <cstdint>
#include <vector>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/bit_layers.h"
#include "vdbdither/model/lattice.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// A piece of a mesh. Its vertices follow those of the pieces before it, and its triangles index
/// all of them.
struct SurfacePiece {
  std::vector<openvdb::Vec3d> vertices;  ///< mm
  std::vector<Mesh::Triangle> triangles;
  /// The first vertex that triangles of later pieces can have; earlier ones are no longer needed.
  std::uint32_t open_from = 0;
};

/// Adds `piece` to the mesh of the pieces before it.
void append(Mesh& mesh, const SurfacePiece& piece);

/// The surface of voxels, or of a scalar field at a level, by marching cubes, layer by layer.
///
/// The mesh is a closed manifold that faces outwards: every side of a triangle is met by exactly
/// one other, in the opposite direction, and the triangles at a vertex form one ring. It is closed
/// at the lattice's box, below the first layer and above the last one, as if everything beyond were
/// empty (for a field: background). Vertices lie on the lines between neighbouring voxel centres,
/// at least 1/256 of the line from its ends, so that no two of them coincide. Neither the vertices
/// nor the triangles nor their order depend on how the layers are divided into pieces. Only a few
/// layers are held in memory.
class IsoSurface {
 public:
  /// The interpolation of a field between voxel centres.
  enum class Between {
    linear,
    /// Linear in the inverse of the normal distribution, for occupancies: exact for a plane
    /// convolved with a Gaussian.
    probit
  };

  /// The surface of voxels, whose vertices lie in the middle of the lines.
  explicit IsoSurface(const Lattice& lattice);

  /// The surface where a field passes `level`. `background` is its value beyond the box, which is
  /// outside.
  IsoSurface(const Lattice& lattice, Inside inside, float level, float background,
             Between between = Between::linear);

  /// Adds the next `layers`, above those before. Throws DataError if the mesh would have more
  /// vertices than 32 bits can count.
  SurfacePiece add(const openvdb::BoolGrid::ConstPtr& voxels, ZRange layers);
  SurfacePiece add(const openvdb::FloatGrid::ConstPtr& field, ZRange layers);

  /// Closes the surface above the last layer.
  SurfacePiece finish();

  /// Returns the voxels of the layers that are inside.
  [[nodiscard]] std::vector<BitLayer> insideOf(const openvdb::BoolGrid& voxels,
                                               ZRange layers) const {
    return bitLayers(voxels, layout_, layers);
  }
  [[nodiscard]] std::vector<BitLayer> insideOf(const openvdb::FloatGrid& field,
                                               ZRange layers) const {
    return bitLayers(field, layout_, layers, inside_, level_);
  }
  [[nodiscard]] const BitLayout& layout() const { return layout_; }

 private:
  /// The lines along one axis that the surface cuts, and their vertices: `first` of a word is the
  /// vertex of its lowest set bit.
  struct CutLines {
    std::vector<std::uint64_t> cut;
    std::vector<std::uint32_t> first;

    [[nodiscard]] std::uint32_t vertex(std::size_t row, int x) const;
  };
  struct Layer {
    BitLayer inside;
    CutLines along_x, along_y;
  };
  struct Step;
  class Values;

  SurfacePiece addBits(std::vector<BitLayer> bits, ZRange layers);
  void march(std::vector<Step>& steps, SurfacePiece& piece);
  void findCuts(Step& step, int row) const;
  void number(std::vector<Step>& steps, SurfacePiece& piece);
  void emitTriangles(const Step& step, int row, SurfacePiece& piece) const;
  void emitVertices(const Step& step, int row, Values& values, SurfacePiece& piece) const;
  template <typename Work>
  void forSomeRows(const std::vector<Step>& steps, const Work& work) const;
  template <typename Visit>
  void forEachCell(const Step& step, int row, const Visit& visit) const;

  Lattice lattice_;
  BitLayout layout_;
  bool is_field_ = false;
  Inside inside_ = Inside::below;
  float level_ = 0;
  float background_ = 0;
  Between between_ = Between::linear;

  bool begun_ = false;
  int next_layer_ = 0;
  Layer last_;
  std::uint32_t vertex_count_ = 0;
  openvdb::FloatGrid::ConstPtr below_, here_;  ///< the field of the last layer, and of the new ones
  ZRange here_layers_;
  int first_layer_ = 0;
};

}  // namespace vdbdither
