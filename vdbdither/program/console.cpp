#include "vdbdither/program/console.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <system_error>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "io/file/standard_streams.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

std::string clockText(double seconds) {
  const int whole = static_cast<int>(std::lround(seconds));
  std::array<char, 32> text{};
  if (whole < 3600) {
    std::snprintf(text.data(), text.size(), "%d:%02d", whole / 60, whole % 60);
  } else {
    std::snprintf(text.data(), text.size(), "%d:%02d:%02d", whole / 3600, whole / 60 % 60,
                  whole % 60);
  }
  return text.data();
}

}  // namespace

void Console::begin(bool quiet, double box_voxels, double expected_seconds) {
  terminal_ = style_ == Progress::bar && !quiet && ::isatty(STDERR_FILENO);
  box_voxels_ = box_voxels;
  expected_seconds_ = expected_seconds;
  start_ = last_ = Clock::now();
  if (style_ != Progress::bar && !teller_.joinable()) {
    try {
      teller_ = std::jthread([this](const std::stop_token& stop) { tellEachSecond(stop); });
    } catch (const std::system_error& error) {
      throw DataError("cannot start a thread: " + error.code().message());
    }
  }
  // The first progress of a stage may take a while to come.
  if (terminal_ && expected_seconds >= 1) {
    std::fprintf(stderr, "\r\033[K%-16s   0 %%  about %s left", "",
                 clockText(expected_seconds).c_str());
    std::fflush(stderr);
    shown_ = true;
  }
}

void Console::warn(const std::string& verb, const std::string& text) {
  clear();
  std::fprintf(stderr, "vdbdither %s: warning: %s\n", verb.c_str(), printable(text).c_str());
}

void Console::progress(const std::string& verb, int done, int total, double fraction) {
  const double share = done == 0 || total == 0 ? fraction : static_cast<double>(done) / total;
  if (style_ != Progress::bar) {
    const std::lock_guard lock(mutex_);
    state_ = {verb, done, total, share};
    return;
  }
  const Clock::time_point now = Clock::now();
  if (!terminal_ || now - last_ < std::chrono::milliseconds(100)) return;
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  std::fprintf(stderr, "\r\033[K%-16s %3d %%", verb.c_str(), static_cast<int>(100 * share));
  if (done > 0 && share > 0) {
    std::fprintf(stderr, "  %.0f Mvoxel/s  %s left", share * box_voxels_ / seconds / 1e6,
                 clockText(seconds * (1 - share) / share).c_str());
  } else if (seconds < expected_seconds_) {
    std::fprintf(stderr, "  about %s left", clockText(expected_seconds_ - seconds).c_str());
  }
  std::fflush(stderr);
  shown_ = true;
}

void Console::print(const std::string& text) {
  clear();
  if (results_to_error_) {
    std::fputs(printableLines(text).c_str(), stderr);
  } else {
    printData(text.c_str());
  }
}

void Console::tellEachSecond(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!stopped_.wait_for(lock, stop, std::chrono::seconds(1), [] { return false; }) &&
         !stop.stop_requested())
    tell(state_);
}

void Console::tell(const State& state) {
  constexpr double percent = 100;
  if (style_ == Progress::openjd) {
    std::array<char, 64> line{};
    std::snprintf(line.data(), line.size(), "openjd_progress: %.1f\n", percent * state.share);
    const std::string text = "openjd_status: " + state.verb + "\n" + line.data();
    std::fputs(text.c_str(), stderr);
    return;
  }
  const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
  nlohmann::ordered_json json{{"stage", state.verb}, {"share", state.share}, {"seconds", seconds}};
  json["seconds_left"] = nullptr;
  if (state.share > 0) json["seconds_left"] = seconds * (1 - state.share) / state.share;
  if (state.total > 0) json["layers"] = {{"done", state.done}, {"all", state.total}};
  std::fputs((jsonText(json) + "\n").c_str(), stderr);
}

Console::~Console() {
  stopTelling();
  clear();
}

bool Console::stopTelling() {
  if (!teller_.joinable()) return false;
  teller_.request_stop();
  teller_.join();
  return true;
}

void Console::end() {
  clear();
  if (!stopTelling()) return;
  state_.share = 1;
  state_.done = state_.total;
  tell(state_);
}

void Console::tellFailure(const std::string& message) {
  std::fputs(("openjd_fail: " + printable(message) + "\n").c_str(), stderr);
}

void Console::clear() {
  if (shown_) std::fputs("\r\033[K", stderr);
  shown_ = false;
}

}  // namespace vdbdither
