#include "ops/kernels/printing/detail_compensation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "ops/kernels/leaf/simple_point.h"
#include "ops/kernels/printing/gaussian_spread.h"
#include "ops/kernels/printing/normal_distribution.h"
#include "tests/support/volumes.h"
#include "vdbdither/model/half_space_share.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using openvdb::Vec3s;
using test::Distance;
using test::Volume;
using test::Voxels;

const Vec3d mimaki_mm(0.042, 0.084, 0.022);
constexpr double band_mm = 0.1;
const Vec3d spread_mm(0.05);

/// A round wire through a point.
Distance wire(const Vec3d& through, const Vec3d& along, double radius, double half_length = 1e9) {
  return [=, axis = along.unit()](const Vec3d& at) {
    const double t = (at - through).dot(axis);
    const double side = (at - through - axis * t).length() - radius;
    const double end = std::abs(t) - half_length;
    return side < 0 || end < 0 ? std::max(side, end) : std::hypot(side, end);
  };
}

Distance several(const std::vector<Distance>& parts) {
  return [=](const Vec3d& at) {
    double nearest = 1e9;
    for (const Distance& part : parts) nearest = std::min(nearest, part(at));
    return nearest;
  };
}

/// The grid without the distances from `limit_mm` on.
FloatGrid::Ptr narrowed(const FloatGrid& surface, float limit_mm) {
  FloatGrid::Ptr grid = surface.deepCopy();
  for (auto value = grid->beginValueOn(); value; ++value) {
    if (std::abs(*value) < limit_mm) continue;
    value.setValue(std::copysign(surface.background(), *value));
    value.setValueOff();
  }
  return grid;
}

DetailCompensation settingsOn(const Lattice& lattice, int steps = 2) {
  return {lattice, spread_mm, steps};
}

/// Both grids over the whole lattice.
struct Compensated {
  Lattice lattice;
  Volume<float> before;
  Volume<float> after;

  Compensated(const Distance& part, const Vec3d& extent_mm, int steps = 2,
              const Vec3d& pitch_mm = mimaki_mm, double band = band_mm)
      : lattice(test::latticeAround(pitch_mm, extent_mm, 0.12)),
        before(lattice.box, 0),
        after(lattice.box, 0) {
    const auto surface = test::sampled(part, lattice, band);
    const ZRange layers = lattice.layers();
    before = test::dense(*surface, lattice.box);
    after = test::dense(*settingsOn(lattice, steps).run(*surface, layers, layers), lattice.box);
  }
};

Voxels insideOf(const Volume<float>& distances) {
  Voxels inside(distances.box(), 0);
  for (const Coord& ijk : distances.box()) inside[ijk] = distances[ijk] < 0 ? 1 : 0;
  return inside;
}

Voxels complementOf(const Voxels& voxels) {
  Voxels others(voxels.box(), 0);
  for (const Coord& ijk : voxels.box()) others[ijk] = voxels[ijk] ? 0 : 1;
  return others;
}

/// The method in double precision on dense arrays, by its definition.
class Reference {
 public:
  Reference(const FloatGrid& surface, const Lattice& lattice)
      : lattice_(lattice),
        background_(double{surface.background()}),
        d_(lattice.box, 0),
        normal_(lattice.box, Vec3d(0.0)) {
    const Volume<float> values = test::dense(surface, lattice.box);
    for (const Coord& ijk : lattice.box) d_[ijk] = double{values[ijk]};
    for (const Coord& ijk : lattice.box) {
      if (isKnown(ijk)) normal_[ijk] = normalAt(ijk);
    }
  }

  Volume<double> operator()(int steps) {
    Volume<double> shares(lattice_.box, 0);
    for (const Coord& ijk : lattice_.box)
      shares[ijk] = halfSpaceShare(d_[ijk], normal_[ijk], lattice_.pitch_mm);
    for (int step = 0; step < steps; ++step) {
      const Volume<double> quantiles = quantilesOf(shares);
      if (step == 0) {
        findDetails(quantiles);
      } else {
        for (One& one : details_)
          one.e = std::clamp(one.e + one.gain * missed(one, quantiles), one.least, one.most);
      }
      if (step + 1 == steps) keepTopology();
      for (const One& one : details_)
        shares[one.at] = halfSpaceShare(corrected(one), one.normal, lattice_.pitch_mm);
      for (const One& one : neighbours())
        shares[one.at] = halfSpaceShare(corrected(one), one.normal, lattice_.pitch_mm);
    }
    Volume<double> result = d_;
    for (const One& one : details_) result[one.at] = corrected(one);
    for (const One& one : neighbours()) {
      if (one.e != 0) result[one.at] = std::clamp(corrected(one), -background_, background_);
    }
    return result;
  }

