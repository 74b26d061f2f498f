// SPDX-License-Identifier: Apache-2.0

// The organ that an exercise is about, by whose grey a sonographer sets gain: neither the lesion,
// which is told from it, nor a vessel, whose blood is black, but the tissue that they lie in.
#pragma once

#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"

namespace sonocase {

// Which labels are the organ, # labels. Of each target, the label that it must lie in, if that is
// soft tissue and fills a fifth of the soft tissue within twice the target's radius and at least 20
// mm: liver, kidney, muscle. Otherwise (a vein, a lesion of the case) every label of soft tissue
// that fills a tenth of that. A thrombus is what fills a vein, and no organ. Without targets, the
// soft tissue that steps and items ask to be shown. All soft tissue where these give none. Cost: 30
// us per target.
std::vector<bool> organ_of_interest(const CaseBundle& bundle, const Exercise& exercise);

}  // namespace sonocase
