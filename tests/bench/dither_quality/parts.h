#pragma once

#include <array>
#include <string>
#include <vector>

#include "tests/support/volumes.h"

/// The parts that dithers are judged on, and what prints them.
namespace vdbdither::quality {

using test::Distance;
using test::Voxels;

struct NamedLattice {
  const char* name;
  openvdb::Vec3d pitch_mm;
};
/// The lattices of two printers and cubes.
extern const std::vector<NamedLattice> lattices;

/// The lattice of that name, or all without a name.
std::vector<NamedLattice> latticesNamed(const std::string& only);

/// A part, where its distance is sampled.
struct Part {
  Distance distance;
  Lattice lattice;
};

openvdb::Vec3d normalOf(const Distance& distance, const openvdb::Vec3d& at);

/// The distances of a part in a band that is wide enough for all methods.
openvdb::FloatGrid::Ptr surfaceOf(const Part& part);

Lattice latticeOver(const openvdb::Vec3d& pitch_mm, const openvdb::Vec3d& min_mm,
                    const openvdb::Vec3d& max_mm);

/// A sinusoidal relief on a plane.
double reliefHeight(double x, double y);
openvdb::Vec3d reliefNormal(double x, double y);
double reliefDistance(const openvdb::Vec3d& at);

/// A small part whose topology or strokes a dither may spoil.
struct Detail {
  std::string name;
  double size_um;
  Part part;
  Distance region;  ///< where volumes are compared; null: everywhere
};

std::vector<Detail> detailsOn(const openvdb::Vec3d& pitch);

}  // namespace vdbdither::quality