 private:
  struct One {
    Coord at;
    double d;
    Vec3d normal, foot;
    double half;
    double gain = 0, e = 0, most = 0, least = 0;
  };

  [[nodiscard]] double distance(const Coord& ijk) const { return d_.at(ijk, background_); }
  [[nodiscard]] bool isKnown(const Coord& ijk) const {
    return std::abs(distance(ijk)) < background_;
  }

  [[nodiscard]] Vec3d normalAt(const Coord& ijk) const {
    Vec3d slope;
    for (int axis = 0; axis < 3; ++axis) {
      Coord step(0);
      step[axis] = 1;
      const Coord above = isKnown(ijk + step) ? ijk + step : ijk;
      const Coord below = isKnown(ijk - step) ? ijk - step : ijk;
      const int pitches = std::max(1, above[axis] - below[axis]);
      slope[axis] = (distance(above) - distance(below)) / (pitches * lattice_.pitch_mm[axis]);
    }
    return slope.length() < 0.5 ? Vec3d(0.0) : slope.unit();
  }

  [[nodiscard]] One oneAt(const Coord& ijk, double d, const Vec3d& normal) const {
    double steepest = 0;
    for (int axis = 0; axis < 3; ++axis)
      steepest = std::max(steepest, std::abs(normal[axis]) / lattice_.pitch_mm[axis]);
    return {ijk, d, normal, ijk.asVec3d() - normal * d / lattice_.pitch_mm, 0.5 / steepest};
  }

  static double corrected(const One& one) {
    return one.d - one.e * std::clamp((7 - std::abs(one.d) / one.half) / 4, 0.0, 1.0);
  }

  [[nodiscard]] Volume<double> quantilesOf(const Volume<double>& shares) const {
    Volume<double> blurred = shares;
    for (int axis = 0; axis < 3; ++axis) {
      const double step = lattice_.pitch_mm[axis] / spread_mm[axis];
      const int reach = static_cast<int>(std::ceil(4 / step - 0.5));
      std::vector<double> weights;
      double sum = 0;
      for (int n = -reach; n <= reach; ++n) {
        weights.push_back(normalShare((n + 0.5) * step) - normalShare((n - 0.5) * step));
        sum += weights.back();
      }
      const Volume<double> before = blurred;
      for (const Coord& ijk : lattice_.box) {
        double share = 0;
        for (int n = -reach; n <= reach; ++n) {
          Coord there = ijk;
          there[axis] += n;
          share += weights[static_cast<std::size_t>(n + reach)] * before.at(there, 0) / sum;
        }
        blurred[ijk] = share;
      }
    }
    for (const Coord& ijk : lattice_.box)
      blurred[ijk] = std::clamp(probit(blurred[ijk]), -2.5, 2.5);
    return blurred;
  }

  [[nodiscard]] double missed(const One& one, const Volume<double>& quantiles) const {
    const Coord cell = Coord::floor(one.foot);
    std::array<std::array<double, 4>, 3> weights{};
    for (int axis = 0; axis < 3; ++axis) {
      const double t = one.foot[axis] - cell[axis];
      weights[static_cast<std::size_t>(axis)] = {
          (-t + 2 * t * t - t * t * t) / 2, (2 - 5 * t * t + 3 * t * t * t) / 2,
          (t + 4 * t * t - 3 * t * t * t) / 2, (-t * t + t * t * t) / 2};
    }
    double sum = 0;
    for (const Coord& n : CoordBBox(Coord(0), Coord(3)))
      sum += weights[0][static_cast<std::size_t>(n.x())] *
             weights[1][static_cast<std::size_t>(n.y())] *
             weights[2][static_cast<std::size_t>(n.z())] * quantiles.at(cell + n - Coord(1), -2.5);
    return -(one.normal * spread_mm).length() * sum;
  }

