#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <openvdb/openvdb.h>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/slab.h"

namespace vdbdither {

/// The grid called `name`, as a `GridType`. Throws DataError that says what there is instead.
template <typename GridType>
std::shared_ptr<const GridType> findGrid(const Grids& grids, std::string_view name) {
  const auto found = grids.find(name);
  if (found == grids.end()) {
    std::string message = "no grid '" + std::string(name) + "'; there is";
    if (grids.empty()) message += " none";
    for (const auto& [other, grid] : grids) message += " '" + other + "'";
    throw DataError(message);
  }
  auto grid = openvdb::gridConstPtrCast<GridType>(found->second);
  if (!grid) {
    throw DataError("grid '" + std::string(name) + "' is of " + found->second->valueType() +
                    ", not of " + openvdb::typeNameAsString<typename GridType::ValueType>());
  }
  return grid;
}

}  // namespace vdbdither
