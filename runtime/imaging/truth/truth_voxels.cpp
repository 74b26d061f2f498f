// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_voxels.h"

#include <string>

#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"

namespace sonocase::runtime {
namespace {

bool is_artery(const std::string& name) {  // as model `physical` has it
    return name.find("aorta") != std::string::npos || name.find("arter") != std::string::npos;
}

template <class T>
const std::int32_t* words_of(const T& values) {
    return reinterpret_cast<const std::int32_t*>(values.data());
}

}  // namespace

TruthVoxels::TruthVoxels(const CaseBundle& bundle, bool physical) : bundle_(&bundle) {
    // A palette has 255 entries at most; 256 let a look-up of any byte stay inside.
    constexpr std::size_t kBytes = 256;
    // At least one, so that a vector in which no brick is uniform has something to read.
    boundary_uniform_.assign(bundle.boundary.uniform.begin(), bundle.boundary.uniform.end());
    boundary_uniform_.push_back(kNoBoundary);
    summarise_bricks();
    swells_.assign(kBytes, 0);
    hard_.assign(kBytes, 0);
    const std::vector<int> tissues = tissue_of_label(bundle);
    for (std::size_t i = 0; i < bundle.labels.size(); ++i) {
        const Tissue& tissue = bundle.tissues[static_cast<std::size_t>(tissues[i])];
        swells_[i] = is_artery(bundle.labels[i].name);
        hard_[i] = physical ? tissue.kind == TissueKind::bone || tissue.kind == TissueKind::gas
                            : tissue.casts_shadow;
    }
}

void TruthVoxels::summarise_bricks() {
    const auto& labels = bundle_->label_bricks;
    const auto& surfaces = bundle_->boundary;
    for (const std::uint32_t record : surfaces.uniform)
        plain_boundaries_ = plain_boundaries_ && record == kNoBoundary;
    bricks_.resize(labels.table.size());
    for (std::size_t n = 0; n < bricks_.size(); ++n) {
        const std::uint32_t entry = labels.table[n];
        if (!(entry & kUniformBrick)) {
            bricks_[n] = static_cast<std::int32_t>(entry);
            continue;
        }
        std::uint32_t word = kOneLabel | labels.uniform[entry & ~kUniformBrick];
        if (!surfaces.table.empty()) {
            const std::uint32_t record = surfaces.table[n];
            if (!(record & kUniformBrick) ||
                surfaces.uniform[record & ~kUniformBrick] != kNoBoundary)
                word |= kHasSurface;
        }
        bricks_[n] = static_cast<std::int32_t>(word);
    }
}

void TruthVoxels::fill(TruthFrameRows& f) const {
    const CaseBundle& b = *bundle_;
    f.bricks = bricks_.data();
    f.label_pool = words_of(b.label_bricks.pool);
    const bool surfaces = !b.boundary.table.empty();
    f.boundary_table = surfaces ? words_of(b.boundary.table) : nullptr;
    f.boundary_pool = surfaces ? words_of(b.boundary.pool) : nullptr;
    f.boundary_uniform = plain_boundaries_ ? nullptr : words_of(boundary_uniform_);
    const Int3 bricks = brick_count(b.grid.size);
    f.bricks_x = bricks.x;
    f.bricks_xy = bricks.x * bricks.y;
    f.label_count = static_cast<std::int32_t>(b.labels.size());
    f.swells = swells_.data();
    f.hard = hard_.data();
}

}  // namespace sonocase::runtime
