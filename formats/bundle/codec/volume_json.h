// SPDX-License-Identifier: Apache-2.0

// Grids, labels and tissues as JSON: the parts of a manifest that bundles and stage files share.
#pragma once

#include <vector>

#include "formats/text/json_reader.h"
#include "formats/volume/grid.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/tissue.h"

namespace sonocase::detail {

Json json_of(const Grid& grid);
Grid grid_from(JsonObject object);
Json json_of(const std::vector<Label>& labels);
std::vector<Label> labels_from(JsonObject& object, const char* key);
Json json_of(const std::vector<Tissue>& tissues);
std::vector<Tissue> tissues_from(JsonObject& object, const char* key);

}  // namespace sonocase::detail
