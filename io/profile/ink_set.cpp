#include "io/profile/ink_set.h"

#include <algorithm>
#include <string>

#include "io/image/srgb.h"
#include "io/profile/icc_coverages.h"
#include "io/profile/material_table.h"
#include "io/profile/printer_profile.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

bool isClear(const Material& material) {
  return lowerCase(material.name).find("clear") != std::string::npos;
}

namespace {

constexpr std::size_t most_inks = 12;

std::vector<Material> namedInks(const std::string& text, const std::vector<Material>& known) {
  std::vector<Material> inks;
  for (const std::string& name : materialEntries(text)) {
    const std::size_t before = inks.size();
    try {
      addMaterial(inks, parseMaterial(name, known));
    } catch (const UsageError& error) {
      throw UsageError(std::string("--inks: ") + error.what());
    }
    if (inks.size() == before)
      throw UsageError("--inks: '" + parseMaterial(name, known).name + "' is there twice");
  }
  return inks;
}

/// Returns the material of the same name and display colour, or null.
const Material* sameAs(const Material& material, const std::vector<Material>& known) {
  const auto same = std::find_if(known.begin(), known.end(), [&](const Material& other) {
    return other.name == material.name && other.rgba == material.rgba;
  });
  return same == known.end() ? nullptr : &*same;
}

/// Gives inks the absorption and scattering of the profile. Without those of an ink that colours,
/// they all mix by their colours.
void takeCoefficients(const std::vector<Material>& known, InkSet& set) {
  for (std::size_t ink = 0; ink < set.inks.size(); ++ink) {
    const Material* same = sameAs(set.inks[ink], known);
    if (same != nullptr && same->absorption && same->scattering) {
      set.inks[ink].absorption = same->absorption;
      set.inks[ink].scattering = same->scattering;
    } else if (ink != set.clear) {
      set.kubelka_munk.reset();
      return;
    }
  }
}

}  // namespace

bool canMixColours(const std::vector<Material>& materials) {
  const auto clear = std::count_if(materials.begin(), materials.end(), isClear);
  return materials.size() <= most_inks && clear <= 1 &&
         static_cast<std::size_t>(clear) < materials.size();
}

InkSet inkSetOf(const InkOptions& options, const Schema& in, const std::vector<Material>& usual) {
  InkSet set;
  const PrinterProfile printer = printerProfileOf(in);
  const std::vector<Material>& known = printer.materials;
  set.yule_nielsen = printer.yule_nielsen;
  set.inks = !options.inks.empty() ? namedInks(options.inks, known) : usual.empty() ? known : usual;
  if (set.inks.empty())
    throw UsageError(
        "--inks: no printer profile names materials; name them, as in "
        "white,black,cyan,magenta,yellow");
  if (set.inks.size() > most_inks)
    throw UsageError("--inks: there are " + std::to_string(set.inks.size()) + " materials; name " +
                     std::to_string(most_inks) + " or fewer");
  if (!known.empty() && set.inks.size() > known.size())
    throw UsageError("--inks: there are " + std::to_string(set.inks.size()) +
                     " materials, and the printer takes " + std::to_string(known.size()));
  set.linear_rgb = linearColoursOf(set.inks, printer);
  for (std::size_t ink = 0; ink < set.inks.size(); ++ink) {
    if (!isClear(set.inks[ink])) continue;
    if (set.clear)
      throw UsageError("--inks: '" + set.inks[*set.clear].name + "' and '" + set.inks[ink].name +
                       "' are both clear; name one of them");
    set.clear = ink;
  }
  if (set.inks.size() == 1 && set.clear)
    throw UsageError("--inks: there must be an ink besides the clear one");
  set.black = options.black;
  set.media_relative = options.white == White::media;
  set.kubelka_munk = printer.kubelka_munk;
  if (set.kubelka_munk) takeCoefficients(known, set);
  if (!options.icc.empty()) {
    if (!options.mixing_given.empty())
      throw UsageError(options.mixing_given + ": the profile of --icc says it; leave it out");
    set.table = readIccCoverages(options, set);
  }
  return set;
}

std::vector<openvdb::Vec3d> linearColoursOf(const std::vector<Material>& materials,
                                            const PrinterProfile& printer) {
  std::vector<openvdb::Vec3d> colours;
  for (const Material& material : materials) {
    const Material* same = sameAs(material, printer.materials);
    if (same != nullptr && same->linear_rgb) {
      colours.push_back(*same->linear_rgb);
      continue;
    }
    openvdb::Vec3d& colour = colours.emplace_back();
    for (int channel = 0; channel < 3; ++channel)
      colour[channel] =
          double{linearOfSrgbBytes()[material.rgba[static_cast<std::size_t>(channel)]]};
  }
  return colours;
}

}  // namespace vdbdither
