// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/region_look_up.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sonocase::runtime {

RegionPlace region_place(const FineRegion& region, const Grid& case_grid) {
    RegionPlace place;
    const double voxel_mm = region.grid.spacing_mm.x;
    place.lower_vx = case_grid.voxel_from_point(region.box.lower);
    place.upper_vx = case_grid.voxel_from_point(region.box.upper);
    place.per_voxel = case_grid.spacing_mm.x / voxel_mm;
    place.first = (case_grid.origin_mm - region.grid.origin_mm) / voxel_mm;
    return place;
}

namespace {

// Limits, in voxels along each axis, of a look-up's random step (two steps of kLookupJitter at
// right angles, at the 4 deviations that noise has at most), and of the step with rounding.
constexpr double kStepVx = 2.3, kLookUpVx = 2.8;

std::size_t brick_number(Int3 bricks, Int3 b) {
    return b.x + bricks.x * (b.y + bricks.y * static_cast<std::size_t>(b.z));
}

// The label of a brick that holds nothing else; negative where it holds more, or a surface.
int plain_label(const BrickVolume<std::uint8_t>& labels,
                const BrickVolume<std::uint32_t>& boundary,
                std::size_t brick) {
    const std::uint32_t entry = labels.table[brick];
    if (!(entry & kUniformBrick)) return -1;
    if (!boundary.table.empty() && !(boundary.table[brick] & kUniformBrick)) return -1;
    return labels.uniform[entry & ~kUniformBrick];
}

struct BrickRange {
    Int3 first, last;
};

// Bricks of a volume that hold voxels within [low, high].
BrickRange bricks_within(Int3 bricks, Point3 low, Point3 high) {
    BrickRange range;
    for (int a = 0; a < 3; ++a) {
        const auto brick = [&](double v) {
            return std::clamp(static_cast<int>(std::floor((v + 0.5) / kBrickEdge)), 0,
                              bricks[a] - 1);
        };
        range.first[a] = brick(low[a]);
        range.last[a] = brick(high[a]);
    }
    return range;
}

}  // namespace

BrickMarks marks_of_region(const CaseBundle& bundle) {
    const FineRegion& region = *bundle.region;
    const RegionPlace place = region_place(region, bundle.grid);
    const Int3 bricks = brick_count(bundle.grid.size), fine = brick_count(region.grid.size);
    const double reach_vx = kStepVx + kLookUpVx / place.per_voxel;
    const Vector3 reach{reach_vx, reach_vx, reach_vx};
    const BrickRange box = bricks_within(bricks, place.lower_vx - reach, place.upper_vx + reach);
    std::vector<std::int16_t> plain(region.label_bricks.table.size());
    for (std::size_t n = 0; n < plain.size(); ++n)
        plain[n] = static_cast<std::int16_t>(plain_label(region.label_bricks, region.boundary, n));
    BrickMarks marks{box.first, {}, {}};
    for (int a = 0; a < 3; ++a) marks.size[a] = box.last[a] - box.first[a] + 1;
    const auto differs = [&](Int3 brick) {
        const int label =
            plain_label(bundle.label_bricks, bundle.boundary, brick_number(bricks, brick));
        if (label < 0) return true;
        const Point3 low{kBrickEdge * brick.x - 0.5, kBrickEdge * brick.y - 0.5,
                         kBrickEdge * brick.z - 0.5};
        const Vector3 edge{kBrickEdge, kBrickEdge, kBrickEdge};
        const BrickRange near =
            bricks_within(fine, place.voxel_of(low - reach), place.voxel_of(low + edge + reach));
        for (int z = near.first.z; z <= near.last.z; ++z) {
            for (int y = near.first.y; y <= near.last.y; ++y) {
                const auto* row = plain.data() + brick_number(fine, {near.first.x, y, z});
                for (int x = near.first.x; x <= near.last.x; ++x) {
                    if (*row++ != label) return true;
                }
            }
        }
        return false;
    };
    for (int z = box.first.z; z <= box.last.z; ++z) {
        for (int y = box.first.y; y <= box.last.y; ++y) {
            for (int x = box.first.x; x <= box.last.x; ++x)
                marks.marked.push_back(differs({x, y, z}) ? 1 : 0);
        }
    }
    return marks;
}

Result<RegionLookUp> make_region_look_up(const CaseBundle& bundle, JobRunner& jobs) {
    RegionLookUp out;
    if (!bundle.region) return out;
    const FineRegion& region = *bundle.region;
    SONOCASE_TRY(auto words, BrickTable::create(region.label_bricks, nullptr, &region.boundary));
    out.region = &region;
    out.words = std::move(words);
    out.words.load_all(jobs);
    out.place = region_place(region, bundle.grid);
    return out;
}

}  // namespace sonocase::runtime
