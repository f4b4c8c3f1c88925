#pragma once

// The program ends in one of three ways: `main` returns, after the destructors; a thread ends it
// that waits for signals, because `main` does not come back in time; or std::terminate is called,
// which prints one line and removes unfinished outputs as well.

namespace vdbdither {

/// Makes the calling thread the one that ends the program, with this exit code, and prints why.
/// Returns in one thread only; any other stays here.
void claimEnding(int code);

/// Prints `message` as the last line of the program. Never waits for a reader of standard error.
void printLastLine(const char* message);

/// Starts the thread that ends the program half a second after a signal at the latest, or at once
/// after a second one, whatever its other threads do: it prints one line, removes unfinished
/// outputs and exits with 128 plus the signal. Throws DataError if the system grants no thread.
void watchForInterrupts();

}  // namespace vdbdither
