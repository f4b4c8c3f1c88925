// Feeds the readers of texts with whatever a fuzzer can think of: they return what they write again
// alike, or refuse. The first letter of a unit chooses the reader.

#include <algorithm>
#include <cmath>
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
#include "io/job/job.h"
#include "io/profile/json_lines.h"
#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "io/profile/profile_parser.h"
#include "io/stack/stack_piece.h"
#include "io/stack/stack_preview.h"
#include "tests/fuzz/require.h"
#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

void readProfile(const std::string& text) {
  const nlohmann::ordered_json json = parsedJson(text);
  require(json.is_discarded() != jsonProblem(text).empty());
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

/// One option of each kind.
struct Sample {
  bool flag = false;
  int whole = 0;
  double number = 0, length_mm = 0;
  openvdb::Vec3d triple{0.0}, lengths_mm{1.0};
  openvdb::Coord coord{0, 0, 0};
  std::string file;
  std::vector<std::string> texts;

  void declare(Options& options) {
    options.positional("in", file, "A file");
    options.flag("flag", flag, "A flag");
    options.integer("whole", whole, {-5, 4096}, "A whole number");
    options.number("number", number, {-1, 1}, "A number");
    options.length("length", length_mm, {0, 100}, "A length");
    options.triple("triple", triple, "X,Y,Z", {0, 1}, "Three numbers");
    options.triple("coord", coord, "X,Y,Z", {0, 9}, "Three whole numbers");
    options.lengths("lengths", lengths_mm, "DX,DY,DZ", {1e-3, 10}, "Three lengths");
    options.texts("text", texts, "TEXT", "Texts");
  }

  [[nodiscard]] bool isWithinRange() const {
    bool is_within =
        whole >= -5 && whole <= 4096 && std::abs(number) <= 1 && length_mm >= 0 && length_mm <= 100;
    for (int axis = 0; axis < 3; ++axis) {
      is_within = is_within && triple[axis] >= 0 && triple[axis] <= 1 && coord[axis] >= 0 &&
                  coord[axis] <= 9 && lengths_mm[axis] >= 1e-3 && lengths_mm[axis] <= 10;
    }
    return is_within;
  }
};

void readChain(const std::string& line) {
  for (const Step& step : parseChain(splitWords(line))) {
    require(!step.verb.empty());
    Sample sample;
    Options options;
    sample.declare(options);
    options.parse(step.arguments);
    require(sample.isWithinRange());
    // The history of a grid holds this line.
    const std::string canonical = options.canonical();
    Sample again;
    Options options_again;
    again.declare(options_again);
    options_again.parse(splitWords(canonical));
    require(options_again.canonical() == canonical);
    for (const std::string& argument : step.arguments) materialEntries(argument);
    parseMaterial(step.verb, {});
  }
}

void readJobText(const std::string& text) {
  const std::string written = textOf(jobOf(text, "'a'"));
  require(textOf(jobOf(written, "'a'")) == written);
}

void readStackPiece(std::span<const std::uint8_t> bytes) {
  const std::vector<std::uint8_t> written = bytesOf(stackPieceOf(bytes));
  require(std::equal(written.begin(), written.end(), bytes.begin(), bytes.end()));
  StackPreview preview({0.1, 0.1, 0.1}, 8, 8, {0, 8}, {0, 1, 2});
  preview.addPart(stackPieceOf(bytes).preview);
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
    case 'j':
      return readJobText(text);
    case 's':
      return readStackPiece(bytes);
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
