#include "ops/kernels/colour/ink_separation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <optional>
#include <span>

#include "ops/kernels/colour/kubelka_munk.h"
#include "ops/kernels/colour/small_matrix.h"
#include "ops/kernels/colour/table_separation.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/split_mix.h"

namespace vdbdither {

using openvdb::Vec3d;
using openvdb::Vec3s;

namespace {

/// Returns a number of 0 … 1 that has no relation to those of other indices.
double randomShare(std::uint64_t index) {
  return std::ldexp(static_cast<double>(splitMix(index * split_mix_step) >> 11), -53);
}

std::vector<std::size_t> inksThatColour(const InkSet& set) {
  std::vector<std::size_t> index;
  for (std::size_t ink = 0; ink < set.inks.size(); ++ink)
    if (ink != set.clear) index.push_back(ink);
  if (index.empty()) throw UsageError("there must be an ink that is not clear");
  return index;
}

InkMixture mixtureOf(const InkSet& set, const std::vector<std::size_t>& index) {
  std::vector<Vec3d> linear_rgb;
  linear_rgb.reserve(index.size());
  for (const std::size_t ink : index) linear_rgb.push_back(set.linear_rgb[ink]);
  return {linear_rgb, set.yule_nielsen};
}

}  // namespace

InkSeparation::InkSeparation(const InkSet& set)
    : index_(inksThatColour(set)),
      mixture_(mixtureOf(set, index_)),
      black_(set.black),
      media_relative_(set.media_relative) {
  std::vector<double> lightness;
  for (const std::size_t ink : index_)
    lightness.push_back(rootOf(luminanceOf(set.linear_rgb[ink]), 1 / set.yule_nielsen[1]));
  const auto [dark, light] = std::minmax_element(lightness.begin(), lightness.end());
  dark_ = static_cast<std::size_t>(dark - lightness.begin());
  light_ = static_cast<std::size_t>(light - lightness.begin());
  dark_colour_ = set.linear_rgb[index_[dark_]];
  light_colour_ = set.linear_rgb[index_[light_]];
  dark_lightness_ = *dark;
  light_lightness_ = *light;
  findBasis();
  constexpr double above_all = 100;
  least_black_ = triangulation(above_all);
  most_black_ = triangulation(-above_all);
  findSides(least_black_);
}

/// Finds an orthonormal basis of the space that the inks span (Gram and Schmidt), and their
/// coordinates in it.
void InkSeparation::findBasis() {
  constexpr double least_length = 1e-3;
  const std::vector<Vec3d>& roots = mixture_.roots();
  for (dimension_ = 0; dimension_ < 3; ++dimension_) {
    Vec3d longest(0.0);
    for (const Vec3d& ink : roots) {
      Vec3d rest = ink - roots[dark_];
      for (int axis = 0; axis < dimension_; ++axis)
        rest -= basis_[static_cast<std::size_t>(axis)].dot(rest) *
                basis_[static_cast<std::size_t>(axis)];
      if (rest.lengthSqr() > longest.lengthSqr()) longest = rest;
    }
    if (longest.length() < least_length) break;
    basis_[static_cast<std::size_t>(dimension_)] = longest / longest.length();
  }
  for (const Vec3d& ink : roots) points_.push_back(flattened(ink));
  for (const Vec3d& point : points_) mean_ += point / static_cast<double>(points_.size());
}

Vec3d InkSeparation::flattened(const Vec3d& roots) const {
  const Vec3d from_dark = roots - mixture_.roots()[dark_];
  Vec3d y(0.0);
  for (int axis = 0; axis < dimension_; ++axis)
    y[axis] = basis_[static_cast<std::size_t>(axis)].dot(from_dark);
  return y;
}

/// Returns the simplices whose lifted points lie below all other lifted points. A point is lifted
/// by the square of its distance from the mean, as for a Delaunay triangulation, and a little more
/// that differs for each, so that no two triangulations are equally good.
InkSeparation::Triangulation InkSeparation::triangulation(double lift_of_black) const {
  std::vector<double> lift;
  for (const Vec3d& point : points_) {
    constexpr double little = 1e-3;
    lift.push_back((point - mean_).lengthSqr() + little * randomShare(lift.size()));
  }
  lift[dark_] += lift_of_black;

  Triangulation found;
  const std::size_t corners = static_cast<std::size_t>(dimension_) + 1;
  forEachChoice(points_.size(), corners, [&](const std::vector<std::size_t>& choice) {
    Matrix rows{};
    for (std::size_t n = 0; n < corners; ++n) {
      rows[n][0] = 1;
      for (std::size_t axis = 1; axis < corners; ++axis)
        rows[n][axis] = points_[choice[n]][static_cast<int>(axis) - 1];
    }
    const auto inverse = inverseOf(rows, corners);
    if (!inverse) return;
    Simplex simplex;
    Affine plane{};
    for (std::size_t n = 0; n < corners; ++n) {
      simplex.inks[n] = static_cast<std::uint8_t>(choice[n]);
      for (std::size_t term = 0; term < corners; ++term) {
        simplex.coordinates[n][term] = (*inverse)[term][n];
        plane[term] += (*inverse)[term][n] * lift[choice[n]];
      }
    }
    for (std::size_t other = 0; other < points_.size(); ++other) {
      if (std::find(choice.begin(), choice.end(), other) != choice.end()) continue;
      if (lift[other] < valueAt(plane, points_[other])) return;
    }
    found.push_back(simplex);
  });
  return found;
}

/// The sides of the hull are those of the simplices that no two share.
void InkSeparation::findSides(const Triangulation& triangulation) {
  const std::size_t corners = static_cast<std::size_t>(dimension_) + 1;
  const auto sideWithout = [&](const Simplex& simplex, std::size_t corner) {
    std::vector<std::uint8_t> side;
    for (std::size_t n = 0; n < corners; ++n)
      if (n != corner) side.push_back(simplex.inks[n]);
    return side;
  };
  for (const Simplex& simplex : triangulation) {
    for (std::size_t corner = 0; dimension_ > 0 && corner < corners; ++corner) {
      int uses = 0;
      for (const Simplex& other : triangulation)
        for (std::size_t n = 0; n < corners; ++n)
          uses += sideWithout(other, n) == sideWithout(simplex, corner) ? 1 : 0;
      if (uses == 1) sides_.push_back(simplex.coordinates[corner]);
    }
  }
}

void InkSeparation::run(const Vec3s& linear_rgb, std::span<float> coverages) const {
  std::fill(coverages.begin(), coverages.end(), 0.0F);
  Vec3s wanted;
  for (int channel = 0; channel < 3; ++channel)
    wanted[channel] = std::clamp(linear_rgb[channel], 0.0F, 1.0F);
  if (media_relative_) wanted = Vec3s(betweenInks(Vec3d(wanted), dark_colour_, light_colour_));
  const Vec3d roots = mixture_.rootsOf(wanted);
  const Vec3d y = mappedIn(flattened(roots), roots, wanted);
  add(least_black_, y, 1 - black_, coverages);
  add(most_black_, y, black_, coverages);
}

Vec3d InkSeparation::mappedIn(const Vec3d& y, const Vec3d& roots, const Vec3s& linear_rgb) const {
  if (dimension_ == 3 && std::all_of(sides_.begin(), sides_.end(),
                                     [&](const Affine& side) { return valueAt(side, y) >= 0; }))
    return y;
  const double range = light_lightness_ - dark_lightness_;
  const auto luminance = static_cast<float>(luminanceOf(Vec3d(linear_rgb)));
  const double lightness = mixture_.rootsOf(Vec3s(luminance))[1];
  const double share = range > 0 ? std::clamp((lightness - dark_lightness_) / range, 0.0, 1.0) : 0;
  const Vec3d grey = points_[dark_] + share * (points_[light_] - points_[dark_]);
  // Inks in one line have no saturation to keep.
  if (dimension_ < 2) return grey;
  const double saturation =
      std::max({roots[0], roots[1], roots[2]}) - std::min({roots[0], roots[1], roots[2]});
  const Vec3d aim = grey + aim_pull * saturation * (mean_ - grey);
  double kept = 1;
  for (const Affine& side : sides_) {
    const double there = valueAt(side, y);
    if (there >= 0) continue;
    const double here = std::max(valueAt(side, aim), 0.0);
    kept = std::min(kept, here / (here - there));
  }
  return aim + kept * (y - aim);
}

void InkSeparation::add(const Triangulation& triangulation, const Vec3d& y, double weight,
                        std::span<float> coverages) const {
  if (weight == 0) return;
  const std::size_t corners = static_cast<std::size_t>(dimension_) + 1;
  const Simplex* best = nullptr;
  std::array<double, 4> shares{};
  double best_least = -std::numeric_limits<double>::infinity();
  for (const Simplex& simplex : triangulation) {
    std::array<double, 4> values{};
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < corners; ++n) {
      values[n] = valueAt(simplex.coordinates[n], y);
      least = std::min(least, values[n]);
    }
    if (least <= best_least) continue;
    best = &simplex;
    best_least = least;
    shares = values;
    if (least >= 0) break;
  }
  double sum = 0;
  for (double& share : shares) sum += share = std::max(share, 0.0);
  for (std::size_t n = 0; n < corners; ++n)
    coverages[index_[best->inks[n]]] += static_cast<float>(weight * shares[n] / sum);
}

double InkSeparation::memoryBytes() const {
  return static_cast<double>(least_black_.size() + most_black_.size()) * sizeof(Simplex);
}

std::unique_ptr<Separation> separationInto(const InkSet& set) {
  if (set.table) return std::make_unique<TableSeparation>(set);
  const std::size_t coloured = set.inks.size() - (set.clear ? 1 : 0);
  // Four inks mix three channels in one way; fewer mix a part of the colours alone. Solving the law
  // for more takes seconds.
  constexpr std::size_t least = 4;
  constexpr std::size_t most = 6;
  if (set.kubelka_munk && coloured >= least && coloured <= most) {
    InkSet tabled = set;
    tabled.table = kubelkaMunkTable(set);
    return std::make_unique<TableSeparation>(tabled);
  }
  return std::make_unique<InkSeparation>(set);
}

}  // namespace vdbdither
