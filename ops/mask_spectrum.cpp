#include <algorithm>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "io/file/staged_output.h"
#include "io/file/text_bytes.h"
#include "ops/kernels/mask/slice_spectrum.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;
using openvdb::Coord;

class MaskSpectrum : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("file", file_, "JSON file to write");
    options.lengths("pitch", pitch_mm_, "DX,DY,DZ", Range::above(0, 1e6),
                    "Pitch of the lattice that the mask is meant for; only its proportions count");
    options.number(
        "step", step_degrees_, {0.5, 45},
        "Step of the polar and azimuthal angle of the facets for projections, in degrees");
    options.number("plane-step", plane_step_degrees_, {0.5, 45},
                   "The same for voxel planes, in degrees");
    options.integer("levels", levels_, {0, 99},
                    "Number of evenly spaced thresholds at which the thresholded mask is measured");
    overwrite_.declare(options, "the file");
  }

  void plan(const Schema& in) override {
    findGrid<openvdb::FloatGrid>(in.grids, mask_grid);
    box_ = in.lattice.box;
    if (box_.empty()) throw DataError("there is no mask to look at: the lattice has no voxels");
    for (int axis = 0; axis < 3; ++axis) {
      if (box_.dim()[axis] > 256) {
        throw DataError("the mask is " + std::to_string(box_.dim()[axis]) +
                        " voxels long; tiles of up to 256 are looked at");
      }
    }
    StagedOutput::check(file_, StagedOutput::Kind::file, overwrite_.overwrite);
    values_.assign(box_.volume(), 0.0f);
  }

  [[nodiscard]] double memoryBytes() const override {
    return static_cast<double>(box_.volume()) * (4 + 16 + 8.0 * (levels_ + 1));
  }

  [[nodiscard]] std::optional<Work> work() const override {
    const Coord size = box_.dim();
    const auto voxels = static_cast<double>(box_.volume());
    const double spectra = levels_ + 1;
    const double transforms_us =
        cost::spectrum_us_per_transform * spectra * voxels * (size.x() + size.y() + size.z());
    // Half of the frequencies are looked at, the others mirror them; of a voxel plane in 13 copies.
    const auto projected = static_cast<double>(normalsOfHalfSphere(step_degrees_).size());
    const auto planes = static_cast<double>(normalsOfHalfSphere(plane_step_degrees_).size() +
                                            normalsNearAxes().size());
    const double facets_us =
        cost::spectrum_us_per_facet * voxels * (projected + 13 * planes) * (8 + 0.8 * spectra);
    return Work{.seconds = 1e-6 * (transforms_us + facets_us)};
  }

  void write(const Slab& in) override {
    const auto grid = findGrid<openvdb::FloatGrid>(in.grids, mask_grid);
    if (!metadata_) metadata_ = grid->copyMeta();
    for (auto voxel = grid->cbeginValueOn(); voxel; ++voxel) {
      openvdb::CoordBBox where;
      voxel.getBoundingBox(where);
      where.intersect(box_);
      for (auto at = where.begin(); at; ++at) {
        if (in.core.contains((*at).z())) values_[index(*at)] = *voxel;
      }
    }
  }

  void finish() override {
    if (!metadata_) throw DataError("no layer of a mask came");
    const std::string text = jsonText(spectra(), 1) + "\n";
    output_.emplace(file_, StagedOutput::Kind::file);
    writeFile(output_->path(), textBytes(text), file_);
    output_->complete();
  }

  void publish() override {
    output_->commit();
    output_.reset();
  }

 private:
  [[nodiscard]] std::size_t index(const Coord& at) const {
    const Coord size = box_.dim();
    const Coord from = at - box_.min();
    return from.x() + static_cast<std::size_t>(size.x()) *
                          (from.y() + static_cast<std::size_t>(size.y()) * from.z());
  }

  /// The mask itself, then thresholded.
  [[nodiscard]] std::vector<PowerSpectrum> powerSpectra() const {
    const auto [least, greatest] = std::minmax_element(values_.begin(), values_.end());
    if (*least == *greatest) throw DataError("the mask is constant: it has no spectrum");
    std::vector<PowerSpectrum> spectra{powerSpectrum(values_, box_.dim())};
    for (int level = 1; level <= levels_; ++level) {
      std::vector<float> above;
      for (const float value : values_) above.push_back(value > kappa(level) ? 1.0f : 0.0f);
      spectra.push_back(powerSpectrum(above, box_.dim()));
    }
    return spectra;
  }

  [[nodiscard]] double kappa(int level) const { return static_cast<double>(level) / (levels_ + 1); }

  static ordered_json json(const FacetSummary& facets) {
    return {{"mean", facets.mean},
            {"greatest", facets.maximum},
            {"low_mean", facets.low_mean},
            {"low_worst", facets.low_worst},
            {"worst_normal",
             {facets.worst_normal.x(), facets.worst_normal.y(), facets.worst_normal.z()}}};
  }

  [[nodiscard]] ordered_json spectra() const {
    const std::vector<PowerSpectrum> power = powerSpectra();
    const SliceSpectra projections(power, pitch_mm_, SliceModel::projection);
    const SliceSpectra planes(power, pitch_mm_, SliceModel::voxel_plane);
    const auto part = [this](double begin, double end) {
      return [this, begin, end](double fraction) {
        report().progress(begin + (end - begin) * fraction);
      };
    };
    const auto projected = summary(projections, normalsOfHalfSphere(step_degrees_), part(0, 0.5));
    const auto printed = summary(planes, normalsOfHalfSphere(plane_step_degrees_), part(0.5, 0.9));
    const auto near_axes = summary(planes, normalsNearAxes(), part(0.9, 1));

    ordered_json result;
    const Coord size = box_.dim();
    result["size"] = {size.x(), size.y(), size.z()};
    for (auto item = metadata_->beginMeta(); item != metadata_->endMeta(); ++item) {
      if (item->first.rfind("mask:", 0) == 0) result[item->first] = item->second->str();
    }
    result["pitch_mm"] = {pitch_mm_.x(), pitch_mm_.y(), pitch_mm_.z()};
    result["step_degrees"] = step_degrees_;
    result["plane_step_degrees"] = plane_step_degrees_;
    result["bands"] = band_count;
    result["low_bands"] = low_bands;
    for (int level = 0; level <= levels_; ++level) {
      ordered_json of{{"projection", json(projected[level])},
                      {"voxel_plane", json(printed[level])},
                      {"voxel_plane_near_axes", json(near_axes[level])}};
      if (level == 0) {
        result["grey"] = of;
      } else {
        of["kappa"] = kappa(level);
        result["thresholded"].push_back(of);
      }
    }
    return result;
  }

  std::string file_;
  openvdb::Vec3d pitch_mm_{1, 1, 1};
  double step_degrees_ = 1;
  double plane_step_degrees_ = 5;
  int levels_ = 9;
  OverwriteOption overwrite_;
  openvdb::CoordBBox box_;
  openvdb::MetaMap::Ptr metadata_;
  std::vector<float> values_;
  std::optional<StagedOutput> output_;
};

}  // namespace

extern const OperatorInfo mask_spectrum{
    "mask-spectrum", "Measures the spectra of the planar slices of a mask",
    "mask --size 16 ! mask-spectrum --step 10 --plane-step 15 mask.json",
    []() -> std::unique_ptr<Operator> { return std::make_unique<MaskSpectrum>(); }};

}  // namespace vdbdither
