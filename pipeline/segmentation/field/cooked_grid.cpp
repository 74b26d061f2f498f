// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/field/cooked_grid.h"

#include <cmath>
#include <cstdio>

namespace sonocase::pipeline {

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

}  // namespace sonocase::pipeline
