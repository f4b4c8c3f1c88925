#include "ops/kernels/mask/slice_spectrum.h"

#include <cmath>
#include <complex>
#include <numeric>

#include <gtest/gtest.h>

#include "ops/kernels/mask/void_and_cluster.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::Vec3d;

std::vector<float> maskValues(const Coord& size, bool white) {
  VoidAndCluster mask;
  mask.size = size;
  const auto count = static_cast<std::uint32_t>(size.x() * size.y() * size.z());
  std::vector<float> values;
  for (const std::uint32_t rank : white ? randomPermutation(count, 3) : voidAndCluster(mask)) {
    values.push_back((static_cast<float>(rank) + 0.5f) / static_cast<float>(count));
  }
  return values;
}

PowerSpectrum flat(const Coord& size) {
  PowerSpectrum spectrum{size, std::vector<float>(size.x() * size.y() * size.z(), 1.0f)};
  spectrum.power[0] = 0;
  return spectrum;
}

TEST(PowerSpectrum, IsOneInTheMeanWithoutDc) {
  for (const Coord size : {Coord(8, 8, 8), Coord(5, 12, 7), Coord(16, 9, 1)}) {
    const PowerSpectrum spectrum = powerSpectrum(maskValues(size, true), size);
    EXPECT_EQ(spectrum.power[0], 0);
    const double sum = std::accumulate(spectrum.power.begin(), spectrum.power.end(), 0.0);
    EXPECT_NEAR(sum, static_cast<double>(spectrum.power.size()), 1e-3);
  }
}

TEST(PowerSpectrum, OfAWaveIsItsFrequencyAndTheMirrorImage) {
  const Coord size(8, 6, 10);
  std::vector<float> values;
  for (int z = 0; z < 10; ++z) {
    for (int y = 0; y < 6; ++y) {
      for (int x = 0; x < 8; ++x)
        values.push_back(std::cos(2 * M_PI * (3 * x / 8.0 + 2 * y / 6.0 + z / 10.0) + 0.3));
    }
  }
  const PowerSpectrum spectrum = powerSpectrum(values, size);
  const std::size_t at = 3 + 8 * (2 + 6 * 1);
  const std::size_t mirror = 5 + 8 * (4 + 6 * 9);
  for (std::size_t i = 0; i < spectrum.power.size(); ++i) {
    EXPECT_NEAR(spectrum.power[i], i == at || i == mirror ? 240 : 0, 1e-3);
  }
}

TEST(SliceSpectra, OfWhiteNoiseIsOneForEveryFacetAndLattice) {
  const std::vector<PowerSpectrum> spectra{flat({16, 12, 20})};
  for (const SliceModel model : {SliceModel::projection, SliceModel::voxel_plane}) {
    const SliceSpectra slices(spectra, {0.042, 0.084, 0.022}, model);
    for (const WeightedNormal& normal : normalsOfHalfSphere(30)) {
      const SliceSpectra::Facet facet = slices.facet(normal.normal);
      const Bands raspd = facet.raspd(0);
      for (int band = 0; band < band_count; ++band) {
        if (facet.white[band] > 0) {
          EXPECT_NEAR(raspd[band], 1, 1e-5);
        }
      }
      EXPECT_NEAR(facet.low(0), 1, 1e-5);
    }
  }
}

TEST(SliceSpectra, ProjectionCountsAFrequencyAtItsDistanceFromTheNormal) {
  PowerSpectrum wave = flat({32, 32, 32});
  std::fill(wave.power.begin(), wave.power.end(), 0.0f);
  wave.power[4 + 32 * 32 * 10] = wave.power[28 + 32 * 32 * 22] = 1;
  const auto bandOf = [&](const Vec3d& normal) {
    const SliceSpectra::Facet facet =
        SliceSpectra({&wave, 1}, {1, 1, 1}, SliceModel::projection).facet(normal);
    for (int band = 0; band < band_count; ++band) {
      if (facet.power[0][band] > 0) return band;
    }
    return -1;
  };
  EXPECT_EQ(bandOf({0, 0, 1}), 8);  // (4, 0)/32 of a cycle, bands of 1/64
  EXPECT_EQ(bandOf({0, 1, 0}), static_cast<int>(64 * std::hypot(4, 10) / 32));
  EXPECT_EQ(bandOf({4, 0, 10}), 0);
}

