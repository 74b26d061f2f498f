// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/slice_groups.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace sonocase::pipeline {
namespace {

// Components of equal label in one slice, 8-connected. Appends outlines; marks voxels.
void find_outlines(const LabelVolume& volume, int k, SliceGroups* out) {
    const int nx = volume.grid.size.x, ny = volume.grid.size.y;
    const std::size_t base = volume.grid.index(0, 0, k);
    const std::uint8_t* label = volume.voxels.data() + base;
    const auto at = [nx](int i, int j) {
        return static_cast<std::size_t>(i) +
               static_cast<std::size_t>(nx) * static_cast<std::size_t>(j);
    };
    std::vector<std::int32_t> parent(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny));
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](std::size_t v) {
        while (static_cast<std::size_t>(parent[v]) != v) {
            parent[v] = parent[static_cast<std::size_t>(parent[v])];
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
            Outline& o = out->outlines[static_cast<std::size_t>(outline_of_root[r])];
            out->outline_of_voxel[base + v] = outline_of_root[r];
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

SliceGroups find_slice_groups(const LabelVolume& volume) {
    SliceGroups out;
    const Grid& g = volume.grid;
    out.outline_of_voxel.assign(g.voxel_count(), -1);
    out.of_label.resize(volume.labels.size());
    for (int k = 0; k < g.size.z; ++k) find_outlines(volume, k, &out);
    for (Outline& o : out.outlines) {
        o.x /= o.area;
        o.y /= o.area;
        o.xx = o.xx / o.area - o.x * o.x;
        o.xy = o.xy / o.area - o.x * o.y;
        o.yy = o.yy / o.area - o.y * o.y;
    }
    const std::size_t plane =
        static_cast<std::size_t>(g.size.x) * static_cast<std::size_t>(g.size.y);
    std::vector<std::vector<std::int32_t>> in_slice(static_cast<std::size_t>(g.size.z));
    for (std::size_t o = 0; o < out.outlines.size(); ++o) {
        in_slice[static_cast<std::size_t>(out.outlines[o].slice)].push_back(
            static_cast<std::int32_t>(o));
    }
    const auto outline = [&](int o) -> const Outline& {
        return out.outlines[static_cast<std::size_t>(o)];
    };
    const auto turn = [&](int a, int b) {
        if (!outline(a).elongated() || !outline(b).elongated()) return 0.0;
        double d = outline(b).direction_rad() - outline(a).direction_rad();
        constexpr double kPi = 3.14159265358979323846;
        if (d > kPi / 2) d -= kPi;
        if (d < -kPi / 2) d += kPi;
        // A tube does not swing round between two slices; such outlines are of another kind.
        return std::abs(d) < 0.8 ? d : 0.0;
    };
    // Pixels of `a` that land on `b` when moved.
    const auto shared = [&](int a, int b, double dx, double dy, double angle) {
        const VoxelBox& box = outline(a).box;
        const double c = std::cos(angle), s = std::sin(angle);
        int count = 0;
        for (int j = box.first.y; j < box.first.y + box.size.y; ++j) {
            for (int i = box.first.x; i < box.first.x + box.size.x; ++i) {
                if (out.outline_of_voxel[g.index(i, j, outline(a).slice)] != a) continue;
                const double u = i - outline(a).x, v = j - outline(a).y;
                const int x = static_cast<int>(std::lround(outline(a).x + dx + c * u - s * v));
                const int y = static_cast<int>(std::lround(outline(a).y + dy + s * u + c * v));
                if (!g.contains(x, y, 0)) continue;
                count += out.outline_of_voxel[g.index(x, y, outline(b).slice)] == b;
            }
        }
        return count;
    };
    const auto length = [&](int o) {
        return std::hypot(outline(o).box.size.x, outline(o).box.size.y);
    };
    // How far apart two outlines of a tube can lie: one of radius r through slices dz apart moves
    // by dz cos(a) / (2 r) of its outline's length.
    const auto gap = [&](int a, int b) {
        return std::hypot(outline(a).x - outline(b).x, outline(a).y - outline(b).y);
    };
    const auto may_pair = [&](int a, int b) {
        const double ratio = static_cast<double>(outline(a).area) / outline(b).area;
        return outline(a).label == outline(b).label && ratio < 4 && ratio > 0.25 &&
               gap(a, b) <= 2 * std::max(length(a), length(b)) + 2;
    };
    // Area of the outlines of the same label that touch an outline from below and from above.
    std::vector<double> area_below(out.outlines.size(), 0), area_above(out.outlines.size(), 0);
    for (int k = 0; k + 1 < g.size.z; ++k) {
        const std::size_t low = static_cast<std::size_t>(k) * plane;
        std::map<std::pair<std::int32_t, std::int32_t>, int> links;
        std::map<std::int32_t, int> ups, downs;
        std::int32_t last_a = -1, last_b = -1;
        for (std::size_t v = low; v < low + plane; ++v) {
            if (volume.voxels[v] != volume.voxels[v + plane]) continue;
            const std::int32_t a = out.outline_of_voxel[v], b = out.outline_of_voxel[v + plane];
            if (a == last_a && b == last_b) continue;  // a run of one pair
            last_a = a;
            last_b = b;
            if (links.try_emplace({a, b}, 0).second) {
                ++ups[a];
                ++downs[b];
                area_above[static_cast<std::size_t>(a)] += outline(b).area;
                area_below[static_cast<std::size_t>(b)] += outline(a).area;
            }
        }
        const auto add = [&](int a, int b) {
            SliceGroup group{a, b, k, 0, 0, 0};
            if (a >= 0 && b >= 0) {
                group.shift_x = outline(b).x - outline(a).x;
                group.shift_y = outline(b).y - outline(a).y;
                group.turn_rad = turn(a, b);
            }
            out.of_label[outline(a >= 0 ? a : b).label].push_back(group);
        };
        for (const auto& [pair, unused] : links) {
            const auto [a, b] = pair;
            if (ups[a] != 1 || downs[b] != 1) continue;
            const int smaller = std::min(outline(a).area, outline(b).area);
            const int still = shared(a, b, 0, 0, 0);
            if (still > 0.7 * smaller) continue;
            const int moved =
                shared(a, b, outline(b).x - outline(a).x, outline(b).y - outline(a).y, turn(a, b));
            if (moved > 1.15 * still && may_pair(a, b)) add(a, b);
        }
        std::vector<std::int32_t> loose_low, loose_high;
        for (const std::int32_t a : in_slice[static_cast<std::size_t>(k)]) {
            if (!ups.count(a)) loose_low.push_back(a);
        }
        for (const std::int32_t b : in_slice[static_cast<std::size_t>(k) + 1]) {
            if (!downs.count(b)) loose_high.push_back(b);
        }
        const auto nearest = [&](std::int32_t o, const std::vector<std::int32_t>& others) {
            std::int32_t best = -1;
            for (const std::int32_t b : others) {
                if (may_pair(o, b) && (best < 0 || gap(o, b) < gap(o, best))) best = b;
            }
            return best;
        };
        std::vector<bool> taken(loose_high.size(), false);
        for (const std::int32_t a : loose_low) {
            const std::int32_t b = nearest(a, loose_high);
            if (b >= 0 && nearest(b, loose_low) == a) {
                add(a, b);
                taken[static_cast<std::size_t>(std::find(loose_high.begin(), loose_high.end(), b) -
                                               loose_high.begin())] = true;
            } else {
                add(a, -1);
            }
        }
        for (std::size_t i = 0; i < loose_high.size(); ++i) {
            if (!taken[i]) add(-1, loose_high[i]);
        }
    }
    // On a ball of radius R, z from its middle, an outline has the area pi (R^2 - z^2).
    const double h = g.spacing_mm.z, disc = g.spacing_mm.x * g.spacing_mm.y / 3.14159265358979;
    for (auto& groups : out.of_label) {
        for (SliceGroup& group : groups) {
            if (group.lower >= 0 && group.upper >= 0) continue;
            const int own = group.lower >= 0 ? group.lower : group.upper;
            const auto o = static_cast<std::size_t>(own);
            const double last = disc * outline(own).area;
            const double before = disc * (group.lower >= 0 ? area_below[o] : area_above[o]);
            if (before <= last) continue;
            const double z = 0.5 * ((before - last) / h + h);
            group.end = std::clamp((std::sqrt(last + z * z) - z) / h, 0.1, 0.95);
        }
    }
    return out;
}

}  // namespace sonocase::pipeline
