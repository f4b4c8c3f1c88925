#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>
#include <openvdb/Types.h>

#include "vdbdither/model/printer.h"

namespace vdbdither {

/// Something wrong with a printer profile.
struct ProfileProblem {
  std::vector<std::string> path;  ///< keys and indices that lead to it
  std::string message;
};

/// The names that `containers` may list: those of all formats of slices, sorted. (The formats
/// themselves know profiles, so they are not asked.)
std::span<const std::string> containerNames();

/// Reads a printer profile and notes all that is wrong with it.
class ProfileParser {
 public:
  explicit ProfileParser(const nlohmann::ordered_json& json);

  [[nodiscard]] const PrinterProfile& profile() const { return profile_; }
  [[nodiscard]] const std::vector<ProfileProblem>& problems() const { return problems_; }
  /// What is worth knowing of a proper profile.
  [[nodiscard]] const std::vector<ProfileProblem>& remarks() const { return remarks_; }

 private:
  using Json = nlohmann::ordered_json;

  /// An object of the profile.
  struct Object {
    const Json& json;
    std::vector<std::string> path;  ///< to it
    std::string prefix;             ///< of messages, such as "material 1: "

    [[nodiscard]] bool has(const std::string& key) const { return json.contains(key); }
    [[nodiscard]] const Json& operator[](const std::string& key) const { return json.at(key); }
  };

  void problem(const Object& object, const std::string& key, const std::string& message);
  void known(const Object& object, const std::vector<std::string>& keys);
  std::string text(const Object& object, const std::string& key);
  std::string name(const Object& object,
                   const std::function<std::optional<std::string>(std::string_view)>& name_problem);
  std::string word(const Object& object, const std::string& key,
                   const std::vector<std::string>& words, const std::string& otherwise);
  bool flag(const Object& object, const std::string& key);
  int count(const Object& object, const std::string& key);
  std::vector<double> lengths(const Object& object, const std::string& key, std::size_t number,
                              double min_mm, double max_mm);
  openvdb::Vec3d lengths3(const Object& object, const std::string& key, double min_mm,
                          double max_mm);

  void identity(const Object& object);
  void layers(const Object& object);
  void slices(const Object& object);
  void optics(const Object& object);
  void mirror(const Object& entry);
  std::optional<openvdb::Vec3d> coefficients(const Object& entry, const std::string& key);
  void material(const Object& entry);
  void remarkColour(const Object& entry, const Material& material);
  void appearance(const Object& entry, Material& material);

  PrinterProfile profile_;
  std::vector<ProfileProblem> problems_;
  std::vector<ProfileProblem> remarks_;
};

}  // namespace vdbdither
