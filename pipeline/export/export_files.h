// SPDX-License-Identifier: Apache-2.0

// A bundle's parts as files that other tools open.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"

namespace sonocase::pipeline::inline exporting {

// A surface as binary PLY in mm, with float coordinates; normals and triangles where the surface
// has them.
std::vector<std::uint8_t> ply_file(const Surface& surface, const std::string& comment);

// Writes into `folder`, which is created: labels.seg.nrrd with Slicer's segments, echo-offset.nrrd,
// boundary.nrrd, textures/NAME.nrrd, patient-skin.ply, mannequin.ply, preview.png, case.toml, the
// exercises, manifest.json. Returns the names written, in that order.
Result<std::vector<std::string>> export_case(const CaseBundle& bundle, const std::string& folder);

}  // namespace sonocase::pipeline::inline exporting
