#pragma once

#include <map>
#include <string>
#include <vector>

#include "vdbdither/engine/operator.h"

namespace vdbdither::test {

/// Records the messages of an operator.
class Listener : public Reporter {
 public:
  void warn(const std::string& text) override { warnings.push_back(text); }
  void count(const std::string& name, double value) override { counts[name] = value; }
  void progress(double) override {}
  void print(const std::string& text) override { printed += text; }

  std::vector<std::string> warnings;
  std::map<std::string, double> counts;
  std::string printed;
};

}  // namespace vdbdither::test
