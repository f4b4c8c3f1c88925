#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/stack/container.h"
#include "io/stack/slice_format.h"

namespace vdbdither {

/// Slices for printers that light a resin through a display: 255 where it hardens, else 0. Or grey
/// levels, see greySlice.
class ResinSlices : public SliceEncoder {
 public:
  /// @param folder  of the slices within the container, with a '/' at its end
  explicit ResinSlices(std::string_view format, std::string_view folder = "")
      : format_(format), folder_(folder) {}

  void declare(Options& options) override;
  void plan(const Manifest& stack, const Grids& grids) override;
  [[nodiscard]] std::vector<std::string> reads() const override;
  /// A print that began with a blank layer would not stick to its plate.
  [[nodiscard]] bool keepsBlank() const override { return false; }
  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override;

 protected:
  [[nodiscard]] const PrinterProfile& printer() const { return printer_; }
  [[nodiscard]] double exposureSeconds() const { return exposure_s_; }
  [[nodiscard]] double bottomExposureSeconds() const { return bottom_exposure_s_; }
  [[nodiscard]] int bottomLayers() const { return bottom_layers_; }

 private:
  std::string format_;
  std::string folder_;
  PrinterProfile printer_;
  double exposure_s_ = 2.5;
  double bottom_exposure_s_ = 30;
  int bottom_layers_ = 5;
  bool grey_ = false;
  std::optional<double> dose_;
};

/// Warns of pictures that a container lacks, which printers and programs show in lists.
void tellMissingPictures(const StackInput& files, std::span<const char* const> names,
                         Findings& findings);

/// The resin of the slices of a container.
inline MaterialTable resinTable() { return {{"solid", {240, 240, 240, 255}}}; }

}  // namespace vdbdither
