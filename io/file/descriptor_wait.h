#pragma once

namespace vdbdither {

/// Returns once a descriptor has data, or its end is reached. Throws Interrupted.
void waitForInput(int descriptor);

/// Returns once a descriptor that does not block takes data again. Throws Interrupted.
void waitForOutput(int descriptor);

}  // namespace vdbdither
