#include <algorithm>

#include "vdbdither/engine/manual.h"

namespace vdbdither {

namespace {

constexpr const char* list_printers = "vdbdither printers 2>/dev/null | cut -d' ' -f1";

bool takesValue(const Option& option) { return option.kind == Option::Kind::value; }

/// The installed printers complete the option besides its words and files.
bool takesPrinter(const Option& option) { return option.completion == Option::Completion::printer; }

bool takesFile(const Option& option) {
  return option.completion == Option::Completion::file || takesPrinter(option);
}

bool hasWords(const Option& option) { return !option.words.empty() || takesPrinter(option); }

std::string wordsOf(const Option& option) {
  std::string text;
  for (const Word& word : option.words) text += (text.empty() ? "" : " ") + word.name;
  return text;
}

std::vector<Option> optionsOf(const Page& page, const Page& common) {
  std::vector<Option> options(page.options.all().begin(), page.options.all().end());
  if (page.kind == "tool") return options;
  for (const Option& option : common.options.all()) {
    if (!page.options.find(option.name)) options.push_back(option);
  }
  std::erase_if(options, [](const Option& o) { return o.kind == Option::Kind::positional; });
  return options;
}

std::string verbs() {
  std::string text;
  for (const Page& page : pages()) text += page.name + " ";
  return text + "run help";
}

/// In single quotes, as every shell takes it.
std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

constexpr const char* bash_head = R"(# Completion of vdbdither for bash. Made by `vdbdither docs`.

_vdbdither() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} verb= i
  for ((i = COMP_CWORD - 1; i > 0; --i)); do
    case ${COMP_WORDS[i]} in
      '!' | '|' | run | help) break ;;
      *) verb=${COMP_WORDS[i]} ;;
    esac
  done
  COMPREPLY=()
  if [ -z "$verb" ]; then
    COMPREPLY=($(compgen -W '@verbs@' -- "$word"))
    return
  fi
  case "$verb $before" in
)";

constexpr const char* bash_middle = R"(  esac
  if [[ $word != -* ]]; then
    COMPREPLY=($(compgen -f -- "$word"))
    return
  fi
  case $verb in
)";

constexpr const char* bash_tail = R"(  esac
}

complete -o filenames -F _vdbdither vdbdither
)";

std::string withVerbs(std::string text) {
  constexpr std::string_view mark = "@verbs@";
  for (std::size_t at = 0; (at = text.find(mark)) != std::string::npos;)
    text.replace(at, mark.size(), verbs());
  return text;
}

std::string bashCompletion() {
  const Page common = commonPage();
  std::string text = withVerbs(bash_head);
  std::string options;
  for (const Page& page : pages()) {
    options += "    " + page.name + ") COMPREPLY=($(compgen -W '";
    for (const Option& option : optionsOf(page, common)) {
      if (option.kind == Option::Kind::positional) continue;
      options += "--" + option.name + " ";
      if (!takesValue(option) || !hasWords(option)) continue;
      text += "    '" + page.name + " --" + option.name + "') COMPREPLY=($(compgen " +
              (takesFile(option) ? "-f " : "") + "-W \"" +
              (takesPrinter(option) ? std::string("$(") + list_printers + ")" : wordsOf(option)) +
              "\" -- \"$word\")); return ;;\n";
    }
    options.pop_back();
    options += "' -- \"$word\")) ;;\n";
  }
  return text + bash_middle + options + bash_tail;
}

constexpr const char* zsh_head = R"(#compdef vdbdither
# Completion of vdbdither for zsh. Made by `vdbdither docs`.

local verb= before=$words[CURRENT-1] i
for ((i = CURRENT - 1; i > 1; --i)); do
  case $words[i] in
    '!' | '\!' | '|' | run | help) break ;;
    *) verb=$words[i] ;;
  esac
done
if [[ -z $verb ]]; then
  local -a verbs=(
)";

std::string zshDescribed(const std::string& name, const std::string& meaning) {
  std::string safe;
  for (const char c : name) safe += c == ':' ? std::string("\\:") : std::string(1, c);
  return "    " + quoted(safe + ":" + meaning) + "\n";
}