/// The band that holds the power of one frequency of a tile of 20 voxels along each axis.
int bandOfWave(const Coord& cycles, const Vec3d& pitch_mm, const Vec3d& normal, SliceModel model) {
  PowerSpectrum wave{{20, 20, 20}, std::vector<float>(8000, 0.0F)};
  const auto at = [](const Coord& c) {
    const auto wrapped = [](int n) { return static_cast<std::size_t>((n + 20) % 20); };
    return wrapped(c.x()) + 20 * (wrapped(c.y()) + 20 * wrapped(c.z()));
  };
  wave.power[at(cycles)] = wave.power[at(Coord(0) - cycles)] = 1;
  const SliceSpectra::Facet facet = SliceSpectra({&wave, 1}, pitch_mm, model).facet(normal);
  for (int band = 0; band < band_count; ++band)
    if (facet.power[0][band] > 0) return band;
  return band_count;
}

/// The band of a frequency in cycles / mm, where the coarsest pitch is 0.08 mm.
int bandAt(double frequency) {
  const double band = frequency * 2 * 0.08 * band_count;
  EXPECT_GT(std::abs(band - std::round(band)), 1e-3) << "between two bands";
  return std::min(static_cast<int>(band), band_count);
}

TEST(SliceSpectra, ProjectionMeasuresEveryAxisInMillimetres) {
  const Vec3d pitch_mm(0.05, 0.08, 0.03);
  for (int axis = 0; axis < 3; ++axis) {
    Coord cycles(0);
    cycles[axis] = 3;
    Vec3d normal(0.0);
    normal[(axis + 1) % 3] = 1;
    EXPECT_EQ(bandOfWave(cycles, pitch_mm, normal, SliceModel::projection),
              bandAt(0.15 / pitch_mm[axis]))
        << axis;
  }
}

TEST(SliceSpectra, VoxelPlaneMeasuresBothItsAxesOnTheTiltedFacet) {
  const Vec3d pitch_mm(0.05, 0.08, 0.03);
  for (int w = 0; w < 3; ++w) {
    const int u = (w + 1) % 3;
    const int v = (w + 2) % 3;
    for (const auto& [s, t] : {std::pair(0.0, 0.0), {0.9, 0.0}, {0.0, 0.9}, {0.7, -0.6}}) {
      // Steps of one column along u and v on the facet.
      Vec3d along_u(0.0);
      Vec3d along_v(0.0);
      along_u[u] = pitch_mm[u];
      along_u[w] = s * pitch_mm[w];
      along_v[v] = pitch_mm[v];
      along_v[w] = t * pitch_mm[w];
      const Vec3d normal = along_u.cross(along_v);
      for (const auto& [cycles_u, cycles_v] : {std::pair(2, 0), {0, 2}, {2, -1}}) {
        Coord cycles(0);
        cycles[u] = cycles_u;
        cycles[v] = cycles_v;
        // The vector of the facet by which a step along u turns the wave by cycles_u / 20, and one
        // along v by cycles_v / 20.
        const Vec3d frequency =
            (cycles_u * along_v.cross(normal) + cycles_v * normal.cross(along_u)) /
            (20 * normal.lengthSqr());
        EXPECT_EQ(bandOfWave(cycles, pitch_mm, normal, SliceModel::voxel_plane),
                  bandAt(frequency.length()))
            << w << ": " << s << " " << t << ", " << cycles;
      }
    }
  }
}