  void findDetails(const Volume<double>& quantiles) {
    for (const Coord& ijk : lattice_.box) {
      if (!isKnown(ijk) || normal_[ijk].isZero()) continue;
      One one = oneAt(ijk, d_[ijk], normal_[ijk]);
      if (std::abs(one.d) >= 7 * one.half) continue;
      const double e = missed(one, quantiles);
      const double t = (std::abs(e) / (one.normal * spread_mm).length() - 0.08) / 0.12;
      one.gain = t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t);
      if (one.gain == 0) continue;
      one.most = limit(one, 1);
      one.least = -limit(one, -1);
      one.e = std::clamp(one.gain * e, one.least, one.most);
      details_.push_back(one);
    }
  }

  [[nodiscard]] double limit(const One& one, int side) const {
    double medial = 1e9;
    double rise = 0;
    for (int axis = 0; axis < 3; ++axis)
      rise += std::abs(one.normal[axis]) * lattice_.pitch_mm[axis];
    for (int n = 1; n <= 8; ++n) {
      const Vec3d place = one.foot + one.normal * (side * n * one.half) / lattice_.pitch_mm;
      const Coord voxel = Coord::floor(place + Vec3d(0.5));
      if (!isKnown(voxel)) continue;
      const double away = side * one.normal.dot((voxel.asVec3d() - one.foot) * lattice_.pitch_mm);
      const double d = side * d_[voxel];
      if (away - d > 0.5 * one.half) medial = std::min(medial, std::max(0.0, (away + d) / 2));
    }
    return std::max(0.0, std::min({1.998 * one.half, medial / 2, medial - rise / 2}));
  }

  void keepTopology() {
    Volume<double> sides = d_;
    for (int turn = 0; turn < 16; ++turn) {
      for (const One& one : details_) {
        const int parity = (one.at.x() & 1) * 4 + (one.at.y() & 1) * 2 + (one.at.z() & 1);
        if (parity != turn % 8 || (corrected(one) < 0) == (one.d < 0)) continue;
        std::uint32_t inside = 0;
        for (const Coord& n : CoordBBox(Coord(-1), Coord(1)))
          inside |= std::uint32_t{sides.at(one.at + n, background_) < 0}
                    << neighbourBit(n.x(), n.y(), n.z());
        if ((sides[one.at] < 0) == (one.d < 0) && isSimplePoint(inside))
          sides[one.at] = corrected(one);
      }
    }
    for (One& one : details_) {
      if ((corrected(one) < 0) != (sides[one.at] < 0)) one.e = 0;
    }
  }

  [[nodiscard]] std::vector<One> neighbours() const {
    Volume<double> e(lattice_.box, 0);
    Volume<char> is_detail(lattice_.box, 0);
    for (const One& one : details_) {
      e[one.at] = one.e;
      is_detail[one.at] = 1;
    }
    std::vector<One> found;
    for (const Coord& ijk : lattice_.box) {
      if (isKnown(ijk)) continue;
      const bool inside = d_[ijk] < 0;
      double nearest = background_;
      Coord of;
      for (const Coord& n : CoordBBox(Coord(-1), Coord(1))) {
        const Coord there = ijk + n;
        if (!is_detail.at(there, 0) || std::abs(d_[there]) >= nearest || (d_[there] < 0) != inside)
          continue;
        nearest = std::abs(d_[there]);
        of = there;
      }
      if (nearest == background_) continue;
      const double flat = d_[of] + normal_[of].dot((ijk - of).asVec3d() * lattice_.pitch_mm);
      const double depth = std::max(inside ? -flat : flat, 2 * oneAt(ijk, 1, normal_[of]).half);
      if (depth >= background_) continue;
      One one = oneAt(ijk, inside ? -depth : depth, normal_[of]);
      one.e = e[of];
      found.push_back(one);
    }
    return found;
  }

  Lattice lattice_;
  double background_;
  Volume<double> d_;
  Volume<Vec3d> normal_;
  std::vector<One> details_;
};

