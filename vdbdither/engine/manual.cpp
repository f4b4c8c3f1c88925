#include "vdbdither/engine/manual.h"

#include <algorithm>
#include <array>
#include <sstream>

#include "vdbdither/engine/registry.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/engine/version.h"

namespace vdbdither {

namespace {

using Files = std::vector<std::pair<std::string, std::string>>;

constexpr std::size_t line_width = 79;
constexpr std::string_view chain_example =
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign ! slice-export out";

/// `--name VALUE`, `-o, --output FILE`, or the name of a positional.
std::string spelled(const Option& option) {
  if (option.kind == Option::Kind::positional) return option.name;
  std::string text;
  if (option.letter) text.append("-").append(1, option.letter).append(", ");
  text.append(option.shown());
  if (option.kind == Option::Kind::value) text.append(" ").append(option.valueText());
  return text;
}

/// What an option is for, and which numbers it accepts.
std::string meaning(const Option& option) {
  return option.range.empty() ? option.help : option.help + " (" + option.range + ")";
}

std::string usage(const Page& page) {
  std::string text = "vdbdither " + page.name;
  for (const Option& option : page.options.all()) {
    if (option.kind != Option::Kind::positional) continue;
    const std::string word = option.name + (option.repeated ? "..." : "");
    text += option.required ? " " + word : " [" + word + "]";
  }
  return text + " [options]";
}

std::string whatItIs(const Page& page) {
  if (page.kind == "source") return "A source: it makes layers and begins a chain.";
  if (page.kind == "filter") return "A filter: it changes the layers that pass through it.";
  if (page.kind == "sink")
    return "A sink: it takes the layers that reach it, and passes them on in the middle of a "
           "chain.";
  return "A tool: it is the whole command line, never part of a chain.";
}

/// `words` in lines of at most `line_width` characters, all with the same indent.
std::string wrapped(const std::vector<std::string>& words, std::size_t indent) {
  std::string text;
  std::size_t column = indent;
  for (const std::string& word : words) {
    if (column > indent && column + 1 + word.size() > line_width) {
      text.append(1, '\n').append(indent, ' ');
      column = indent;
    }
    if (column > indent) {
      text += ' ';
      ++column;
    }
    text += word;
    column += word.size();
  }
  return text;
}

/// The words of a sentence in lines of at most `line_width`, all indented alike.
std::string wrapped(const std::string& sentence, std::size_t indent) {
  std::vector<std::string> words;
  std::istringstream stream(sentence);
  for (std::string word; stream >> word;) words.push_back(word);
  return wrapped(words, indent);
}

/// `text` and blanks up to a column; on a line of its own where it reaches the column.
std::string upToColumn(const std::string& text, std::size_t column) {
  if (text.size() + 1 < column) return text + std::string(column - text.size(), ' ');
  return text + "\n" + std::string(column, ' ');
}

/// An option, its default and its words as lines of --help.
std::string helpOf(const Option& option) {
  constexpr std::size_t column = 30;
  constexpr std::size_t word_column = column + 2;
  std::string head = "  " + spelled(option);
  if (!option.fallback.empty()) head += " [" + option.fallback + "]";
  std::string text = upToColumn(head, column) + wrapped(meaning(option), column) + "\n";
  for (const Word& word : option.words) {
    text += std::string(word_column, ' ') +
            wrapped(word.name + ": " + word.meaning, word_column + 2) + "\n";
  }
  return text;
}

std::string helpOf(const Options& options, Option::Kind kind, const Options& but) {
  std::string text;
  for (const Option& option : options.all()) {
    const bool positional = option.kind == Option::Kind::positional;
    if (positional == (kind == Option::Kind::positional) && !but.find(option.name))
      text += helpOf(option);
  }
  return text;
}

std::string replaced(std::string_view text, std::string_view from, std::string_view to) {
  std::string result;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t at = std::min(text.find(from, begin), text.size());
    result.append(text.substr(begin, at - begin));
    if (at == text.size()) break;
    result.append(to);
    begin = at + from.size();
  }
  return result;
}

/// `text` escaped for a cell of a table.
std::string cell(const std::string& text) { return replaced(text, "|", "\\|"); }

std::string markdownOptions(const Options& options) {
  std::string text = "| option | default | meaning |\n| --- | --- | --- |\n";
  for (const Option& option : options.all()) {
    text += "| `" + cell(spelled(option)) + "` | " +
            (option.fallback.empty() ? "" : "`" + cell(option.fallback) + "`") + " | " +
            cell(meaning(option));
    for (const Word& word : option.words)
      text += "<br>`" + cell(word.name) + "`: " + cell(word.meaning);
    text += " |\n";
  }
  return text;
}

std::string markdownPage(const Page& page) {
  std::string text = "# " + page.name + "\n\n" + page.summary + ".\n\n" + whatItIs(page) +
                     "\n\n```\n" + usage(page) + "\n```\n\n";
  if (!page.options.all().empty()) text += markdownOptions(page.options) + "\n";
  if (page.kind != "tool") text += "The [options of every operator](README.md) apply as well.\n\n";
  return text + "Example:\n\n    vdbdither " + replaced(page.example, "\n", "\n    vdbdither ") +
         "\n";
}

std::string markdownIndex() {
  std::string text = "# Operators and tools\n\n| | | |\n| --- | --- | --- |\n";
  for (const Page& page : pages()) {
    text += "| [" + page.name + "](" + page.name + ".md) | " + page.kind + " | " + page.summary +
            " |\n";
  }
  return text +
         "\n## Options of every operator\n\nThey apply to the whole job and may follow any "
         "operator of "
         "a chain.\n\n" +
         markdownOptions(commonPage().options);
}

/// `text` escaped for troff.
std::string troff(const std::string& text) {
  std::string safe = replaced(replaced(text, "\\", "\\e"), "-", "\\-");
  const bool control = safe.starts_with('.') || safe.starts_with('\'');
  return std::string(control ? "\\&" : "").append(safe);
}

std::string troffOptions(const Options& options) {
  std::string text;
  for (const Option& option : options.all()) {
    text.append(".TP\n.B ").append(troff(spelled(option))).append("\n");
    text.append(troff(meaning(option))).append(".");
    if (!option.fallback.empty()) text += "\nDefault: " + troff(option.fallback) + ".";
    text += "\n";
    if (option.words.empty()) continue;
    text += ".RS\n";
    for (const Word& word : option.words)
      text += ".TP\n.B " + troff(word.name) + "\n" + troff(word.meaning) + ".\n";
    text += ".RE\n";
  }
  return text;
}

std::string troffHead(const std::string& name, const std::string& summary) {
  return ".TH \"" + replaced(name, "-", "\\-") + "\" 1 \"\" \"vdbdither " + version +
         "\" \"vdbdither\"\n.SH NAME\n" + troff(name) + " \\- " + troff(summary) + "\n";
}

std::string manualPage(const Page& page) {
  std::string text = troffHead("vdbdither-" + page.name, page.summary) + ".SH SYNOPSIS\n.B " +
                     troff(usage(page)) + "\n.SH DESCRIPTION\n" + troff(whatItIs(page)) + "\n";
  if (!page.options.all().empty()) text += ".SH OPTIONS\n" + troffOptions(page.options);
  if (page.kind != "tool")
    text += ".PP\nThe options of every operator are listed in\n.BR vdbdither (1).\n";
  return text + ".SH EXAMPLE\n.nf\nvdbdither " +
         troff(replaced(page.example, "\n", "\nvdbdither ")) +
         "\n.fi\n.SH SEE ALSO\n.BR vdbdither (1)\n";
}

std::string mainManualPage() {
  std::string text =
      troffHead("vdbdither", "shape dithering for voxel-controlled 3D printing") +
      ".SH SYNOPSIS\n.B vdbdither\nOPERATOR [arguments] [! OPERATOR [arguments] "
      "...]\n.br\n.B vdbdither run\n\"OPERATOR ... | OPERATOR ...\"\n.br\n.B "
      "vdbdither help\n[OPERATOR]\n.SH DESCRIPTION\nOperators work on sparse OpenVDB "
      "grids, layer by layer, and chain. They read and write .vdb: files with names, "
      "or pipes between processes; an exclamation mark joins operators in one "
      "process.\n.SH OPERATORS AND TOOLS\n";
  for (const Page& page : pages())
    text += ".TP\n.BR " + troff("vdbdither-" + page.name) + " (1)\n" + troff(page.summary) + ".\n";
  return text + ".SH OPTIONS OF EVERY OPERATOR\n" + troffOptions(commonPage().options) +
         ".SH EXIT STATUS\n0 done, 1 bad data or a failed run, 2 wrong usage.\n.SH "
         "EXAMPLE\n.nf\nvdbdither " +
         troff(std::string(chain_example)) + "\n.fi\n";
}

}  // namespace

