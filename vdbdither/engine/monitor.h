#pragma once

#include <chrono>
#include <ctime>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vdbdither/engine/verb.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/unexpected.h"

namespace vdbdither {

/// Shows the user how a job goes.
class Watcher {
 public:
  virtual ~Watcher() = default;
  virtual void warn(const std::string& verb, const std::string& text) = 0;
  /// `done` of `total` layers have reached the end; `fraction` is the share that is done of a long
  /// step within one slab.
  virtual void progress(const std::string& verb, int done, int total, double fraction) = 0;
  /// The result of a verb that reports something, in whole lines.
  virtual void print(const std::string& /*text*/) {}
};

/// What a stage did, for --json and --verbose.
struct StageReport {
  std::string name;
  double seconds = 0;
  double cpu_seconds = 0;                      ///< of all threads
  std::optional<double> expected_cpu_seconds;  ///< planned; nothing if unknown
  double active_voxels = 0;                    ///< of all grids it gave out
  double bytes = 0;                            ///< in memory, of all grids it gave out
  double peak_memory_bytes = 0;                ///< of the process, when the stage last returned
  std::vector<std::pair<std::string, double>> counts;  ///< from `Reporter::count`
};

/// What a job did.
struct JobReport {
  int layers = 0;
  double box_voxels = 0;
  std::optional<double> expected_seconds;  ///< planned; nothing if unknown
  std::vector<StageReport> stages;
};

/// The largest resident size the process has had.
double peakMemoryBytes();

/// Calls `function` for a verb. Every error that it throws is an Error whose message begins with
/// the name of the verb; only Interrupted stays as it is.
template <typename Function>
auto callNamed(const std::string& verb, const Function& function) {
  try {
    return function();
  } catch (const Interrupted&) {
    throw;
  } catch (const UsageError& error) {
    throw UsageError(verb + ": " + error.what());
  } catch (const std::bad_alloc&) {
    throw DataError(verb + ": out of memory; try a smaller --slab or fewer layers");
  } catch (const Error& error) {
    throw DataError(verb + ": " + error.what());
  } catch (const std::exception& error) {
    throw DataError(verb + ": " + unexpectedText(error));
  }
}

/// Stands between one verb and the user: passes its messages on, keeps its counts and measures its
/// calls.
class Monitor : public Reporter {
 public:
  explicit Monitor(std::string_view verb) { report_.name = verb; }

  /// `watcher` must outlive all calls of the verb.
  void attach(Watcher& watcher) { watcher_ = &watcher; }
  /// The layers of the job, for the progress.
  void expectLayers(int total) { total_layers_ = total; }
  void layersDone(int count) { done_layers_ += count; }

  void warn(const std::string& text) override { watcher_->warn(report_.name, text); }
  void count(const std::string& name, double value) override;
  void print(const std::string& text) override { watcher_->print(text); }
  void progress(double fraction) override;

  /// Calls `function` as `callNamed` does, and adds its time to the report.
  template <typename Function>
  auto timed(const Function& function) {
    throwIfInterrupted();
    const Timer timer(report_);
    return callNamed(report_.name, function);
  }

  [[nodiscard]] const std::string& verb() const { return report_.name; }
  [[nodiscard]] StageReport& report() { return report_; }
  [[nodiscard]] const StageReport& report() const { return report_; }

 private:
  class Timer {
   public:
    explicit Timer(StageReport& report) : report_(report) {}
    ~Timer();
    Timer(const Timer&) = delete;
    Timer& operator=(const Timer&) = delete;

   private:
    StageReport& report_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    std::clock_t cpu_start_ = std::clock();
  };

  Watcher* watcher_ = nullptr;
  int done_layers_ = 0;
  int total_layers_ = 0;
  StageReport report_;
  std::mutex count_mutex_;
};

}  // namespace vdbdither
