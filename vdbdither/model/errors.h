#pragma once

#include <stdexcept>

namespace vdbdither {

/// What a run can fail with. Messages say what, where and what to do, in one line and without a
/// full stop.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The command line requests something impossible: exit code 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// The input is bad or the run failed (disk full, closed pipe, not enough memory): exit code 1.
class DataError : public Error {
 public:
  using Error::Error;
};

}  // namespace vdbdither
