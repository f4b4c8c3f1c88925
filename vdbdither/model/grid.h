#pragma once

#include <memory>

#include <openvdb/version.h>

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {
class GridBase;
}
}  // namespace openvdb

namespace vdbdither {

/// How grids travel: shared and never changed. (OpenVDB's own alias would pull its heavy headers
/// into ours.)
using GridConstPtr = std::shared_ptr<const openvdb::GridBase>;

}  // namespace vdbdither
