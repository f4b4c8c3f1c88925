#include "vdbdither/engine/operator.h"

#include "vdbdither/model/errors.h"

namespace vdbdither {

void Sink::makePiece(const std::filesystem::path& /*folder*/) {
  throw UsageError(
      "its result cannot be made in pieces; write a .vdb or a stack, and run it on the merged one");
}

void Sink::takePiece(const std::filesystem::path& /*folder*/, ZRange /*core*/) {
  throw UsageError("its result cannot be made in pieces");
}

}  // namespace vdbdither
