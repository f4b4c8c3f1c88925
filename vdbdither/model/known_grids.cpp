#include "vdbdither/model/known_grids.h"

#include "vdbdither/model/schema.h"

namespace vdbdither {

Schema withoutSurfaceExtras(Schema schema) {
  for (const char* name : {normal_grid, closest_grid}) schema.grids.erase(name);
  return schema;
}

}  // namespace vdbdither
