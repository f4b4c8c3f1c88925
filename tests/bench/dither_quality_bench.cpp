// What dithers leave after the print, on shapes whose surface is known: facets of every tilt, a
// sphere, a relief, thin walls, wires, combs and letters on the lattices of two printers and on
// cubes. The process is a Gaussian blur of the occupancy, and the printed surface its level ½.
// Prints one JSON object per line; samples/paper/quality.py makes the tables of docs/evaluation.md
// of them.
//
//     dither_quality_bench MASK.vdb PAPERS_MASK.vdb facets|sweep|heights|smooth|detail [LATTICE
//     [RULE]]

#include <array>
#include <cmath>
#include <cstring>
#include <iostream>
#include <numbers>
#include <random>
#include <utility>

#include "io/vdb/vdb.h"
#include "ops/kernels/leaf/voxel_diameter.h"
#include "tests/bench/dither_quality/methods.h"
#include "tests/bench/dither_quality/parts.h"
#include "tests/bench/dither_quality/print_measures.h"

namespace vdbdither::quality {
namespace {

using openvdb::CoordBBox;
using openvdb::Vec3d;

constexpr double pi = std::numbers::pi;

/// The lattice and the method to run; all where a name is empty.
struct Choice {
  std::string lattice, method;
};

/// A flat facet through the origin, `tilt` degrees off an axis of the lattice towards `azimuth`.
struct Facet {
  Vec3d normal, down, across;
};

Facet facetOf(int axis, double tilt, double azimuth) {
  const int b = (axis + 1) % 3;
  const int c = (axis + 2) % 3;
  const double t = tilt * pi / 180;
  const double z = azimuth * pi / 180;
  Facet facet;
  facet.normal[axis] = std::cos(t);
  facet.normal[b] = std::sin(t) * std::cos(z);
  facet.normal[c] = std::sin(t) * std::sin(z);
  facet.down[axis] = -std::sin(t);
  facet.down[b] = std::cos(t) * std::cos(z);
  facet.down[c] = std::cos(t) * std::sin(z);
  facet.across = facet.normal.cross(facet.down);
  return facet;
}

/// Numbers in [0, 1).
class Uniform {
 public:
  explicit Uniform(unsigned seed) : random_(seed) {}
  double operator()() { return static_cast<double>(random_() >> 8U) * 0x1p-24; }

 private:
  std::mt19937 random_;
};

/// The errors of one strip of 3.2 × 1 mm for each method and spread, added to `errors`.
void measureStrip(const Facet& facet, int axis, const Vec3d& pitch, unsigned seed,
                  const std::vector<Method>& methods, std::vector<std::array<Errors, 2>>& errors) {
  const Vec3d half(1.6, 0.5, 0);
  Uniform uniform(seed);
  const double x_mm = 64 * uniform() * pitch.x();
  const double y_mm = 64 * uniform() * pitch.y();
  const Vec3d at(x_mm, y_mm, 64 * uniform() * pitch.z());
  Vec3d reach;
  for (int q = 0; q < 3; ++q)
    reach[q] = std::abs(facet.down[q]) * half[0] + std::abs(facet.across[q]) * half[1] + 0.46;
  const Part part{[=](const Vec3d& x) { return facet.normal.dot(x - at); },
                  latticeOver(pitch, at - reach, at + reach)};
  const auto surface = surfaceOf(part);
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const Voxels printed = methods[m].print(part, *surface);
    for (std::size_t s = 0; s < 2; ++s) {
      const Blurred blurred(printed, pitch, spreads_mm[s]);
      const int rows = s == 0 ? 64 : 40;
      const int columns = s == 0 ? 12 : 8;
      Uniform within(5);
      for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) {
          const double u = half[0] * (2 * (i + within()) / rows - 1);
          const double w = half[1] * (2 * (j + within()) / columns - 1);
          const Vec3d x = at + u * facet.down + w * facet.across;
          errors[m][s].add(blurred.error(x, facet.normal), x[axis] / pitch[axis] + 0.5);
        }
      }
    }
  }
}

