#include "vdbdither/model/instruction_set.h"

#include <cstdlib>
#include <string_view>

namespace vdbdither {

InstructionSet bestInstructionSet() {
  const char* wanted = std::getenv("VDBDITHER_INSTRUCTIONS");
  if (wanted != nullptr && std::string_view(wanted) == "baseline") return InstructionSet::baseline;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return InstructionSet::avx2;
#endif
  return InstructionSet::baseline;
}

}  // namespace vdbdither