TEST(DetailCompensation, IsWhatTheDefinitionSays) {
  const Distance hole = wire(Vec3d(0.01, 0, 0), Vec3d(0.3, 1, 0.2), 0.08, 0.2);
  const std::array<Distance, 3> parts{
      wire(Vec3d(0.01, 0.02, 0), Vec3d(1, 2, 1.5), 0.06, 0.25),
      several({test::box(Vec3d(0, 0, -0.1), Vec3d(0.25, 0.25, 0.1), Vec3d(20, 30, 0)),
               wire(Vec3d(0.05, 0, 0.1), Vec3d(1, 0, 0.3), 0.07, 0.2)}),
      [=](const Vec3d& at) { return std::max(at.length() - 0.32, -hole(at)); }};
  for (std::size_t n = 0; n < parts.size(); ++n) {
    const Lattice lattice = test::latticeAround(mimaki_mm, Vec3d(0.35), 0.2);
    const auto surface = narrowed(*test::sampled(parts[n], lattice, band_mm), 0.085F);
    for (const int steps : {1, 2}) {
      const ZRange layers = lattice.layers();
      const auto found =
          test::dense(*settingsOn(lattice, steps).run(*surface, layers, layers), lattice.box);
      const Volume<double> expected = Reference(*surface, lattice)(steps);
      int moved = 0;
      int wrong = 0;
      for (const Coord& ijk : lattice.box) {
        moved += std::abs(expected[ijk] - double{surface->tree().getValue(ijk)}) > 0.001 ? 1 : 0;
        wrong += std::abs(double{found[ijk]} - expected[ijk]) > 2e-4 ? 1 : 0;
      }
      EXPECT_GT(moved, 500) << n;
      EXPECT_LE(wrong, moved / 500) << n << ", steps " << steps << ": rounding may turn a decision";
    }
  }
}

TEST(DetailCompensation, KeepsSmoothSurfacesToAMicrometre) {
  const Compensated ball(test::sphere(Vec3d(0.01, 0.02, 0.005), 1.5), Vec3d(1.5));
  int changed = 0;
  for (const Coord& ijk : ball.lattice.box) {
    ASSERT_NEAR(ball.after[ijk], ball.before[ijk], 0.001) << ijk;
    changed += ball.after[ijk] != ball.before[ijk] ? 1 : 0;
  }
  EXPECT_LT(changed, 0.02 * std::pow(3 / 0.05, 2) * 3.14) << "most voxels keep their bits";
}

TEST(DetailCompensation, KeepsFlatFacesAwayFromEdges) {
  for (const Vec3d& degrees : {Vec3d(0.0), Vec3d(11, 27, 40)}) {
    const Distance shape = test::box(Vec3d(0.01, 0, 0), Vec3d(0.6, 0.5, 0.5), degrees);
    const Compensated box(shape, Vec3d(0.9));
    const Distance core = test::box(Vec3d(0.01, 0, 0), Vec3d(0.6, 0.5, 0.5) - Vec3d(0.25), degrees);
    int faces = 0;
    for (const Coord& ijk : box.lattice.box) {
      // Near one face alone.
      const Vec3d at = box.lattice.position(ijk);
      if (std::abs(shape(at)) > 0.08 || core(at) > 0.25 + shape(at) + 1e-6) continue;
      ASSERT_EQ(box.after[ijk], box.before[ijk]) << ijk;
      ++faces;
    }
    EXPECT_GT(faces, 1000);
  }
}

TEST(DetailCompensation, MovesEdgesByAVoxelDiameterAtMost) {
  const Compensated box(test::box(Vec3d(0.01, 0, 0), Vec3d(0.3), Vec3d(10, 20, 30)), Vec3d(0.5));
  double most = 0;
  for (const Coord& ijk : box.lattice.box)
    most = std::max(most, std::abs(double{box.after[ijk]} - double{box.before[ijk]}));
  EXPECT_GT(most, 0.01);
  EXPECT_LE(most, mimaki_mm.length());
}

/// The overlap of a print with a part: of the voxel centres of `within`.
double overlap(const Voxels& solid, const Lattice& lattice, const Distance& part,
               const std::function<bool(const Vec3d&)>& within) {
  openvdb::BoolGrid::Ptr grid = openvdb::BoolGrid::create(false);
  for (const Coord& ijk : solid.box()) {
    if (solid[ijk]) grid->tree().setValueOn(ijk, true);
  }
  const ZRange layers = lattice.layers();
  const auto printed =
      GaussianSpread(lattice.pitch_mm, spread_mm).run(*grid, lattice.box, layers, layers);
  int both = 0;
  int either = 0;
  for (const Coord& ijk : lattice.box) {
    const Vec3d at = lattice.position(ijk);
    if (!within(at)) continue;
    const bool a = printed->tree().getValue(ijk) >= 0.5F;
    const bool b = part(at) < 0;
    both += a && b ? 1 : 0;
    either += a || b ? 1 : 0;
  }
  return either ? both / double(either) : 1;
}

