// What dithers leave after the print, on shapes whose surface is known: facets of every tilt, a
// sphere, a relief, thin walls, wires, combs and letters on the lattices of two printers and on
// cubes. The process is a Gaussian blur of the occupancy, and the printed surface its level ½.
// Prints one JSON object per line; samples/paper/quality.py makes the tables of docs/evaluation.md
// of them.
//
//     dither_quality_bench MASK.vdb PAPERS_MASK.vdb facets|sweep|heights|smooth|detail [LATTICE
//     [RULE]]

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <iostream>
#include <map>
#include <numbers>
#include <random>

#include "io/vdb/vdb.h"
#include "ops/kernels/dither/shape_dither.h"
#include "ops/kernels/dither/voxel_diameter.h"
#include "tests/support/volumes.h"
#include "vdbdither/engine/options.h"

namespace vdbdither {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using test::Distance;
using test::Voxels;

constexpr double pi = std::numbers::pi;

struct NamedLattice {
  const char* name;
  Vec3d pitch_mm;
};
const std::vector<NamedLattice> lattices{{"mimaki", {0.042, 0.084, 0.022}},
                                         {"j750", {25.4 / 600, 25.4 / 300, 0.027}},
                                         {"cubic", {0.05, 0.05, 0.05}}};
constexpr std::array spreads_mm{0.05, 0.1};

/// That one, or all without a name.
std::vector<NamedLattice> latticesNamed(const std::string& only) {
  std::vector<NamedLattice> named = lattices;
  std::erase_if(named,
                [&](const NamedLattice& lattice) { return !only.empty() && lattice.name != only; });
  return named;
}

/// Occupancy after the blur, exact for voxels that are boxes.
class Blurred {
 public:
  Blurred(const Voxels& voxels, const Vec3d& pitch_mm, double spread_mm)
      : box_(voxels.box()), pitch_mm_(pitch_mm), spread_mm_(spread_mm) {
    for (auto v = box_.begin(); v; ++v) occupied_.push_back(voxels[*v] ? 1.0F : 0.0F);
  }

  double operator()(const Vec3d& at_mm) const {
    Coord first;
    for (int axis = 0; axis < 3; ++axis) first[axis] = weigh(axis, at_mm[axis]);
    const Coord size = box_.dim();
    double sum = 0;
    for (std::size_t i = 0; i < weights_[0].size(); ++i) {
      double of_plane = 0;
      for (std::size_t j = 0; j < weights_[1].size(); ++j) {
        const Coord row = first - box_.min() + Coord(static_cast<int>(i), static_cast<int>(j), 0);
        const float* values =
            occupied_.data() + (row.x() * size.y() + row.y()) * size.z() + row.z();
        float of_row = 0;
        for (std::size_t k = 0; k < weights_[2].size(); ++k) of_row += weights_[2][k] * values[k];
        of_plane += static_cast<double>(weights_[1][j]) * static_cast<double>(of_row);
      }
      sum += static_cast<double>(weights_[0][i]) * of_plane;
    }
    return sum;
  }

  /// How far outwards from a point of the surface, along the normal, the printed surface lies.
  double error(const Vec3d& surface_mm, const Vec3d& normal) const {
    const double first = height(surface_mm);
    return first + height(surface_mm + first * normal);
  }

 private:
  /// Of a flat print whose occupancy there is this; a step of Newton's method for any other.
  double height(const Vec3d& at_mm) const {
    const double share = std::clamp((*this)(at_mm), 1e-5, 1 - 1e-5);
    double low = -5;
    double high = 5;
    for (int n = 0; n < 40; ++n) {
      const double middle = (low + high) / 2;
      (std::erfc(-middle / std::numbers::sqrt2) / 2 < share ? low : high) = middle;
    }
    return spread_mm_ * low;
  }

  int weigh(int axis, double at_mm) const {
    const double pitch = pitch_mm_[axis];
    const int reach = static_cast<int>(std::ceil(3.6 * spread_mm_ / pitch));
    const int first = static_cast<int>(std::lround(at_mm / pitch)) - reach;
    auto& weights = weights_[static_cast<std::size_t>(axis)];
    weights.resize(static_cast<std::size_t>(2 * reach + 1));
    const auto below = [&](int n) {
      return std::erf(((first + n - 0.5) * pitch - at_mm) / spread_mm_ / std::numbers::sqrt2) / 2;
    };
    const double least = below(0);
    const double all = below(2 * reach + 1) - least;
    double before = least;
    for (int n = 0; n <= 2 * reach; ++n) {
      const double after = below(n + 1);
      weights[static_cast<std::size_t>(n)] = static_cast<float>((after - before) / all);
      before = after;
    }
    return first;
  }

