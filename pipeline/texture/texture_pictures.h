// SPDX-License-Identifier: Apache-2.0

// A page to compare a solid texture with its example by eye.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "pipeline/texture/texture_quality.h"

namespace sonocase::pipeline {

// Writes a PNG: the example; cuts x-y, x-z and z-y and an oblique cut at the scale of the example,
// larger than the texture's period; histograms; autocorrelation along and across.
// Error: those of the chart writer.
Status write_texture_page(const TextureAssessment& assessment, const std::string& path);

}  // namespace sonocase::pipeline
