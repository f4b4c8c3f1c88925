#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include <openvdb/math/Vec3.h>

#include "ops/kernels/mesh/mesh_edges.h"
#include "ops/kernels/mesh/swallowed_walls.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// A linear function of the position: gradient · p + constant.
struct LinearForm {
  openvdb::Vec3d gradient;
  double constant;

  [[nodiscard]] double at(const openvdb::Vec3d& p) const { return gradient.dot(p) + constant; }
};

/// A face, an edge or a vertex of a mesh, in the form in which distances to it are computed.
///
/// The squared distance from p to the feature's plane, line or point is the sum of `rank` squared
/// forms. Where every bound is at least zero, this is the distance to the feature itself; only
/// there can the nearest point of the mesh lie on the feature.
struct MeshFeature {
  static constexpr int max_bounds = 16;

  int rank = 0;  ///< 1 face, 2 edge, 3 vertex; 0 for a face without area, which its edges represent
  int bounds = 0;
  std::array<LinearForm, 3> distance;  ///< in mm
  std::array<LinearForm, max_bounds> bound;
  /// If `capped`, a form in mm that never exceeds the distance in the region.
  LinearForm cap;
  bool capped = false;
  /// Whether the region of an edge lies wholly on the side that the normals of its faces point to.
  bool is_ridge = false;
  /// A side of a face: how far a point of the plane lies beyond it and along it, mm.
  struct Side {
    LinearForm outward, along;
    double length_mm;
  };
  /// The sides of a face; its first three bounds are theirs. A face also represents its smooth
  /// edges and corners: its region reaches `spread_mm` beyond its sides.
  std::array<Side, 3> side;
  double spread_mm = 0;
  openvdb::Vec3d min, max;  ///< bounding box of the feature, mm
  openvdb::Vec3d below,
      above;  ///< within distance b: min − b·below to max + b·above
};

/// The triangles of a mesh in rising order of their lowest layer, then row, and the faces, edges
/// and vertices that each owns: every edge and vertex belongs to the first of its triangles.
///
/// The triangles can be any. If they share vertices, the regions of neighbours hardly overlap, so
/// that the work for a distance field depends on its voxels, not on its triangles. Edges and
/// vertices at which the surface is almost flat have no region: the points nearest to them lie so
/// close to the sides of the faces that the regions of the faces are widened instead.
class MeshFeatures {
 public:
  enum class Kind : std::uint32_t { face, edge, vertex };
  class Id {
   public:
    Id() = default;
    Id(Kind kind, std::uint32_t index) : packed_(index << 2 | static_cast<std::uint32_t>(kind)) {}
    explicit Id(std::uint32_t packed) : packed_(packed) {}
    [[nodiscard]] Kind kind() const { return static_cast<Kind>(packed_ & 3); }
    /// The index of the triangle, the edge or the vertex.
    [[nodiscard]] std::uint32_t index() const { return packed_ >> 2; }
    [[nodiscard]] std::uint32_t packed() const { return packed_; }

   private:
    std::uint32_t packed_ = 0;
  };
  struct Extent {
    double low, high;
  };

  /// Keeps a sorted copy of `mesh` (mm), with positions relative to `origin_mm`. `layer_mm` and
  /// `row_mm` are the sizes of the bins along z and y that define the order. Distances above
  /// `maximum_mm` are not needed. Triangles that `walls` hides have no features; their pieces do.
  MeshFeatures(const Mesh& mesh, const SwallowedWalls& walls, const openvdb::Vec3d& origin_mm,
               double layer_mm, double row_mm, double maximum_mm);

  [[nodiscard]] double memoryBytes() const;

  [[nodiscard]] std::uint32_t triangles() const {
    return static_cast<std::uint32_t>(mesh_.triangles.size());
  }

  /// Returns the triangles that meet the layers [low, high] mm, in order. A triangle is identified
  /// by its place in the order.
  [[nodiscard]] std::vector<std::uint32_t> collect(double low, double high) const;

  /// Whether rows that cross the triangle enter or leave the solid; false for pieces.
  [[nodiscard]] bool bounds(std::uint32_t triangle) const {
    return triangle < whole_ || triangle >= features_;
  }
  /// Whether distances are measured to the triangle.
  [[nodiscard]] bool hasFeatures(std::uint32_t triangle) const { return triangle < features_; }

  /// Returns the extent of a triangle along an axis.
  [[nodiscard]] Extent extent(std::uint32_t triangle, int axis) const {
    const Mesh::Triangle& t = mesh_.triangles[triangle];
    const double a = mesh_.vertices[t[0]][axis];
    const double b = mesh_.vertices[t[1]][axis];
    const double c = mesh_.vertices[t[2]][axis];
    return {std::min(std::min(a, b), c), std::max(std::max(a, b), c)};
  }