TEST(DetailCompensation, LetsThinWiresPrint) {
  for (const auto& [diameter, minimum] : {std::pair(0.12, 0.75), {0.18, 0.85}, {0.25, 0.9}}) {
    double before = 0;
    double after = 0;
    const std::array<Vec3d, 4> along{Vec3d(1, 0.4, 0.3), Vec3d(0.2, 1, 0.5), Vec3d(0.4, 0.3, 1),
                                     Vec3d(1, 1, 1)};
    for (const Vec3d& axis : along) {
      const Distance part = wire(Vec3d(0.01, 0.02, 0.003), axis, diameter / 2);
      const Compensated result(part, Vec3d(0.5));
      const auto within = [](const Vec3d& at) { return at.length() < 0.25; };
      before += overlap(insideOf(result.before), result.lattice, part, within) / 4;
      after += overlap(insideOf(result.after), result.lattice, part, within) / 4;
    }
    EXPECT_GT(after, minimum) << diameter;
    EXPECT_GT(after, before + 0.05) << diameter;
  }
}

TEST(DetailCompensation, FusesNoCombsAndNoParallelWires) {
  for (const Vec3d& degrees : {Vec3d(0.0), Vec3d(0, 0, 90), Vec3d(0, 90, 0), Vec3d(15, 35, 50)}) {
    openvdb::Mat4d turn = openvdb::Mat4d::identity();
    for (const int axis : {0, 1, 2})
      turn.postRotate(static_cast<openvdb::math::Axis>(axis), degrees[axis] * M_PI / 180);
    const Vec3d across = turn.transform3x3(Vec3d(1, 0, 0));
    for (const double thickness : {0.1, 0.16}) {
      for (const double gap : {0.12, 0.2}) {
        std::vector<Distance> plates, wires;
        for (int n = -1; n <= 1; ++n) {
          const Vec3d centre = across * (n * (thickness + gap)) + Vec3d(0.004, 0.01, 0.002);
          plates.push_back([=](const Vec3d& at) {
            return test::box(Vec3d(0.0), Vec3d(thickness / 2, 0.3, 0.3))(
                turn.transpose().transform3x3(at - centre));
          });
          wires.push_back(wire(centre, turn.transform3x3(Vec3d(0, 1, 0)), thickness / 2, 0.3));
        }
        for (const auto& parts : {plates, wires}) {
          const Compensated result(several(parts), Vec3d(0.75));
          const auto before = insideOf(result.before);
          if (test::components(before, test::Touching::corners) != 3) continue;
          EXPECT_EQ(test::components(insideOf(result.after), test::Touching::corners), 3)
              << degrees << ' ' << thickness << ' ' << gap;
        }
      }
    }
  }
}

TEST(DetailCompensation, OpensNoPlates) {
  for (const Vec3d& degrees : {Vec3d(0.0), Vec3d(90, 0, 0), Vec3d(0, 90, 0), Vec3d(25, 35, 50)}) {
    for (const double thickness : {0.1, 0.15, 0.25}) {
      const Distance plate = test::box(Vec3d(0.003), Vec3d(2, 2, thickness / 2), degrees);
      const Compensated result(plate, Vec3d(0.4));
      const Voxels before = complementOf(insideOf(result.before));
      if (test::components(before, test::Touching::corners) != 2) continue;
      EXPECT_EQ(test::components(complementOf(insideOf(result.after)), test::Touching::corners), 2)
          << degrees << ' ' << thickness;
    }
  }
}

TEST(DetailCompensation, ActivatesVoxelsThatTheSurfaceMovesTo) {
  const Lattice lattice = test::latticeAround(mimaki_mm, Vec3d(0.3), 0.1);
  const auto surface =
      narrowed(*test::sampled(wire(Vec3d(0.0), Vec3d(0, 1, 0), 0.06), lattice, band_mm), 0.06F);
  const ZRange layers = lattice.layers();
  const auto result = settingsOn(lattice).run(*surface, layers, layers);
  EXPECT_GT(result->activeVoxelCount(), surface->activeVoxelCount());
  for (auto value = result->cbeginValueOn(); value; ++value)
    ASSERT_LT(std::abs(*value), result->background());
  EXPECT_EQ(result->background(), surface->background());
}

}  // namespace
}  // namespace vdbdither
