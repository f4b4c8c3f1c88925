#pragma once

#include <string>

#include "vdbdither/engine/options.h"

namespace vdbdither {

/// Passes the messages of a verb to the user. Safe to call from many threads.
class Reporter {
 public:
  virtual ~Reporter() = default;
  /// A line that the user must see, even with --quiet.
  virtual void warn(const std::string& text) = 0;
  /// A figure for --json and --verbose, such as `repaired_edges`, 12.
  virtual void count(const std::string& name, double value) = 0;
  /// The share of a long computation that is done, 0 to 1. Throws Interrupted if the user stops the
  /// program.
  virtual void progress(double fraction) = 0;
  /// The result of a verb that reports something, in whole lines. It goes to standard output, or to
  /// standard error if standard output carries voxels.
  virtual void print(const std::string& /*text*/) {}
};

/// A word of the command line that does something: an operator or a tool.
class Verb {
 public:
  virtual ~Verb() = default;
  /// Binds the options to members.
  virtual void declare(Options& options) = 0;

  /// `reporter` must outlive the verb. Without one, messages are dropped.
  void setReporter(Reporter* reporter) { reporter_ = reporter; }

 protected:
  [[nodiscard]] Reporter& report() const;

 private:
  Reporter* reporter_ = nullptr;
};

}  // namespace vdbdither
