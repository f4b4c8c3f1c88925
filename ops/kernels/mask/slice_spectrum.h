#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include <openvdb/Types.h>

namespace vdbdither {

/// The power of a periodic signal at every frequency of its DFT, x fastest: |DFT|² / (count ·
/// variance), so that it is 1 in the mean and white noise is flat. The mean (DC) is taken out: 0.
struct PowerSpectrum {
  openvdb::Coord size;
  std::vector<float> power;
};

/// values: x fastest, `size` voxels, not all equal.
PowerSpectrum powerSpectrum(std::span<const float> values, const openvdb::Coord& size);

/// What a planar facet sees of a mask.
enum class SliceModel {
  /// The mathematical plane, by the Fourier slice theorem: the power of the mask projected along
  /// the normal.
  projection,
  /// The plane as it is printed: the voxels (x, y, round(s·x + t·y + c)) where z is the axis along
  /// which there is one voxel in each column, |s|, |t| ≤ 1.
  voxel_plane,
};

/// Bands of equal width from 0 to half a cycle per voxel of the coarsest pitch.
inline constexpr int band_count = 32;
using Bands = std::array<double, band_count>;

/// The bands below an eighth of a cycle per voxel, which the eye and the material pass.
inline constexpr int low_bands = 8;

/// Radially averaged power spectral density (RASPD) of the facets of masks, white noise = 1.
///
/// It is the expectation over all positions of the facet along its normal, so no phase is left. A
/// frequency of the mask counts, whole and without interpolation, in the band in which its
/// frequency on the facet falls: for `projection` its distance from the normal; for `voxel_plane`,
/// with w = f_z + m for every whole m, the frequency (f_x + w·s, f_y + w·t) modulo 1 with the
/// weight sinc²(w), its length measured on the tilted facet. |m| ≤ 6; the rest, 3 % of the power,
/// is left out. A band is divided by what white noise has in it. DC and what lies beyond half a
/// cycle count nowhere.
class SliceSpectra {
 public:
  /// spectra: of one size, at least one. pitch_mm: edge of a voxel along x, y, z.
  SliceSpectra(std::span<const PowerSpectrum> spectra, const openvdb::Vec3d& pitch_mm,
               SliceModel model);

  /// Power in each band, and how much white noise has there.
  struct Facet {
    std::vector<Bands> power;  ///< per spectrum
    Bands white{};

    /// The RASPD of a spectrum; 0 where a band holds nothing.
    [[nodiscard]] Bands raspd(std::size_t spectrum) const;
    /// Mean power of a spectrum over the low bands.
    [[nodiscard]] double low(std::size_t spectrum) const;
  };

  /// normal: of the facet in space (mm), any length but 0.
  [[nodiscard]] Facet facet(const openvdb::Vec3d& normal) const;

  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  /// A frequency, cycles per voxel, that stands for itself and its mirror image.
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
  Bands greatest{};  ///< of every band for itself, over the facets with ≥ 4 frequencies in it
  double low_mean = 0;
  double low_worst = 0;
  openvdb::Vec3d worst_normal{0, 0, 0};
};

/// A normal and its share in a mean.
struct WeightedNormal {
  openvdb::Vec3d normal;
  double weight;
};

/// The half sphere in steps of the polar and the azimuthal angle, weighted by area.
std::vector<WeightedNormal> normalsOfHalfSphere(double step_degrees);

/// Normals 0.5°, 1°, 2°, … 8° off an axis of the lattice, every 30° around it: the longest
/// staircases.
std::vector<WeightedNormal> normalsNearAxes();

/// Per spectrum. progress: called with the fraction done; may throw to stop.
std::vector<FacetSummary> summary(const SliceSpectra& spectra,
                                  std::span<const WeightedNormal> normals,
                                  const std::function<void(double fraction)>& progress = {});

}  // namespace vdbdither
