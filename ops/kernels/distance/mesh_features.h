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

/// A face, an edge or a vertex of a mesh, as the distance to it is computed.
///
/// The squared distance from p to the feature's plane, line or point is the sum of `rank` squared
/// forms. It is the distance to the feature itself where every bound is at least zero, and the
/// nearest point of the whole mesh can lie on this feature only there.
struct MeshFeature {
  static constexpr int max_bounds = 16;

  int rank = 0;  ///< 1 face, 2 edge, 3 vertex; 0 for a face without area, which its edges stand for
  int bounds = 0;
  std::array<LinearForm, 3> distance;  ///< in mm
  std::array<LinearForm, max_bounds> bound;
  /// Where it has one, a form in mm that is nowhere in the region above the distance.
  LinearForm cap;
  bool capped = false;
  /// A side of a face: how far a point of its plane is beyond it and along it, mm.
  struct Side {
    LinearForm outward, along;
    double length_mm;
  };
  /// Of a face, the first three bounds being the sides'. It answers for its smooth edges and
  /// corners too: its region reaches `spread_mm` beyond its sides.
  std::array<Side, 3> side;
  double spread_mm = 0;
  openvdb::Vec3d min, max;  ///< bounding box of the feature, mm
  openvdb::Vec3d below,
      above;  ///< the region within distance b lies from min − b·below to max + b·above
};

/// The triangles of a mesh in rising order of their lowest layer, then row, and the faces, edges
/// and vertices that each answers for: every edge and vertex belongs to the first of its triangles.
///
/// Any set of triangles will do. Where triangles share vertices the regions of neighbours hardly
/// overlap, so that the work of a distance field follows its voxels instead of its triangles. Edges
/// and vertices where the surface hardly bends have no region of their own: the points that are
/// nearest to them lie so little beyond the sides of the faces there that these reach further.
class MeshFeatures {
 public:
  enum class Kind : std::uint32_t { face, edge, vertex };
  class Id {
   public:
    Id() = default;
    Id(Kind kind, std::uint32_t index) : packed_(index << 2 | static_cast<std::uint32_t>(kind)) {}
    explicit Id(std::uint32_t packed) : packed_(packed) {}
    [[nodiscard]] Kind kind() const { return static_cast<Kind>(packed_ & 3); }
    /// Of the triangle, the edge or the vertex.
    [[nodiscard]] std::uint32_t index() const { return packed_ >> 2; }
    [[nodiscard]] std::uint32_t packed() const { return packed_; }

   private:
    std::uint32_t packed_ = 0;
  };
  struct Extent {
    double low, high;
  };

  /// `mesh` in mm, of which a sorted copy is kept; positions are taken relative to `origin_mm`.
  /// `layer_mm` and `row_mm` are the sizes of the bins along z and y that the order is made by.
  /// Distances above `greatest_mm` are not asked for. Triangles that `walls` hides have no
  /// features, the pieces that are left of them have.
  MeshFeatures(const Mesh& mesh, const SwallowedWalls& walls, const openvdb::Vec3d& origin_mm,
               double layer_mm, double row_mm, double greatest_mm);

  [[nodiscard]] double memoryBytes() const;

  [[nodiscard]] std::uint32_t triangles() const {
    return static_cast<std::uint32_t>(mesh_.triangles.size());
  }

  /// The triangles that meet the layers [low, high] mm, in order. A triangle's number is its place
  /// in the order.
  [[nodiscard]] std::vector<std::uint32_t> collect(double low, double high) const;

  /// Whether rows that cross the triangle enter or leave the solid; not for pieces.
  [[nodiscard]] bool bounds(std::uint32_t triangle) const {
    return triangle < whole_ || triangle >= features_;
  }
  /// Whether distances are measured to the triangle.
  [[nodiscard]] bool hasFeatures(std::uint32_t triangle) const { return triangle < features_; }

