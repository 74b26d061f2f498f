// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/slice_groups.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "formats/base/constants.h"

namespace sonocase::pipeline::inline segmentation_distance {

namespace {

// 8-connected components of equal label in slice k, by union-find. Appends them with sums instead
// of moments.
void add_outlines(const LabelVolume& volume, int k, OutlineMap* out) {
    const int nx = volume.grid.size.x, ny = volume.grid.size.y;
    const std::size_t base = volume.grid.index(0, 0, k);
    const std::uint8_t* label = volume.voxels.data() + base;
    const auto at = [nx](int i, int j) { return i + static_cast<std::size_t>(nx) * j; };
    std::vector<std::int32_t> parent(static_cast<std::size_t>(nx) * ny);
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](std::size_t v) {
        while (static_cast<std::size_t>(parent[v]) != v) {
            parent[v] = parent[parent[v]];
            v = static_cast<std::size_t>(parent[v]);
        }
        return v;
    };
    for (int j = 0; j < ny; ++j) {
        for (int i = 0; i < nx; ++i) {
            const std::size_t v = at(i, j);
            const auto join = [&](int a, int b) {
                if (a < 0 || a >= nx || b < 0 || label[at(a, b)] != label[v]) return;
                const std::size_t p = root(v), q = root(at(a, b));
                parent[std::max(p, q)] = static_cast<std::int32_t>(std::min(p, q));
            };
            join(i - 1, j);
            join(i - 1, j - 1);
            join(i, j - 1);
            join(i + 1, j - 1);
        }
    }
    std::vector<std::int32_t> outline_of_root(parent.size(), -1);
    for (int j = 0; j < ny; ++j) {
        for (int i = 0; i < nx; ++i) {
            const std::size_t v = at(i, j), r = root(v);
            if (outline_of_root[r] < 0) {  // roots come first in scan order
                outline_of_root[r] = static_cast<std::int32_t>(out->outlines.size());
                out->outlines.push_back({k, label[v], {{i, j, k}, {1, 1, 1}}, 0, 0, 0});
            }
            Outline& o = out->outlines[outline_of_root[r]];
            out->of_voxel[base + v] = outline_of_root[r];
            const int x1 = std::max(o.box.first.x + o.box.size.x, i + 1);
            o.box.first.x = std::min(o.box.first.x, i);
            o.box.size.x = x1 - o.box.first.x;
            o.box.size.y = j + 1 - o.box.first.y;
            ++o.area;
            o.x += i;
            o.y += j;
            o.xx += static_cast<double>(i) * i;
            o.xy += static_cast<double>(i) * j;
            o.yy += static_cast<double>(j) * j;
        }
    }
}

}  // namespace

bool Outline::elongated() const {
    const double mean = 0.5 * (xx + yy), spread = std::hypot(0.5 * (xx - yy), xy);
    return mean + spread > 6.25 * (mean - spread + 1.0 / 12);  // 2.5 times as long as wide
}

double Outline::direction_rad() const {
    return 0.5 * std::atan2(2 * xy, xx - yy);
}

OutlineMap find_outlines(const LabelVolume& volume) {
    OutlineMap out;
    out.of_voxel.assign(volume.grid.voxel_count(), -1);
    for (int k = 0; k < volume.grid.size.z; ++k) add_outlines(volume, k, &out);
    for (Outline& o : out.outlines) {
        o.x /= o.area;
        o.y /= o.area;
        o.xx = o.xx / o.area - o.x * o.x;
        o.xy = o.xy / o.area - o.x * o.y;
        o.yy = o.yy / o.area - o.y * o.y;
    }
    return out;
}

namespace {

class GroupFinder {
  public:
    explicit GroupFinder(const LabelVolume& volume)
        : volume_(volume), grid_(volume.grid), map_(find_outlines(volume)) {
        of_label_.resize(volume.labels.size());
        area_below_.assign(map_.outlines.size(), 0);
        area_above_.assign(map_.outlines.size(), 0);
        in_slice_.resize(grid_.size.z);
        for (std::size_t o = 0; o < map_.outlines.size(); ++o) {
            in_slice_[map_.outlines[o].slice].push_back(static_cast<std::int32_t>(o));
        }
    }