/// Strips of flat facets of every tilt; fewer of them where `every` method is compared.
void facets(const Masks& masks, const Choice& choice, bool every) {
  const int positions = every ? 1 : 3;
  const std::vector<double> tilts =
      every ? std::vector{0.5, 2.0, 5.0, 10.0, 20.0, 45.0}
            : std::vector{0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 45.0};
  const auto methods = chosen(methodsFor(masks, every), choice.method);
  const auto measure = [&](const NamedLattice& lattice, int axis, double azimuth, double tilt) {
    const Facet facet = facetOf(axis, tilt, azimuth);
    std::vector<std::array<Errors, 2>> errors(methods.size());
    for (int position = 0; position < positions; ++position)
      measureStrip(facet, axis, lattice.pitch_mm, static_cast<unsigned>(17 * position + 3), methods,
                   errors);
    const double diameter_mm =
        2 * halfVoxelDiameter(openvdb::Vec3s(facet.normal), lattice.pitch_mm);
    for (std::size_t m = 0; m < methods.size(); ++m) {
      for (std::size_t s = 0; s < 2; ++s) {
        std::cout << "{\"set\":\"" << (every ? "sweep" : "facets") << "\",\"lattice\":\""
                  << lattice.name << "\",\"axis\":" << axis << ",\"azimuth\":" << azimuth
                  << ",\"tilt\":" << tilt << ",\"spread\":" << 1000 * spreads_mm[s]
                  << ",\"method\":\"" << methods[m].name << "\",\"diameter\":" << 1000 * diameter_mm
                  << ",";
        errors[m][s].print();
        std::cout << "}" << std::endl;
      }
    }
  };
  for (const NamedLattice& lattice : latticesNamed(choice.lattice))
    for (int axis = 0; axis < 3; ++axis) {
      if (std::strcmp(lattice.name, "cubic") == 0 && axis != 2) continue;
      for (const double azimuth : {3.0, 40.0, 87.0})
        for (const double tilt : tilts) measure(lattice, axis, azimuth, tilt);
    }
}

