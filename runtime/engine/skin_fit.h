// SPDX-License-Identifier: Apache-2.0

// Where the patient's skin was not fitted: no reading of the mannequin lies near, so that the body
// under it is a guess.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime {

class SkinFit {
  public:
    SkinFit() = default;  // everything is fitted
    // Of CaseBundle::skin_unfitted. Cost: one pass over the skin's points.
    explicit SkinFit(const CaseBundle& bundle);

    // True where most skin points within some 18 mm of a place, frame `mannequin`, were not fitted.
    // Where there is no skin the answer is false. Constant time, no allocation.
    bool not_fitted(Point3 p) const;

  private:
    Point3 lower_;
    Int3 size_{0, 0, 0};              // cells
    std::vector<std::int32_t> vote_;  // of each cell: unfitted points less fitted ones
};

}  // namespace sonocase::runtime
