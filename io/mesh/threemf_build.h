#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "io/mesh/mesh_file.h"
#include "io/mesh/part_names.h"
#include "io/mesh/threemf_model.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Places the objects of 3MF model parts: makes one mesh of what is printed. Everything is counted
/// before it is made.
class ThreemfBuild {
 public:
  /// Called with each object that is placed, in the order of the triangles.
  using Placed = std::function<void(const ThreemfPart&, const ThreemfObject&, bool is_turned)>;

  /// @param parts    the root first; must outlive the object
  /// @param part_of  returns the index of the part that a path names, or of the part itself
  ThreemfBuild(const MeshFile& file, std::vector<ThreemfPart>& parts,
               std::function<std::size_t(std::size_t part, const std::string& path)> part_of);

  /// Returns the mesh, with a part for each object where there are several. Throws DataError for
  /// what cannot be placed.
  Mesh make(const Placed& placed);

 private:
  using Key = std::pair<std::size_t, std::size_t>;  ///< a part, and an object of it

  struct Counts {
    bool is_open = true;      ///< its components are being counted
    int height = 1;           ///< of the tree of components
    std::uint64_t nodes = 1;  ///< of the tree
    std::uint64_t triangles = 0;
    std::uint64_t vertices = 0;
    void add(const Counts& other);
  };

  [[nodiscard]] ThreemfObject& objectOf(const Key& key) const;
  [[nodiscard]] Key keyOf(std::size_t part, const ThreemfUse& use) const;
  [[nodiscard]] std::vector<ThreemfUse> items() const;
  Counts count(const Key& key, int depth);
  void checkCounts(const Counts& all) const;
  void place(const Key& key, const ThreemfTransform& transform, const std::string& name,
             const Placed& placed);
  void append(ThreemfObject& object, const ThreemfTransform& transform, bool is_turned);

  const MeshFile& file_;
  std::vector<ThreemfPart>& parts_;
  std::function<std::size_t(std::size_t, const std::string&)> part_of_;
  std::map<Key, Counts> counts_;
  Mesh mesh_;
  bool is_only_use_ = false;  ///< of an object's vertices, which can then be moved
  std::uint64_t left_out_ = 0;
  PartNames names_;
};

}  // namespace vdbdither
