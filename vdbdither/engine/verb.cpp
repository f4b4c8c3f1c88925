#include "vdbdither/engine/verb.h"

namespace vdbdither {

namespace {

class SilentReporter : public Reporter {
 public:
  void warn(const std::string&) override {}
  void count(const std::string&, double) override {}
  void progress(double) override {}
};

}  // namespace

Reporter& Verb::report() const {
  static SilentReporter silent;
  return reporter_ ? *reporter_ : silent;
}

}  // namespace vdbdither
