#pragma once

#include <memory>
#include <string>
#include <vector>

#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/tool.h"

namespace vdbdither {

/// The manual of a verb, from which --help, pages and completion are made.
struct Page {
  std::string name;
  std::string kind;  ///< source, filter, sink or tool
  std::string summary;
  std::string example;  ///< lines, each without the name of the program
  Options options;
  std::shared_ptr<void> owner;  ///< holds the members that the options are bound to
};

/// The options of a filter or sink begin with the file that may begin its chain. If it also works
/// on files as a tool, they are those of the tool.
Page pageOf(const OperatorInfo& info);
Page pageOf(const ToolInfo& info);

/// Every operator and every tool that is not hidden, by name.
std::vector<Page> pages();

/// The options that every operator takes.
Page commonPage();

/// The text of --help for a verb.
std::string helpText(const Page& page);

/// The text of `help`; fits a screen of 80 columns and 24 lines.
std::string overview();

/// The text of `help all`: a line for each verb.
std::string listing();

/// Markdown files by name: one for each verb, and README.md, which lists them.
std::vector<std::pair<std::string, std::string>> markdownFiles();

/// Manual pages by file name, in troff.
std::vector<std::pair<std::string, std::string>> manualFiles();

/// Completion for bash, zsh and fish, each by its path below `share`.
std::vector<std::pair<std::string, std::string>> completionFiles();

}  // namespace vdbdither
