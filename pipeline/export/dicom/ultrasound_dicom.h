// SPDX-License-Identifier: Apache-2.0

// A film as DICOM: Ultrasound Multi-frame Image Storage (PS3.3 A.7), uncompressed, with the region
// calibration (C.8.5.5) that lets a viewer measure in it. Nobody's patient: the patient's name is
// that of the case.
//
// The same film gives the same bytes: identifiers are made from a hash of the pictures (2.25,
// PS3.5 B.2), and dates are those of the session.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "pipeline/export/dicom/ultrasound_film.h"

namespace sonocase::pipeline {

// Errors: the file cannot be written; more than 65535 pixels on a side.
Status write_ultrasound_dicom(const UltrasoundFilm& film, const std::string& path);

// The decimal form of 32 hex digits behind "2.25.", at most 64 characters.
std::string uid_from_hex(const std::string& hex);

}  // namespace sonocase::pipeline
