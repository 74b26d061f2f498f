// SPDX-License-Identifier: Apache-2.0

// Labels as a .seg.nrrd that 3D Slicer opens as a segmentation, with names and colours.
#pragma once

#include <map>
#include <string>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline {

// Slicer's header fields: one segment per label, all in one layer and with its extent. Labels
// without a colour get one of their own.
// Source: 3D Slicer, developer guide, "Segmentation labelmap file format (.seg.nrrd)".
std::map<std::string, std::string> seg_nrrd_fields(const LabelVolume& volume);

// One 8-bit layer, gzip inside; a label's value is its palette index. The volume's frame is written
// as right-anterior-superior, so that reading the file back gives the same coordinates. Same
// volume, same bytes.
Status export_seg_nrrd(const LabelVolume& volume, const std::string& path);

}  // namespace sonocase::pipeline
