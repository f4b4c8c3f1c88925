#include "tests/support/threemf_files.h"

#include <array>
#include <fstream>
#include <iterator>
#include <minizip/zip.h>
#include <stdexcept>

#include "tests/support/scratch_folder.h"

namespace vdbdither::test {

std::string zipOf(const Members& members) {
  const ScratchFolder scratch;
  const auto path = scratch / "a.zip";
  void* zip = zipOpen64(path.c_str(), APPEND_STATUS_CREATE);
  for (const auto& [name, text] : members) {
    const zip_fileinfo information{};
    if (zipOpenNewFileInZip64(zip, name.c_str(), &information, nullptr, 0, nullptr, 0, nullptr,
                              Z_DEFLATED, 9, 0) != ZIP_OK ||
        zipWriteInFileInZip(zip, text.data(), static_cast<unsigned>(text.size())) != ZIP_OK ||
        zipCloseFileInZip(zip) != ZIP_OK)
      throw std::runtime_error("no zip archive");
  }
  zipClose(zip, nullptr);
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string threemfOf(const std::string& model, const Members& more) {
  Members members{
      {"_rels/.rels",
       "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
       "<Relationship Id=\"r0\" Target=\"/3D/3dmodel.model\" "
       "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>"},
      {"3D/3dmodel.model", model}};
  members.insert(members.end(), more.begin(), more.end());
  return zipOf(members);
}

std::string threemfModel(const std::string& resources, const std::string& build,
                         const std::string& attributes) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model "
         "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
         "xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\" "
         "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" "
         "xmlns:b=\"http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02\" "
         "xmlns:other=\"http://example.com/other\" " +
         attributes + "><resources>" + resources + "</resources><build>" + build +
         "</build></model>";
}

std::string threemfCorner(const std::vector<std::string>& triangle_attributes) {
  constexpr std::array corners{"v1=\"0\" v2=\"2\" v3=\"1\"", "v1=\"0\" v2=\"1\" v3=\"3\"",
                               "v1=\"1\" v2=\"2\" v3=\"3\"", "v1=\"0\" v2=\"3\" v3=\"2\""};
  std::string triangles;
  for (std::size_t t = 0; t < corners.size(); ++t) {
    const std::string more = t < triangle_attributes.size() ? " " + triangle_attributes[t] : "";
    triangles += "<triangle " + std::string(corners.at(t)) + more + "/>";
  }
  return "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>"
         "<vertex x=\"0\" y=\"1\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"1\"/></vertices>"
         "<triangles>" +
         triangles + "</triangles></mesh>";
}

}  // namespace vdbdither::test