    SliceGroups find() && {
        for (int k = 0; k + 1 < grid_.size.z; ++k) {
            const Overlaps overlaps = find_overlaps(k);
            pair_overlapping(k, overlaps);
            pair_separate(k, overlaps);
        }
        place_poles();
        return {std::move(map_), std::move(of_label_)};
    }

  private:
    // Outlines of one label in slices k and k + 1 that share pixels.
    struct Overlaps {
        std::set<std::pair<std::int32_t, std::int32_t>> pairs;  // lower, upper
        std::map<std::int32_t, int> ups, downs;                 // partners of a lower, an upper one
    };

    const Outline& outline(int o) const { return map_.outlines[o]; }

    double turn(int a, int b) const {
        if (!outline(a).elongated() || !outline(b).elongated()) return 0.0;
        double d = outline(b).direction_rad() - outline(a).direction_rad();
        if (d > kPi / 2) d -= kPi;
        if (d < -kPi / 2) d += kPi;
        // A tube does not rotate further between two slices; such outlines have another cause.
        return std::abs(d) < 0.8 ? d : 0.0;
    }

    // Pixels of `a` that coincide with pixels of `b` after a shift and a turn.
    int shared(int a, int b, double dx, double dy, double angle) const {
        const VoxelBox& box = outline(a).box;
        const double c = std::cos(angle), s = std::sin(angle);
        int count = 0;
        for (int j = box.first.y; j < box.first.y + box.size.y; ++j) {
            for (int i = box.first.x; i < box.first.x + box.size.x; ++i) {
                if (map_.of_voxel[grid_.index(i, j, outline(a).slice)] != a) continue;
                const double u = i - outline(a).x, v = j - outline(a).y;
                const int x = static_cast<int>(std::lround(outline(a).x + dx + c * u - s * v));
                const int y = static_cast<int>(std::lround(outline(a).y + dy + s * u + c * v));
                if (!grid_.contains(x, y, 0)) continue;
                count += map_.of_voxel[grid_.index(x, y, outline(b).slice)] == b;
            }
        }
        return count;
    }

    double length(int o) const { return std::hypot(outline(o).box.size.x, outline(o).box.size.y); }

    double gap(int a, int b) const {
        return std::hypot(outline(a).x - outline(b).x, outline(a).y - outline(b).y);
    }

    // The outlines of a tube of radius r in slices dz apart are apart by dz cos(a) / (2 r) of their
    // length, with the angle a between the tube and the slices.
    bool may_pair(int a, int b) const {
        const double ratio = static_cast<double>(outline(a).area) / outline(b).area;
        return outline(a).label == outline(b).label && ratio < 4 && ratio > 0.25 &&
               gap(a, b) <= 2 * std::max(length(a), length(b)) + 2;
    }

    // Lower outline or upper outline may be -1: none.
    void add(int k, int lower, int upper) {
        SliceGroup group{lower, upper, k, 0, 0, 0};
        if (lower >= 0 && upper >= 0) {
            group.shift_x = outline(upper).x - outline(lower).x;
            group.shift_y = outline(upper).y - outline(lower).y;
            group.turn_rad = turn(lower, upper);
        }
        of_label_[outline(lower >= 0 ? lower : upper).label].push_back(group);
    }

