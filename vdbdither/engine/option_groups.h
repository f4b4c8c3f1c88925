#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/engine/options.h"

namespace vdbdither {

// Options that several operators share. An operator holds a group as a member and calls its
// `declare`.

/// The units of numbers in files that do not name one.
enum class LengthUnit { mm, cm, m, in, um };
inline constexpr std::array<Choice<LengthUnit>, 5> length_units{
    {{LengthUnit::mm, "mm", "Millimetres"},
     {LengthUnit::cm, "cm", "Centimetres"},
     {LengthUnit::m, "m", "Metres"},
     {LengthUnit::in, "in", "Inches"},
     {LengthUnit::um, "um", "Micrometres"}}};

/// The length of `unit` in mm.
double mmOf(LengthUnit unit);

/// `--unit`, `--scale` and `--place`: how a part comes from its file to the printer.
struct PlacementOptions {
  LengthUnit unit = LengthUnit::mm;
  double scale = 1;
  bool on_bed = false;

  /// \param part  what help calls it, such as "the mesh"
  void declare(Options& options, const std::string& part);
  /// The factor from the numbers of the file to mm.
  [[nodiscard]] double mmPerUnit() const { return mmOf(unit) * scale; }
};

/// The same, and `--fit` and `--rotate`: how a mesh comes to the printer.
struct MeshPlacementOptions : PlacementOptions {
  std::optional<double> fit_mm;  ///< the length of the longest axis, in place of the factor
  openvdb::Vec3d rotate_degrees{0, 0, 0};

  void declare(Options& options, const std::string& mesh);
};

/// `--printer`, `--layer` and `--pitch`: the lattice to print on. A printer or a pitch must be
/// given, and the layer with a printer alone, which targetPitchMm (io/profile/target_lattice.h)
/// checks.
struct LatticeOptions {
  std::string printer;
  std::optional<double> layer_mm;  ///< the height of a layer in place of the printer's usual one
  std::optional<openvdb::Vec3d> pitch_mm;

  void declare(Options& options);
};

/// How an ICC profile of a printer reproduces colours.
enum class Intent { perceptual, relative, saturation, absolute };
inline constexpr std::array<Choice<Intent>, 4> intents{
    {{Intent::perceptual, "perceptual", "Keeps the relations between colours"},
     {Intent::relative, "relative", "Keeps colours relative to white"},
     {Intent::saturation, "saturation", "Keeps colours vivid"},
     {Intent::absolute, "absolute", "Keeps colours as measured, that of white too"}}};

/// The black of a colour and the black of a printer.
enum class BlackPoint { compensated, kept };
inline constexpr std::array<Choice<BlackPoint>, 2> black_points{
    {{BlackPoint::compensated, "compensated", "Scales lightness from black to black"},
     {BlackPoint::kept, "kept", "Leaves lightness as it is"}}};

/// What white means to inks.
enum class White { media, absolute };
inline constexpr std::array<Choice<White>, 2> whites{
    {{White::media, "media", "The lightest ink, and black the darkest; colours lie between"},
     {White::absolute, "absolute",
      "A perfect white: colours stay as they are where inks can mix them"}}};

/// `--inks`, `--black`, `--white`, `--icc` and what belongs to it: which materials make up a colour
/// (io/profile/ink_set.h).
struct InkOptions {
  std::string inks;
  double black = 0.5;
  White white = White::media;
  std::string icc;
  std::string channels;
  Intent intent = Intent::relative;
  BlackPoint black_point = BlackPoint::compensated;
  std::string mixing_given;  ///< `--black` or `--white`, if it is given

  void declare(Options& options);
};

/// `--overwrite` of an operator that writes files of its own.
struct OverwriteOption {
  bool overwrite = false;

  /// \param output  what help calls it, such as "the file"
  void declare(Options& options, const std::string& output);
};

/// `--json` of a verb that reports.
struct JsonOption {
  bool json = false;

  void declare(Options& options);
};

/// `--grids`: some of the grids of a file.
struct GridListOption {
  std::string names;

  void declare(Options& options);
  /// The names, or nothing where all grids are meant.
  [[nodiscard]] std::vector<std::string> list() const;
};

/// `--grid`: the grid whose surface is meant.
struct SurfaceGridOption {
  std::optional<std::string> grid;  ///< the one furthest down the chain where there is none

  void declare(Options& options);
};

enum class Smoothing { none, taubin };

/// `--smooth` and `--iterations`: what happens to a surface before it is used.
struct SmoothingOptions {
  Smoothing smoothing = Smoothing::none;
  int iterations = 160;

  void declare(Options& options);
};

/// `--pixel` and `--distance`: how large the pixels of a picture are to the eye.
struct ViewOptions {
  double pixel_mm = 0.0873;  ///< 50 cycles per degree from 50 cm
  double distance_mm = 500;

  void declare(Options& options);
};

}  // namespace vdbdither
