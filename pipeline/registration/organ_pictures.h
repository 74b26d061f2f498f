// SPDX-License-Identifier: Apache-2.0

// What a fit does to the patient's organs: three axial cuts before and after, and a table.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface.h"
#include "pipeline/registration/elastic/organ_change.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration {

// Writes fit_organs.png into the folder, which exists. Left: the patient laid on the mannequin
// rigidly; middle: through the map; each with outlines of the structures and the mannequin's
// readings near the cut. Skin farther than 20 mm from any reading is drawn as not fitted. Right:
// the volume of each structure before and after, and the change of its shape. Needs no display.
// Errors: a folder that cannot be written. Cost: 0.3 s.
Status write_organ_pictures(const LabelVolume& labels,
                            const Surface& mannequin,
                            const Registration& registration,
                            const std::vector<OrganChange>& changes,
                            const std::string& folder);

}  // namespace sonocase::pipeline::inline registration
