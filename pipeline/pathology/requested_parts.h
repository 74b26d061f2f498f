// SPDX-License-Identifier: Apache-2.0

// What the requests of a recipe need of the table of kinds.
#pragma once

#include <span>
#include <vector>

#include "formats/pathology/pathology_kinds.h"
#include "pipeline/pathology/pathology.h"

namespace sonocase::pipeline {

// The tissues that these requests need and that the table lacks, once each.
std::vector<Tissue> pathology_tissues(std::span<const PathologyRequest> requests);

// Thickness, count or share of a part: the request's, else the kind's. 0: the part is left out.
double part_size(const PathologyRequest& request, const LesionPart& part);

}  // namespace sonocase::pipeline
