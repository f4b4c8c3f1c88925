#include <cmath>

#include <benchmark/benchmark.h>

#include "ops/kernels/mask/void_and_cluster.h"

namespace vdbdither {
namespace {

/// Weights that a rank touches.
double support(const VoidAndCluster& mask) {
  const ToroidalKernel kernel(mask.kernel, mask.size);
  const double smallest = std::max(smallestWeight(mask.size), std::ldexp(1.0, -41));
  double count = 0;
  for (int z = 0; z < mask.size.z(); ++z) {
    for (int y = 0; y < mask.size.y(); ++y) {
      for (int x = 0; x < mask.size.x(); ++x) count += std::abs(kernel(x, y, z)) >= smallest;
    }
  }
  return count;
}

void makeMask(benchmark::State& state, MaskKernel::Shape shape, InstructionSet instructions) {
  VoidAndCluster mask;
  const auto size = static_cast<int>(state.range(0));
  const double sigma = static_cast<double>(state.range(1)) / 10;
  mask.size = {size, size, size};
  mask.kernel.shape = shape;
  mask.kernel.sigma = {sigma, sigma, sigma};
  const double ranks = std::pow(size, 3);
  for (auto _ : state) benchmark::DoNotOptimize(voidAndCluster(mask, {}, instructions));
  state.counters["ranks"] = ranks;
  state.counters["support"] = support(mask);
  state.counters["per_rank"] =
      benchmark::Counter(ranks * static_cast<double>(state.iterations()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void sizesAndSigmas(benchmark::internal::Benchmark* run) {
  run->ArgNames({"size", "sigma_tenths"})->Unit(benchmark::kSecond)->Iterations(1);
  for (const int size : {16, 32, 48, 64, 96, 128}) run->Args({size, 11});
  for (const int sigma : {5, 8, 15, 19, 25, 31}) run->Args({64, sigma});
}

using Shape = MaskKernel::Shape;
const InstructionSet best = bestInstructionSet();
constexpr InstructionSet baseline = InstructionSet::baseline;
BENCHMARK_CAPTURE(makeMask, gauss_best, Shape::gauss, best)->Apply(sizesAndSigmas);
BENCHMARK_CAPTURE(makeMask, gauss_baseline, Shape::gauss, baseline)->Apply(sizesAndSigmas);
BENCHMARK_CAPTURE(makeMask, peters_best, Shape::peters, best)->Apply(sizesAndSigmas);
BENCHMARK_CAPTURE(makeMask, peters_baseline, Shape::peters, baseline)->Apply(sizesAndSigmas);

}  // namespace
}  // namespace vdbdither

BENCHMARK_MAIN();