    Overlaps find_overlaps(int k) {
        const std::size_t plane = static_cast<std::size_t>(grid_.size.x) * grid_.size.y;
        const std::size_t low = static_cast<std::size_t>(k) * plane;
        Overlaps out;
        std::int32_t last_a = -1, last_b = -1;
        for (std::size_t v = low; v < low + plane; ++v) {
            if (volume_.voxels[v] != volume_.voxels[v + plane]) continue;
            const std::int32_t a = map_.of_voxel[v], b = map_.of_voxel[v + plane];
            if (a == last_a && b == last_b) continue;  // a run of one pair
            last_a = a;
            last_b = b;
            if (out.pairs.insert({a, b}).second) {
                ++out.ups[a];
                ++out.downs[b];
                area_above_[a] += outline(b).area;
                area_below_[b] += outline(a).area;
            }
        }
        return out;
    }

    // Pairs that overlap, have no other partner and coincide better when moved.
    void pair_overlapping(int k, const Overlaps& overlaps) {
        for (const auto& [a, b] : overlaps.pairs) {
            if (overlaps.ups.at(a) != 1 || overlaps.downs.at(b) != 1) continue;
            const int smaller = std::min(outline(a).area, outline(b).area);
            const int in_place = shared(a, b, 0, 0, 0);
            if (in_place > 0.7 * smaller) continue;
            const int moved =
                shared(a, b, outline(b).x - outline(a).x, outline(b).y - outline(a).y, turn(a, b));
            if (moved > 1.15 * in_place && may_pair(a, b)) add(k, a, b);
        }
    }

    // Outlines without overlap: pairs that are nearest to each other; the others end here.
    void pair_separate(int k, const Overlaps& overlaps) {
        std::vector<std::int32_t> lower, upper;
        for (const std::int32_t a : in_slice_[k]) {
            if (!overlaps.ups.count(a)) lower.push_back(a);
        }
        for (const std::int32_t b : in_slice_[static_cast<std::size_t>(k) + 1]) {
            if (!overlaps.downs.count(b)) upper.push_back(b);
        }
        const auto nearest = [&](std::int32_t o, const std::vector<std::int32_t>& others) {
            std::int32_t best = -1;
            for (const std::int32_t b : others) {
                if (may_pair(o, b) && (best < 0 || gap(o, b) < gap(o, best))) best = b;
            }
            return best;
        };
        std::vector<bool> taken(upper.size(), false);
        for (const std::int32_t a : lower) {
            const std::int32_t b = nearest(a, upper);
            if (b >= 0 && nearest(b, lower) == a) {
                add(k, a, b);
                taken[std::find(upper.begin(), upper.end(), b) - upper.begin()] = true;
            } else {
                add(k, a, -1);
            }
        }
        for (std::size_t i = 0; i < upper.size(); ++i) {
            if (!taken[i]) add(k, -1, upper[i]);
        }
    }

    // On a ball of radius R, an outline at height z above the centre has the area pi (R^2 - z^2).
    void place_poles() {
        const double h = grid_.spacing_mm.z, disc = grid_.spacing_mm.x * grid_.spacing_mm.y / kPi;
        for (auto& groups : of_label_) {
            for (SliceGroup& group : groups) {
                if (group.lower >= 0 && group.upper >= 0) continue;
                const int own = group.lower >= 0 ? group.lower : group.upper;
                const auto o = static_cast<std::size_t>(own);
                const double last = disc * outline(own).area;
                const double before = disc * (group.lower >= 0 ? area_below_[o] : area_above_[o]);
                if (before <= last) continue;
                const double z = 0.5 * ((before - last) / h + h);
                group.end = std::clamp((std::sqrt(last + z * z) - z) / h, 0.1, 0.95);
            }
        }
    }

    const LabelVolume& volume_;
    const Grid& grid_;
    OutlineMap map_;
    std::vector<std::vector<std::int32_t>> in_slice_;  // outlines of each slice
    std::vector<std::vector<SliceGroup>> of_label_;
    // Area of the overlapping outlines of the same label in the slice below, above. # outlines
    std::vector<double> area_below_, area_above_;
};

}  // namespace

SliceGroups find_slice_groups(const LabelVolume& volume) {
    return GroupFinder(volume).find();
}

}  // namespace sonocase::pipeline::inline segmentation_distance
