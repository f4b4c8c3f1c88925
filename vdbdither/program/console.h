#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "vdbdither/engine/monitor.h"
#include "vdbdither/engine/run_options.h"

namespace vdbdither {

/// Shows how a job goes: at a terminal by one line on standard error that is overwritten, with
/// percent, rate and time left; to a program by lines of `Progress::json` or `Progress::openjd`
/// (docs/jobs.md), one each second. Otherwise it only passes warnings and results on.
class Console : public Watcher {
 public:
  /// @param verb  what works until another says so
  Console(Progress style, std::string verb) : style_(style), state_{.verb = std::move(verb)} {}
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;
  ~Console() override;

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
  /// Ends the progress: the run came to its end.
  void end();
  /// Tells Open Job Description why the run failed.
  static void tellFailure(const std::string& message);

 private:
  using Clock = std::chrono::steady_clock;

  /// How far the run is.
  struct State {
    std::string verb;
    int done = 0;
    int total = 0;
    double share = 0;
  };

  void tellEachSecond(const std::stop_token& stop);
  /// Returns whether lines for programs were told until now.
  bool stopTelling();
  void tell(const State& state);

  Progress style_;
  std::mutex mutex_;
  State state_;
  std::condition_variable_any stopped_;
  std::jthread teller_;  ///< of lines for programs
  bool shown_ = false;
  bool results_to_error_ = false;
  bool terminal_ = false;
  double box_voxels_ = 0;
  double expected_seconds_ = 0;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace vdbdither