/// Offers the words of an option with what they do.
std::string zshValues(const Option& option) {
  if (takesPrinter(option)) return std::string("compadd -- ${(f)\"$(") + list_printers + ")\"}";
  std::string text = "local -a values=(\n";
  for (const Word& word : option.words) text += zshDescribed(word.name, word.meaning);
  return text + "  ); _describe 'value' values";
}

std::string zshCompletion() {
  const Page common = commonPage();
  std::string text = zsh_head;
  std::string values_of;
  std::string options_of;
  for (const Page& page : pages()) {
    text += zshDescribed(page.name, page.summary);
    options_of += "  " + page.name + ") options=(\n";
    for (const Option& option : optionsOf(page, common)) {
      if (option.kind == Option::Kind::positional) continue;
      options_of += zshDescribed("--" + option.name, option.help);
      if (!takesValue(option) || !hasWords(option)) continue;
      values_of += "  '" + page.name + " --" + option.name + "') " + zshValues(option) +
                   (takesFile(option) ? "; _files" : "") + "; return ;;\n";
    }
    options_of += "  ) ;;\n";
  }
  return text + zshDescribed("run", "A chain in quotes") +
         zshDescribed("help", "What a verb does") +
         "  )\n  _describe 'operator' verbs\n  return\nfi\ncase \"$verb $before\" in\n" +
         values_of +
         "esac\nif [[ $PREFIX != -* ]]; then\n  _files\n  return\nfi\nlocal -a options\ncase $verb "
         "in\n" +
         options_of + "esac\n_describe 'option' options\n";
}

constexpr const char* fish_head = R"(# Completion of vdbdither for fish. Made by `vdbdither docs`.

function __vdbdither_verb --description 'Whether the step that is being written has this verb'
    set --local verb
    for word in (commandline --tokenize --cut-at-cursor --current-process)[2..-1]
        switch $word
            case '!' '|' run help
                set verb
            case '*'
                set --query verb[1]; or set verb $word
        end
    end
    test "$verb" = "$argv"
end

complete --command vdbdither --condition '__vdbdither_verb' --no-files
)";

/// In single quotes as fish takes it: backslashes keep their meaning before quotes.
std::string fishQuoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') result += '\\';
    result += c;
  }
  result += '\'';
  return result;
}

/// The words of an option, each with a tab and what it does.
std::string fishValues(const Option& option) {
  std::string text;
  for (const Word& word : option.words)
    text += (text.empty() ? "" : " ") + word.name + "\\t" + fishQuoted(word.meaning);
  return text;
}

std::string fishCompletion() {
  const Page common = commonPage();
  std::string text = fish_head;
  const std::string begin = "complete --command vdbdither --condition ";
  for (const Page& page : pages()) {
    text += begin + "'__vdbdither_verb' --arguments " + page.name + " --description " +
            fishQuoted(page.summary) + "\n";
  }
  text += begin + "'__vdbdither_verb' --arguments 'run help'\n";
  for (const Page& page : pages()) {
    for (const Option& option : optionsOf(page, common)) {
      if (option.kind == Option::Kind::positional) continue;
      text += begin + "'__vdbdither_verb " + page.name + "' --long-option " + option.name;
      if (option.letter) text += std::string(" --short-option ") + option.letter;
      if (takesValue(option)) text += takesFile(option) ? " --require-parameter" : " --exclusive";
      if (takesPrinter(option))
        text += " --arguments '(vdbdither printers | string split -f1 \" \")'";
      if (!option.words.empty()) text += " --arguments " + fishQuoted(fishValues(option));
      text += " --description " + fishQuoted(option.help) + "\n";
    }
  }
  return text;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> completionFiles() {
  return {{"bash-completion/completions/vdbdither", bashCompletion()},
          {"zsh/site-functions/_vdbdither", zshCompletion()},
          {"fish/vendor_completions.d/vdbdither.fish", fishCompletion()}};
}

}  // namespace vdbdither
