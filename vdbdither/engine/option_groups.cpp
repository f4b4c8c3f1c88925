#include "vdbdither/engine/option_groups.h"

#include "vdbdither/engine/comma_list.h"

namespace vdbdither {

namespace {

constexpr Range scales{1e-6, 1e6};
constexpr Range fits_mm = Range::above(0, 1e5);
constexpr Range turns_degrees{-360, 360};
constexpr Range pitches_mm{1e-3, 10};

constexpr std::array<Choice<Smoothing>, 2> smoothings{
    {{Smoothing::none, "none", "Leaves the surface as it is"},
     {Smoothing::taubin, "taubin",
      "Taubin's smoothing with lambda 0.5 and mu -0.53, which keeps the volume; holds the whole "
      "mesh in memory"}}};

void declareSize(PlacementOptions& placement, Options& options, const std::string& part) {
  options.choice("unit", placement.unit, length_units,
                 "Unit of the numbers in the file; glTF and 3MF state theirs");
  options.number("scale", placement.scale, scales, "Scales " + part + " about the origin");
}

void declareBed(PlacementOptions& placement, Options& options, const std::string& part) {
  options.flag("place", placement.on_bed,
               "Moves " + part +
                   " to the bed: its bounding box begins at the lower faces of voxel (0, 0, 0)");
}

}  // namespace

double mmOf(LengthUnit unit) {
  switch (unit) {
    case LengthUnit::cm:
      return 10;
    case LengthUnit::m:
      return 1000;
    case LengthUnit::in:
      return 25.4;
    case LengthUnit::um:
      return 0.001;
    default:
      return 1;
  }
}

void PlacementOptions::declare(Options& options, const std::string& part) {
  declareSize(*this, options, part);
  declareBed(*this, options, part);
}

void MeshPlacementOptions::declare(Options& options, const std::string& mesh) {
  declareSize(*this, options, mesh);
  options.length("fit", fit_mm, fits_mm,
                 "Scales " + mesh +
                     " until its longest axis has this length; replaces --unit and "
                     "--scale");
  options.triple("rotate", rotate_degrees, "X,Y,Z", turns_degrees,
                 "Turns " + mesh + " about x, then y, then z, in degrees");
  declareBed(*this, options, mesh);
}

void LatticeOptions::declare(Options& options) {
  options.text("printer", printer, "NAME|FILE.json",
               "Printer whose lattice is used: a name that `vdbdither printers` lists, or a "
               "profile");
  options.completion(Option::Completion::printer);
  options.length(
      "layer", layer_mm, pitches_mm,
      "Height of a layer in place of the printer's own, within the range of its profile");
  options.lengths("pitch", pitch_mm, "DX,DY,DZ", pitches_mm,
                  "Pitch of the lattice, in place of --printer");
}

void InkOptions::declare(Options& options) {
  options.text(
      "inks", inks, "NAME,...",
      "Materials that make up colours: names of the printer's profile, or NAME=#rrggbb; by "
      "default all of the profile. One whose name contains 'clear' stands for what is not "
      "opaque");
  options.number(
      "black", black, {0, 1},
      "Where colours can be mixed with more or less black, without --icc: 0 takes as little as "
      "possible, 1 as much");
  options.choice("white", white, whites, "What white is, without --icc");
  options.noteGiven(mixing_given, 2);
  options.onlyIf([this] { return icc.empty(); }, 2);
  options.file(
      "icc", icc, "FILE.icc",
      "ICC output profile that says which inks make up a colour, in place of the mixing of "
      "the colours of the inks");
  options.text("channels", channels, "NAME,...",
               "Inks of the channels of --icc, in their order; by default those with the names of "
               "the channels");
  options.choice("intent", intent, intents, "Rendering intent of --icc");
  options.choice("black-point", black_point, black_points, "Black of --icc with --intent relative");
  options.belongTo(
      "--icc", [this] { return !icc.empty(); }, 3);
}

void OverwriteOption::declare(Options& options, const std::string& output) {
  options.flag("overwrite", overwrite, "Replaces " + output + " if it exists");
}

void JsonOption::declare(Options& options) {
  options.flag("json", json, "Prints the report as JSON");
}

void GridListOption::declare(Options& options) {
  options.text("grids", names, "NAME,NAME", "Names of the grids to take; all others are left out");
}

std::vector<std::string> GridListOption::list() const {
  return names.empty() ? std::vector<std::string>{} : commaList(names);
}

void SurfaceGridOption::declare(Options& options) {
  options.text("grid", grid, "NAME",
               "Grid whose surface is taken: of solid the steps of its voxels with cut corners, of "
               "surface and displaced a level "
               "of the distance, of printed a level of the share of material",
               {"auto", "The first of printed, solid, displaced and surface that there is"});
}

void SmoothingOptions::declare(Options& options) {
  options.choice("smooth", smoothing, smoothings, "Smoothing of the surface");
  options.integer("iterations", iterations, {1, 100000}, "Number of smoothing steps");
  options.belongTo("--smooth", [this] { return smoothing != Smoothing::none; });
}

void ViewOptions::declare(Options& options) {
  options.length("distance", distance_mm, Range::above(0, 1e6),
                 "Distance from the eye to the object");
  options.length("pixel", pixel_mm, Range::above(0, 1000), "Side of a pixel at the object");
}

}  // namespace vdbdither
