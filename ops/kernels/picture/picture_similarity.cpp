// SSIM: Wang, Bovik, Sheikh, Simoncelli: "Image Quality Assessment: From Error Visibility to
// Structural Similarity", IEEE Transactions on Image Processing 13(4), 2004. Contrast
// sensitivity: Mannos, Sakrison: "The Effects of a Visual Fidelity Criterion on the Encoding of
// Images", IEEE Transactions on Information Theory 20(4), 1974. LDR-FLIP: Andersson, Nilsson,
// Akenine-Möller, Oskarsson, Åström, Fairchild: "FLIP: A Difference Evaluator for Alternating
// Images", Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2), 2020.

#include "ops/kernels/picture/picture_similarity.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

namespace vdbdither {

namespace {

enum class Beyond { mirrored, clamped };

/// Returns the one of `size` pixels that takes the place of pixel `i`, which may lie beyond them.
int inside(int i, int size, Beyond beyond) {
  if (beyond == Beyond::clamped) return std::clamp(i, 0, size - 1);
  const int period = 2 * size;
  i = ((i % period) + period) % period;
  return i < size ? i : period - 1 - i;
}

/// Weights for the offsets -radius ... radius.
using Weights = std::vector<double>;

int radiusOf(const Weights& weights) { return static_cast<int>(weights.size() / 2); }

template <typename Function>
Weights weights(int radius, const Function& function) {
  Weights result;
  for (int i = -radius; i <= radius; ++i) result.push_back(function(static_cast<double>(i)));
  return result;
}

double sumOf(const Weights& of) {
  double sum = 0;
  for (const double weight : of) sum += weight;
  return sum;
}

Weights normalized(Weights of) {
  const double sum = sumOf(of);
  for (double& weight : of) weight /= sum;
  return of;
}

/// Returns the correlation with the product of two rows of weights.
Channel filtered(const Channel& in, const Weights& across, const Weights& along, Beyond beyond) {
  Channel rows(in.width, in.height);
  tbb::parallel_for(0, in.height, [&](int y) {
    const int radius = radiusOf(across);
    for (int x = 0; x < in.width; ++x) {
      double sum = 0;
      for (int i = -radius; i <= radius; ++i)
        sum += across[static_cast<std::size_t>(i + radius)] *
               in.at(inside(x + i, in.width, beyond), y);
      rows.at(x, y) = sum;
    }
  });
  Channel out(in.width, in.height);
  tbb::parallel_for(0, in.height, [&](int y) {
    const int radius = radiusOf(along);
    for (int i = -radius; i <= radius; ++i) {
      const int from = inside(y + i, in.height, beyond);
      const double weight = along[static_cast<std::size_t>(i + radius)];
      for (int x = 0; x < in.width; ++x) out.at(x, y) += weight * rows.at(x, from);
    }
  });
  return out;
}

template <typename Function>
Channel combined(const Channel& a, const Channel& b, const Function& function) {
  Channel out(a.width, a.height);
  for (std::size_t i = 0; i < out.values.size(); ++i)
    out.values[i] = function(a.values[i], b.values[i]);
  return out;
}

using Complex = std::complex<double>;

std::size_t powerOfTwoFrom(int minimum) {
  std::size_t size = 1;
  while (size < static_cast<std::size_t>(minimum)) size *= 2;
  return size;
}

/// The discrete Fourier transform in place, of a power of two of values, or its inverse without the
/// division (Cooley, Tukey 1965).
void transform(std::vector<Complex>& values, bool inverse) {
  const std::size_t size = values.size();
  for (std::size_t i = 1, j = 0; i < size; ++i) {
    std::size_t bit = size / 2;
    for (; (j & bit) != 0; bit /= 2) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(values[i], values[j]);
  }
  for (std::size_t half = 1; half < size; half *= 2) {
    const double step = (inverse ? 1 : -1) * std::numbers::pi / static_cast<double>(half);
    for (std::size_t k = 0; k < half; ++k) {
      const Complex turn = std::polar(1.0, step * static_cast<double>(k));
      for (std::size_t i = k; i < size; i += 2 * half) {
        // Written out, because the operator of std::complex checks for infinities.
        const Complex& v = values[i + half];
        const Complex odd(v.real() * turn.real() - v.imag() * turn.imag(),
                          v.real() * turn.imag() + v.imag() * turn.real());
        values[i + half] = values[i] - odd;
        values[i] += odd;
      }
    }
  }
}

class Spectrum {
 public:
  Spectrum(std::size_t width, std::size_t height)
      : width_(width), height_(height), values_(width * height) {}

