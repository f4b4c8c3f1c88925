/// Reflectance of a block of voxels by a Monte Carlo walk of light through its materials.
///
///     g++ -std=c++20 -O3 -pthread monte_carlo.cpp -o monte_carlo
///     monte_carlo SCENE VOXELS
///
/// Wang, Jacques, Zheng: MCML, Computer Methods and Programs in Biomedicine 47, 1995 (weights,
/// Fresnel reflection at the surfaces, Henyey-Greenstein scattering), with free paths by the
/// tracking of Woodcock et al. (1965), which needs no boundaries between voxels. VOXELS holds a
/// byte for each voxel, x fastest, then y, then z upwards: the index of its material from 1. The
/// block repeats along x and y without end; light falls on its top. SCENE is a text of lines:
///
///     size X Y Z                    voxels
///     pitch_mm X Y Z
///     refractive_index N            inside; 1 outside
///     illumination normal|diffuse   diffuse: the same radiance from everywhere
///     photons N                     for each channel
///     seed N
///     material ABSORPTION SCATTERING ANISOTROPY ...   three numbers for each channel; coefficients
///     in 1/mm; in order
///
/// Prints a line for each channel: the reflectance without the light that the surface mirrors, its
/// standard error, the transmittance, its standard error. The result does not depend on the number
/// of threads. Exits with 1 if SCENE or VOXELS is not as described.

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <limits>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

struct Vector {
  double x = 0, y = 0, z = 0;
};

struct Optics {
  double absorption = 0;
  double scattering = 0;
  double anisotropy = 0;
};

struct Scene {
  std::array<int, 3> size{};
  std::array<double, 3> pitch_mm{};
  double refractive_index = 1.5;
  bool diffuse = false;
  std::int64_t photons = 100000;
  std::uint64_t seed = 1;
  std::vector<std::vector<Optics>> materials;
  std::vector<std::uint8_t> voxels;
};

/// xoshiro256++ of Blackman and Vigna (2018), seeded by splitmix64.
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) {
    std::uint64_t at = seed * 0x9e3779b97f4a7c15U + stream * 0xd1342543de82ef95U;
    for (std::uint64_t& word : state_) {
      at += 0x9e3779b97f4a7c15U;
      std::uint64_t mixed = (at ^ (at >> 30)) * 0xbf58476d1ce4e5b9U;
      mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111ebU;
      word = mixed ^ (mixed >> 31);
    }
  }

  /// Uniform in [0, 1).
  double uniform() {
    const std::uint64_t result = std::rotl(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = std::rotl(state_[3], 45);
    return static_cast<double>(result >> 11) * 0x1p-53;
  }

 private:
  std::array<std::uint64_t, 4> state_{};
};

/// The share of unpolarized light that a surface reflects; `cosine` to the normal, from index
/// `inside` to `outside`.
double fresnel(double cosine, double inside, double outside) {
  const double sine = inside / outside * std::sqrt(std::max(0.0, 1 - cosine * cosine));
  if (sine >= 1) return 1;
  const double through = std::sqrt(1 - sine * sine);
  const double s = (inside * cosine - outside * through) / (inside * cosine + outside * through);
  const double p = (inside * through - outside * cosine) / (inside * through + outside * cosine);
  return (s * s + p * p) / 2;
}

/// `direction` turned by the angle with `cosine` to a random side.
Vector turned(const Vector& direction, double cosine, Random& random) {
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  const double angle = 2 * std::numbers::pi * random.uniform();
  const double a = sine * std::cos(angle);
  const double b = sine * std::sin(angle);
  const Vector& d = direction;
  const double flat = std::sqrt(std::max(0.0, 1 - d.z * d.z));
  if (flat < 1e-6) return {a, b, d.z > 0 ? cosine : -cosine};
  return {a * (d.x * d.z) / flat - b * d.y / flat + d.x * cosine,
          a * (d.y * d.z) / flat + b * d.x / flat + d.y * cosine, -a * flat + d.z * cosine};
}

double henyeyGreenstein(double anisotropy, Random& random) {
  if (std::abs(anisotropy) < 1e-6) return 2 * random.uniform() - 1;
  const double g = anisotropy;
  const double part = (1 - g * g) / (1 - g + 2 * g * random.uniform());
  return std::clamp((1 + g * g - part * part) / (2 * g), -1.0, 1.0);
}

