#pragma once

#include <algorithm>
#include <string>

#include "vdbdither/engine/monitor.h"

namespace vdbdither {

/// Passes on to the user of a tool what a chain tells that the tool runs.
class ToolWatcher : public Watcher {
 public:
  /// \param reporter  of the tool; must outlive the watcher
  explicit ToolWatcher(Reporter& reporter) : reporter_(reporter) {}

  /// Says which share of the whole run of the tool the chain is: it begins at `begin` and is
  /// `share` of it.
  void expect(double begin, double share) {
    begin_ = begin;
    share_ = share;
  }

  void warn(const std::string& verb, const std::string& text) override {
    reporter_.warn(verb + ": " + text);
  }
  void progress(const std::string& /*verb*/, int done, int total, double fraction) override {
    const double of_chain =
        done == 0 || total == 0 ? 0 : std::min(1.0, static_cast<double>(done) / total);
    reporter_.progress(begin_ + share_ * std::max(of_chain, total == 0 ? fraction : 0));
  }
  void print(const std::string& text) override { reporter_.print(text); }

 private:
  Reporter& reporter_;
  double begin_ = 0;
  double share_ = 1;
};

}  // namespace vdbdither
