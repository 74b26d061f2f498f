// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/segmentation_pictures.h"
#include "pipeline/base/label_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "formats/files/atomic_file.h"
#include "formats/volume/boundary_record.h"
#include "pipeline/export/nrrd_file.h"
#include "pipeline/pictures/preview_picture.h"
#include "pipeline/registration/map/inverse_map.h"

namespace sonocase::pipeline::inline exporting {
namespace {

using Colour = std::array<std::uint8_t, 3>;

int nearest_label(const LabelVolume& volume, Point3 voxel) {
    const int i = static_cast<int>(std::lround(voxel.x)),
              j = static_cast<int>(std::lround(voxel.y)),
              k = static_cast<int>(std::lround(voxel.z));
    return volume.grid.contains(i, j, k) ? volume.voxels[volume.grid.index(i, j, k)] : 0;
}

struct Plane {
    const char* name;
    int across, up, normal;
};
constexpr Plane kPlanes[] = {{"xy", 0, 1, 2}, {"xz", 0, 2, 1}, {"yz", 1, 2, 0}};

// The middle of the cube of 8 voxels that holds the most labels and nothing of the outside (which
// surrounds the body and its cut ends): the most difficult place.
Point3 busiest_place(const LabelVolume& volume) {
    const Int3 n = volume.grid.size;
    constexpr int kEdge = 8;
    std::size_t max_labels = 0;
    Point3 place{0.5 * n.x, 0.5 * n.y, 0.5 * n.z};
    for (int k = 0; k + kEdge <= n.z; k += kEdge) {
        for (int j = 0; j + kEdge <= n.y; j += kEdge) {
            for (int i = 0; i + kEdge <= n.x; i += kEdge) {
                LabelSet present;
                for (int q = 0; q < kEdge * kEdge * kEdge; q += 3) {
                    present.set(volume.voxels[volume.grid.index(
                        i + q % kEdge, j + q / kEdge % kEdge, k + q / kEdge / kEdge)]);
                }
                if (!present[0] && present.count() > max_labels) {
                    max_labels = present.count();
                    place = {i + 0.5 * kEdge, j + 0.5 * kEdge, k + 0.5 * kEdge};
                }
            }
        }
    }
    return place;
}

}  // namespace

int label_with_boundary(const LabelVolume& volume,
                        const BrickVolume<std::uint32_t>& boundary,
                        double x,
                        double y,
                        double z) {
    const int i = static_cast<int>(std::lround(x)), j = static_cast<int>(std::lround(y)),
              k = static_cast<int>(std::lround(z));
    if (!volume.grid.contains(i, j, k)) return 0;
    const int own = volume.voxels[volume.grid.index(i, j, k)];
    if (boundary.table.empty()) return own;
    const std::uint32_t packed = boundary.at(i, j, k);
    if (packed == kNoBoundary) return own;
    const BoundaryRecord record = unpack_boundary(packed);
    const double d = record.distance_vx + dot(record.normal, Vector3{x - i, y - j, z - k});
    return d >= 0 ? own : record.second_label;
}

bool label_is_within(const LabelVolume& volume, int label, double reach_vx, Point3 voxel) {
    const int n = static_cast<int>(std::ceil(reach_vx));
    for (int k = -n; k <= n; ++k) {
        for (int j = -n; j <= n; ++j) {
            for (int i = -n; i <= n; ++i) {
                const Vector3 step{1.0 * i, 1.0 * j, 1.0 * k};
                if (norm(step) <= reach_vx && nearest_label(volume, voxel + step) == label)
                    return true;
            }
        }
    }
    return false;
}

Status write_segmentation_pictures(const SegmentationPictureInput& input,
                                   const std::string& folder) {
    const Grid& g = input.after.grid;
    std::optional<InverseMap> inverse_map;
    if (input.registration) inverse_map.emplace(*input.registration);
    const auto before = [&](Point3 voxel) {
        Point3 p = g.point_from_voxel(voxel);
        if (inverse_map) {
            Point3 ct;
            if (inverse_map->invert(p, &ct) != MapStatus::ok) return 0;
            p = ct;
        }
        return nearest_label(input.before, input.before.grid.voxel_from_point(p));
    };
    // In voxels of `after`: the steps of either volume reach half a diagonal of its voxel to either
    // side of a smooth surface.
    const double reach_vx =
        0.5 * (norm(input.before.grid.spacing_mm) + norm(g.spacing_mm)) / g.spacing_mm.x;
    const auto changed_colour = [&](int before_label, int after_label, Point3 v) {
        const Colour c = colour_of(input.after.labels, after_label);
        const auto grey = static_cast<std::uint8_t>(20 + (c[0] + 2 * c[1] + c[2]) / 10);
        if (before_label == after_label) return Colour{grey, grey, grey};
        return label_is_within(input.after, before_label, reach_vx, v) ? Colour{150, 130, 60}
                                                                       : Colour{255, 40, 40};
    };
    const Point3 middle{0.5 * (g.size.x - 1), 0.5 * (g.size.y - 1), 0.5 * (g.size.z - 1)};
    const Point3 busy = busiest_place(input.after);
    for (const Plane& plane : kPlanes) {
        for (const bool close : {false, true}) {
            const Point3 centre = close ? busy : middle;
            const double reach_mm = 40;
            const double wide = close ? reach_mm / g.spacing_mm.x : g.size[plane.across];
            const double high = close ? reach_mm / g.spacing_mm.x : g.size[plane.up];
            const double step = std::max(wide, high) / 480;  // voxels per pixel
            const int width = std::max(1, static_cast<int>(wide / step));
            const int height = std::max(1, static_cast<int>(high / step));
            constexpr int kGap = 6, kPanels = 4;
            Picture picture;
            picture.width_px = kPanels * width + (kPanels - 1) * kGap;
            picture.height_px = height;
            picture.rgb.assign(static_cast<std::size_t>(3) * picture.width_px * height, 255);
            for (int y = 0; y < height; ++y) {
                for (int x = 0; x < width; ++x) {
                    Point3 v = centre;
                    v[plane.across] += (x + 0.5 - 0.5 * width) * step;
                    v[plane.up] -= (y + 0.5 - 0.5 * height) * step;
                    const int labels[3] = {
                        before(v), nearest_label(input.after, v),
                        label_with_boundary(input.after, input.boundary, v.x, v.y, v.z)};
                    for (int panel = 0; panel < kPanels; ++panel) {
                        const auto& palette = panel == 0 ? input.before.labels : input.after.labels;
                        const Colour colour = panel < 3 ? colour_of(palette, labels[panel])
                                                        : changed_colour(labels[0], labels[2], v);
                        const std::size_t at = 3 * (static_cast<std::size_t>(y) * picture.width_px +
                                                    panel * (width + kGap) + x);
                        std::copy(colour.begin(), colour.end(),
                                  picture.rgb.begin() + static_cast<std::ptrdiff_t>(at));
                    }
                }
            }
            const std::string path =
                folder + (close ? "/close-up-" : "/whole-") + plane.name + ".png";
            SONOCASE_TRY_DONE(write_file(path, png_of(picture)));
        }
    }
    return Done{};
}

}  // namespace sonocase::pipeline::inline exporting