  Complex& at(std::size_t x, std::size_t y) { return values_[y * width_ + x]; }

  void transformed(bool inverse) {
    tbb::parallel_for(std::size_t{0}, height_, [&](std::size_t y) {
      std::vector<Complex> row(width_);
      for (std::size_t x = 0; x < width_; ++x) row[x] = at(x, y);
      transform(row, inverse);
      for (std::size_t x = 0; x < width_; ++x) at(x, y) = row[x];
    });
    tbb::parallel_for(std::size_t{0}, width_, [&](std::size_t x) {
      std::vector<Complex> column(height_);
      for (std::size_t y = 0; y < height_; ++y) column[y] = at(x, y);
      transform(column, inverse);
      for (std::size_t y = 0; y < height_; ++y) at(x, y) = column[y];
    });
  }

 private:
  std::size_t width_, height_;
  std::vector<Complex> values_;
};

double mannosSakrison(double f) {
  return 2.6 * (0.0192 + 0.114 * f) * std::exp(-std::pow(0.114 * f, 1.1));
}

/// Returns the frequency to which the eye is most sensitive, in cycles per degree.
double mostVisible() {
  double best = 0;
  for (int i = 1; i <= 20000; ++i) {
    const double f = i * 0.001;
    if (mannosSakrison(f) > mannosSakrison(best)) best = f;
  }
  return best;
}

using Colour = std::array<double, 3>;

double linearOfCoded(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

constexpr std::array<Colour, 3> xyz_of_rgb{
    {{10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
     {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
     {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}}};

/// Returns X, Y and Z divided by those of white.
Colour relativeXyz(const Colour& rgb) {
  Colour out{};
  for (std::size_t row = 0; row < 3; ++row) {
    double white = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      out[row] += xyz_of_rgb[row][i] * rgb[i];
      white += xyz_of_rgb[row][i];
    }
    out[row] /= white;
  }
  return out;
}

/// Converts to the linear space of opponent colours YCxCz.
Colour opponent(const Colour& rgb) {
  const Colour xyz = relativeXyz(rgb);
  return {116 * xyz[1] - 16, 500 * (xyz[0] - xyz[1]), 200 * (xyz[1] - xyz[2])};
}

/// Returns the solution of opponent(rgb) = `of`, by Cramer's rule.
Colour rgbOfOpponent(const Colour& of) {
  const double y = (of[0] + 16) / 116;
  const Colour wanted{of[1] / 500 + y, y, y - of[2] / 200};
  std::array<Colour, 3> m = xyz_of_rgb;
  for (Colour& row : m) {
    const double white = row[0] + row[1] + row[2];
    for (double& value : row) value /= white;
  }
  const auto determinant = [](const std::array<Colour, 3>& a) {
    return a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
           a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
           a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
  };
  Colour out{};
  for (std::size_t column = 0; column < 3; ++column) {
    std::array<Colour, 3> replaced = m;
    for (std::size_t row = 0; row < 3; ++row) replaced[row][column] = wanted[row];
    out[column] = determinant(replaced) / determinant(m);
  }
  return out;
}

/// Converts to CIELAB with the chroma scaled by the lightness, for the Hunt effect.
Colour huntLab(const Colour& rgb) {
  Colour f = relativeXyz(rgb);
  constexpr double delta = 6.0 / 29;
  for (double& value : f)
    value =
        value > delta * delta * delta ? std::cbrt(value) : value / (3 * delta * delta) + 4.0 / 29;
  const double lightness = 116 * f[1] - 16;
  return {lightness, 0.01 * lightness * 500 * (f[0] - f[1]),
          0.01 * lightness * 200 * (f[1] - f[2])};
}

/// Returns the HyAB distance (Abasi, Tehran, Fairchild 2019).
double hyab(const Colour& a, const Colour& b) {
  return std::abs(a[0] - b[0]) + std::hypot(a[1] - b[1], a[2] - b[2]);
}

/// The eye's contrast sensitivity in one channel of the opponent colours: a sum of two Gaussians, a
/// sqrt(pi/b) exp(-pi² x²/b), with x in degrees.
struct OpponentFilter {
  double a1, b1, a2, b2;
};
constexpr std::array<OpponentFilter, 3> opponent_filters{
    {{1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}}};

Channel filtered(const Channel& in, const OpponentFilter& filter, double pixels_per_degree) {
  constexpr double pi = std::numbers::pi;
  constexpr double widest = 0.04;
  const int radius =
      static_cast<int>(std::ceil(3 * std::sqrt(widest / (2 * pi * pi)) * pixels_per_degree));
  Channel out(in.width, in.height);
  double total = 0;
  for (const auto& [a, b] : {std::pair(filter.a1, filter.b1), std::pair(filter.a2, filter.b2)}) {
    if (a == 0) continue;
    const double over = b;
    const Weights row = weights(radius, [&](double i) {
      const double degrees = i / pixels_per_degree;
      return std::exp(-pi * pi * degrees * degrees / over);
    });
    const double height = a * std::sqrt(pi / b);
    total += height * sumOf(row) * sumOf(row);
    const Channel part = filtered(in, row, row, Beyond::clamped);
    for (std::size_t i = 0; i < out.values.size(); ++i) out.values[i] += height * part.values[i];
  }
  for (double& value : out.values) value /= total;
  return out;
}

/// Scales positive weights to sum to 1 and negative ones to sum to -1.
Weights balanced(Weights of) {
  double above = 0;
  double below = 0;
  for (const double weight : of) (weight > 0 ? above : below) += std::abs(weight);
  for (double& weight : of) weight /= weight > 0 ? above : below;
  return of;
}

/// Returns the magnitude of the first or second derivative of a picture, by Gaussians of the width
/// of the edges or points that the eye detects.
Channel feature(const Channel& luminance, double pixels_per_degree, bool points) {
  const double sigma = 0.5 * 0.082 * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  const auto gauss = [&](double i) { return std::exp(-i * i / (2 * sigma * sigma)); };
  const Weights smooth = normalized(weights(radius, gauss));
  const Weights derived = balanced(weights(
      radius, [&](double i) { return (points ? i * i / (sigma * sigma) - 1 : -i) * gauss(i); }));
  return combined(filtered(luminance, derived, smooth, Beyond::clamped),
                  filtered(luminance, smooth, derived, Beyond::clamped),
                  [](double x, double y) { return std::hypot(x, y); });
}

/// A picture as FLIP compares it.
struct FlipView {
  std::array<Channel, 3> colour;  ///< Hunt-adjusted CIELAB of the picture as the eye perceives it
  Channel edges, points;
};

FlipView flipView(const ColourChannels& picture, double pixels_per_degree) {
  const int width = picture[0].width;
  const int height = picture[0].height;
  const std::size_t pixels = picture[0].values.size();
  std::array<Channel, 3> channels{Channel(width, height), Channel(width, height),
                                  Channel(width, height)};
  for (std::size_t i = 0; i < pixels; ++i) {
    Colour rgb{};
    for (std::size_t n = 0; n < 3; ++n) rgb[n] = linearOfCoded(picture[n].values[i]);
    const Colour coded = opponent(rgb);
    for (std::size_t n = 0; n < 3; ++n) channels[n].values[i] = coded[n];
  }
  FlipView view;
  Channel luminance = channels[0];
  for (double& value : luminance.values) value = (value + 16) / 116;
  view.edges = feature(luminance, pixels_per_degree, false);
  view.points = feature(luminance, pixels_per_degree, true);
  for (std::size_t n = 0; n < 3; ++n)
    view.colour[n] = filtered(channels[n], opponent_filters[n], pixels_per_degree);
  for (std::size_t i = 0; i < pixels; ++i) {
    Colour rgb = rgbOfOpponent(
        {view.colour[0].values[i], view.colour[1].values[i], view.colour[2].values[i]});
    for (double& value : rgb) value = std::clamp(value, 0.0, 1.0);
    const Colour lab = huntLab(rgb);
    for (std::size_t n = 0; n < 3; ++n) view.colour[n].values[i] = lab[n];
  }
  return view;
}

}  // namespace

Channel structuralSimilarity(const Channel& a, const Channel& b) {
  const Weights window =
      normalized(weights(5, [](double i) { return std::exp(-i * i / (2 * 1.5 * 1.5)); }));
  const auto windowed = [&](const Channel& channel) {
    return filtered(channel, window, window, Beyond::mirrored);
  };
  const auto product = [](double x, double y) { return x * y; };
  const Channel mean_a = windowed(a);
  const Channel mean_b = windowed(b);
  const Channel squares_a = windowed(combined(a, a, product));
  const Channel squares_b = windowed(combined(b, b, product));
  const Channel products = windowed(combined(a, b, product));
  constexpr double c1 = 0.01 * 0.01;
  constexpr double c2 = 0.03 * 0.03;
  Channel map(a.width, a.height);
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    const double ma = mean_a.values[i];
    const double mb = mean_b.values[i];
    const double variances = squares_a.values[i] - ma * ma + squares_b.values[i] - mb * mb;
    const double covariance = products.values[i] - ma * mb;
    map.values[i] =
        (2 * ma * mb + c1) * (2 * covariance + c2) / ((ma * ma + mb * mb + c1) * (variances + c2));
  }
  return map;
}

double contrastSensitivity(double cycles_per_degree) {
  static const double peak = mostVisible();
  if (cycles_per_degree <= peak) return 1;
  return mannosSakrison(cycles_per_degree) / mannosSakrison(peak);
}

Channel seenByTheEye(const Channel& picture, double pixels_per_degree) {
  // A pixel does not affect others beyond two thirds of a degree.
  const int margin = static_cast<int>(std::ceil(pixels_per_degree * 2 / 3));
  const std::size_t width = powerOfTwoFrom(picture.width + 2 * margin);
  const std::size_t height = powerOfTwoFrom(picture.height + 2 * margin);
  Spectrum spectrum(width, height);
  tbb::parallel_for(std::size_t{0}, height, [&](std::size_t y) {
    const int from = inside(static_cast<int>(y) - margin, picture.height, Beyond::mirrored);
    for (std::size_t x = 0; x < width; ++x)
      spectrum.at(x, y) =
          picture.at(inside(static_cast<int>(x) - margin, picture.width, Beyond::mirrored), from);
  });
  spectrum.transformed(false);
  const auto frequency = [&](std::size_t i, std::size_t size) {
    return static_cast<double>(std::min(i, size - i)) / static_cast<double>(size) *
           pixels_per_degree;
  };
  const double scale = 1 / static_cast<double>(width * height);
  tbb::parallel_for(std::size_t{0}, height, [&](std::size_t y) {
    const double fy = frequency(y, height);
    for (std::size_t x = 0; x < width; ++x) {
      const double fx = frequency(x, width);
      spectrum.at(x, y) *= scale * contrastSensitivity(std::sqrt(fx * fx + fy * fy));
    }
  });
  spectrum.transformed(true);
  Channel out(picture.width, picture.height);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x)
      out.at(x, y) =
          spectrum.at(static_cast<std::size_t>(x + margin), static_cast<std::size_t>(y + margin))
              .real();
  }
  return out;
}

