#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tests/support/told.h"
#include "vdbdither/engine/operator.h"

namespace vdbdither::test {

/// The registered sink of that name with its options set, and its messages.
class SinkCalled {
 public:
  SinkCalled(const std::string& name, const std::vector<std::string>& arguments);

  [[nodiscard]] Sink& operator*() const { return static_cast<Sink&>(*made_); }
  Sink* operator->() const { return &**this; }

  /// Plans the sink, passes it the grids in slabs of `height` layers unless it stands alone, and
  /// finishes.
  void run(const Schema& schema, const Grids& grids, int height = 8) const;
  /// The same with the grids of the schema.
  void run(const Schema& schema = {}, int height = 8) const { run(schema, schema.grids, height); }

  Listener said;

 private:
  std::unique_ptr<Operator> made_;
};

}  // namespace vdbdither::test
