#include "tests/support/sinks.h"

#include "tests/support/slabs.h"
#include "vdbdither/engine/registry.h"

namespace vdbdither::test {

SinkCalled::SinkCalled(const std::string& name, const std::vector<std::string>& arguments)
    : made_(findOperator(name).make()) {
  Options options;
  made_->declare(options);
  options.parse(arguments);
  made_->setReporter(&said);
}

void SinkCalled::run(const Schema& schema, const Grids& grids, int height) const {
  Sink& sink = **this;
  sink.plan(schema);
  for (const Slab& slab : cutIntoSlabs(grids, schema.lattice, height)) sink.write(slab);
  for (Input* input : sink.inputs()) input->readToEnd();
  sink.finish();
  sink.publish();
}

FileToolCalled::FileToolCalled(const std::string& name, const std::vector<std::string>& arguments)
    : made_(findOperator(name).on_file.make()) {
  Options options;
  made_->declare(options);
  options.parse(arguments);
  made_->setReporter(&said);
}

}  // namespace vdbdither::test