Channel flipDifference(const ColourChannels& reference, const ColourChannels& test,
                       double pixels_per_degree) {
  constexpr double colour_exponent = 0.7;
  constexpr double feature_exponent = 0.5;
  constexpr double bend_from = 0.4;
  constexpr double bend_to = 0.95;
  const FlipView a = flipView(reference, pixels_per_degree);
  const FlipView b = flipView(test, pixels_per_degree);
  const double maximum = std::pow(hyab(huntLab({0, 1, 0}), huntLab({0, 0, 1})), colour_exponent);
  Channel map(reference[0].width, reference[0].height);
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    const auto colourOf = [i](const FlipView& view) {
      return Colour{view.colour[0].values[i], view.colour[1].values[i], view.colour[2].values[i]};
    };
    const double raised = std::pow(hyab(colourOf(a), colourOf(b)), colour_exponent);
    const double bend = bend_from * maximum;
    const double colour = raised < bend
                              ? bend_to / bend * raised
                              : bend_to + (raised - bend) / (maximum - bend) * (1 - bend_to);
    const double features = std::max(std::abs(a.edges.values[i] - b.edges.values[i]),
                                     std::abs(a.points.values[i] - b.points.values[i]));
    const double sharp =
        std::pow(std::clamp(features / std::numbers::sqrt2, 0.0, 1.0), feature_exponent);
    map.values[i] = std::pow(colour, 1 - sharp);
  }
  return map;
}

}  // namespace vdbdither
