#include "tests/support/drawn_grids.h"

namespace vdbdither::test {

openvdb::Int32Grid::Ptr drawnMaterial(const std::vector<std::vector<std::string>>& layers,
                                      int first_layer) {
  auto grid = openvdb::Int32Grid::create(0);
  for (std::size_t z = 0; z < layers.size(); ++z) {
    const auto rows = static_cast<int>(layers[z].size());
    for (int row = 0; row < rows; ++row) {
      const std::string& text = layers[z][row];
      for (std::size_t x = 0; x < text.size(); ++x) {
        if (text[x] < '1' || text[x] > '9') continue;
        grid->tree().setValue(
            openvdb::Coord(static_cast<int>(x), rows - 1 - row, first_layer + static_cast<int>(z)),
            text[x] - '0');
      }
    }
  }
  return grid;
}

openvdb::BoolGrid::Ptr solidOf(const openvdb::Int32Grid& values) {
  return openvdb::BoolGrid::create(
      std::make_shared<openvdb::BoolTree>(values.tree(), false, true, openvdb::TopologyCopy()));
}

}  // namespace vdbdither::test
