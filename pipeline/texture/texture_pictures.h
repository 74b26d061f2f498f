// SPDX-License-Identifier: Apache-2.0

// A page that lets the eye judge a solid texture beside its example.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "pipeline/texture/texture_quality.h"

namespace sonocase::pipeline {

// Example, cuts x-y, x-z and y-z and an oblique cut at the example's scale and size, so that each
// cut shows the texture wrapping round; histograms; autocorrelation along and across. PNG.
// Errors: those of the chart writer.
Status write_texture_page(const TextureAssessment& assessment, const std::string& path);

}  // namespace sonocase::pipeline