Page pageOf(const OperatorInfo& info) {
  struct Owner {
    std::unique_ptr<Operator> made;
    std::unique_ptr<Tool> tool;
    std::string input;
  };
  const auto owner = std::make_shared<Owner>();
  owner->made = info.make();
  Page page{std::string(info.name),    "sink", std::string(info.summary),
            std::string(info.example), {},     owner};
  if (dynamic_cast<Source*>(owner->made.get())) page.kind = "source";
  if (dynamic_cast<Filter*>(owner->made.get())) page.kind = "filter";
  if (info.on_file.make) {
    owner->tool = info.on_file.make();
    owner->tool->declare(page.options);
    return page;
  }
  if (page.kind != "source") {
    page.options.positional("input", owner->input,
                            "The .vdb to read if this operator begins the chain, as with --input",
                            false);
  }
  owner->made->declare(page.options);
  return page;
}

Page pageOf(const ToolInfo& info) {
  struct Owner {
    std::unique_ptr<Tool> made;
    RunOptions run;
  };
  const auto owner = std::make_shared<Owner>();
  owner->made = info.make();
  Page page{std::string(info.name),    "tool", std::string(info.summary),
            std::string(info.example), {},     owner};
  owner->made->declare(page.options);
  if (info.takes_run_options) owner->run.declareForTool(page.options);
  return page;
}

