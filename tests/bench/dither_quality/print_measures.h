#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "tests/support/volumes.h"

/// What is measured of a print.
namespace vdbdither::quality {

using test::Voxels;

inline constexpr std::array spreads_mm{0.05, 0.1};

/// Occupancy after the blur, exact for voxels that are boxes.
class Blurred {
 public:
  Blurred(const Voxels& voxels, const openvdb::Vec3d& pitch_mm, double spread_mm)
      : box_(voxels.box()), pitch_mm_(pitch_mm), spread_mm_(spread_mm) {
    for (auto v = box_.begin(); v; ++v) occupied_.push_back(voxels[*v] ? 1.0F : 0.0F);
  }

  double operator()(const openvdb::Vec3d& at_mm) const;

  /// How far outwards from a point of the surface, along the normal, the printed surface lies.
  double error(const openvdb::Vec3d& surface_mm, const openvdb::Vec3d& normal) const {
    const double first = height(surface_mm);
    return first + height(surface_mm + first * normal);
  }

 private:
  double height(const openvdb::Vec3d& at_mm) const;
  int weigh(int axis, double at_mm) const;

  openvdb::CoordBBox box_;
  openvdb::Vec3d pitch_mm_;
  double spread_mm_;
  std::vector<float> occupied_;
  mutable std::array<std::vector<float>, 3> weights_;
};

/// Errors in µm, and what they are on average at each phase of the stairs.
class Errors {
 public:
  void add(double error_mm, double phase) {
    const double um = 1000 * error_mm;
    all_.add(um);
    absolute_ += std::abs(um);
    phases_[static_cast<std::size_t>(16 * (phase - std::floor(phase))) % 16].add(um);
  }

  void print() const;

 private:
  struct Moments {
    double count = 0;
    double sum = 0;
    double squares = 0;
    void add(double value) {
      ++count;
      sum += value;
      squares += value * value;
    }
    [[nodiscard]] double mean() const { return count > 0 ? sum / count : 0; }
    [[nodiscard]] double deviation() const {
      return count > 0 ? std::sqrt(std::max(0.0, squares / count - mean() * mean())) : 0;
    }
  };
  Moments all_;
  double absolute_ = 0;
  std::array<Moments, 16> phases_;
};

/// Cavities, taken with faces.
int cavities(const Voxels& printed);

/// Handles of the printed set, its voxels taken with faces, edges and corners: by Euler's number.
int tunnels(const Voxels& printed);

double volumeMm3(const Voxels& printed, const openvdb::Vec3d& pitch_mm);

}  // namespace vdbdither::quality
