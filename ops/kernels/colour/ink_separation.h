#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "ops/kernels/colour/ink_mixture.h"
#include "ops/kernels/colour/separation.h"

namespace vdbdither {

/// Separation by the mixing law of InkMixture, exact for every colour that the inks can mix.
///
/// In the space of the roots, colours mix linearly: what the inks can mix is the convex hull of
/// their points, and a colour in it has barycentric coordinates in a triangulation of the points.
/// More than four inks mix a colour in several ways. Of these, one triangulation uses as little of
/// the darkest ink as possible and one as much; `InkSet::black` mixes the two. Each is regular (the
/// projection of a convex hull of lifted points), so that coverages are continuous.
///
/// A colour outside moves straight towards a grey until the inks can mix it. The grey has the
/// lightness of the colour and lies between the darkest and the lightest ink, so lightness and hue
/// nearly stay. For saturated colours the aim lies a little towards the mean of the inks, because
/// the ends of the greys are corners of what can be mixed, where no saturation is left.
/// docs/halftone.md compares this with other ways.
///
/// Sources: Lee: Regular triangulations of convex polytopes, in Applied Geometry and Discrete
/// Mathematics (1991); Morovič: Color Gamut Mapping (2008) on the mapping along lines.
class InkSeparation : public Separation {
 public:
  /// @param set  its table is ignored
  explicit InkSeparation(const InkSet& set);

  void run(const openvdb::Vec3s& linear_rgb, std::span<float> coverages) const override;
  [[nodiscard]] double memoryBytes() const override;

 private:
  /// A function a·y + b of a point y, as (b, a).
  using Affine = std::array<double, 4>;
  /// Up to four inks and the barycentric coordinates of a point in them; those beyond are zero.
  struct Simplex {
    std::array<std::uint8_t, 4> inks{};
    std::array<Affine, 4> coordinates{};
  };
  using Triangulation = std::vector<Simplex>;

  static double valueAt(const Affine& function, const openvdb::Vec3d& y) {
    return function[0] + function[1] * y[0] + function[2] * y[1] + function[3] * y[2];
  }
  void findBasis();
  [[nodiscard]] Triangulation triangulation(double lift_of_black) const;
  void findSides(const Triangulation& triangulation);
  [[nodiscard]] openvdb::Vec3d flattened(const openvdb::Vec3d& roots) const;
  [[nodiscard]] openvdb::Vec3d mappedIn(const openvdb::Vec3d& y, const openvdb::Vec3d& roots,
                                        const openvdb::Vec3s& linear_rgb) const;
  void add(const Triangulation& triangulation, const openvdb::Vec3d& y, double weight,
           std::span<float> coverages) const;

  std::vector<std::size_t> index_;  ///< in the set, of every ink but the clear one
  InkMixture mixture_;
  double black_;
  bool media_relative_;
  std::size_t dark_ = 0;  ///< of the inks without the clear one
  std::size_t light_ = 0;
  openvdb::Vec3d dark_colour_{0.0};
  openvdb::Vec3d light_colour_{1.0};
  double dark_lightness_ = 0;
  double light_lightness_ = 1;
  int dimension_ = 0;  ///< of the convex hull, 0 … 3
  std::array<openvdb::Vec3d, 3> basis_{};
  std::vector<openvdb::Vec3d> points_;  ///< the inks in that basis, unused coordinates 0
  openvdb::Vec3d mean_{0.0};            ///< of the points
  Triangulation least_black_;
  Triangulation most_black_;
  std::vector<Affine> sides_;  ///< of the convex hull; ≥ 0 inside
};

}  // namespace vdbdither
