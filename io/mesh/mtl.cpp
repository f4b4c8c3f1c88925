// MTL, the materials of Wavefront OBJ: "Alias/WaveFront Material (.mtl) File Format" (Diane Ramey,
// Linda Rose, Lisa Tyerman, 1995). Tr is not in it; exporters write one less the opacity.

#include "io/mesh/mtl.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <set>

#include "io/mesh/text_cursor.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

constexpr const char* colour_numbers = "three numbers from 0 to 1";

double share(double value) {
  if (!(value > 0)) return 0;
  return value < 1 ? value : 1;
}

class MtlParser {
 public:
  MtlParser(const MeshFile& file, std::string_view text, const std::string& shown)
      : file_(file), shown_(shown), all_(text), text_(text) {}

  std::vector<MtlMaterial> parse() {
    constexpr std::size_t lines_per_look = 1 << 16;
    for (std::size_t line = 0; !text_.atEnd(); text_.skipLine()) {
      if (++line % lines_per_look == 0) throwIfInterrupted();
      readStatement(text_.word());
    }
    scaleBytes();
    whitenTextured();
    if (!passed_over_.empty()) {
      std::string list;
      for (const std::string& word : passed_over_) list += (list.empty() ? "" : ", ") + word;
      file_.warn(shown_ + ": not read: " + list);
    }
    if (black_ > 0) {
      file_.warn(shown_ + ": " + std::to_string(black_) + " materials, the first " +
                 inQuotes(first_black_) +
                 ", are black with a texture; their textures are read as they are");
    }
    return std::move(materials_);
  }

 private:
  void readStatement(std::string_view statement) {
    if (equalsIgnoringCase(statement, "newmtl")) {
      materials_.push_back({});
      materials_.back().name = mtlName(text_.line());
      has_dissolve_ = false;
      return;
    }
    if (materials_.empty()) return;
    if (equalsIgnoringCase(statement, "kd")) {
      readDiffuse();
    } else if (equalsIgnoringCase(statement, "d")) {
      readDissolve();
    } else if (equalsIgnoringCase(statement, "tr")) {
      const double transparency = share(number("Tr", "one number from 0 to 1"));
      if (!has_dissolve_) materials_.back().opacity = 1 - transparency;
    } else if (equalsIgnoringCase(statement, "map_kd")) {
      readMap();
    } else if (equalsIgnoringCase(statement, "map_d")) {
      passed_over_.insert("map_d");
    }
  }

  /// Green and blue are as red where they are left out.
  void readDiffuse() {
    TextCursor ahead = text_;
    if (const std::string_view word = ahead.word(); word == "spectral" || word == "xyz") {
      passed_over_.insert("Kd " + std::string(word));
      return;
    }
    std::array<double, 3>& diffuse = materials_.back().diffuse;
    diffuse[0] = number("Kd", colour_numbers);
    diffuse[1] = diffuse[2] = diffuse[0];
    for (std::size_t i = 1; i < 3; ++i) {
      ahead = text_;
      if (const std::string_view word = ahead.word(); word.empty() || word.starts_with('#')) break;
      diffuse[i] = number("Kd", colour_numbers);
    }
    for (const double value : diffuse) greatest_ = std::max(greatest_, value);
  }

  /// Comes before Tr, wherever the two stand.
  void readDissolve() {
    TextCursor ahead = text_;
    if (ahead.word() == "-halo") text_ = ahead;
    materials_.back().opacity = share(number("d", "one number from 0 to 1"));
    has_dissolve_ = true;
  }

  /// @param wanted  what the statement must have
  double number(const std::string& statement, const std::string& wanted) {
    TextCursor ahead = text_;
    if (const auto value = text_.number(); value && *value >= 0 && std::isfinite(*value))
      return *value;
    const std::string_view word = ahead.word();
    const auto line = 1 + std::count(all_.data(), text_.position(), '\n');
    file_.refuse(shown_ + ", line " + std::to_string(line) + ": " + statement + " needs " + wanted +
                 ", not " + (word.empty() ? "nothing" : inQuotes(word)) +
                 "; repair the line or export again");
  }

