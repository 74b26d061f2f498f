// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/truth_voxels.h"

#include <string>

#include "formats/volume/boundary_record.h"
#include "formats/volume/brick_volume.h"
#include "runtime/imaging/physical/model/region_look_up.h"

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

TruthVolume::TruthVolume(const BrickVolume<std::uint8_t>& labels,
                         const BrickVolume<std::uint32_t>& boundary)
    : labels_(labels), boundary_(boundary) {
    // At least one, so that a vector in which no brick is uniform has something to read.
    boundary_uniform_.assign(boundary.uniform.begin(), boundary.uniform.end());
    boundary_uniform_.push_back(kNoBoundary);
    for (const std::uint32_t record : boundary.uniform)
        plain_boundaries_ = plain_boundaries_ && record == kNoBoundary;
    bricks_.resize(labels.table.size());
    for (std::size_t n = 0; n < bricks_.size(); ++n) {
        const std::uint32_t entry = labels.table[n];
        if (!(entry & kUniformBrick)) {
            bricks_[n] = static_cast<std::int32_t>(entry);
            continue;
        }
        std::uint32_t word = kOneLabel | labels.uniform[entry & ~kUniformBrick];
        if (!boundary.table.empty()) {
            const std::uint32_t record = boundary.table[n];
            if (!(record & kUniformBrick) ||
                boundary.uniform[record & ~kUniformBrick] != kNoBoundary)
                word |= kHasSurface;
        }
        bricks_[n] = static_cast<std::int32_t>(word);
    }
}

void TruthVolume::fill(TruthFrameRows& f) const {
    f.bricks = bricks_.data();
    f.label_pool = words_of(labels_.pool);
    const bool surfaces = !boundary_.table.empty();
    f.boundary_table = surfaces ? words_of(boundary_.table) : nullptr;
    f.boundary_pool = surfaces ? words_of(boundary_.pool) : nullptr;
    f.boundary_uniform = plain_boundaries_ ? nullptr : words_of(boundary_uniform_);
    const Int3 bricks = brick_count(labels_.size);
    f.bricks_x = bricks.x;
    f.bricks_xy = bricks.x * bricks.y;
    for (int a = 0; a < 3; ++a) f.size[a] = labels_.size[a];
}

TruthVoxels::TruthVoxels(const CaseBundle& bundle, bool physical)
    : bundle_(&bundle), volume_(bundle.label_bricks, bundle.boundary) {
    // A palette has 255 entries at most; 256 let a look-up of any byte stay inside.
    constexpr std::size_t kBytes = 256;
    if (physical && bundle.region)
        region_.emplace(bundle.region->label_bricks, bundle.region->boundary);
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

void TruthVoxels::fill(TruthFrameRows& f, TruthFrameRows& region) const {
    volume_.fill(f);
    f.label_count = static_cast<std::int32_t>(bundle_->labels.size());
    f.swells = swells_.data();
    f.hard = hard_.data();
    f.region = nullptr;
    if (!region_) return;
    region_->fill(region);
    region.label_count = f.label_count;
    region.swells = f.swells;
    const RegionPlace place = region_place(*bundle_->region, bundle_->grid);
    for (int a = 0; a < 3; ++a) {
        f.region_lower[a] = static_cast<float>(place.lower_vx[a]);
        f.region_upper[a] = static_cast<float>(place.upper_vx[a]);
        f.region_first[a] = static_cast<float>(place.first[a]);
    }
    f.region_per_voxel = static_cast<float>(place.per_voxel);
    f.region = &region;
}

}  // namespace sonocase::runtime