/// The power of the voxels (x, y, round(s·x + c)) of a tile over a window that both repeat in, in
/// the mean over c.
Bands sampledVoxelPlane(const std::vector<float>& values, int edge, int window) {
  const double mean =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  double variance = 0;
  for (const float value : values)
    variance += (value - mean) * (value - mean) / static_cast<double>(values.size());
  const double s = static_cast<double>(edge) / window;
  Bands power{};
  const int offsets = 2 * window;
  for (int offset = 0; offset < offsets; ++offset) {
    const double c = (offset + 0.5) * edge / offsets;
    std::vector<double> plane;
    for (int y = 0; y < edge; ++y) {
      for (int x = 0; x < window; ++x) {
        const int z = static_cast<int>(std::floor(s * x + c + 0.5)) % edge;
        plane.push_back(values[x % edge + edge * (y + edge * z)] - mean);
      }
    }
    for (int l = 0; l < edge; ++l) {
      for (int k = 0; k < window; ++k) {
        std::complex<double> sum = 0;
        for (int y = 0; y < edge; ++y) {
          for (int x = 0; x < window; ++x) {
            sum +=
                plane[x + window * y] * std::polar(1.0, -2 * M_PI *
                                                            (static_cast<double>(k * x) / window +
                                                             static_cast<double>(l * y) / edge));
          }
        }
        const double u = static_cast<double>(2 * k < window ? k : k - window) / window;
        const double v = static_cast<double>(2 * l < edge ? l : l - edge) / edge;
        const int band = static_cast<int>(64 * std::hypot(u / std::sqrt(1 + s * s), v));
        if (band >= band_count) continue;
        power[band] += std::norm(sum) / (window * edge * variance * offsets);
      }
    }
  }
  return power;
}

TEST(SliceSpectra, VoxelPlaneIsTheMeanOfDirectlySampledPlanes) {
  const int edge = 8;
  const Coord size(edge, edge, edge);
  for (const bool white : {true, false}) {
    const std::vector<float> values = maskValues(size, white);
    for (const int window : {24, 32}) {
      const Bands sampled = sampledVoxelPlane(values, edge, window);
      const std::vector<PowerSpectrum> spectra{powerSpectrum(values, size)};
      const SliceSpectra slices(spectra, {1, 1, 1}, SliceModel::voxel_plane);
      const SliceSpectra::Facet facet = slices.facet({-static_cast<double>(edge) / window, 0, 1});
      // The facet's sums are over edge³ frequencies, the plane's over edge · window.
      const double scale = static_cast<double>(window) / (edge * edge);
      for (const int bands : {4, 8, 16, 32}) {
        const double expected = std::accumulate(sampled.begin(), sampled.begin() + bands, 0.0);
        const double got =
            scale * std::accumulate(facet.power[0].begin(), facet.power[0].begin() + bands, 0.0);
        EXPECT_NEAR(got, expected, 0.05 * expected + 0.02)
            << white << ' ' << window << ' ' << bands;
      }
    }
  }
}

TEST(SliceSpectra, BlueMaskHasLessLowFrequenciesOnItsFacetsThanWhiteNoise) {
  const Coord size(24, 24, 24);
  const std::vector<PowerSpectrum> spectra{powerSpectrum(maskValues(size, true), size),
                                           powerSpectrum(maskValues(size, false), size)};
  for (const SliceModel model : {SliceModel::projection, SliceModel::voxel_plane}) {
    const std::vector<FacetSummary> facets =
        summary({spectra, {1, 1, 1}, model}, normalsOfHalfSphere(15));
    EXPECT_NEAR(facets[0].low_mean, 1, 0.1);
    EXPECT_LT(facets[1].low_mean, 0.6);
    EXPECT_GE(facets[1].low_worst, facets[1].low_mean);
    EXPECT_GT(facets[1].mean[28], 1);
  }
}

TEST(Normals, CoverTheHalfSphereByArea) {
  double area = 0;
  double z = 0;
  for (const WeightedNormal& normal : normalsOfHalfSphere(5)) {
    EXPECT_NEAR(normal.normal.length(), 1, 1e-12);
    area += normal.weight;
    z += normal.weight * normal.normal.z();
  }
  EXPECT_NEAR(area, 1, 1e-12);
  EXPECT_NEAR(z, 0.5, 1e-3);
}

TEST(Normals, NearAxesAreWithinEightDegreesOfOne) {
  for (const WeightedNormal& normal : normalsNearAxes()) {
    const double most = std::max(
        {std::abs(normal.normal.x()), std::abs(normal.normal.y()), std::abs(normal.normal.z())});
    EXPECT_GT(most, std::cos(8.01 * M_PI / 180));
    EXPECT_LT(most, std::cos(0.49 * M_PI / 180));
  }
}

}  // namespace
}  // namespace vdbdither
