// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/lesion_parts.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/counter_random.h"
#include "pipeline/pathology/lesion_shape.h"
#include "pipeline/pathology/place_pathology.h"

namespace sonocase::pipeline::inline pathology {
namespace {

constexpr double kThinnestVx = 0.75;
constexpr double kSeptumMm = 1, kBubbleMm = 2;

bool is_sheet(PartPlace place) {
    return place == PartPlace::shell || place == PartPlace::rim || place == PartPlace::septa;
}

bool can_be_drawn(const PathologyRequest& request, const LesionPart& part, double voxel_mm) {
    const double size = part_size(request, part);
    if (!(size > 0)) return false;
    const double thick_mm = part.place == PartPlace::septa ? kSeptumMm : size;
    return !is_sheet(part.place) || thick_mm >= kThinnestVx * voxel_mm;
}

std::array<std::uint8_t, 3> colour_of(const Tissue& tissue) {
    const auto grey = static_cast<std::uint8_t>(std::clamp(tissue.grey_mean + 40, 0.0, 255.0));
    return {255, grey, static_cast<std::uint8_t>(grey / 2)};
}

VoxelField offset(const VoxelField& distance, double outwards_vx) {
    return [distance, outwards_vx](Vector3 at) { return distance(at) - outwards_vx; };
}

// The lowest `share` of the lesion's height.
VoxelField lowest(const Lesion& lesion, double share) {
    double low = 1e18, high = -1e18;
    for (const Vector3 u : sphere_directions(200)) {
        // Where the surface is, along u: by bisection, since shapes are star-shaped.
        double inside = 0, outside = 4 * lesion.radius_vx;
        for (int n = 0; n < 24; ++n) {
            const double middle = 0.5 * (inside + outside);
            (lesion.distance(lesion.centre_vx + middle * u) < 0 ? inside : outside) = middle;
        }
        const double height = -dot(inside * u, lesion.down);
        low = std::min(low, height);
        high = std::max(high, height);
    }
    const double level = low + share * (high - low) - dot(lesion.centre_vx, lesion.down);
    const Vector3 down = lesion.down;
    return intersection(lesion.distance,
                        [down, level](Vector3 at) { return -dot(at, down) - level; });
}

VoxelField sheets(const Lesion& lesion, int count, double thick_vx, std::uint64_t seed) {
    VoxelField any = [](Vector3) { return 1e9; };
    for (int n = 0; n < count; ++n) {
        const auto at = static_cast<std::uint64_t>(n);
        const Vector3 normal =
            normalized({uniform_at(seed, 3 * at) - 0.5, uniform_at(seed, 3 * at + 1) - 0.5,
                        uniform_at(seed, 3 * at + 2) - 0.5});
        const double off = (n - 0.5 * (count - 1)) * 0.8 * lesion.radius_vx / std::max(1, count);
        const Vector3 middle = lesion.centre_vx + off * normal;
        any = [any, normal, middle, thick_vx](Vector3 p) {
            return std::min(any(p), std::abs(dot(p - middle, normal)) - 0.5 * thick_vx);
        };
    }
    return intersection(lesion.distance, any);
}

VoxelField bubbles(const Lesion& lesion, int count, double voxel_mm, std::uint64_t seed) {
    VoxelField any = [](Vector3) { return 1e9; };
    const Vector3 across = any_perpendicular(lesion.down), along = cross(lesion.down, across);
    for (int n = 0; n < count; ++n) {
        const auto at = static_cast<std::uint64_t>(n);
        const Vector3 middle = lesion.centre_vx - 0.6 * lesion.radius_vx * lesion.down +
                               (uniform_at(seed, 2 * at) - 0.5) * lesion.radius_vx * across +
                               (uniform_at(seed, 2 * at + 1) - 0.5) * lesion.radius_vx * along;
        const VoxelField one = ball(middle, 0.5 * kBubbleMm / voxel_mm);
        any = [any, one](Vector3 p) { return std::min(any(p), one(p)); };
    }
    return intersection(lesion.distance, any);
}

VoxelField inner_part(const Lesion& lesion,
                      const LesionPart& part,
                      double size,
                      double voxel_mm,
                      std::uint64_t seed) {
    switch (part.place) {
        case PartPlace::core: {
            const VoxelField whole = lesion.distance;
            const Vector3 centre = lesion.centre_vx;
            return [whole, centre, size](Vector3 at) {
                return size * whole(centre + (1 / size) * (at - centre));
            };
        }
        case PartPlace::debris: return lowest(lesion, size);
        case PartPlace::septa:
            return sheets(lesion, static_cast<int>(std::lround(size)), kSeptumMm / voxel_mm, seed);
        default: return bubbles(lesion, static_cast<int>(std::lround(size)), voxel_mm, seed);
    }
}

}  // namespace

double shell_mm(const PathologyRequest& request, const PathologyKind& kind, double voxel_mm) {
    double sum = 0;
    for (const LesionPart& part : kind.parts)
        if (part.place == PartPlace::shell && can_be_drawn(request, part, voxel_mm))
            sum += part_size(request, part);
    return sum;
}

Result<PaintedLesion> paint_lesion(LabelCanvas& canvas,
                                   const Lesion& lesion,
                                   const PathologyRequest& request,
                                   const PathologyKind& kind) {
    PaintedLesion painted;
    const double voxel_mm = canvas.grid().spacing_mm.x;
    const std::size_t room = static_cast<std::size_t>(kMaxLabels) - canvas.volume().labels.size();
    if (room < 1 + kind.parts.size())
        return Error{"no room for another label", request.name,
                     "a case has at most 254 labels: leave some out"};
    const auto new_label = [&](const std::string& part, const Tissue& tissue,
                               const std::string& name) {
        return canvas.add_label(
            {part.empty() ? request.name : request.name + "_" + part, name, 0, colour_of(tissue)});
    };
    const std::uint8_t own =
        new_label("", kind.tissue, request.tissue.empty() ? kind.tissue.name : request.tissue);
    LabelSet into = lesion.into;
    double rim_vx = 0;
    for (const LesionPart& part : kind.parts) {
        if (!(part_size(request, part) > 0)) continue;
        if (!can_be_drawn(request, part, voxel_mm)) {
            painted.skipped.push_back(part.name);
            continue;
        }
        if (part.place != PartPlace::shell && part.place != PartPlace::rim) continue;
        const std::uint8_t label = new_label(part.name, part.tissue, part.tissue.name);
        const double vx = part_size(request, part) / voxel_mm;
        const bool outer = part.place == PartPlace::shell;
        VoxelRange range = lesion.range;
        for (int axis = 0; outer && axis < 3; ++axis) {
            const int more = static_cast<int>(std::ceil(vx)) + 1;
            range.low[axis] = std::max(0, range.low[axis] - more);
            range.high[axis] = std::min(canvas.grid().size[axis] - 1, range.high[axis] + more);
        }
        canvas.paint(range, offset(lesion.distance, outer ? vx : 0), label, into);
        into.set(label);
        if (!outer) {
            rim_vx = vx;
            painted.inside.set(label);
        }
    }
    canvas.paint(lesion.range, offset(lesion.distance, -rim_vx), own, into);
    painted.inside.set(own);
    std::uint64_t number = 0;
    for (const LesionPart& part : kind.parts) {
        const bool outer = part.place == PartPlace::shell || part.place == PartPlace::rim;
        ++number;
        if (outer || !can_be_drawn(request, part, voxel_mm)) continue;
        const std::uint8_t label = new_label(part.name, part.tissue, part.tissue.name);
        const std::uint64_t seed =
            derive_seed(static_cast<std::uint64_t>(request.seed), 100 + number);
        canvas.paint(lesion.range,
                     inner_part(lesion, part, part_size(request, part), voxel_mm, seed), label,
                     painted.inside);
        painted.inside.set(label);
    }
    return painted;
}

}  // namespace sonocase::pipeline::inline pathology
