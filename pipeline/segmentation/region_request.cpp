// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/region_request.h"

#include <algorithm>
#include <cstdio>

namespace sonocase::pipeline {
namespace {

Box3 box_of_value(const LabelVolume& volume, std::uint8_t label, double margin_mm) {
    Box3 box;
    const Grid& g = volume.grid;
    for (int k = 0; k < g.size.z; ++k) {
        for (int j = 0; j < g.size.y; ++j) {
            const auto row = volume.voxels.begin() + static_cast<std::ptrdiff_t>(g.index(0, j, k));
            const auto end = row + g.size.x;
            const auto first = std::find(row, end, label);
            if (first == end) continue;
            auto last = end - 1;
            while (*last != label) --last;
            for (const auto at : {first, last})
                box.include(g.point_from_voxel({static_cast<double>(at - row),
                                                static_cast<double>(j), static_cast<double>(k)}));
        }
    }
    if (box.empty()) return box;
    for (int a = 0; a < 3; ++a) {
        box.lower[a] -= margin_mm;
        box.upper[a] += margin_mm;
    }
    return box;
}

}  // namespace

Box3 box_of_label(const LabelVolume& volume, const std::string& label, double margin_mm) {
    const auto found = std::find_if(volume.labels.begin(), volume.labels.end(),
                                    [&](const Label& l) { return l.name == label; });
    if (found == volume.labels.end()) return {};
    return box_of_value(volume, static_cast<std::uint8_t>(found - volume.labels.begin()),
                        margin_mm);
}

Result<Box3> region_box(const RegionRequest& request,
                        const LabelVolume& cooked,
                        const Registration& registration) {
    const std::string where = "region '" + request.name + "'";
    const double case_mm = cooked.grid.spacing_mm.x;
    char text[160];
    if (!(request.voxel_mm < case_mm)) {
        std::snprintf(text, sizeof text, "voxels of %g mm in a case of %g mm", request.voxel_mm,
                      case_mm);
        return Error{text, where, "voxels smaller than the case's"};
    }
    Box3 box;
    if (!request.label.empty()) {
        box = box_of_label(cooked, request.label, request.margin_mm);
        if (box.empty())
            return Error{"the case has no label '" + request.label + "'", where,
                         "a label of the case, or centre and size_mm"};
    } else {
        Point3 centre = request.centre.value_or(Point3{});
        if (request.in_ct) centre = mannequin_from_ct(registration, centre);
        box = {centre - 0.5 * request.size_mm, centre + 0.5 * request.size_mm};
    }
    const Box3 all = cooked.grid.bounds();
    double voxels = 1;
    for (int a = 0; a < 3; ++a) {
        box.lower[a] = std::max(box.lower[a], all.lower[a]);
        box.upper[a] = std::min(box.upper[a], all.upper[a]);
        if (!(box.upper[a] - box.lower[a] > case_mm))
            return Error{"the box lies beyond the body", where, "a place in the case"};
        voxels *= (box.upper[a] - box.lower[a]) / request.voxel_mm + 2 * kRegionRim;
    }
    if (voxels > kMostRegionVoxels) {
        std::snprintf(text, sizeof text, "%.0f million voxels", voxels / 1e6);
        return Error{text, where, "at most 200 million: a smaller box, or larger voxels"};
    }
    return box;
}

}  // namespace sonocase::pipeline