  /// What a triangle takes along an axis.
  [[nodiscard]] Extent extent(std::uint32_t triangle, int axis) const {
    const Mesh::Triangle& t = mesh_.triangles[triangle];
    const double a = mesh_.vertices[t[0]][axis];
    const double b = mesh_.vertices[t[1]][axis];
    const double c = mesh_.vertices[t[2]][axis];
    return {std::min(std::min(a, b), c), std::max(std::max(a, b), c)};
  }

  /// Calls visit(id) for the features that the triangle answers for, but those that no distance is
  /// needed from.
  template <class Visit>
  void visit(std::uint32_t triangle, const Visit& visit) const {
    const std::uint8_t owned = owned_[triangle];
    visit(Id(Kind::face, triangle));
    for (std::uint32_t side = 0; side < 3; ++side)
      if (owned >> side & 1) visit(Id(Kind::edge, side_edges_[3 * triangle + side]));
    for (std::uint32_t corner = 0; corner < 3; ++corner)
      if (owned >> (3 + corner) & 1) visit(Id(Kind::vertex, mesh_.triangles[triangle][corner]));
  }

  /// Whether the feature's bounding box meets the layers and rows [low, high] mm; any face does.
  [[nodiscard]] bool meets(Id id, const openvdb::Vec3d& low, const openvdb::Vec3d& high) const {
    if (id.kind() == Kind::face) return true;
    const bool edge = id.kind() == Kind::edge;
    const openvdb::Vec3d& a = mesh_.vertices[edge ? edges_[id.index()].from : id.index()];
    const openvdb::Vec3d& b = mesh_.vertices[edge ? edges_[id.index()].to : id.index()];
    return std::min(a.z(), b.z()) <= high.z() && std::max(a.z(), b.z()) >= low.z() &&
           std::min(a.y(), b.y()) <= high.y() && std::max(a.y(), b.y()) >= low.y();
  }

  [[nodiscard]] MeshFeature describe(Id id) const;

  /// What lies nearest to a point.
  struct Nearest {
    openvdb::Vec3d away;  ///< from there to the point
    /// Of the triangles that the face, edge or vertex belongs to the one first in the mesh given,
    /// of those with area if there are any.
    std::uint32_t triangle;
  };
  /// Of the feature, whose region `p` is in.
  [[nodiscard]] Nearest nearest(Id id, const openvdb::Vec3d& p) const;

  /// Corner `corner` of a triangle, relative to the origin.
  [[nodiscard]] const openvdb::Vec3d& corner(std::uint32_t triangle, int corner) const {
    return mesh_.vertices[mesh_.triangles[triangle][static_cast<std::size_t>(corner)]];
  }
  /// Unit normal, counter-clockwise; zero for a face without area.
  [[nodiscard]] const openvdb::Vec3d& normal(std::uint32_t triangle) const {
    return normals_[triangle];
  }

  /// What the components of the normals of a triangle's face and of its three edges' wedges come to
  /// at least.
  [[nodiscard]] openvdb::Vec3d leastNormal(std::uint32_t triangle) const;

  /// The number that a triangle has in the mesh that was given.
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
  std::uint32_t whole_ = 0;              ///< end of the first
  std::uint32_t features_ = 0;           ///< and of the second
  std::vector<std::uint32_t> original_;  ///< by triangle
  Mesh mesh_;
  std::vector<openvdb::Vec3d> normals_;
  MeshEdges edges_;
  std::vector<std::uint32_t> first_edge_;  ///< by vertex, and the end of the last
  std::vector<std::uint32_t> vertex_edges_;
  std::vector<std::uint32_t> side_edges_;  ///< by half-edge
  std::vector<std::uint8_t> owned_;        ///< by triangle: bits of its sides, then of its corners
  double greatest_mm_;
  std::vector<float> bend_;     ///< by triangle: the most at its smooth edges and corners
  std::vector<Extent> blocks_;  ///< of every `block_size` triangles in order
};

}  // namespace vdbdither
