// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/label_canvas.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline pathology {
namespace {

std::size_t place_in_brick(Int3 v) {
    return static_cast<std::size_t>((v.x % kBrickEdge) + kBrickEdge * (v.y % kBrickEdge) +
                                    kBrickEdge * kBrickEdge * (v.z % kBrickEdge));
}

// Calls visit(n, v) for the voxels of a range in order, x fastest.
template <class Visit>
void each_voxel(const VoxelRange& range, Visit visit) {
    std::size_t n = 0;
    for (int k = range.low.z; k <= range.high.z; ++k)
        for (int j = range.low.y; j <= range.high.y; ++j)
            for (int i = range.low.x; i <= range.high.x; ++i) visit(n++, Int3{i, j, k});
}

// The field at every voxel of the range, slice by slice on all threads.
std::vector<float> sampled(const VoxelRange& range, const VoxelField& field) {
    std::vector<float> values(range.count());
    const auto slices = static_cast<std::size_t>(range.high.z - range.low.z + 1);
    const std::size_t per_slice = range.count() / slices;
    parallel_for(slices, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
            VoxelRange slice = range;
            slice.low.z = slice.high.z = range.low.z + static_cast<int>(s);
            each_voxel(slice, [&](std::size_t n, Int3 v) {
                values[s * per_slice + n] = static_cast<float>(field(as_vector(v)));
            });
        }
    });
    return values;
}

}  // namespace

LabelCanvas::LabelCanvas(const LabelVolume& volume, const BoundaryBricks& boundary)
    : volume_(volume), before_(boundary), has_records_(!boundary.table.empty()) {}

std::size_t LabelCanvas::brick_of(Int3 v) const {
    const Int3 n = brick_count(grid().size);
    return static_cast<std::size_t>(v.x / kBrickEdge) +
           static_cast<std::size_t>(n.x) *
               (static_cast<std::size_t>(v.y / kBrickEdge) +
                static_cast<std::size_t>(n.y) * static_cast<std::size_t>(v.z / kBrickEdge));
}

std::uint32_t LabelCanvas::record(Int3 v) const {
    if (!has_records_) return kNoBoundary;
    const auto found = touched_.find(brick_of(v));
    if (found != touched_.end()) return found->second[place_in_brick(v)];
    return before_.at(v.x, v.y, v.z);
}

void LabelCanvas::set(Int3 v, std::uint8_t label, std::uint32_t record) {
    volume_.voxels[grid().index(v.x, v.y, v.z)] = label;
    if (!has_records_) return;
    const auto [brick, added] = touched_.try_emplace(brick_of(v));
    if (added) {
        const Int3 first{v.x / kBrickEdge * kBrickEdge, v.y / kBrickEdge * kBrickEdge,
                         v.z / kBrickEdge * kBrickEdge};
        for (int n = 0; n < kBrickVoxels; ++n)
            brick->second[n] =
                before_.at(std::min(first.x + n % kBrickEdge, grid().size.x - 1),
                           std::min(first.y + n / kBrickEdge % kBrickEdge, grid().size.y - 1),
                           std::min(first.z + n / kBrickEdge / kBrickEdge, grid().size.z - 1));
    }
    brick->second[place_in_brick(v)] = record;
}

std::uint8_t LabelCanvas::add_label(Label label) {
    volume_.labels.push_back(std::move(label));
    return static_cast<std::uint8_t>(volume_.labels.size() - 1);
}

VoxelRange LabelCanvas::around(Vector3 centre_vx, double radius_vx) const {
    VoxelRange range;
    for (int axis = 0; axis < 3; ++axis) {
        const double last = grid().size[axis] - 1;
        range.low[axis] =
            static_cast<int>(std::clamp(std::floor(centre_vx[axis] - radius_vx), 0.0, last + 1));
        range.high[axis] =
            static_cast<int>(std::clamp(std::ceil(centre_vx[axis] + radius_vx), -1.0, last));
    }
    return range;
}

double LabelCanvas::threshold(const VoxelRange& range,
                              const VoxelField& rank,
                              const LabelSet& into,
                              std::size_t voxels,
                              std::size_t* found) const {
    *found = 0;
    if (range.empty()) return 0;
    const std::vector<float> all = sampled(range, rank);
    std::vector<float> ranks;
    each_voxel(range, [&](std::size_t n, Int3 v) {
        if (into[label(v)] && std::isfinite(all[n])) ranks.push_back(all[n]);
    });
    *found = ranks.size();
    if (ranks.empty()) return 0;
    if (voxels >= ranks.size()) return *std::max_element(ranks.begin(), ranks.end()) + 1e-3;
    const auto next = ranks.begin() + static_cast<std::ptrdiff_t>(voxels);
    std::nth_element(ranks.begin(), next, ranks.end());
    const double above = *next;
    const double below = *std::max_element(ranks.begin(), next);
    return 0.5 * (above + below);
}

