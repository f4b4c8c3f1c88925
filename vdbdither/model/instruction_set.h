#pragma once

namespace vdbdither {

/// The instruction set of code that is compiled for several. All give the same bits.
enum class InstructionSet { baseline, avx2 };

/// Returns the best instruction set of this processor; the baseline if the environment variable
/// VDBDITHER_INSTRUCTIONS is `baseline`, with which tests compare both.
InstructionSet bestInstructionSet();

}  // namespace vdbdither