  CoordBBox box_;
  Vec3d pitch_mm_;
  double spread_mm_;
  std::vector<float> occupied_;
  mutable std::array<std::vector<float>, 3> weights_;
};

/// A part, where its distance is sampled.
struct Part {
  Distance distance;
  Lattice lattice;
};

Vec3d normalOf(const Distance& distance, const Vec3d& at) {
  constexpr double h = 1e-5;
  Vec3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d step(0.0);
    step[axis] = h;
    gradient[axis] = distance(at + step) - distance(at - step);
  }
  return gradient.unit();
}

struct Method {
  std::string name;
  std::function<Voxels(const Part&, const FloatGrid&)> print;
};

/// A rule that decides every voxel near the surface by itself.
template <typename Rule>
Method ruled(const std::string& name, Rule rule) {
  return {name, [rule](const Part& part, const FloatGrid& surface) {
            Voxels printed(part.lattice.box, 0);
            auto accessor = surface.getConstAccessor();
            for (auto v = part.lattice.box.begin(); v; ++v) {
              float d;
              printed[*v] = accessor.probeValue(*v, d) ? rule(part, *v, double{d}) : d < 0;
            }
            return printed;
          }};
}

/// Made once for each lattice and spread.
std::shared_ptr<const AdaptedAmplitude> adaptedTo(const Vec3d& pitch_mm, double spread_mm) {
  static std::map<std::array<double, 4>, std::shared_ptr<const AdaptedAmplitude>> known;
  auto& adapted = known[{pitch_mm.x(), pitch_mm.y(), pitch_mm.z(), spread_mm}];
  if (!adapted) adapted = std::make_shared<AdaptedAmplitude>(pitch_mm, spread_mm);
  return adapted;
}

Method dithered(const std::string& name, const ThresholdMask& mask, double amplitude, DitherAt at,
                bool adapted = false, bool guarded = false, double spread_mm = 0.05) {
  return {name, [=](const Part& part, const FloatGrid& surface) {
            ShapeDither dither{part.lattice.pitch_mm, amplitude, at, mask};
            if (adapted) dither.adapted = adaptedTo(part.lattice.pitch_mm, spread_mm);
            dither.guarded = guarded;
            const ZRange layers = part.lattice.layers();
            return test::dense(*dither.run(surface, nullptr, layers, layers, false).solid,
                               part.lattice.box);
          }};
}

Method triangular(const ThresholdMask& mask) {
  return ruled("triangular 2", [&mask](const Part& part, const Coord& v, double d) {
    const double M = mask(v);
    const double along = M < 0.5 ? std::sqrt(2 * M) - 1 : 1 - std::sqrt(2 * (1 - M));
    const openvdb::Vec3s normal(normalOf(part.distance, part.lattice.position(v)));
    return d + 2 * halfVoxelDiameter(normal, part.lattice.pitch_mm) * along < 0;
  });
}

/// The share of the voxel that the part covers, by sub-samples, against the threshold.
Method coverage(const ThresholdMask& mask) {
  return ruled("coverage", [&mask](const Part& part, const Coord& v, double d) {
    if (std::abs(d) > part.lattice.pitch_mm.length() / 2) return d < 0;
    constexpr int n = 6;
    int covered = 0;
    for (int at = 0; at < n * n * n; ++at) {
      const Vec3d inside((at % n + 0.5) / n - 0.5, (at / n % n + 0.5) / n - 0.5,
                         (at / n / n + 0.5) / n - 0.5);
      covered += part.distance(part.lattice.position(v) + inside * part.lattice.pitch_mm) < 0;
    }
    return static_cast<double>(covered) / (n * n * n) > double{mask(v)};
  });
}

Method control() {
  return ruled("control", [](const Part&, const Coord&, double d) { return d < 0; });
}

/// Eq. (11) of Morsy, Brunton, Urban 2022, ± a quarter voxel.
Method interlacing() {
  return ruled("interlacing", [](const Part& part, const Coord& v, double) {
    const double shift = part.lattice.pitch_mm.y() / 4 * ((v.z() & 1) != 0 ? 1 : -1);
    return part.distance(part.lattice.position(v) + Vec3d(0, shift, 0)) < 0;
  });
}

