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

  /// Plans it, gives it the grids in slabs of `height` layers, and finishes.
  void run(const Schema& schema, const Grids& grids, int height = 8) const;
  /// The same with the grids of the schema.
  void run(const Schema& schema = {}, int height = 8) const { run(schema, schema.grids, height); }

  Listener said;

 private:
  std::unique_ptr<Operator> made_;
};

/// The tool that the registered operator of that name is on a file, with its options set, and what
/// it says.
class FileToolCalled {
 public:
  FileToolCalled(const std::string& name, const std::vector<std::string>& arguments);

  void run() const { made_->run(); }

  Listener said;

 private:
  std::unique_ptr<Tool> made_;
};

}  // namespace vdbdither::test
