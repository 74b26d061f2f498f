// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/cooked_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sonocase::pipeline::inline segmentation {

Result<Grid> cooked_grid(const LabelVolume& ct_labels,
                         const Registration& registration,
                         const CookedGridOptions& options) {
    const double h = options.voxel_mm;
    char text[160];
    if (!(h >= 0.2 && h <= 10) || !(options.margin_mm >= 0 && options.margin_mm <= 1000)) {
        std::snprintf(text, sizeof text, "voxels of %g mm with a margin of %g mm", h,
                      options.margin_mm);
        return Error{text, "resample", "a voxel edge in [0.2, 10] mm and a margin in [0, 1000] mm"};
    }
    // The ends of the body in each row of voxels are enough: with det J > 0 the image of the body
    // is bounded by the image of its surface, and the margin covers the curvature of the rows.
    Box3 image;
    const Grid& g = ct_labels.grid;
    for (int k = 0; k < g.size.z; ++k) {
        for (int j = 0; j < g.size.y; ++j) {
            const std::uint8_t* row = ct_labels.voxels.data() + g.index(0, j, k);
            int first = 0, last = g.size.x - 1;
            while (first < g.size.x && row[first] == 0) ++first;
            while (last > first && row[last] == 0) --last;
            for (const int i : {first, last}) {
                if (i >= g.size.x) break;
                for (int corner = 0; corner < 4; ++corner) {  // voxels have thickness
                    const Point3 at{i == first ? i - 0.5 : i + 0.5, j + (corner & 1 ? 0.5 : -0.5),
                                    k + (corner & 2 ? 0.5 : -0.5)};
                    image.include(mannequin_from_ct(registration, g.point_from_voxel(at)));
                }
            }
        }
    }
    if (image.empty()) {
        return Error{"the label map holds no body voxel", "resample",
                     "at least one voxel with a label other than 0"};
    }
    Grid out;
    out.spacing_mm = {h, h, h};
    double voxels = 1;
    for (int a = 0; a < 3; ++a) {
        const double low = std::floor((image.lower[a] - options.margin_mm) / h);
        const double high = std::ceil((image.upper[a] + options.margin_mm) / h);
        voxels *= high - low + 1;
        if (!(high - low < 30000) || !(voxels <= 0x1p31)) {
            std::snprintf(text, sizeof text, "the warped body measures %.0f x %.0f x %.0f mm",
                          image.extent().x, image.extent().y, image.extent().z);
            return Error{text, "resample",
                         "at most 2^31 voxels: choose a larger voxel, and check the registration"};
        }
        out.origin_mm[a] = low * h;
        out.size[a] = static_cast<int>(high - low) + 1;
    }
    return out;
}

Registration with_voxel_rim(const Registration& registration, const Grid& ct_grid) {
    Registration out = registration;
    if (out.ct_box.empty()) return out;
    for (int row = 0; row < 3; ++row) {
        double half = 0;
        for (int axis = 0; axis < 3; ++axis) {
            half += 0.5 * std::abs(ct_grid.direction(row, axis)) * ct_grid.spacing_mm[axis];
        }
        out.ct_box.lower[row] -= half;
        out.ct_box.upper[row] += half;
    }
    return out;
}

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
    if (voxels > kMaxRegionVoxels) {
        std::snprintf(text, sizeof text, "%.0f million voxels", voxels / 1e6);
        return Error{text, where, "at most 200 million: a smaller box, or larger voxels"};
    }
    return box;
}

}  // namespace sonocase::pipeline::inline segmentation
