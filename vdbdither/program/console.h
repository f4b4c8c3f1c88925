#pragma once

#include <chrono>
#include <string>

#include "vdbdither/engine/monitor.h"

namespace vdbdither {

/// Shows at a terminal how a job goes: one line on standard error that is overwritten, with
/// percent, rate and time left. Without a terminal it only passes warnings and results on.
class Console : public Watcher {
 public:
  /// \param quiet             no line of progress
  /// \param box_voxels        the voxels of the whole job, for the rate
  /// \param expected_seconds  shown until the first layers are done; 0 if unknown
  void begin(bool quiet, double box_voxels, double expected_seconds);
  /// Whether results go to standard error, because voxels go to standard output.
  void keepStandardOutputFree(bool free) { results_to_error_ = free; }
  void warn(const std::string& verb, const std::string& text) override;
  void progress(const std::string& verb, int done, int total, double fraction) override;
  void print(const std::string& text) override;
  /// Removes the line.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;

  bool shown_ = false;
  bool results_to_error_ = false;
  bool terminal_ = false;
  double box_voxels_ = 0;
  double expected_seconds_ = 0;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace vdbdither
