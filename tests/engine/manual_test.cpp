#include "vdbdither/engine/manual.h"

#include <array>
#include <sstream>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

enum class Colour { red, blue };
constexpr std::array<Choice<Colour>, 2> colours{
    {{Colour::red, "red", "The colour of a ripe tomato, of a rose and of most fire engines"},
     {Colour::blue, "blue", "The colour of the sky"}}};

Page examplePage() {
  struct Members {
    std::string file;
    double amplitude = 4;
    Colour colour = Colour::blue;
    bool strict = false;
  };
  const auto members = std::make_shared<Members>();
  Page page{"example", "tool", "Does things", "example part.stl\nexample again.stl", {}, members};
  page.options.positional("file", members->file, "The file");
  page.options.number("amplitude", members->amplitude, {0, 8}, "The constant");
  page.options.choice("colour", members->colour, colours, "The colour");
  page.options.flag("strict", members->strict, "Refuses repairs");
  return page;
}

TEST(Manual, HelpShowsEveryOptionWithItsDefaultRangeAndValues) {
  EXPECT_EQ(helpText(examplePage()),
            "Does things\n"
            "\n"
            "Usage: vdbdither example file [options]\n"
            "\n"
            "Arguments:\n"
            "  file                        The file\n"
            "\n"
            "Options:\n"
            "  --amplitude X [4]           The constant (from 0 to 8)\n"
            "  --colour red|blue [blue]    The colour\n"
            "                                red: The colour of a ripe tomato, of a rose\n"
            "                                  and of most fire engines\n"
            "                                blue: The colour of the sky\n"
            "  --strict                    Refuses repairs\n"
            "\n"
            "Example:\n"
            "  vdbdither example part.stl\n"
            "  vdbdither example again.stl\n");
}

TEST(Manual, HelpOfEveryVerbFitsEightyColumns) {
  for (const Page& page : pages()) {
    std::istringstream text(helpText(page));
    bool in_options = false;
    for (std::string line; std::getline(text, line);) {
      in_options = (in_options || line == "Options:") && line != "Example:";
      if (in_options) {
        EXPECT_LT(line.size(), 80U) << page.name << ": " << line;
      }
    }
  }
}

TEST(Manual, EveryValueOfAChoiceIsExplained) {
  for (const Page& page : pages()) {
    const std::string help = helpText(page);
    for (const Option& option : page.options.all()) {
      for (const Word& word : option.words) {
        EXPECT_FALSE(word.meaning.empty()) << page.name << " " << option.name << " " << word.name;
        EXPECT_NE(help.find(word.name + ": "), std::string::npos)
            << page.name << " " << option.name << " " << word.name;
      }
    }
  }
}

}  // namespace
}  // namespace vdbdither