Page commonPage() {
  const auto made = std::make_shared<RunOptions>();
  Page page{"", "", "", "", {}, made};
  made->declare(page.options);
  return page;
}

std::vector<Page> pages() {
  std::vector<Page> all;
  for (const OperatorInfo* info : registeredOperators()) all.push_back(pageOf(*info));
  for (const ToolInfo* info : registeredTools()) {
    if (!info->hidden) all.push_back(pageOf(*info));
  }
  std::sort(all.begin(), all.end(), [](const Page& a, const Page& b) { return a.name < b.name; });
  return all;
}

std::string helpText(const Page& page) {
  const Page common = page.kind == "tool" ? Page{} : commonPage();
  std::string text = page.summary + "\n\nUsage: " + usage(page) + "\n";
  const auto addGroup = [&](const std::string& title, const std::string& lines) {
    if (!lines.empty()) text += "\n" + title + ":\n" + lines;
  };
  addGroup("Arguments", helpOf(page.options, Option::Kind::positional, {}));
  addGroup("Options", helpOf(page.options, Option::Kind::value, {}));
  addGroup("Options of every operator", helpOf(common.options, Option::Kind::value, page.options));
  return text + "\nExample:\n  vdbdither " + replaced(page.example, "\n", "\n  vdbdither ") + "\n";
}

std::string overview() {
  std::string text =
      "vdbdither: shape dithering for voxel-controlled 3D printing\n\n"
      "Usage: vdbdither OPERATOR [arguments] [! OPERATOR [arguments] ...]\n"
      "       vdbdither run \"OPERATOR ... | OPERATOR ...\"\n"
      "       vdbdither help OPERATOR, or all\n\n";
  constexpr std::array<std::pair<const char*, const char*>, 4> groups{{{"source", "Sources   "},
                                                                       {"filter", "Filters   "},
                                                                       {"sink", "Sinks     "},
                                                                       {"tool", "Tools     "}}};
  for (const auto& [kind, title] : groups) {
    std::vector<std::string> names;
    for (const Page& page : pages()) {
      if (page.kind == kind) names.push_back(page.name);
    }
    text += title + wrapped(names, std::string_view(title).size()) + "\n";
  }
  return text +
         "\nOperators read and write .vdb: -i and -o name files, pipes carry layers, ! joins\n"
         "operators in one process. A chain begins with a source or a .vdb (read), and\n"
         "ends with a sink or -o (write).\n\n"
         "Example: vdbdither mesh2sdf part.stl --printer mimaki-3duj-553 ! dither !\n"
         "           material-assign ! slice-export out\n";
}

std::string listing() {
  std::string text;
  for (const Page& page : pages()) {
    text += page.name +
            std::string(std::max<std::size_t>(18, page.name.size() + 1) - page.name.size(), ' ') +
            page.summary + "\n";
  }
  return text;
}

Files markdownFiles() {
  Files files{{"README.md", markdownIndex()}};
  for (const Page& page : pages()) files.emplace_back(page.name + ".md", markdownPage(page));
  return files;
}

Files manualFiles() {
  Files files{{"vdbdither.1", mainManualPage()}};
  for (const Page& page : pages())
    files.emplace_back("vdbdither-" + page.name + ".1", manualPage(page));
  return files;
}

}  // namespace vdbdither