/// The printed heights, µm, over 4 × 2 mm of facets 2° off z and off y, at points 40 µm apart.
void heights(const Masks& masks, const Choice& choice) {
  auto methods = methodsFor(masks, false);
  methods.push_back(dithered("4 foot", masks.ours, 4, DitherAt::foot));
  methods.push_back(dithered("2 voxel, paper's mask", masks.papers, 2, DitherAt::voxel));
  methods = chosen(std::move(methods), choice.method);
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

/// A point of a smooth surface, and the error of a perfect print there: what the blur takes away.
struct SurfacePoint {
  Vec3d at, normal;
  double expected_mm;
};

constexpr double sphere_mm = 1.5;

/// The blur moves a surface by its mean curvature: −σ²/r on a sphere.
SurfacePoint pointOnSphere(const Vec3d& centre, double spread_mm, Uniform& uniform) {
  const double height = 2 * uniform() - 1;
  const double turn = 2 * pi * uniform();
  const double lateral = std::sqrt(1 - height * height);
  const Vec3d normal(lateral * std::cos(turn), lateral * std::sin(turn), height);
  return {centre + sphere_mm * normal, normal, -spread_mm * spread_mm / sphere_mm};
}

SurfacePoint pointOnRelief(const Vec3d& centre, double spread_mm, Uniform& uniform) {
  const double u = centre.x() + 3 * (uniform() - 0.5);
  const double w = centre.y() + 2.6 * (uniform() - 0.5);
  // Twice the mean curvature of a graph, by differences of its normal.
  constexpr double h = 1e-4;
  const double divergence = (reliefNormal(u + h, w).x() - reliefNormal(u - h, w).x() +
                             reliefNormal(u, w + h).y() - reliefNormal(u, w - h).y()) /
                            (2 * h);
  return {{u, w, reliefHeight(u, w)}, reliefNormal(u, w), -spread_mm * spread_mm / 2 * divergence};
}

void smooth(const Masks& masks, const Choice& choice) {
  const auto methods = chosen(methodsFor(masks, false), choice.method);
  for (const auto& [name, pitch] : latticesNamed(choice.lattice)) {
    for (const std::string shape : {"sphere", "relief"}) {
      const bool sphere = shape == "sphere";
      const Vec3d centre(0.011, 0.027, 0.005);
      const Vec3d reach = sphere ? Vec3d(sphere_mm + 0.46) : Vec3d(2.2, 2.0, 0.62);
      const Part part{sphere ? test::sphere(centre, sphere_mm) : Distance(reliefDistance),
                      latticeOver(pitch, centre - reach, centre + reach)};
      const auto surface = surfaceOf(part);
      for (const Method& method : methods) {
        const Voxels printed = method.print(part, *surface);
        for (const double spread_mm : spreads_mm) {
          const Blurred blurred(printed, pitch, spread_mm);
          Errors errors;
          Uniform uniform(7);
          for (int n = 0; n < 6000; ++n) {
            const auto [x, normal, expected] = sphere ? pointOnSphere(centre, spread_mm, uniform)
                                                      : pointOnRelief(centre, spread_mm, uniform);
            errors.add(blurred.error(x, normal) - expected, x.z() / pitch.z() + 0.5);
          }
          std::cout << "{\"set\":\"smooth\",\"lattice\":\"" << name << "\",\"shape\":\"" << shape
                    << "\",\"spread\":" << 1000 * spread_mm << ",\"method\":\"" << method.name
                    << "\",";
          if (sphere) {
            const double truth = 4 * pi / 3 * sphere_mm * sphere_mm * sphere_mm;
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

bool isInRegion(const Detail& piece, const Vec3d& x) {
  return !piece.region || piece.region(x) < 0;
}

/// The voxels' worth of a detail within its region, by sub-samples.
double trueVolume(const Detail& piece) {
  double truth = 0;
  const CoordBBox& box = piece.part.lattice.box;
  constexpr int fine = 4;
  for (auto v = box.begin(); v; ++v) {
    const Vec3d centre = piece.part.lattice.position(*v);
    if (std::abs(piece.part.distance(centre)) > piece.part.lattice.pitch_mm.length()) {
      truth += piece.part.distance(centre) < 0 && isInRegion(piece, centre) ? 1 : 0;
      continue;
    }
    int covered = 0;
    for (int at = 0; at < fine * fine * fine; ++at) {
      const Vec3d inside((at % fine + 0.5) / fine - 0.5, (at / fine % fine + 0.5) / fine - 0.5,
                         (at / fine / fine + 0.5) / fine - 0.5);
      const Vec3d x = centre + inside * piece.part.lattice.pitch_mm;
      covered += isInRegion(piece, x) && piece.part.distance(x) < 0;
    }
    truth += static_cast<double>(covered) / (fine * fine * fine);
  }
  return truth;
}

/// After the blur, at points 25 µm apart: how the strokes overlap with what they should be.
void printStrokes(const Detail& piece, const Voxels& printed) {
  const Blurred blurred(printed, piece.part.lattice.pitch_mm, spreads_mm[0]);
  double both = 0;
  double either = 0;
  double after = 0;
  double ideal = 0;
  const Vec3d low = piece.part.lattice.position(piece.part.lattice.box.min()) + 0.35;
  const Vec3d high = piece.part.lattice.position(piece.part.lattice.box.max()) - 0.35;
  for (double x = low.x(); x < high.x(); x += 0.025) {
    for (double y = low.y(); y < high.y(); y += 0.025) {
      for (double z = low.z(); z < high.z(); z += 0.025) {
        const Vec3d at(x, y, z);
        if (!isInRegion(piece, at)) continue;
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

void detail(const Masks& masks, const Choice& choice) {
  std::vector<Method> methods = methodsFor(masks, false);
  methods.push_back(diffused("best unguarded", false));
  methods.push_back(dithered("2 voxel", masks.ours, 2, DitherAt::voxel));
  methods.push_back(coverage(masks.ours));
  methods = chosen(std::move(methods), choice.method);
  for (const auto& [name, pitch] : latticesNamed(choice.lattice)) {
    for (const Detail& piece : detailsOn(pitch)) {
      const auto surface = surfaceOf(piece.part);
      const double truth = trueVolume(piece);
      for (const Method& method : methods) {
        // Sub-samples of so many voxels take long, and say nothing new of plates.
        if (!piece.region && method.name == "coverage") continue;
        const Voxels printed = method.print(piece.part, *surface);
        double count = 0;
        for (auto v = piece.part.lattice.box.begin(); v; ++v)
          count += printed[*v] && isInRegion(piece, piece.part.lattice.position(*v)) ? 1 : 0;
        std::cout << "{\"set\":\"detail\",\"lattice\":\"" << name << "\",\"piece\":\"" << piece.name
                  << "\",\"size\":" << piece.size_um << ",\"method\":\"" << method.name
                  << "\",\"volume_error_percent\":" << 100 * (count / truth - 1)
                  << ",\"components\":" << test::components(printed, test::Touching::corners)
                  << ",\"cavities\":" << cavities(printed) << ",\"tunnels\":" << tunnels(printed);
        if (piece.region) printStrokes(piece, printed);
        std::cout << "}" << std::endl;
      }
    }
  }
}

}  // namespace
}  // namespace vdbdither::quality

int main(int argc, char** argv) {
  using namespace vdbdither;
  using namespace vdbdither::quality;
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
  const Choice choice{argc > 4 ? argv[4] : "", argc > 5 ? argv[5] : ""};
  if (what == "facets") facets(masks, choice, false);
  if (what == "sweep") facets(masks, choice, true);
  if (what == "heights") heights(masks, choice);
  if (what == "smooth") smooth(masks, choice);
  if (what == "detail") detail(masks, choice);
}
