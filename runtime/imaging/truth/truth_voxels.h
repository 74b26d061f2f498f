// SPDX-License-Identifier: Apache-2.0

// A bundle's voxels and labels as the kernels of truth_rows.h read them.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "runtime/imaging/truth/truth_rows.h"

namespace sonocase::runtime {

// Labels and surfaces of one volume.
class TruthVolume {
  public:
    TruthVolume(const BrickVolume<std::uint8_t>& labels,
                const BrickVolume<std::uint32_t>& boundary);

    void fill(TruthFrameRows& rows) const;

  private:
    const BrickVolume<std::uint8_t>& labels_;
    const BrickVolume<std::uint32_t>& boundary_;
    std::vector<std::uint32_t> boundary_uniform_;
    std::vector<std::int32_t> bricks_;
    bool plain_boundaries_ = true;
};

class TruthVoxels {
  public:
    // physical: bone and gas are hard; else what casts a shadow. The bundle must outlive this.
    TruthVoxels(const CaseBundle& bundle, bool physical);

    // What belongs to the bundle and not to the frame. region: rows.region points to it where model
    // `physical` shows a fine region.
    void fill(TruthFrameRows& rows, TruthFrameRows& region) const;

  private:
    const CaseBundle* bundle_;
    std::vector<std::int32_t> swells_, hard_;
    TruthVolume volume_;
    std::optional<TruthVolume> region_;
};

}  // namespace sonocase::runtime