FloatGrid::Ptr surfaceOf(const Part& part) {
  // Enough for the constant 6.
  return test::sampled(part.distance, part.lattice, 1.6 * part.lattice.pitch_mm.length());
}

Lattice latticeOver(const Vec3d& pitch_mm, const Vec3d& min_mm, const Vec3d& max_mm) {
  return {pitch_mm, Vec3d(0.0),
          CoordBBox(Coord::floor(min_mm / pitch_mm), Coord::ceil(max_mm / pitch_mm))};
}

/// Errors in µm, and what they are on average at each phase of the stairs.
class Errors {
 public:
  void add(double error_mm, double phase) {
    const double um = 1000 * error_mm;
    all_.add(um);
    absolute_ += std::abs(um);
    phases_[static_cast<std::size_t>(16 * (phase - std::floor(phase))) % 16].add(um);
  }

  void print() const {
    double stairs = 0;
    double mean_deviation = 0;
    double deviation2 = 0;
    for (const Moments& phase : phases_) {
      stairs += std::pow(phase.mean() - all_.mean(), 2);
      mean_deviation += phase.deviation();
      deviation2 += std::pow(phase.deviation(), 2);
    }
    mean_deviation /= 16;
    std::cout << "\"bias\":" << all_.mean() << ",\"mean\":" << absolute_ / all_.count
              << ",\"rms\":" << std::sqrt(all_.squares / all_.count)
              << ",\"stairs\":" << std::sqrt(stairs / 16) << ",\"modulation\":"
              << std::sqrt(std::max(0.0, deviation2 / 16 - mean_deviation * mean_deviation));
  }

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

/// Ours, and what the paper's rule takes.
struct Masks {
  ThresholdMask ours;
  ThresholdMask papers;
};

/// Not all that are in the tables, but this one; all if empty.
std::string only_method;

std::vector<Method> chosen(std::vector<Method> methods) {
  if (!only_method.empty())
    std::erase_if(methods, [](const Method& method) { return method.name != only_method; });
  return methods;
}

std::vector<Method> methodsFor(const Masks& masks, bool every) {
  const ThresholdMask& mask = masks.ours;
  std::vector<Method> methods{control(), interlacing(),
                              dithered("paper", masks.papers, 4, DitherAt::closest),
                              dithered("best", mask, 2, DitherAt::voxel, true, true)};
  if (!every) return methods;
  methods.push_back(dithered("best, paper's mask", masks.papers, 2, DitherAt::voxel, true, true));
  methods.push_back(dithered("4 closest", mask, 4, DitherAt::closest));
  methods.push_back(dithered("2 voxel, paper's mask", masks.papers, 2, DitherAt::voxel));
  methods.push_back(dithered("4 foot", mask, 4, DitherAt::foot));
  methods.push_back(dithered("4 voxel", mask, 4, DitherAt::voxel));
  for (const double amplitude : {0.5, 1.0, 1.5, 2.0})
    methods.push_back(
        dithered(shortestText(amplitude) + " voxel", mask, amplitude, DitherAt::voxel));
  methods.push_back(dithered("2 closest", mask, 2, DitherAt::closest));
  for (const double amplitude : {2.5, 3.0, 5.0, 6.0})
    methods.push_back(dithered(shortestText(amplitude) + " foot", mask, amplitude, DitherAt::foot));
  methods.push_back(triangular(mask));
  methods.push_back(coverage(mask));
  methods.push_back(dithered("best 25", mask, 2, DitherAt::voxel, true, true, 0.025));
  methods.push_back(dithered("best 100", mask, 2, DitherAt::voxel, true, true, 0.1));
  methods.push_back(dithered("best unguarded", mask, 2, DitherAt::voxel, true, false));
  return methods;
}

/// Strips of flat facets, 3.2 × 1 mm, `tilt` degrees off an axis of the lattice towards `azimuth`;
/// for every rule fewer of them.
void facets(const Masks& masks, const std::string& only, bool every) {
  const int positions = every ? 1 : 3;
  const std::vector<double> tilts =
      every ? std::vector{0.5, 2.0, 5.0, 10.0, 20.0, 45.0}
            : std::vector{0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 45.0};
  const Vec3d half(1.6, 0.5, 0);
  const auto methods = chosen(methodsFor(masks, every));
  for (const auto& [name, pitch] : latticesNamed(only)) {
    for (int a = 0; a < 3; ++a) {
      if (std::strcmp(name, "cubic") == 0 && a != 2) continue;
      for (const double azimuth : {3.0, 40.0, 87.0}) {
        for (const double tilt : tilts) {
          const int b = (a + 1) % 3;
          const int c = (a + 2) % 3;
          const double t = tilt * pi / 180;
          const double z = azimuth * pi / 180;
          Vec3d n;
          Vec3d down;
          n[a] = std::cos(t);
          n[b] = std::sin(t) * std::cos(z);
          n[c] = std::sin(t) * std::sin(z);
          down[a] = -std::sin(t);
          down[b] = std::cos(t) * std::cos(z);
          down[c] = std::cos(t) * std::sin(z);
          const Vec3d across = n.cross(down);
          std::vector<std::array<Errors, 2>> errors(methods.size());
          for (int position = 0; position < positions; ++position) {
            std::mt19937 random(static_cast<unsigned>(17 * position + 3));
            const auto uniform = [&] { return static_cast<double>(random() >> 8U) * 0x1p-24; };
            const Vec3d at(64 * uniform() * pitch.x(), 64 * uniform() * pitch.y(),
                           64 * uniform() * pitch.z());
            Vec3d reach;
            for (int q = 0; q < 3; ++q)
              reach[q] = std::abs(down[q]) * half[0] + std::abs(across[q]) * half[1] + 0.46;
            const Part part{[=](const Vec3d& x) { return n.dot(x - at); },
                            latticeOver(pitch, at - reach, at + reach)};
            const auto surface = surfaceOf(part);
            for (std::size_t m = 0; m < methods.size(); ++m) {
              const Voxels printed = methods[m].print(part, *surface);
              for (std::size_t s = 0; s < 2; ++s) {
                const Blurred blurred(printed, pitch, spreads_mm[s]);
                const int rows = s == 0 ? 64 : 40;
                const int columns = s == 0 ? 12 : 8;
                std::mt19937 jitter(5);
                const auto within = [&] { return static_cast<double>(jitter() >> 8U) * 0x1p-24; };
                for (int i = 0; i < rows; ++i) {
                  for (int j = 0; j < columns; ++j) {
                    const double u = half[0] * (2 * (i + within()) / rows - 1);
                    const double w = half[1] * (2 * (j + within()) / columns - 1);
                    const Vec3d x = at + u * down + w * across;
                    errors[m][s].add(blurred.error(x, n), x[a] / pitch[a] + 0.5);
                  }
                }
              }
            }
          }
          for (std::size_t m = 0; m < methods.size(); ++m) {
            for (std::size_t s = 0; s < 2; ++s) {
              std::cout << "{\"set\":\"" << (every ? "sweep" : "facets") << "\",\"lattice\":\""
                        << name << "\",\"axis\":" << a << ",\"azimuth\":" << azimuth
                        << ",\"tilt\":" << tilt << ",\"spread\":" << 1000 * spreads_mm[s]
                        << ",\"method\":\"" << methods[m].name
                        << "\",\"diameter\":" << 2000 * halfVoxelDiameter(openvdb::Vec3s(n), pitch)
                        << ",";
              errors[m][s].print();
              std::cout << "}" << std::endl;
            }
          }
        }
      }
    }
  }
}

/// The printed heights, µm, over 4 × 2 mm of facets 2° off z and off y, at points 40 µm apart.
void heights(const Masks& masks) {
  auto methods = methodsFor(masks, false);
  methods.push_back(dithered("4 foot", masks.ours, 4, DitherAt::foot));
  methods.push_back(dithered("2 voxel, paper's mask", masks.papers, 2, DitherAt::voxel));
  methods = chosen(std::move(methods));
  const Vec3d pitch = lattices[0].pitch_mm;
  for (const int a : {2, 1}) {
    const double tilt = 2 * pi / 180;
    const int b = a == 2 ? 0 : 2;
    const int c = 3 - a - b;
    Vec3d n(0.0);
    n[a] = std::cos(tilt);
    n[b] = std::sin(tilt);
    Vec3d down(0.0);
    down[a] = -std::sin(tilt);
    down[b] = std::cos(tilt);
    Vec3d across(0.0);
    across[c] = 1;
    Vec3d reach;
    for (int q = 0; q < 3; ++q) reach[q] = 2 * std::abs(down[q]) + std::abs(across[q]) + 0.46;
    const Part part{[=](const Vec3d& x) { return n.dot(x); }, latticeOver(pitch, -reach, reach)};
    const auto surface = surfaceOf(part);
    for (const Method& method : methods) {
      const Blurred blurred(method.print(part, *surface), pitch, spreads_mm[0]);
      std::cout << "{\"set\":\"heights\",\"axis\":" << a << ",\"method\":\"" << method.name
                << "\",\"rows\":50,\"um\":[";
      for (int i = 0; i < 50; ++i) {
        for (int j = 0; j < 100; ++j) {
          const Vec3d x = (0.04 * (j - 49.5)) * down + (0.04 * (i - 24.5)) * across;
          std::cout << (i + j > 0 ? "," : "") << std::round(10000 * blurred.error(x, n)) / 10;
        }
      }
      std::cout << "]}" << std::endl;
    }
  }
}

constexpr double relief_mm = 0.12;
double reliefHeight(double x, double y) {
  return relief_mm * std::sin(2 * pi * x / 2.1 + 0.3) * std::cos(2 * pi * y / 1.7 + 0.1);
}

Vec3d reliefNormal(double x, double y) {
  const double u = 2 * pi * x / 2.1 + 0.3;
  const double w = 2 * pi * y / 1.7 + 0.1;
  return Vec3d(-relief_mm * 2 * pi / 2.1 * std::cos(u) * std::cos(w),
               relief_mm * 2 * pi / 1.7 * std::sin(u) * std::sin(w), 1)
      .unit();
}

/// By the foot point, which a few steps find.
double reliefDistance(const Vec3d& at) {
  const double rough = at.z() - reliefHeight(at.x(), at.y());
  if (std::abs(rough) > 0.4) return rough;
  Vec3d foot(at.x(), at.y(), 0);
  double d = 0;
  for (int n = 0; n < 8; ++n) {
    const Vec3d normal = reliefNormal(foot.x(), foot.y());
    const Vec3d on(foot.x(), foot.y(), reliefHeight(foot.x(), foot.y()));
    d = (at - on).dot(normal);
    const Vec3d lateral = at - on - d * normal;
    foot.x() += 0.8 * lateral.x();
    foot.y() += 0.8 * lateral.y();
  }
  return d;
}

int cavities(const Voxels& printed) {
  Voxels empty(printed.box(), 0);
  for (auto v = printed.box().begin(); v; ++v) empty[*v] = printed[*v] ? 0 : 1;
  return test::components(empty, test::Touching::faces) - 1;
}

/// Handles of the printed set, its voxels taken with faces, edges and corners: by Euler's number.
int tunnels(const Voxels& printed) {
  const CoordBBox& box = printed.box();
  int euler = 0;
  // Every cell of the cubic complex is counted at its lowest corner: a voxel, or what the voxels
  // around it hold of it.
  for (auto v = CoordBBox(box.min(), box.max().offsetBy(1)).begin(); v; ++v) {
    for (int kind = 0; kind < 8; ++kind) {
      // Bits: the axes along which the cell is flat.
      bool held = false;
      for (int around = 0; around < 8 && !held; ++around) {
        if ((around & ~kind) != 0) continue;
        held = printed.at((*v).offsetBy(-(around & 1), -(around >> 1 & 1), -(around >> 2)), 0) != 0;
      }
      if (held) euler += std::popcount(static_cast<unsigned>(kind)) % 2 == 0 ? -1 : 1;
    }
  }
  return test::components(printed, test::Touching::corners) + cavities(printed) - euler;
}

double volumeMm3(const Voxels& printed, const Vec3d& pitch_mm) {
  double count = 0;
  for (auto v = printed.box().begin(); v; ++v) count += printed[*v] ? 1 : 0;
  return count * pitch_mm.product();
}

void smooth(const Masks& masks, const std::string& only) {
  const auto methods = chosen(methodsFor(masks, false));
  constexpr double radius = 1.5;
  for (const auto& [name, pitch] : latticesNamed(only)) {
    for (const std::string shape : {"sphere", "relief"}) {
      const bool sphere = shape == "sphere";
      const Vec3d centre(0.011, 0.027, 0.005);
      const Vec3d reach = sphere ? Vec3d(radius + 0.46) : Vec3d(2.2, 2.0, 0.62);
      const Part part{sphere ? test::sphere(centre, radius) : Distance(reliefDistance),
                      latticeOver(pitch, centre - reach, centre + reach)};
      const auto surface = surfaceOf(part);
      for (const Method& method : methods) {
        const Voxels printed = method.print(part, *surface);
        for (const double spread_mm : spreads_mm) {
          const Blurred blurred(printed, pitch, spread_mm);
          Errors errors;
          // What the blur itself takes from a sphere: the error of a perfect print, from finest
          // voxels; by the mean curvature, −σ²/r.
          std::mt19937 random(7);
          const auto uniform = [&] { return static_cast<double>(random() >> 8U) * 0x1p-24; };
          for (int n = 0; n < 6000; ++n) {
            Vec3d normal;
            Vec3d x;
            double expected = 0;
            if (sphere) {
              const double height = 2 * uniform() - 1;
              const double turn = 2 * pi * uniform();
              const double lateral = std::sqrt(1 - height * height);
              normal = {lateral * std::cos(turn), lateral * std::sin(turn), height};
              x = centre + radius * normal;
              expected = -spread_mm * spread_mm / radius;
            } else {
              const double u = centre.x() + 3 * (uniform() - 0.5);
              const double w = centre.y() + 2.6 * (uniform() - 0.5);
              normal = reliefNormal(u, w);
              x = {u, w, reliefHeight(u, w)};
              // Twice the mean curvature of a graph, by differences of its normal.
              constexpr double h = 1e-4;
              const double divergence = (reliefNormal(u + h, w).x() - reliefNormal(u - h, w).x() +
                                         reliefNormal(u, w + h).y() - reliefNormal(u, w - h).y()) /
                                        (2 * h);
              expected = -spread_mm * spread_mm / 2 * divergence;
            }
            errors.add(blurred.error(x, normal) - expected, x.z() / pitch.z() + 0.5);
          }
          std::cout << "{\"set\":\"smooth\",\"lattice\":\"" << name << "\",\"shape\":\"" << shape
                    << "\",\"spread\":" << 1000 * spread_mm << ",\"method\":\"" << method.name
                    << "\",";
          if (sphere) {
            const double truth = 4 * pi / 3 * radius * radius * radius;
            std::cout << "\"volume_error_percent\":"
                      << 100 * (volumeMm3(printed, pitch) / truth - 1)
                      << ",\"components\":" << test::components(printed, test::Touching::corners)
                      << ",\"cavities\":" << cavities(printed) << ",";
          }
          errors.print();
          std::cout << "}" << std::endl;
        }
      }
    }
  }
}

Distance joined(std::vector<Distance> parts) {
  return [parts = std::move(parts)](const Vec3d& at) {
    double nearest = 1e9;
    for (const Distance& part : parts) nearest = std::min(nearest, part(at));
    return nearest;
  };
}

Distance cut(Distance from, Distance what) {
  return [from = std::move(from), what = std::move(what)](const Vec3d& at) {
    return std::max(from(at), -what(at));
  };
}

Distance capsule(const Vec3d& from, const Vec3d& to, double radius) {
  return [=](const Vec3d& at) {
    const double share = std::clamp((at - from).dot(to - from) / (to - from).lengthSqr(), 0.0, 1.0);
    return (at - from - share * (to - from)).length() - radius;
  };
}

/// The strokes of E, H and A, `width` wide and as high as the box, in the plane, turned by 7°.
Distance letters(double width, double half_height) {
  const double size = std::max(0.5, 4 * width);
  std::vector<Distance> strokes;
  const auto stroke = [&](Vec3d from, Vec3d to) {
    const Vec3d middle = (from + to) / 2;
    const Vec3d along = to - from;
    const double turn = std::atan2(along.y(), along.x()) * 180 / pi;
    const double angle = 7 * pi / 180;
    const Vec3d turned(middle.x() * std::cos(angle) - middle.y() * std::sin(angle),
                       middle.x() * std::sin(angle) + middle.y() * std::cos(angle), 0);
    strokes.push_back(test::box(turned, {(along.length() + width) / 2, width / 2, half_height},
                                {0, 0, turn + 7}));
  };
  const double gap = 1.3 * size;
  stroke({-gap, 0, 0}, {-gap, size, 0});
  for (const double y : {0.0, 0.5, 1.0})
    stroke({-gap, y * size, 0}, {-gap + 0.6 * size, y * size, 0});
  stroke({0, 0, 0}, {0, size, 0});
  stroke({0.6 * size, 0, 0}, {0.6 * size, size, 0});
  stroke({0, 0.5 * size, 0}, {0.6 * size, 0.5 * size, 0});
  stroke({gap, 0, 0}, {gap + 0.3 * size, size, 0});
  stroke({gap + 0.6 * size, 0, 0}, {gap + 0.3 * size, size, 0});
  return joined(strokes);
}

struct Detail {
  std::string name;
  double size_um;
  Part part;
  Distance region;  ///< where volumes are compared; null: everywhere
};

std::vector<Detail> detailsOn(const Vec3d& pitch) {
  std::vector<Detail> details;
  for (const double um : {80.0, 120.0, 180.0, 250.0}) {
    const double r = um / 2000;
    const Distance wires = joined({capsule({-0.9, -0.5, 0.1}, {0.9, -0.4, 0.2}, r),
                                   capsule({-0.9, 0.1, -0.5}, {0.9, 0.2, 0.4}, r),
                                   capsule({0.1, -0.9, -0.9}, {-0.2, 0.8, -0.7}, r),
                                   capsule({0.7, 0.7, -0.8}, {0.6, 0.75, 0.9}, r)});
    details.push_back(
        {"wires", um, {wires, latticeOver(pitch, Vec3d(-1.5), Vec3d(1.5))}, [=](const Vec3d& x) {
           return wires(x) - 0.15;
         }});
  }
  for (const double um : {76.0, 120.0, 180.0, 280.0}) {
    const double w = um / 1000;
    const double size = std::max(0.5, 4 * w);
    const Vec3d min(-1.9 * size, -0.7 * size, -0.5);
    const Vec3d max(2.3 * size, 1.7 * size, 0.7);
    const Lattice lattice = latticeOver(pitch, min - 0.4, max + 0.4);
    const Distance slab =
        test::box({0.2 * size, 0.5 * size, -0.25}, {1.9 * size, size, 0.25}, Vec3d(0.0));
    const Distance raised = letters(w, 0.2);
    const Distance sunk = letters(w, 0.15);
    details.push_back({"embossed", um, {joined({slab, raised}), lattice}, [=](const Vec3d& x) {
                         return std::max(0.03 - x.z(), raised(x) - 0.08);
                       }});
    details.push_back({"engraved", um, {cut(slab, sunk), lattice}, [=](const Vec3d& x) {
                         return std::max(x.z() + 0.0, sunk(x) - 0.08);
                       }});
  }
  const Vec3d tilt_of_plates[] = {{3, 4, 0}, {20, 11, 0}, {40, 5, 30}, {88, 0, 2}, {3, 87, 10}};
  for (const Vec3d& tilt : tilt_of_plates) {
    const Vec3d half(0.8, 0.7, 1);
    const Vec3d normal = normalOf(test::box(Vec3d(0.0), half, tilt), [&] {
      // A point above the middle of the wide face.
      const double a = tilt.x() * pi / 180;
      const double b = tilt.y() * pi / 180;
      const double c = tilt.z() * pi / 180;
      Vec3d n(0, -std::sin(a), std::cos(a));
      n = {n.x() * std::cos(b) + n.z() * std::sin(b), n.y(),
           -n.x() * std::sin(b) + n.z() * std::cos(b)};
      n = {n.x() * std::cos(c) - n.y() * std::sin(c), n.x() * std::sin(c) + n.y() * std::cos(c),
           n.z()};
      return 1.2 * n;
    }());
    const double diameter = 2 * halfVoxelDiameter(openvdb::Vec3s(normal), pitch);
    for (const double voxels : {1.0, 1.5, 2.0, 3.0, 4.0}) {
      const double thickness = voxels * diameter;
      const Distance plate = test::box({0.003, 0.007, 0.002}, {0.8, 0.7, thickness / 2}, tilt);
      details.push_back(
          {"plate", voxels, {plate, latticeOver(pitch, Vec3d(-1.4), Vec3d(1.4))}, {}});
    }
    for (const double voxels : {1.0, 2.0, 3.0}) {
      std::vector<Distance> bars;
      const double step = (3 + voxels) * diameter;
      for (int n = -2; n <= 2; ++n)
        bars.push_back(test::box(Vec3d(0.003, 0.007, 0.002) + n * step * normal,
                                 {0.6, 0.5, 1.5 * diameter}, tilt));
      details.push_back(
          {"comb", voxels, {joined(bars), latticeOver(pitch, Vec3d(-1.6), Vec3d(1.6))}, {}});
    }
  }
  return details;
}

void detail(const Masks& masks, const std::string& only) {
  std::vector<Method> methods = methodsFor(masks, false);
  methods.push_back(dithered("best unguarded", masks.ours, 2, DitherAt::voxel, true, false));
  methods.push_back(dithered("2 voxel", masks.ours, 2, DitherAt::voxel));
  methods.push_back(coverage(masks.ours));
  methods = chosen(std::move(methods));
  for (const auto& [name, pitch] : latticesNamed(only)) {
    for (const Detail& piece : detailsOn(pitch)) {
      const auto surface = surfaceOf(piece.part);
      double truth = 0;
      const CoordBBox& box = piece.part.lattice.box;
      constexpr int fine = 4;
      const auto inRegion = [&](const Vec3d& x) { return !piece.region || piece.region(x) < 0; };
      for (auto v = box.begin(); v; ++v) {
        const Vec3d centre = piece.part.lattice.position(*v);
        if (std::abs(piece.part.distance(centre)) > pitch.length()) {
          truth += piece.part.distance(centre) < 0 && inRegion(centre) ? 1 : 0;
          continue;
        }
        int covered = 0;
        for (int at = 0; at < fine * fine * fine; ++at) {
          const Vec3d inside((at % fine + 0.5) / fine - 0.5, (at / fine % fine + 0.5) / fine - 0.5,
                             (at / fine / fine + 0.5) / fine - 0.5);
          const Vec3d x = centre + inside * pitch;
          covered += inRegion(x) && piece.part.distance(x) < 0;
        }
        truth += static_cast<double>(covered) / (fine * fine * fine);
      }
      for (const Method& method : methods) {
        // Sub-samples of so many voxels take long, and say nothing new of plates.
        if (!piece.region && method.name == "coverage") continue;
        const Voxels printed = method.print(piece.part, *surface);
        double count = 0;
        for (auto v = box.begin(); v; ++v)
          count += printed[*v] && inRegion(piece.part.lattice.position(*v)) ? 1 : 0;
        std::cout << "{\"set\":\"detail\",\"lattice\":\"" << name << "\",\"piece\":\"" << piece.name
                  << "\",\"size\":" << piece.size_um << ",\"method\":\"" << method.name
                  << "\",\"volume_error_percent\":" << 100 * (count / truth - 1)
                  << ",\"components\":" << test::components(printed, test::Touching::corners)
                  << ",\"cavities\":" << cavities(printed) << ",\"tunnels\":" << tunnels(printed);
        if (piece.region) {
          // After the blur, at points 25 µm apart.
          const Blurred blurred(printed, pitch, spreads_mm[0]);
          double both = 0;
          double either = 0;
          double after = 0;
          double ideal = 0;
          const Vec3d low = piece.part.lattice.position(box.min()) + 0.35;
          const Vec3d high = piece.part.lattice.position(box.max()) - 0.35;
          for (double x = low.x(); x < high.x(); x += 0.025) {
            for (double y = low.y(); y < high.y(); y += 0.025) {
              for (double z = low.z(); z < high.z(); z += 0.025) {
                const Vec3d at(x, y, z);
                if (!inRegion(at)) continue;
                const bool is = piece.part.distance(at) < 0;
                const bool made = blurred(at) > 0.5;
                const bool stroke = piece.name != "engraved";
                both += (is == stroke) && (made == stroke);
                either += (is == stroke) || (made == stroke);
                after += made == stroke;
                ideal += is == stroke;
              }
            }
          }
          std::cout << ",\"stroke_overlap\":" << both / either
                    << ",\"stroke_volume_error_percent\":" << 100 * (after / ideal - 1);
        }
        std::cout << "}" << std::endl;
      }
    }
  }
}

}  // namespace
}  // namespace vdbdither

int main(int argc, char** argv) {
  using namespace vdbdither;
  if (argc < 4) {
    std::cerr << "usage: dither_quality_bench MASK.vdb PAPERS_MASK.vdb "
                 "facets|sweep|heights|smooth|detail [mimaki|j750|cubic "
                 "[RULE]]\n";
    return 2;
  }
  initializeVdb();
  const auto read = [](const char* path) {
    return ThresholdMask(*openvdb::gridConstPtrCast<openvdb::FloatGrid>(readGrid(path, "mask")));
  };
  const Masks masks{read(argv[1]), read(argv[2])};
  const std::string what = argv[3];
  const std::string only = argc > 4 ? argv[4] : "";
  if (argc > 5) only_method = argv[5];
  if (what == "facets") facets(masks, only, false);
  if (what == "sweep") facets(masks, only, true);
  if (what == "heights") heights(masks);
  if (what == "smooth") smooth(masks, only);
  if (what == "detail") detail(masks, only);
}
