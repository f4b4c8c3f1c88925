// Feeds the readers of texts with whatever a fuzzer can think of: they return what they write again
// alike, or refuse. The first letter of a unit chooses the reader.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/file/key_values.h"
#include "io/file/xml_reader.h"
#include "io/profile/json_lines.h"
#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "io/profile/profile_parser.h"
#include "tests/fuzz/require.h"
#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

void readProfile(const std::string& text) {
  const nlohmann::ordered_json json = parsedJson(text);
  // What nests too deep has no problem of syntax.
  if (!jsonSyntaxProblem(text).empty()) require(json.is_discarded());
  const ProfileParser parser(json);
  if (json.is_discarded()) {
    require(!parser.problems().empty());
    return;
  }
  const std::string written = jsonText(json);
  require(isPrintable(written) && jsonText(parsedJson(written)) == written);
  const JsonLines lines = jsonLines(text);
  for (const ProfileProblem& problem : parser.problems()) require(lines.of(problem.path) >= 1);
  if (!parser.problems().empty()) return;
  const std::string profile = toJson(parser.profile());
  require(toJson(printerProfileFromJson(profile)) == profile);
}

void readMaterials(const std::string& text) {
  const std::string table = toJson(materialTableFromJson(text));
  require(toJson(materialTableFromJson(table)) == table);
}

void readKeyValues(std::span<const std::uint8_t> bytes) {
  const KeyValues values(bytes, "'a'");
  const double number = values.number("number", -1, 1e9);
  require(number >= -1 && number <= 1e9);
  const int whole = values.integer("whole", 0, 1000);
  require(whole >= 0 && whole <= 1000);
}

/// Requires that what begins also ends.
class Elements final : public XmlReader {
 public:
  Elements() : XmlReader("'a'") {}
  [[nodiscard]] int open() const { return open_; }

 private:
  void begin(const XmlElement& element) override {
    ++open_;
    require(!element.name().empty());
    static_cast<void>(element.attribute("a"));
    if (element.name() == "refused") refuse("has it");
  }
  void end() override { require(--open_ >= 0); }

  int open_ = 0;
};

void readXml(std::span<const std::uint8_t> bytes) {
  Elements elements;
  elements.read(bytes);
  elements.finish();
  require(elements.open() == 0);
}

void readChain(const std::string& line) {
  const Chain chain(parseChain(splitWords(line)));
  if (chain.helpWanted()) return;
  require(chain.stages().size() >= 2);
  require(chain.stages().front()->source() && chain.stages().back()->sink());
}

void readText(std::span<const std::uint8_t> unit) {
  const auto bytes = unit.subspan(1);
  const std::string text(bytes.begin(), bytes.end());
  switch (unit[0]) {
    case 'p':
      return readProfile(text);
    case 'm':
      return readMaterials(text);
    case 'k':
      return readKeyValues(bytes);
    case 'x':
      return readXml(bytes);
    case 'c':
      return readChain(text);
    default:
      return;
  }
}

}  // namespace

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  try {
    vdbdither::readText({data, size});
  } catch (const vdbdither::Error& error) {
    vdbdither::require(!std::string_view(error.what()).empty());
  }
  return 0;
}
