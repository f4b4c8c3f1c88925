// The slices of Morsy, Brunton, Urban, "Shape Dithering for 3D Printing", ACM TOG 41(4) (2022),
// equations (8) to (10): the spectrum of a slice is that of the volume projected along the normal.
// Radial averages as in Lau and Arce, "Modern digital halftoning" (2001). The voxel plane follows
// from g(x, y, round(t)) with t = s·x + t·y + c: as round(t) - t has period 1 in t,
// exp(2πi·f·round(t)) is the sum over m of sinc(f + m)·exp(2πi·(f + m)·t), and the mean over c
// separates the terms.
#include "ops/kernels/mask/slice_spectrum.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace vdbdither {

namespace {

using openvdb::Coord;
using openvdb::Vec3d;

constexpr double pi = 3.14159265358979323846;
constexpr int copies = 6;

/// The DFT along one axis, by its definition; tiles are small.
void transform(std::vector<std::complex<double>>& values, std::size_t length, std::size_t stride) {
  std::vector<std::complex<double>> turns(length);
  for (std::size_t i = 0; i < length; ++i)
    turns[i] = std::polar(1.0, -2 * pi * static_cast<double>(i) / static_cast<double>(length));
  tbb::parallel_for(std::size_t{0}, values.size() / length, [&](std::size_t line) {
    std::complex<double>* const first =
        values.data() + line / stride * stride * length + line % stride;
    std::vector<std::complex<double>> result(length);
    for (std::size_t k = 0; k < length; ++k) {
      double real = 0;
      double imaginary = 0;
      for (std::size_t i = 0, turn = 0; i < length; ++i) {
        const std::complex<double> value = first[i * stride];
        real += value.real() * turns[turn].real() - value.imag() * turns[turn].imag();
        imaginary += value.real() * turns[turn].imag() + value.imag() * turns[turn].real();
        turn += k;
        if (turn >= length) turn -= length;
      }
      result[k] = {real, imaginary};
    }
    for (std::size_t k = 0; k < length; ++k) first[k * stride] = result[k];
  });
}

/// Returns the equivalent frequency in [-½, ½).
float wrapped(float frequency) {
  return frequency - static_cast<float>(static_cast<int>(frequency + 1024.5f) - 1024);
}

Vec3d polar(double polar_degrees, double azimuth_degrees) {
  const double theta = polar_degrees * pi / 180;
  const double phi = azimuth_degrees * pi / 180;
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

}  // namespace

PowerSpectrum powerSpectrum(std::span<const float> values, const Coord& size) {
  const auto count = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  double variance = 0;
  std::vector<std::complex<double>> signal;
  signal.reserve(values.size());
  for (const float value : values) {
    signal.emplace_back(value - mean);
    variance += (value - mean) * (value - mean) / count;
  }
  transform(signal, size.x(), 1);
  transform(signal, size.y(), size.x());
  transform(signal, size.z(), static_cast<std::size_t>(size.x()) * size.y());
  PowerSpectrum result{size, {}};
  result.power.reserve(values.size());
  for (const std::complex<double>& value : signal) {
    result.power.push_back(static_cast<float>(std::norm(value) / (count * variance)));
  }
  result.power[0] = 0;
  return result;
}

SliceSpectra::SliceSpectra(std::span<const PowerSpectrum> spectra, const Vec3d& pitch_mm,
                           SliceModel model)
    : count_(spectra.size()),
      pitch_(pitch_mm),
      model_(model),
      bands_per_cycle_(2 * band_count * std::max({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()})) {
  const Coord size = spectra.front().size;
  std::size_t i = 0;
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x, ++i) {
        const std::size_t mirror =
            (size.x() - x) % size.x() +
            static_cast<std::size_t>(size.x()) *
                ((size.y() - y) % size.y() +
                 static_cast<std::size_t>(size.y()) * ((size.z() - z) % size.z()));
        if (i == 0 || mirror < i) continue;
        const float weight = mirror == i ? 1 : 2;
        frequencies_.push_back({{wrapped(static_cast<float>(x) / static_cast<float>(size.x())),
                                 wrapped(static_cast<float>(y) / static_cast<float>(size.y())),
                                 wrapped(static_cast<float>(z) / static_cast<float>(size.z()))},
                                weight});
        for (const PowerSpectrum& spectrum : spectra) power_.push_back(weight * spectrum.power[i]);
      }
    }
  }
}