/// What leaves through the top and the bottom, as shares of the light that falls on the top.
struct Light {
  double reflected = 0;
  double transmitted = 0;
};

/// The walks of one channel.
class Walk {
 public:
  Walk(const Scene& scene, std::size_t channel) : scene_(scene) {
    for (const auto& material : scene.materials) optics_.push_back(material[channel]);
    for (const std::uint8_t index : scene.voxels) {
      const Optics& optics = optics_[index - 1U];
      majorant_ = std::max(majorant_, optics.absorption + optics.scattering);
    }
    for (std::size_t axis = 0; axis < 3; ++axis)
      extent_[axis] = scene.size[axis] * scene.pitch_mm[axis];
  }

  /// Sends one photon.
  [[nodiscard]] Light photon(Random& random) const {
    const double outside_cosine = scene_.diffuse ? std::sqrt(1 - random.uniform()) : 1;
    const double n = scene_.refractive_index;
    double weight = 1 - fresnel(outside_cosine, 1, n);
    const double sine = std::sqrt(1 - outside_cosine * outside_cosine) / n;
    const double angle = 2 * std::numbers::pi * random.uniform();
    Vector direction{sine * std::cos(angle), sine * std::sin(angle), -std::sqrt(1 - sine * sine)};
    Vector at{random.uniform() * extent_[0], random.uniform() * extent_[1], extent_[2]};
    Light light;
    while (weight > 0) {
      const double free_path = -std::log(1 - random.uniform()) / majorant_;
      const double edge = direction.z > 0 ? extent_[2] : 0;
      const double to_edge =
          direction.z == 0 ? std::numeric_limits<double>::infinity() : (edge - at.z) / direction.z;
      const double path = std::min(free_path, to_edge);
      at = {wrapped(at.x + path * direction.x, extent_[0]),
            wrapped(at.y + path * direction.y, extent_[1]), at.z + path * direction.z};
      if (to_edge <= free_path) {
        const double kept = fresnel(std::abs(direction.z), n, 1);
        (direction.z > 0 ? light.reflected : light.transmitted) += weight * (1 - kept);
        weight *= kept;
        at.z = edge;
        direction.z = -direction.z;
      } else {
        collide(at, direction, weight, random);
        continue;
      }
      roulette(weight, random);
    }
    return light;
  }

 private:
  static double wrapped(double value, double extent) {
    return value - extent * std::floor(value / extent);
  }

  /// Light ways that hardly count end at random, which keeps the mean.
  static void roulette(double& weight, Random& random) {
    constexpr double least = 0.02;
    constexpr double chance = 0.1;
    if (weight < least) weight = random.uniform() < chance ? weight / chance : 0;
  }

  void collide(const Vector& at, Vector& direction, double& weight, Random& random) const {
    const auto index = [&](double place, std::size_t axis) {
      return std::min(static_cast<int>(place / scene_.pitch_mm[axis]), scene_.size[axis] - 1);
    };
    const auto flat = (static_cast<std::size_t>(index(at.z, 2)) * scene_.size[1] + index(at.y, 1)) *
                          scene_.size[0] +
                      index(at.x, 0);
    const Optics& optics = optics_[scene_.voxels[flat] - 1U];
    const double total = optics.absorption + optics.scattering;
    if (random.uniform() * majorant_ >= total) return;  // no collision in this material
    weight *= optics.scattering / total;
    direction = turned(direction, henyeyGreenstein(optics.anisotropy, random), random);
    roulette(weight, random);
  }

  const Scene& scene_;
  std::vector<Optics> optics_;
  double majorant_ = 1e-9;
  std::array<double, 3> extent_{};
};

struct Result {
  double mean = 0;
  double error = 0;
};

/// The mean of equal batches, and its standard error from their spread.
Result resultOf(const std::vector<Light>& batches, double Light::*part) {
  double sum = 0;
  for (const Light& batch : batches) sum += batch.*part;
  const double count = static_cast<double>(batches.size());
  const double mean = sum / count;
  double squares = 0;
  for (const Light& batch : batches) squares += (batch.*part - mean) * (batch.*part - mean);
  return {mean, std::sqrt(squares / (count * (count - 1)))};
}

