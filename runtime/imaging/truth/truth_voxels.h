// SPDX-License-Identifier: Apache-2.0

// A bundle's voxels and labels as the kernels of truth_rows.h read them.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "runtime/imaging/truth/truth_rows.h"

namespace sonocase::runtime {

class TruthVoxels {
  public:
    // physical: bone and gas are hard; else what casts a shadow. The bundle must outlive this.
    TruthVoxels(const CaseBundle& bundle, bool physical);

    void fill(TruthFrameRows& rows) const;  // what belongs to the bundle and not to the frame

  private:
    void summarise_bricks();

    const CaseBundle* bundle_;
    std::vector<std::int32_t> swells_, hard_;
    std::vector<std::uint32_t> boundary_uniform_;
    std::vector<std::int32_t> bricks_;
    bool plain_boundaries_ = true;
};

}  // namespace sonocase::runtime
