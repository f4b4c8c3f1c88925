#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// The power of a periodic signal at every frequency of its DFT, x fastest: |DFT|² / (count ·
/// variance), so that the mean power is 1 and white noise is flat. The power at DC is set to 0.
struct PowerSpectrum {
  openvdb::Coord size;
  std::vector<float> power;
};

/// `values` are those of `size` voxels, x fastest; they must not all be equal.
PowerSpectrum powerSpectrum(std::span<const float> values, const openvdb::Coord& size);

/// The voxels of a mask that a planar facet uses.
enum class SliceModel {
  /// Those of the mathematical plane, by the Fourier slice theorem: the power of the mask projected
  /// along the normal.
  projection,
  /// Those of the printed plane: the voxels (x, y, round(s·x + t·y + c)), where z is the axis along
  /// which each column has one voxel, |s|, |t| ≤ 1.
  voxel_plane,
};

/// Bands of equal width from 0 to half a cycle per voxel of the coarsest pitch.
inline constexpr int band_count = 32;
using Bands = std::array<double, band_count>;

/// The number of bands below an eighth of a cycle per voxel, which neither the eye nor the material
/// filters out.
inline constexpr int low_bands = 8;

/// Radially averaged power spectral density (RASPD) of the facets of masks, white noise = 1.
///
/// It is the expectation over all positions of the facet along its normal, so that it has no phase.
/// A frequency of the mask counts, without interpolation, in the band of its frequency on the
/// facet: for `projection` its distance from the normal; for `voxel_plane`, with w = f_z + m for
/// every whole m, the frequency (f_x + w·s, f_y + w·t) modulo 1 with the weight sinc²(w), its
/// length measured on the tilted facet. |m| ≤ 6; the rest, 3 % of the power, is omitted. Bands are
/// divided by those of white noise. DC and frequencies above half a cycle do not count.
class SliceSpectra {
 public:
  /// `spectra` are of one size, at least one. `pitch_mm` are the edges of a voxel along x, y, z.
  SliceSpectra(std::span<const PowerSpectrum> spectra, const openvdb::Vec3d& pitch_mm,
               SliceModel model);

  /// The power in each band, and that of white noise.
  struct Facet {
    std::vector<Bands> power;  ///< per spectrum
    Bands white{};

    /// Returns the RASPD of a spectrum; 0 in bands without a frequency.
    [[nodiscard]] Bands raspd(std::size_t spectrum) const;
    /// Returns the mean power of a spectrum over the low bands.
    [[nodiscard]] double low(std::size_t spectrum) const;
  };

  /// `normal` is that of the facet in space (mm), of any length except 0.
  [[nodiscard]] Facet facet(const openvdb::Vec3d& normal) const;

  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  /// A frequency, cycles per voxel, that represents itself and its mirror image.
  struct Frequency {
    std::array<float, 3> cycles;
    float weight;
  };
  void addProjection(const openvdb::Vec3d& normal, std::vector<double>& sums, Bands& white) const;
  void addVoxelPlane(const openvdb::Vec3d& normal, std::vector<double>& sums, Bands& white) const;
  void add(double weight, const float* power, double* sums) const;

  std::size_t count_;
  openvdb::Vec3d pitch_;
  SliceModel model_;
  double bands_per_cycle_;  ///< bands per cycle / mm
  std::vector<Frequency> frequencies_;
  std::vector<float> power_;  ///< frequency by frequency, per spectrum, times its weight
};

/// The RASPD of one mask over many facets.
struct FacetSummary {
  Bands mean{};
  Bands maximum{};  ///< maximum of each band over the facets with ≥ 4 frequencies in it
  double low_mean = 0;
  double low_worst = 0;
  openvdb::Vec3d worst_normal{0, 0, 0};
};

/// A normal and its weight in a mean.
struct WeightedNormal {
  openvdb::Vec3d normal;
  double weight;
};

/// Returns the normals of the half sphere in steps of the polar and the azimuthal angle, weighted
/// by area.
std::vector<WeightedNormal> normalsOfHalfSphere(double step_degrees);

/// Returns the normals 0.5°, 1°, 2°, … 8° off an axis of the lattice, every 30° around it: those of
/// the longest staircases.
std::vector<WeightedNormal> normalsNearAxes();

/// Returns one summary per spectrum. `progress` is called with the fraction done; it may throw to
/// stop.
std::vector<FacetSummary> summary(const SliceSpectra& spectra,
                                  std::span<const WeightedNormal> normals,
                                  const std::function<void(double fraction)>& progress = {});

}  // namespace vdbdither
