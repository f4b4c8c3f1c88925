#pragma once

#include <optional>
#include <string>

#include "vdbdither/model/footprint.h"

namespace vdbdither {

struct JobPlan;

/// The cost of an operator's computing: CPU time of one thread of the machine in
/// docs/performance.md.
struct Work {
  double us_per_surface_leaf = 0;  ///< microseconds for each leaf at the surface
  double us_per_held_leaf = 0;     ///< for each leaf, also those far from the surface
  double us_per_layer = 0;
  double seconds = 0;  ///< once, whatever the layers
};

/// Where the output of a sink goes, and its size.
struct OutputEstimate {
  std::string path;  ///< `-`: standard output; empty: no file
  double bytes = 0;  ///< about; 0 if unknown
};

/// The measured costs that operators put into `Work`, all in one place: they were measured together
/// (docs/performance.md) and must be measured again together.
namespace cost {

// Microseconds for each leaf.
inline constexpr double compare_us_per_grid = 3;
inline constexpr double compensate_us = 200;
inline constexpr double copies_us = 0.6;  ///< for each grid and copy
inline constexpr double csg_us = 14;
inline constexpr double diffusion_us = 14;
inline constexpr double dither_us = 6;
inline constexpr double dither_own_normals_us = 3;
inline constexpr double dither_plain_us = 2;  ///< without displacement
inline constexpr double halftone_us = 12;
inline constexpr double halftone_columns_us = 8;  ///< thresholds that follow the surface
inline constexpr double hollow_us = 6;
inline constexpr double info_us = 2;
inline constexpr double interlace_us = 1.6;
inline constexpr double material_shell_us = 9;
inline constexpr double material_us = 1;
inline constexpr double mesh2sdf_us = 2;
inline constexpr double mesh2sdf_closest_us = 2;
inline constexpr double mesh2sdf_colour_us = 14;
inline constexpr double mesh2sdf_normals_us = 8;
inline constexpr double mesh2sdf_us_per_triangle = 1.2;  ///< of those near the leaf
inline constexpr double normals_us = 4.7;
inline constexpr double offset_us = 5.5;
inline constexpr double refine_us = 20;
inline constexpr double refine_us_per_sweep = 100;
inline constexpr double resample_us = 400;
inline constexpr double separate_us = 30;
inline constexpr double simulate_colours_us = 150;
inline constexpr double simulate_us = 42;
inline constexpr double slice_export_us = 10;  ///< for each stack
inline constexpr double slice_import_us = 15;
inline constexpr double stats_us = 14;

// Microseconds for each layer.
inline constexpr double slice_export_us_per_layer = 200;  ///< for each stack
inline constexpr double slice_import_us_per_layer = 450;

// Microseconds for each byte that the leaves of the grids take in memory.
inline constexpr double compare_us_per_byte = 1e-3;
inline constexpr double read_us_per_byte = 1.4e-3;
inline constexpr double write_us_per_byte = 4e-3;

// Microseconds for each vertex of a surface.
inline constexpr double measure_us = 0.3;
inline constexpr double measure_us_per_point = 1.3;
inline constexpr double mesh_export_us = 0.1;  ///< besides writing, which is up to the format
inline constexpr double render_us = 1.4;
constexpr double smoothingUs(int iterations) { return 0.25 + 0.022 * iterations; }

// Microseconds for each voxel of a mask.
inline constexpr double mask_us = 0.025;
inline constexpr double mask_gradient_noise_us = 0.3;
inline constexpr double mask_void_and_cluster_us = 0.02;  ///< besides the search itself
inline constexpr double spectrum_us_per_facet = 5e-4;
inline constexpr double spectrum_us_per_transform = 2.5e-3;

// Microseconds for each triangle of a mesh and for each ray of a picture.
inline constexpr double measure_us_per_triangle = 2;
inline constexpr double render_us_per_ray = 1.1;

}  // namespace cost

/// CPU seconds of `work` on `layers` of the `all` layers that `footprint` counts; nothing if the
/// footprint is needed and unknown.
std::optional<double> cpuSeconds(const Work& work, const Footprint& footprint, int layers, int all);

/// Bytes of memory that the job takes with slabs of so many layers.
double memoryBytes(const JobPlan& plan, int slab_layers);

/// Seconds that the job takes on `plan.threads`; nothing if the cost of a stage is unknown.
std::optional<double> secondsOf(const JobPlan& plan);

/// Four fifths of the memory that is free now; infinite if the system does not tell.
double freeMemoryBytes();

/// The space that is left on the disk of `path`; infinite if the system does not tell.
double freeDiskBytes(const std::string& path);

}  // namespace vdbdither
