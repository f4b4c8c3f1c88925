#include "ops/kernels/mask/void_and_cluster.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "ops/kernels/mask/mask_tile.h"

namespace vdbdither {
namespace {

using openvdb::Coord;

VoidAndCluster settings(const Coord& size, MaskKernel::Shape shape, double sigma,
                        std::uint64_t seed = 1) {
  VoidAndCluster result;
  result.size = size;
  result.kernel.shape = shape;
  result.kernel.sigma = {sigma, sigma, sigma};
  result.seed = seed;
  return result;
}

std::size_t voxelCount(const Coord& size) {
  return static_cast<std::size_t>(size.x()) * size.y() * size.z();
}

bool isPermutation(std::vector<std::uint32_t> ranks) {
  std::sort(ranks.begin(), ranks.end());
  for (std::size_t i = 0; i < ranks.size(); ++i) {
    if (ranks[i] != i) return false;
  }
  return true;
}

/// A Gaussian along one axis by its definition, with the library's exp and cos.
double gaussianAt(int d, double sigma, int size) {
  double sum = 0;
  for (int image = -20; image <= 20; ++image)
    sum += std::exp(-0.5 * std::pow((d + image * size) / sigma, 2));
  return sum;
}

double filterAt(int d, double sigma, int size) {
  std::complex<double> sum = 0;
  for (int k = 0; k < size; ++k) {
    const double f = static_cast<double>(2 * k < size ? k : k - size) / size;
    sum += std::exp(-2 * M_PI * M_PI * sigma * sigma * f * f) * std::polar(1.0, 2 * M_PI * f * d);
  }
  return sum.real() / size;
}

double kernelAt(const VoidAndCluster& mask, int x, int y, int z) {
  const MaskKernel& kernel = mask.kernel;
  const Coord d(x, y, z);
  if (kernel.shape == MaskKernel::Shape::exponential) {
    double squares = 0;
    for (int axis = 0; axis < 3; ++axis)
      squares += std::pow(std::min(d[axis], mask.size[axis] - d[axis]) / kernel.sigma[axis], 2);
    const int planes = (x == 0 ? 1 : 0) + (y == 0 ? 1 : 0) + (z == 0 ? 1 : 0);
    return (kernel.space_weight + planes) * std::exp(-std::sqrt(squares));
  }
  double space = 1;
  for (int axis = 0; axis < 3; ++axis) {
    space *= (kernel.shape == MaskKernel::Shape::peters ? filterAt : gaussianAt)(
        d[axis], kernel.sigma[axis], mask.size[axis]);
  }
  if (kernel.shape != MaskKernel::Shape::axis_mix) return space;
  space *= kernel.space_weight /
           (std::pow(2 * M_PI, 1.5) * kernel.sigma[0] * kernel.sigma[1] * kernel.sigma[2]);
  for (int normal = 0; normal < 3; ++normal) {
    if (d[normal] != 0) continue;
    const int u = (normal + 1) % 3;
    const int v = (normal + 2) % 3;
    space += gaussianAt(d[u], kernel.plane_sigma, mask.size[u]) *
             gaussianAt(d[v], kernel.plane_sigma, mask.size[v]) /
             (2 * M_PI * kernel.plane_sigma * kernel.plane_sigma);
  }
  return space;
}

/// Void and cluster as it is told: the full kernel in double, every extremum by looking at every
/// voxel. The third phase is Ulichney's own, by the tightest clusters of unset voxels.
class DirectVoidAndCluster {
 public:
  explicit DirectVoidAndCluster(const VoidAndCluster& mask)
      : size_(mask.size),
        count_(voxelCount(mask.size)),
        ties_(randomPermutation(count_, mask.seed)) {
    for (int z = 0; z < size_.z(); ++z) {
      for (int y = 0; y < size_.y(); ++y) {
        for (int x = 0; x < size_.x(); ++x) kernel_.push_back(kernelAt(mask, x, y, z));
      }
    }
    const double peak = kernel_[0];
    for (double& weight : kernel_) weight /= peak;
  }

  /// Energies this near to each other are equal.
  static constexpr double tolerance = 1e-10;

