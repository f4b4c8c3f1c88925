// The stacks of the voxel printing of Objet and Connex printers, before GrabCAD: bitmaps of one bit
// for each material, and a text file that names them. Undocumented by Stratasys; after public
// scripts that write them.

#include <sstream>

#include "io/image/bmp.h"
#include "io/stack/container.h"
#include "io/stack/slice_format.h"
#include "vdbdither/engine/option_values.h"

namespace vdbdither {

namespace {

const SliceNames objet_names{"slice_", 4, 0};

class ObjetSlices : public SliceEncoder {
 public:
  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    return forEachMaterial(layer, ".bmp", [&](std::uint32_t material) {
      return encodeBmp(onlyValue(layer.image, material), pitchMm().x(), pitchMm().y());
    });
  }

  void finish(const Manifest& stack, const SpanImage& preview, StackOutput& output) const override {
    const PrinterProfile printer = printerOf(stack);
    std::ostringstream text;
    text << "[Build]\nFormat version = 1;\nLayer thickness = " << shortestText(pitchMm().z())
         << ";\nNumber of slices = " << stack.layers.size() << ";\n\n[Resin Type]\n";
    for (std::size_t i = 0; i < stack.materials.size(); ++i) {
      text << (i == 0 ? "Color" : "Resin" + std::to_string(i + 1)) << " = "
           << resinOf(stack.materials[i], printer) << ";\n";
    }
    text << "\n[Materials]\n";
    for (std::size_t i = 0; i < stack.materials.size(); ++i) {
      text << "Material" << i + 1 << " = " << stack.materials[i].name << "\\" << objet_names.prefix
           << std::string(objet_names.digits, 'x') << ".bmp;\n";
    }
    writeText(output, "print.txt", text.str());
    SliceEncoder::finish(stack, preview, output);
  }
};

}  // namespace

extern const SliceFormat objet;
const SliceFormat objet{.name = "objet",
                        .summary =
                            "For each material a folder of BMP with 1 bit per voxel, and "
                            "print.txt, as Objet and Connex printers took them",
                        .ending = ".bmp",
                        .pixel = SlicePixel::one_material,
                        .encoder = makeSliceEncoder<ObjetSlices>,
                        .decode = decodeBmp,
                        .bytes_per_leaf = 600,
                        .names = &objet_names,
                        .width_multiple = 32};

}  // namespace vdbdither
