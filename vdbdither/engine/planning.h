#pragma once

#include <memory>
#include <span>

#include "vdbdither/engine/job_plan.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/engine/stage.h"

namespace vdbdither {

/// Plans a chain without computing a voxel: plans the operators in order, then derives from the
/// end which grids and layers each stage must give, chooses the height of the slabs, and estimates
/// memory, time and disk. Throws UsageError or DataError for everything that can be refused now; a
/// job that does not fit into memory or onto the disk is refused unless `options.explain` is set.
JobPlan planJob(std::span<const std::unique_ptr<Stage>> stages, const RunOptions& options);

/// The plan of a run that makes only some layers of a job, estimates included.
/// \param whole   of all layers
/// \param layers  of the last stage
JobPlan planPiece(const JobPlan& whole, ZRange layers, const RunOptions& options);

}  // namespace vdbdither
