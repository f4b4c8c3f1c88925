#pragma once

#include <memory>
#include <string>
#include <vector>

#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/tool.h"

namespace vdbdither {

/// What is to be said of a verb. All manuals are made from these.
struct Page {
  std::string name;
  std::string kind;  ///< source, filter, sink or command
  std::string summary;
  std::string example;  ///< lines, each without the name of the program
  Options options;
  std::shared_ptr<void> owner;  ///< what the options are bound to
};

Page pageOf(const OperatorInfo& info);
Page pageOf(const ToolInfo& info);

/// Every operator and every command that is for people, by name.
std::vector<Page> pages();

/// The options that every operator takes.
Page commonPage();

/// What --help says of a verb.
std::string helpText(const Page& page);

/// What `help` says: it fits a screen of 80 columns and 24 lines.
std::string overview();

/// What `help all` says: a line for each verb.
std::string listing();

/// Markdown files by name: one for each verb, and README.md that lists them.
std::vector<std::pair<std::string, std::string>> markdownFiles();

/// Manual pages by file name, in troff.
std::vector<std::pair<std::string, std::string>> manualFiles();

/// Completion for bash, zsh and fish, each by its place below `share`.
std::vector<std::pair<std::string, std::string>> completionFiles();

}  // namespace vdbdither
