#pragma once

#include <span>
#include <string>
#include <vector>

#include "vdbdither/engine/operator.h"

namespace vdbdither {

/// Whether --help is among the arguments.
bool asksForHelp(std::span<const std::string> arguments);

/// Takes the file that begins a chain out of the arguments of a filter or sink and returns it, or
/// an empty text if there is none. It is the first word that is neither an option nor an option's
/// value, and stands before the operator's own words: `normals a.vdb`, `slice-export a.vdb out`. If
/// the operator's own first word is a .vdb (`write b.vdb`), it is its own unless there is one word
/// more (`write a.vdb b.vdb`).
///
/// \param own     the options that the operator declares
/// \param common  those that every operator takes
std::string takeNamedFile(std::vector<std::string>& arguments, const OperatorInfo& info,
                          const Options& own, const Options& common);

/// Throws UsageError if the operator cannot read `file` as the input of a chain: slabs come from a
/// stage before it (`has_input`), or it works on such a file as a tool.
void refuseNamedFile(const OperatorInfo& info, const std::string& file, bool has_input);

/// Whether an operator with these arguments, as the whole command line, works on a file that it
/// names: see FileTool.
bool worksOnFile(const OperatorInfo& info, std::span<const std::string> arguments);

}  // namespace vdbdither
