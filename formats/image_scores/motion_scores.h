// SPDX-License-Identifier: Apache-2.0

// How much of the speckle two frames share.
#pragma once

#include "formats/image_scores/patch_scores.h"

namespace sonocase {

struct DetailMatch {
    double correlation = 0;      // best over the shifts, [-1, 1]; 0 where the detail is flat
    int samples = 0, lines = 0;  // shift of `after` against `before` there
};

// Best normalised correlation of the detail of a patch of `before` with that of `after`, shifted in
// the plane by up to `reach` samples and lines. Unrelated speckle gives 0.1 to 0.2, by chance and
// the search. Cost: (2 reach + 1)^2 times 5 microseconds.
DetailMatch match_detail(const BeamImage& before,
                         const BeamImage& after,
                         PatchPlace place,
                         int reach = 4);

}  // namespace sonocase
