#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// A material a printer can lay: what it is called and how it is shown.
struct Material {
  std::string name;
  std::array<std::uint8_t, 4> rgba{};  ///< display colour, alpha 255 is opaque
  /// Measured colour of a full area, linear light with the primaries of Rec. 709, 0 … 1; the
  /// display colour where there is none.
  std::optional<openvdb::Vec3d> linear_rgb = std::nullopt;
  /// Absorption and scattering of red, green and blue light, ≥ 0, in units that all materials of a
  /// printer share.
  std::optional<openvdb::Vec3d> absorption = std::nullopt;
  std::optional<openvdb::Vec3d> scattering = std::nullopt;
  std::optional<double> density_g_per_cm3 = std::nullopt;  ///< of the solid, > 0
  /// What containers of slices call it, such as VeroCY-V; empty where that is its name.
  std::string resin = {};
};

/// How the surface of a print mirrors light, 0 … 1 (Saunderson 1942).
struct SurfaceMirror {
  double outer = 0.04;                  ///< share of the light that falls on it from outside
  openvdb::Vec3d inner{0.6, 0.6, 0.6};  ///< share of the diffuse light from inside, by channel
};

/// What must be known of a printer before anything is voxelized for it.
struct PrinterProfile {
  std::string name;    ///< as written after --printer: mimaki-3duj-553
  std::string title;   ///< as people call it
  std::string source;  ///< where these figures were taken from
  /// Voxel size across the carriage (x), along it (y), and the layer (z).
  openvdb::Vec3d pitch_mm{0.0};
  openvdb::Vec3d build_mm{0.0};  ///< usable volume; zero where unknown
  /// How it makes a layer: "jetting" lays droplets, "resin" cures a vat by light, so that parts of
  /// a slice without anything below are lost; empty where unknown.
  std::string technology;
  std::optional<openvdb::Vec2d> layer_mm;  ///< lowest and highest layers it takes; pitch_mm[2] is
                                           ///< one of them; nothing where only that is known
  openvdb::Vec2i slice_px{0, 0};  ///< columns and rows of the display or tray; zero where unknown
  /// Where x = y = 0 of the part lies on the display or tray: "corner" or "centre".
  std::string origin = "corner";
  bool mirror_x = false;                ///< it takes slices mirrored, left to right
  bool mirror_y = false;                ///< it takes slices mirrored, top to bottom
  int minimum_slices = 0;               ///< of a job; zero where unknown
  int maximum_colours = 0;              ///< of a job, besides the background; zero where unknown
  std::vector<std::string> containers;  ///< formats of slices it takes, such as gcvf
  std::string printer_notes;            ///< for SL1 files, such as FILEFORMAT_GOO
  /// How far a droplet spreads: standard deviation of a Gaussian along each axis; zero where
  /// unknown.
  openvdb::Vec3d point_spread_mm{0.0};
  /// Factor n of Yule and Nielsen for red, green and blue: how the colours of materials mix.
  openvdb::Vec3d yule_nielsen{2.0};
  /// Where there is one, colours mix by the absorption and scattering of the materials instead.
  std::optional<SurfaceMirror> kubelka_munk;
  std::vector<Material>
      materials;  ///< model materials first to last; support is the printer's own affair
};

}  // namespace vdbdither
