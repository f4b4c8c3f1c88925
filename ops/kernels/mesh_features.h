#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <openvdb/math/Vec3.h>

#include "ops/kernels/mesh_edges.h"
#include "vdbdither/mesh.h"

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
  int bounds = 0;  ///< how many bounds follow the distance forms
  std::array<LinearForm, 3 + max_bounds> forms;
  openvdb::Vec3d min, max;  ///< bounding box of the feature, mm
  openvdb::Vec3d below,
      above;  ///< the region within distance b lies from min − b·below to max + b·above
};

/// The faces, edges and vertices of a mesh in rising order of their lowest layer.
///
/// Any set of triangles will do. Where triangles share vertices the regions of neighbours hardly
/// overlap, so that the work of a distance field follows its voxels instead of its triangles.
class MeshFeatures {
 public:
  enum class Kind : std::uint32_t { face, edge, vertex };
  class Id {
   public:
    Id() = default;
    Id(Kind kind, std::uint32_t index) : packed_(index << 2 | static_cast<std::uint32_t>(kind)) {}
    [[nodiscard]] Kind kind() const { return static_cast<Kind>(packed_ & 3); }
    /// Of the triangle, the edge or the vertex.
    [[nodiscard]] std::uint32_t index() const { return packed_ >> 2; }

   private:
    std::uint32_t packed_ = 0;
  };

  /// `mesh` in mm, kept by reference; positions are taken relative to `origin_mm`. `layer_mm` is
  /// the height of the bins that the order is made by.
  MeshFeatures(const Mesh& mesh, const openvdb::Vec3d& origin_mm, double layer_mm);

  [[nodiscard]] double memoryBytes() const;
  [[nodiscard]] std::size_t size() const { return order_.size(); }
  [[nodiscard]] Id id(std::size_t position) const { return order_[position]; }

  /// The positions of the features that meet the layers [low, high] mm, in rising order.
  [[nodiscard]] std::vector<std::uint32_t> collect(double low, double high) const;

  /// Whether the feature at `position` meets [low, high] mm along `axis`.
  [[nodiscard]] bool meets(std::uint32_t position, int axis, double low, double high) const {
    const Extent extent = this->extent(order_[position], axis);
    return extent.low <= high && extent.high >= low;
  }

  [[nodiscard]] MeshFeature describe(Id id) const;

  /// Corner `corner` of a triangle, relative to the origin.
  [[nodiscard]] const openvdb::Vec3d& corner(std::uint32_t triangle, int corner) const {
    return positions_[mesh_.triangles[triangle][static_cast<std::size_t>(corner)]];
  }
  [[nodiscard]] const Mesh::Triangle& triangle(std::uint32_t index) const {
    return mesh_.triangles[index];
  }
  /// Unit normal, counter-clockwise; zero for a face without area.
  [[nodiscard]] const openvdb::Vec3d& normal(std::uint32_t triangle) const {
    return normals_[triangle];
  }

  /// By triangle: what the components of the normals of its face and of its three edges' wedges
  /// come to at least.
  [[nodiscard]] std::vector<openvdb::Vec3d> leastNormals() const;

  /// The lowest triangle that the feature belongs to.
  [[nodiscard]] std::uint32_t triangleOf(Id id) const;

 private:
  struct Extent {
    double low, high;
  };

  void findNormals();
  void findNeighbours();
  void sortByLayer(double layer_mm);

  [[nodiscard]] Extent extent(Id id, int axis) const;
  [[nodiscard]] MeshFeature describeFace(std::uint32_t triangle) const;
  [[nodiscard]] MeshFeature describeEdge(std::uint32_t index) const;
  [[nodiscard]] MeshFeature describeVertex(std::uint32_t index) const;

  const Mesh& mesh_;
  std::vector<openvdb::Vec3d> positions_;
  std::vector<openvdb::Vec3d> normals_;
  MeshEdges edges_;
  std::vector<std::uint32_t> first_edge_;  ///< by vertex, and the end of the last
  std::vector<std::uint32_t> vertex_edges_;
  std::vector<Id> order_;
  std::vector<Extent> blocks_;  ///< of every `block_size` features in order
};

}  // namespace vdbdither