  /// The ranks. Of equal voxels the one that `guide` names is taken, or without it the one that
  /// randomPermutation does.
  std::vector<std::uint32_t> ranks(const std::vector<std::uint32_t>& guide) const {
    const std::size_t nowhere = count_;
    std::vector<std::size_t> guided(count_, nowhere);
    for (std::size_t i = 0; i < guide.size(); ++i) guided[guide[i]] = i;
    const std::uint32_t initial = initialCount(count_);
    Pattern start(count_);
    for (std::size_t i = 0; i < count_; ++i) {
      if (ties_[i] < initial) change(start, i, 1);
    }
    while (true) {
      const std::size_t from = tightestCluster(start, nowhere);
      change(start, from, -1);
      const std::size_t to = largestVoid(start, nowhere);
      change(start, to, 1);
      if (to == from) break;
    }
    std::vector<std::uint32_t> ranks(count_);
    Pattern one = start;
    for (std::uint32_t rank = initial; rank-- > 0;) {
      const std::size_t i = tightestCluster(one, guided[rank]);
      ranks[i] = rank;
      change(one, i, -1);
    }
    Pattern two = start;
    std::uint32_t rank = initial;
    for (; rank < count_ / 2; ++rank) {
      const std::size_t i = largestVoid(two, guided[rank]);
      ranks[i] = rank;
      change(two, i, 1);
    }
    Pattern three(count_);
    for (std::size_t i = 0; i < count_; ++i) {
      if (!two.set[i]) change(three, i, 1);
    }
    for (; rank < count_; ++rank) {
      const std::size_t i = tightestCluster(three, guided[rank], false);
      ranks[i] = rank;
      change(three, i, -1);
    }
    return ranks;
  }

 private:
  struct Pattern {
    explicit Pattern(std::size_t count) : set(count), energy(count) {}
    std::vector<char> set;
    std::vector<double> energy;
  };

  void change(Pattern& pattern, std::size_t centre, int sign) const {
    pattern.set[centre] = sign > 0;
    const int cx = static_cast<int>(centre % size_.x());
    const int cy = static_cast<int>(centre / size_.x() % size_.y());
    const int cz = static_cast<int>(centre / size_.x() / size_.y());
    const double* weight = kernel_.data();
    for (int z = 0; z < size_.z(); ++z) {
      for (int y = 0; y < size_.y(); ++y) {
        double* line = pattern.energy.data() +
                       ((cz + z) % size_.z() * size_.y() + (cy + y) % size_.y()) * size_.x();
        for (int x = cx; x < size_.x(); ++x) line[x] += sign * *weight++;
        for (int x = 0; x < cx; ++x) line[x] += sign * *weight++;
      }
    }
  }

  std::size_t largestVoid(const Pattern& pattern, std::size_t guided) const {
    double least = 1e9;
    for (std::size_t i = 0; i < count_; ++i) {
      if (!pattern.set[i] && pattern.energy[i] < least) least = pattern.energy[i];
    }
    std::size_t best = count_;
    for (std::size_t i = 0; i < count_; ++i) {
      if (pattern.set[i] || pattern.energy[i] > least + tolerance) continue;
      if (i == guided) return i;
      if (best == count_ || ties_[i] < ties_[best]) best = i;
    }
    return best;
  }

  std::size_t tightestCluster(const Pattern& pattern, std::size_t guided,
                              bool last_of_equals = true) const {
    double greatest = -1e9;
    for (std::size_t i = 0; i < count_; ++i) {
      if (pattern.set[i] && pattern.energy[i] > greatest) greatest = pattern.energy[i];
    }
    std::size_t best = count_;
    for (std::size_t i = 0; i < count_; ++i) {
      if (!pattern.set[i] || pattern.energy[i] < greatest - tolerance) continue;
      if (i == guided) return i;
      if (best == count_ || (ties_[i] > ties_[best]) == last_of_equals) best = i;
    }
    return best;
  }