  /// Calls visit(id) for the features that the triangle owns, except those to which no distance is
  /// needed.
  template <class Visit>
  void visit(std::uint32_t triangle, const Visit& visit) const {
    const std::uint8_t owned = owned_[triangle];
    visit(Id(Kind::face, triangle));
    for (std::uint32_t side = 0; side < 3; ++side)
      if (owned >> side & 1) visit(Id(Kind::edge, side_edges_[3 * triangle + side]));
    for (std::uint32_t corner = 0; corner < 3; ++corner)
      if (owned >> (3 + corner) & 1) visit(Id(Kind::vertex, mesh_.triangles[triangle][corner]));
  }

  /// Whether the feature's bounding box meets the layers and rows [low, high] mm; always true for a
  /// face.
  [[nodiscard]] bool meets(Id id, const openvdb::Vec3d& low, const openvdb::Vec3d& high) const {
    if (id.kind() == Kind::face) return true;
    const bool edge = id.kind() == Kind::edge;
    const openvdb::Vec3d& a = mesh_.vertices[edge ? edges_[id.index()].from : id.index()];
    const openvdb::Vec3d& b = mesh_.vertices[edge ? edges_[id.index()].to : id.index()];
    return std::min(a.z(), b.z()) <= high.z() && std::max(a.z(), b.z()) >= low.z() &&
           std::min(a.y(), b.y()) <= high.y() && std::max(a.y(), b.y()) >= low.y();
  }

  [[nodiscard]] MeshFeature describe(Id id) const;

  /// The point of a feature nearest to a given one.
  struct Nearest {
    openvdb::Vec3d away;  ///< from the nearest point to the given one
    /// The first triangle, in the mesh given, that the face, edge or vertex belongs to; one with
    /// area if there is any.
    std::uint32_t triangle;
  };
  /// Returns the nearest point of the feature, whose region must hold `p`.
  [[nodiscard]] Nearest nearest(Id id, const openvdb::Vec3d& p) const;

  /// Returns a triangle that the feature belongs to.
  [[nodiscard]] std::uint32_t ownerOf(Id id) const {
    switch (id.kind()) {
      case Kind::edge:
        return edges_.halves(id.index()).front() / 3;
      case Kind::vertex:
        return edges_.halves(vertex_edges_[first_edge_[id.index()]]).front() / 3;
      default:
        return id.index();
    }
  }

  /// Returns a corner of a triangle, relative to the origin.
  [[nodiscard]] const openvdb::Vec3d& corner(std::uint32_t triangle, int corner) const {
    return mesh_.vertices[mesh_.triangles[triangle][static_cast<std::size_t>(corner)]];
  }
  /// Returns the unit normal, counter-clockwise; zero for a face without area.
  [[nodiscard]] const openvdb::Vec3d& normal(std::uint32_t triangle) const {
    return normals_[triangle];
  }

  /// Returns by component the minimum magnitude of the normals of a triangle's face and of the
  /// wedges at its three edges.
  [[nodiscard]] openvdb::Vec3d minimumNormal(std::uint32_t triangle) const;

  /// Returns the index of a triangle in the mesh that was given.
  [[nodiscard]] std::uint32_t original(std::uint32_t triangle) const { return original_[triangle]; }

 private:
  Mesh sorted(const Mesh& mesh, const SwallowedWalls& walls, const openvdb::Vec3d& origin_mm,
              double layer_mm, double row_mm);
  void findNormals();
  void findNeighbours();
  void findOwned();
  void findBlocks();

  [[nodiscard]] double bendAtEdge(std::uint32_t edge) const;
  [[nodiscard]] double bendAtVertex(std::uint32_t vertex, const std::vector<float>& at_edge) const;
  [[nodiscard]] bool comesBefore(std::uint32_t one, std::uint32_t other) const;
  [[nodiscard]] std::uint32_t lowestAtEdge(std::uint32_t edge) const;
  [[nodiscard]] std::uint32_t lowestAtVertex(std::uint32_t vertex) const;
  [[nodiscard]] MeshFeature describeFace(std::uint32_t triangle) const;
  [[nodiscard]] MeshFeature describeEdge(std::uint32_t index) const;
  [[nodiscard]] MeshFeature describeVertex(std::uint32_t index) const;

  // Whole triangles come first, then pieces, then hidden triangles.
  std::uint32_t whole_ = 0;              ///< the end of the whole triangles
  std::uint32_t features_ = 0;           ///< the end of the pieces
  std::vector<std::uint32_t> original_;  ///< by triangle
  Mesh mesh_;
  std::vector<openvdb::Vec3d> normals_;
  MeshEdges edges_;
  std::vector<std::uint32_t> first_edge_;  ///< by vertex; one more entry ends the last
  std::vector<std::uint32_t> vertex_edges_;
  std::vector<std::uint32_t> side_edges_;  ///< by half-edge
  std::vector<std::uint8_t> owned_;        ///< by triangle: bits of its sides, then of its corners
  double maximum_mm_;
  std::vector<float> bend_;     ///< by triangle: the maximum at its smooth edges and corners
  std::vector<Extent> blocks_;  ///< of every `block_size` triangles in order
};

}  // namespace vdbdither
