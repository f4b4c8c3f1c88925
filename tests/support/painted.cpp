#include "tests/support/painted.h"

#include <algorithm>

namespace vdbdither::test {

using openvdb::Coord;

openvdb::BoolGrid::Ptr painted(const std::vector<std::string>& layers, const Coord& origin) {
  auto grid = openvdb::BoolGrid::create(false);
  auto accessor = grid->getAccessor();
  for (std::size_t z = 0; z < layers.size(); ++z) {
    const std::string& layer = layers[z];
    const auto lines = static_cast<int>(std::count(layer.begin(), layer.end(), '\n'));
    int x = 0;
    int y = lines - 1;
    for (const char c : layer) {
      if (c == '\n') {
        x = 0;
        --y;
        continue;
      }
      if (c == '#') accessor.setValueOn(origin.offsetBy(x, y, static_cast<int>(z)), true);
      ++x;
    }
  }
  return grid;
}

std::vector<std::string> picture(const openvdb::BoolGrid& grid, const openvdb::CoordBBox& box) {
  std::vector<std::string> layers;
  const auto accessor = grid.getConstAccessor();
  for (int z = box.min().z(); z <= box.max().z(); ++z) {
    std::string& layer = layers.emplace_back();
    for (int y = box.max().y(); y >= box.min().y(); --y) {
      for (int x = box.min().x(); x <= box.max().x(); ++x)
        layer += accessor.getValue({x, y, z}) ? '#' : '.';
      layer += '\n';
    }
  }
  return layers;
}

}  // namespace vdbdither::test