Bands SliceSpectra::Facet::raspd(std::size_t spectrum) const {
  Bands result{};
  for (int band = 0; band < band_count; ++band) {
    if (white[band] > 0) result[band] = power[spectrum][band] / white[band];
  }
  return result;
}

double SliceSpectra::Facet::low(std::size_t spectrum) const {
  const double all = std::accumulate(white.begin(), white.begin() + low_bands, 0.0);
  return all > 0
             ? std::accumulate(power[spectrum].begin(), power[spectrum].begin() + low_bands, 0.0) /
                   all
             : 0;
}

SliceSpectra::Facet SliceSpectra::facet(const Vec3d& normal) const {
  Facet facet;
  std::vector<double> sums(band_count * count_);
  model_ == SliceModel::projection ? addProjection(normal, sums, facet.white)
                                   : addVoxelPlane(normal, sums, facet.white);
  facet.power.resize(count_);
  for (std::size_t i = 0; i < sums.size(); ++i) facet.power[i % count_][i / count_] = sums[i];
  return facet;
}

void SliceSpectra::add(double weight, const float* power, double* sums) const {
  for (std::size_t i = 0; i < count_; ++i) sums[i] += weight * power[i];
}

void SliceSpectra::addProjection(const Vec3d& normal, std::vector<double>& sums,
                                 Bands& white) const {
  const Vec3d unit = normal.unit();
  const float* power = power_.data();
  for (const Frequency& frequency : frequencies_) {
    const Vec3d f(frequency.cycles[0] / pitch_.x(), frequency.cycles[1] / pitch_.y(),
                  frequency.cycles[2] / pitch_.z());
    const double along = f.dot(unit);
    const double radius = std::sqrt(std::max(0.0, f.lengthSqr() - along * along));
    const int band = static_cast<int>(radius * bands_per_cycle_);
    if (band < band_count) {
      white[band] += frequency.weight;
      add(1, power, sums.data() + band * count_);
    }
    power += count_;
  }
}

void SliceSpectra::addVoxelPlane(const Vec3d& normal, std::vector<double>& sums,
                                 Bands& white) const {
  const Vec3d in_voxels = normal * pitch_;
  int w_axis = 2;
  for (int axis = 1; axis >= 0; --axis) {
    if (std::abs(in_voxels[axis]) > std::abs(in_voxels[w_axis])) w_axis = axis;
  }
  const int u_axis = (w_axis + 1) % 3;
  const int v_axis = (w_axis + 2) % 3;
  const double s = -in_voxels[u_axis] / in_voxels[w_axis];
  const double t = -in_voxels[v_axis] / in_voxels[w_axis];
  // The facet's metric: the squared length in space of a step of one column.
  const double uu = pitch_[u_axis] * pitch_[u_axis] + s * s * pitch_[w_axis] * pitch_[w_axis];
  const double vv = pitch_[v_axis] * pitch_[v_axis] + t * t * pitch_[w_axis] * pitch_[w_axis];
  const double uv = s * t * pitch_[w_axis] * pitch_[w_axis];
  const double scale = bands_per_cycle_ * bands_per_cycle_ / (uu * vv - uv * uv);
  const auto cu = static_cast<float>(vv * scale);
  const auto cv = static_cast<float>(uu * scale);
  const auto cuv = static_cast<float>(-2 * uv * scale);

  const float* power = power_.data();
  for (const Frequency& frequency : frequencies_) {
    const double sine = std::sin(pi * frequency.cycles[w_axis]) / pi;
    for (int copy = -copies; copy <= copies; ++copy) {
      const double w = frequency.cycles[w_axis] + static_cast<float>(copy);
      const double weight = w == 0 ? 1 : sine * sine / (w * w);
      if (weight < 1e-6) continue;
      const float u = wrapped(frequency.cycles[u_axis] + static_cast<float>(w * s));
      const float v = wrapped(frequency.cycles[v_axis] + static_cast<float>(w * t));
      const auto band =
          static_cast<int>(std::sqrt(std::max(0.0f, cu * u * u + cv * v * v + cuv * u * v)));
      if (band >= band_count) continue;
      white[band] += weight * frequency.weight;
      add(weight, power, sums.data() + band * count_);
    }
    power += count_;
  }
}