std::size_t LabelCanvas::paint(const VoxelRange& range,
                               const VoxelField& distance,
                               std::uint8_t painted,
                               const LabelSet& into) {
    if (range.empty()) return 0;
    // Records of the voxels around the range see the new surface as well.
    VoxelRange wide = range;
    for (int axis = 0; axis < 3; ++axis) {
        wide.low[axis] = std::max(0, range.low[axis] - 2);
        wide.high[axis] = std::min(grid().size[axis] - 1, range.high[axis] + 2);
    }
    const std::vector<float> phi = sampled(wide, distance);
    struct Change {
        Int3 voxel;
        std::uint8_t label;
        std::uint32_t record;
    };
    std::vector<Change> changes;
    std::size_t count = 0;
    each_voxel(wide, [&](std::size_t n, Int3 v) {
        const double d = phi[n];
        if (d > 3 * kBandVx) return;
        const std::uint8_t own = label(v);
        const std::uint32_t old = record(v);
        const bool open = into[own];
        const bool inside = open && d < 0;
        count += inside;
        if (!has_records_) {
            if (inside) changes.push_back({v, painted, kNoBoundary});
            return;
        }
        bool had = old != kNoBoundary;
        BoundaryRecord was = had ? unpack_boundary(old) : BoundaryRecord{};
        std::uint32_t now = old;
        if (had && into[was.second_label] &&
            distance(as_vector(v) - (was.distance_vx + 0.3) * was.normal) < 0) {
            // The label beyond that surface has been painted over.
            was.second_label = painted;
            had = !inside;
            now = had ? pack_boundary(was) : kNoBoundary;
        }
        // Where both surfaces are near, the nearer one is kept.
        if (open && std::abs(d) < kBandVx && (!had || std::abs(was.distance_vx) > std::abs(d))) {
            const Vector3 outwards = normalized(gradient(distance, as_vector(v)));
            now = inside ? pack_boundary({own, -d, -outwards})
                         : pack_boundary({painted, d, outwards});
        }
        if (inside && now != kNoBoundary && unpack_boundary(now).second_label == painted)
            now = kNoBoundary;
        if (inside || now != old) changes.push_back({v, inside ? painted : own, now});
    });
    for (const Change& change : changes) set(change.voxel, change.label, change.record);
    return count;
}

BoundaryBricks LabelCanvas::take_boundary() {
    if (!has_records_) return {};
    BoundaryBricks out;
    out.size = grid().size;
    out.patches.step = before_.patches.step;
    const bool patches = !before_.patches.first.empty();
    std::map<std::uint32_t, std::uint32_t> uniform_index;
    std::array<std::uint32_t, kBrickVoxels> filled;
    for (std::size_t b = 0; b < before_.table.size(); ++b) {
        const std::uint32_t entry = before_.table[b];
        const auto changed = touched_.find(b);
        const std::uint32_t* values = nullptr;
        bool alike = false;
        if (changed != touched_.end()) {
            values = changed->second.data();
            alike = std::all_of(values, values + kBrickVoxels,
                                [&](std::uint32_t v) { return v == values[0]; });
        } else if (entry & kUniformBrick) {
            filled.fill(before_.uniform[entry & ~kUniformBrick]);
            values = filled.data();
            alike = true;
        } else {
            values = before_.pool.data() + static_cast<std::size_t>(entry) * kBrickVoxels;
        }
        if (alike) {
            const auto [it, added] = uniform_index.try_emplace(
                values[0], static_cast<std::uint32_t>(out.uniform.size()));
            if (added) out.uniform.push_back(values[0]);
            out.table.push_back(kUniformBrick | it->second);
            continue;
        }
        out.table.push_back(static_cast<std::uint32_t>(out.pool.size() / kBrickVoxels));
        out.pool.insert(out.pool.end(), values, values + kBrickVoxels);
        if (!patches) continue;
        const auto of_brick =
            changed == touched_.end() ? before_.patches.of(entry) : std::span<const SurfacePatch>{};
        out.patches.first.push_back(static_cast<std::uint32_t>(out.patches.patches.size()));
        out.patches.count.push_back(static_cast<std::uint8_t>(of_brick.size()));
        out.patches.patches.insert(out.patches.patches.end(), of_brick.begin(), of_brick.end());
    }
    return out;
}

Vector3 gradient(const VoxelField& field, Vector3 at) {
    constexpr double kStepVx = 0.5;
    Vector3 slope;
    for (int axis = 0; axis < 3; ++axis) {
        Vector3 low = at, high = at;
        low[axis] -= kStepVx;
        high[axis] += kStepVx;
        slope[axis] = (field(high) - field(low)) / (2 * kStepVx);
    }
    return slope;
}

VoxelField distance_to_level(VoxelField rank, double threshold, double scale_vx) {
    return [rank = std::move(rank), threshold, scale_vx](Vector3 at) {
        const double above = rank(at) - threshold;
        const double far = above * scale_vx;
        // Only near the surface is the slope needed, and in the middle of a shape it has none.
        if (!(std::abs(far) < 8)) return far;
        const double slope = norm(gradient(rank, at));
        return slope * scale_vx > 0.2 ? above / slope : far;
    };
}

}  // namespace sonocase::pipeline::inline pathology