  Coord size_;
  std::size_t count_;
  std::vector<std::uint32_t> ties_;
  std::vector<double> kernel_;
};

struct Case {
  Coord size;
  MaskKernel::Shape shape;
  double sigma;
};

class Parity : public testing::TestWithParam<Case> {};

TEST_P(Parity, RanksAreThoseOfTheDirectMethodInDoubleWithUlichneysThirdPhase) {
  const VoidAndCluster mask = settings(GetParam().size, GetParam().shape, GetParam().sigma);
  const std::vector<std::uint32_t> ranks = voidAndCluster(mask);
  ASSERT_TRUE(isPermutation(ranks));
  EXPECT_TRUE(ranks == DirectVoidAndCluster(mask).ranks(ranks));
}

using Shape = MaskKernel::Shape;
INSTANTIATE_TEST_SUITE_P(
    VoidAndCluster, Parity,
    testing::Values(Case{{8, 8, 8}, Shape::peters, 0.5}, Case{{8, 8, 8}, Shape::peters, 1.1},
                    Case{{8, 8, 8}, Shape::gauss, 1.9}, Case{{12, 12, 12}, Shape::peters, 0.8},
                    Case{{12, 12, 12}, Shape::peters, 1.9}, Case{{12, 12, 12}, Shape::gauss, 0.6},
                    Case{{12, 12, 12}, Shape::gauss, 3.1}, Case{{12, 12, 12}, Shape::axis_mix, 1.1},
                    Case{{12, 8, 16}, Shape::exponential, 1.6},
                    Case{{16, 16, 16}, Shape::peters, 1.1}, Case{{16, 16, 16}, Shape::gauss, 1.1},
                    Case{{24, 24, 24}, Shape::gauss, 1.1}, Case{{7, 12, 9}, Shape::peters, 1.1},
                    Case{{5, 1, 16}, Shape::gauss, 1.1}, Case{{32, 32, 1}, Shape::peters, 1.5},
                    Case{{64, 48, 1}, Shape::gauss, 1.9}, Case{{2, 3, 2}, Shape::peters, 1.1},
                    Case{{1, 1, 1}, Shape::gauss, 1.1}));

TEST(VoidAndCluster, EqualEnergiesGoByTheRandomPermutation) {
  for (const double sigma : {0.5, 1.1, 1.9}) {
    const VoidAndCluster mask = settings({8, 8, 8}, Shape::peters, sigma);
    EXPECT_TRUE(voidAndCluster(mask) == DirectVoidAndCluster(mask).ranks({}));
  }
}

TEST(VoidAndCluster, LargeTilesTakeTheLargestVoidAndTheTightestClusterAtEveryRank) {
  for (const Coord size : {Coord(40, 32, 30), Coord(35, 33, 31)}) {
    const VoidAndCluster mask = settings(size, Shape::peters, 1.1);
    const std::vector<std::uint32_t> ranks = voidAndCluster(mask);
    ASSERT_TRUE(isPermutation(ranks));
    const ToroidalKernel kernel(mask.kernel, size);
    std::vector<std::pair<Coord, double>> weights;
    for (int z = 0; z < size.z(); ++z) {
      for (int y = 0; y < size.y(); ++y) {
        for (int x = 0; x < size.x(); ++x) {
          const double weight = kernel(x, y, z);
          if (std::abs(weight) >= smallestWeight(size)) weights.push_back({{x, y, z}, weight});
        }
      }
    }
    const auto index = [&](int x, int y, int z) {
      return x % size.x() + size.x() * (y % size.y() + size.y() * (z % size.z()));
    };
    const std::uint32_t initial = initialCount(ranks.size());
    for (const std::uint32_t rank : {10u, initial - 1, initial, 9000u, 20000u, 30000u}) {
      // The pattern in which the voxel of this rank is set last or taken out first.
      const bool removed = rank < initial;
      std::vector<double> energy(ranks.size());
      for (int z = 0; z < size.z(); ++z) {
        for (int y = 0; y < size.y(); ++y) {
          for (int x = 0; x < size.x(); ++x) {
            if (ranks[index(x, y, z)] >= rank + removed) continue;
            for (const auto& [d, weight] : weights) {
              energy[index(x + d.x(), y + d.y(), z + d.z())] += weight;
            }
          }
        }
      }
      double chosen = 0;
      double least = 1e9;
      double greatest = -1e9;
      for (std::size_t i = 0; i < ranks.size(); ++i) {
        if (ranks[i] == rank) chosen = energy[i];
        if (ranks[i] >= rank) least = std::min(least, energy[i]);
        if (ranks[i] <= rank) greatest = std::max(greatest, energy[i]);
      }
      EXPECT_NEAR(chosen, removed ? greatest : least, 1e-4) << rank;
    }
  }
}

TEST(VoidAndCluster, RanksArePermutation) {
  for (const Shape shape : {Shape::peters, Shape::gauss, Shape::axis_mix}) {
    EXPECT_TRUE(isPermutation(voidAndCluster(settings({20, 40, 36}, shape, 1.1))));
  }
}

TEST(VoidAndCluster, BaselineAndVectorCodeGiveTheSameRanks) {
  if (bestInstructionSet() == InstructionSet::baseline)
    GTEST_SKIP() << "this processor has one instruction set";
  for (const Shape shape : {Shape::peters, Shape::gauss, Shape::axis_mix}) {
    const VoidAndCluster mask = settings({24, 33, 15}, shape, 1.1);
    EXPECT_EQ(voidAndCluster(mask, {}, InstructionSet::baseline), voidAndCluster(mask));
  }
}

TEST(VoidAndCluster, SeedsGiveDifferentMasks) {
  EXPECT_NE(voidAndCluster(settings({8, 8, 8}, Shape::gauss, 1.1, 1)),
            voidAndCluster(settings({8, 8, 8}, Shape::gauss, 1.1, 2)));
}

TEST(VoidAndCluster, RanksNeverChangeFromReleaseToRelease) {
  std::uint64_t digest = 14695981039346656037u;
  for (const std::uint32_t rank : voidAndCluster(settings({16, 16, 16}, Shape::peters, 1.1))) {
    digest = (digest ^ rank) * 1099511628211u;
  }
  EXPECT_EQ(digest, 7241052981520120759u);
}

TEST(VoidAndCluster, ProgressRisesToOneAndMayThrowToStop) {
  const VoidAndCluster mask = settings({24, 24, 24}, Shape::gauss, 1.1);
  double last = 0;
  voidAndCluster(mask, [&](double fraction) {
    EXPECT_GE(fraction, last);
    EXPECT_LE(fraction, 1.0);
    last = fraction;
  });
  EXPECT_GT(last, 0.8);
  EXPECT_THROW(voidAndCluster(mask, [](double) { throw std::runtime_error("stop"); }),
               std::runtime_error);
}

TEST(VoidAndCluster, ThresholdedMaskKeepsItsVoxelsFartherApartThanChance) {
  const Coord size(24, 24, 24);
  const auto nearestNeighbours = [&](const std::vector<std::uint32_t>& ranks) {
    int touching = 0;
    for (int z = 0; z < 24; ++z) {
      for (int y = 0; y < 24; ++y) {
        for (int x = 0; x < 24; ++x) {
          const auto low = [&](int i, int j, int k) {
            return ranks[(k % 24 * 24 + j % 24) * 24 + i % 24] < 1000;
          };
          touching += low(x, y, z) && (low(x + 1, y, z) || low(x, y + 1, z) || low(x, y, z + 1));
        }
      }
    }
    return touching;
  };
  EXPECT_EQ(nearestNeighbours(voidAndCluster(settings(size, Shape::peters, 1.1))), 0);
  EXPECT_GT(nearestNeighbours(randomPermutation(voxelCount(size), 1)), 100);
}

TEST(RandomPermutation, IsAPermutationThatTheSeedDecides) {
  EXPECT_TRUE(isPermutation(randomPermutation(1000, 7)));
  EXPECT_EQ(randomPermutation(1000, 7), randomPermutation(1000, 7));
  EXPECT_NE(randomPermutation(1000, 7), randomPermutation(1000, 8));
}

TEST(ToroidalKernel, IsItsDefinitionAndOneAtTheOrigin) {
  for (const Shape shape : {Shape::peters, Shape::gauss, Shape::axis_mix}) {
    for (const double sigma : {0.4, 1.1, 3.1}) {
      const VoidAndCluster mask = settings({9, 12, 5}, shape, sigma);
      const ToroidalKernel kernel(mask.kernel, mask.size);
      EXPECT_DOUBLE_EQ(kernel(0, 0, 0), 1.0);
      const double peak = kernelAt(mask, 0, 0, 0);
      for (int x = 0; x < 9; ++x) {
        for (int y = 0; y < 12; ++y) {
          for (int z = 0; z < 5; ++z)
            EXPECT_NEAR(kernel(x, y, z), kernelAt(mask, x, y, z) / peak, 1e-14);
        }
      }
    }
  }
}

/// The correlation coefficient of two masks of equal size.
double correlation(const std::vector<std::uint32_t>& a, const std::vector<std::uint32_t>& b) {
  const double mean = (static_cast<double>(a.size()) - 1) / 2;
  double product = 0;
  double square = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    product += (a[i] - mean) * (b[i] - mean);
    square += (a[i] - mean) * (a[i] - mean);
  }
  return product / square;
}

TEST(HalftoneMask, DoesNotFollowTheMaskOfTheDither) {
  for (const int seed : {0, 1, 7, std::numeric_limits<int>::max()}) {
    VoidAndCluster shape = defaultMask();
    shape.seed = static_cast<std::uint64_t>(seed);
    VoidAndCluster halftone = halftoneMask({0.042, 0.042, 0.042}, seed);
    shape.size = halftone.size = Coord(16);
    // Of independent masks the standard deviation is 1/64.
    EXPECT_LT(std::abs(correlation(voidAndCluster(shape), voidAndCluster(halftone))), 0.07) << seed;
    halftone.seed = shape.seed;
    EXPECT_GT(correlation(voidAndCluster(shape), voidAndCluster(halftone)), 0.1) << seed;
  }
}

}  // namespace
}  // namespace vdbdither
