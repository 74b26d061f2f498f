// SPDX-License-Identifier: Apache-2.0

// Elements of a DICOM header, and where the frames of an object lie: by the functional groups of a
// multi-frame object, by its own elements where it has none. Only for .cpp files of this folder
// that include GDCM. Elements that are missing or damaged give an empty text or 0.
#pragma once

#include <string>
#include <vector>

#include <gdcmDataSet.h>
#include <gdcmSequenceOfItems.h>

#include "pipeline/import/volume/dicom_series.h"

namespace sonocase::pipeline::inline import_volume {

std::string text_of(const gdcm::DataSet& set, const gdcm::Tag& tag);  // without padding
int short_of(const gdcm::DataSet& set, const gdcm::Tag& tag);         // of 16 bits
int whole_of(const gdcm::DataSet& set, const gdcm::Tag& tag);         // text of 1 .. 1e6; else 0

// The items of a sequence; null where there is none.
using DicomItems = gdcm::SmartPointer<gdcm::SequenceOfItems>;
DicomItems items_of(const gdcm::DataSet& set, const gdcm::Tag& tag);

// The place of each of the object's frames. Frames that lack a position or an orientation are not
// placed, and one whose numbers are damaged or not finite says which in `fault`.
std::vector<DicomFrame> frames_of(const gdcm::DataSet& set, int frames);

}  // namespace sonocase::pipeline::inline import_volume
