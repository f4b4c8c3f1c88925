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