  /// Some exporters write bytes. A value slightly above 1 is an overbright colour.
  void scaleBytes() {
    constexpr double least_byte = 2;
    const bool has_bytes = greatest_ > least_byte;
    if (has_bytes) file_.warn(shown_ + ": Kd goes beyond 1; it is read as 0 to 255");
    for (MtlMaterial& material : materials_)
      for (double& value : material.diffuse) value = share(has_bytes ? value / 255 : value);
  }

  void readMap() {
    MtlMaterial& material = materials_.back();
    material.offset = {0, 0};
    material.scale = {1, 1};
    material.is_clamped = false;
    for (;;) {
      TextCursor ahead = text_;
      const std::string_view option = ahead.word();
      if (!option.starts_with('-') || !readOption(option, ahead, material)) break;
      text_ = ahead;
    }
    material.texture = unquoted(mtlName(text_.line()));
    if (material.texture.empty()) passed_over_.insert("map_Kd without the name of a file");
  }

  /// Whether `option` is one; then `text` is behind its arguments.
  bool readOption(std::string_view option, TextCursor& text, MtlMaterial& material) {
    if (option == "-clamp") {
      material.is_clamped = text.word() == "on";
    } else if (option == "-o") {
      readNumbers(text, material.offset);
    } else if (option == "-s") {
      readNumbers(text, material.scale);
    } else if (option == "-t") {
      std::array<double, 2> turbulence{};
      readNumbers(text, turbulence);
      if (turbulence != std::array<double, 2>{}) passed_over_.insert("the option -t of map_Kd");
    } else if (option == "-mm") {
      const auto base = text.number();
      const auto gain = text.number();
      if (base.value_or(0) != 0 || gain.value_or(1) != 1)
        passed_over_.insert("the option -mm of map_Kd");
    } else if (option == "-blendu" || option == "-blendv" || option == "-cc" ||
               option == "-texres" || option == "-bm" || option == "-boost" || option == "-type" ||
               option == "-imfchan") {
      text.word();
    } else {
      return false;
    }
    return true;
  }

  /// One to three numbers, of which the third, for textures in space, means nothing here.
  static void readNumbers(TextCursor& text, std::array<double, 2>& numbers) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto number = text.number();
      if (!number) return;
      if (i < 2 && std::isfinite(*number)) numbers[i] = *number;
    }
  }

  /// Some exporters write black where the texture alone is the colour.
  void whitenTextured() {
    for (MtlMaterial& material : materials_) {
      if (material.texture.empty() || material.diffuse != std::array<double, 3>{}) continue;
      material.diffuse = {1, 1, 1};
      if (black_++ == 0) first_black_ = material.name;
    }
  }

  const MeshFile& file_;
  const std::string& shown_;
  std::string_view all_;
  TextCursor text_;
  std::vector<MtlMaterial> materials_;
  bool has_dissolve_ = false;
  double greatest_ = 0;
  std::set<std::string> passed_over_;
  std::size_t black_ = 0;
  std::string first_black_;
};

}  // namespace

std::vector<MtlMaterial> parseMtl(const MeshFile& file, std::string_view text,
                                  const std::string& shown) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  return MtlParser(file, text, shown).parse();
}

std::string_view unquoted(std::string_view name) {
  const bool is_quoted = name.size() > 1 && name.front() == '"' && name.back() == '"';
  return is_quoted ? name.substr(1, name.size() - 2) : name;
}

std::string_view mtlName(std::string_view line) {
  constexpr std::string_view blanks = " \t\v\f\r";
  for (std::size_t at = line.find('#'); at != line.npos; at = line.find('#', at + 1)) {
    if (at != 0 && blanks.find(line[at - 1]) == blanks.npos) continue;
    line = line.substr(0, at);
    break;
  }
  const std::size_t begin = line.find_first_not_of(blanks);
  if (begin == line.npos) return {};
  return line.substr(begin, line.find_last_not_of(blanks) + 1 - begin);
}

}  // namespace vdbdither
