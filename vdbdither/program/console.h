#pragma once

#include <chrono>
#include <string>

#include "vdbdither/engine/pipeline.h"

namespace vdbdither {

/// Tells a person at a terminal how a run goes: one line on standard error that is written over,
/// with percent, rate and time left. Elsewhere it only passes warnings on.
class Console : public Watcher {
 public:
  /// `quiet`: warnings only. `box_voxels`: what the whole run goes through, for the rate.
  /// `expected_seconds`: how long it may take, told until layers come; 0 where unknown.
  void begin(bool quiet, double box_voxels, double expected_seconds);
  void warn(const std::string& stage, const std::string& text) override;
  void progress(const std::string& stage, int done, int total, double fraction) override;
  /// Takes the line away.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;

  bool shown_ = false;
  bool terminal_ = false;
  double box_voxels_ = 0;
  double expected_seconds_ = 0;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace vdbdither