std::vector<Light> batchesOf(const Scene& scene, std::size_t channel) {
  constexpr std::size_t batch_count = 100;
  const Walk walk(scene, channel);
  const std::int64_t each = (scene.photons + batch_count - 1) / batch_count;
  std::vector<Light> batches(batch_count);
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < batch_count; i = next++) {
      Random random(scene.seed, channel * batch_count + i);
      Light sum;
      for (std::int64_t photon = 0; photon < each; ++photon) {
        const Light light = walk.photon(random);
        sum.reflected += light.reflected;
        sum.transmitted += light.transmitted;
      }
      batches[i] = {sum.reflected / static_cast<double>(each),
                    sum.transmitted / static_cast<double>(each)};
    }
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 0; i < std::max(1U, std::thread::hardware_concurrency()); ++i)
    threads.emplace_back(work);
  threads.clear();
  return batches;
}

void readMaterial(std::istream& words, Scene& scene) {
  std::vector<Optics>& channels = scene.materials.emplace_back();
  Optics optics;
  while (words >> optics.absorption >> optics.scattering >> optics.anisotropy) {
    if (!(optics.absorption >= 0 && optics.scattering >= 0 && std::abs(optics.anisotropy) < 1))
      throw std::runtime_error(
          "coefficients must not be negative, and anisotropies lie between -1 and 1");
    if (optics.absorption + optics.scattering == 0) optics.scattering = 1e-9;
    channels.push_back(optics);
  }
  words.clear();
  if (channels.empty() || channels.size() != scene.materials.front().size())
    throw std::runtime_error("each material needs three numbers for each channel");
}

Scene readScene(const std::string& scene_path, const std::string& voxel_path) {
  std::ifstream text(scene_path);
  Scene scene;
  for (std::string line; std::getline(text, line);) {
    std::istringstream words(line);
    std::string key;
    std::string kind;
    if (!(words >> key)) continue;
    if (key == "size") {
      words >> scene.size[0] >> scene.size[1] >> scene.size[2];
    } else if (key == "pitch_mm") {
      words >> scene.pitch_mm[0] >> scene.pitch_mm[1] >> scene.pitch_mm[2];
    } else if (key == "refractive_index") {
      words >> scene.refractive_index;
    } else if (key == "illumination") {
      words >> kind;
      scene.diffuse = kind == "diffuse";
      if (!scene.diffuse && kind != "normal") words.setstate(std::ios::failbit);
    } else if (key == "photons") {
      words >> scene.photons;
    } else if (key == "seed") {
      words >> scene.seed;
    } else if (key == "material") {
      readMaterial(words, scene);
    } else {
      throw std::runtime_error("'" + key + "' means nothing here");
    }
    if (!words) throw std::runtime_error("the line '" + line + "' is not as described");
  }
  std::ifstream bytes(voxel_path, std::ios::binary);
  scene.voxels.assign(std::istreambuf_iterator<char>(bytes), {});
  const auto [x, y, z] = scene.size;
  if (x < 1 || y < 1 || z < 1 || std::int64_t{x} * y * z != std::ssize(scene.voxels))
    throw std::runtime_error("the voxels are not as many as the size says");
  if (*std::ranges::min_element(scene.pitch_mm) <= 0 || scene.refractive_index < 1 ||
      scene.photons < 1)
    throw std::runtime_error(
        "pitch and photons must be above 0, and the refractive index at least 1");
  const auto known = [&](std::uint8_t index) {
    return index > 0 && index <= scene.materials.size();
  };
  if (!std::ranges::all_of(scene.voxels, known))
    throw std::runtime_error("a voxel has a material that is not described");
  return scene;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) {
    std::fputs("usage: monte_carlo SCENE VOXELS\n", stderr);
    return 2;
  }
  try {
    const Scene scene = readScene(arguments[1], arguments[2]);
    for (std::size_t channel = 0; channel < scene.materials.front().size(); ++channel) {
      const std::vector<Light> batches = batchesOf(scene, channel);
      const Result reflected = resultOf(batches, &Light::reflected);
      const Result transmitted = resultOf(batches, &Light::transmitted);
      std::printf("%.9f %.9f %.9f %.9f\n", reflected.mean, reflected.error, transmitted.mean,
                  transmitted.error);
    }
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "monte_carlo: %s\n", problem.what());
    return 1;
  }
  return 0;
}