std::vector<WeightedNormal> normalsOfHalfSphere(double step_degrees) {
  std::vector<WeightedNormal> normals;
  const int polar_steps = static_cast<int>(std::round(90 / step_degrees));
  const int azimuth_steps = static_cast<int>(std::round(360 / step_degrees));
  for (int i = 0; i <= polar_steps; ++i) {
    const double theta = 90.0 * i / polar_steps;
    // The area of the ring of a step; at the pole it is a cap, at the equator half a ring.
    const double half = 45.0 / polar_steps;
    const double area = std::cos(std::max(0.0, theta - half) * pi / 180) -
                        std::cos(std::min(90.0, theta + half) * pi / 180);
    const int around = i == 0 ? 1 : azimuth_steps;
    for (int j = 0; j < around; ++j)
      normals.push_back({polar(theta, 360.0 * j / around), area / around});
  }
  return normals;
}

std::vector<WeightedNormal> normalsNearAxes() {
  std::vector<WeightedNormal> normals;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double degrees : {0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0}) {
      for (int azimuth = 0; azimuth < 360; azimuth += 30) {
        const Vec3d tilted = polar(degrees, azimuth);
        Vec3d normal;
        for (int i = 0; i < 3; ++i) normal[(axis + 1 + i) % 3] = tilted[i];
        normals.push_back({normal, 1.0});
      }
    }
  }
  return normals;
}

std::vector<FacetSummary> summary(const SliceSpectra& spectra,
                                  std::span<const WeightedNormal> normals,
                                  const std::function<void(double fraction)>& progress) {
  std::vector<FacetSummary> result(spectra.count());
  double weights = 0;
  constexpr std::size_t chunk = 64;
  std::vector<SliceSpectra::Facet> facets(std::min(chunk, normals.size()));
  // Facets are computed in parallel and added in order, so that sums have the same bits for any
  // number of threads.
  for (std::size_t begin = 0; begin < normals.size(); begin += chunk) {
    const std::size_t end = std::min(normals.size(), begin + chunk);
    tbb::parallel_for(begin, end,
                      [&](std::size_t i) { facets[i - begin] = spectra.facet(normals[i].normal); });
    for (std::size_t i = begin; i < end; ++i) {
      const SliceSpectra::Facet& facet = facets[i - begin];
      weights += normals[i].weight;
      for (std::size_t s = 0; s < result.size(); ++s) {
        FacetSummary& of = result[s];
        const Bands raspd = facet.raspd(s);
        for (int band = 0; band < band_count; ++band) {
          of.mean[band] += normals[i].weight * raspd[band];
          if (facet.white[band] >= 4) of.maximum[band] = std::max(of.maximum[band], raspd[band]);
        }
        const double low = facet.low(s);
        of.low_mean += normals[i].weight * low;
        if (low > of.low_worst) {
          of.low_worst = low;
          of.worst_normal = normals[i].normal;
        }
      }
    }
    if (progress) progress(static_cast<double>(end) / static_cast<double>(normals.size()));
  }
  for (FacetSummary& of : result) {
    for (double& band : of.mean) band /= weights;
    of.low_mean /= weights;
  }
  return result;
}

}  // namespace vdbdither
