// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/skin_plane.h"

#include <algorithm>
#include <cmath>

#include "formats/volume/boundary_record.h"

namespace sonocase::runtime::press {

std::optional<SkinPlane> skin_plane_of(const CaseView& bundle, Int3 v) {
    if (bundle->boundary.table.empty()) return std::nullopt;
    if (bundle.blocks() != nullptr) bundle.blocks()->ensure_voxel_loaded(v.x, v.y, v.z);
    const std::uint32_t bits = bundle->boundary.at(v.x, v.y, v.z);
    if (bits == kNoBoundary) return std::nullopt;
    const bool body = bundle->label_bricks.at(v.x, v.y, v.z) != 0;
    const BoundaryRecord r = unpack_boundary(bits);
    if (body == (r.second_label != 0)) return std::nullopt;
    const double sign = body ? 1 : -1;
    return SkinPlane{{static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)},
                     sign * r.distance_vx,
                     sign * r.normal};
}

double steps_to_skin(const CaseView& bundle, Point3 p, Vector3 step) {
    constexpr double kLeastSlope = 0.2;
    const double length = norm(step), most = std::sqrt(3.0) / length;
    // The voxel's own record may be that of the lower face of a thin skin.
    for (const Point3 q : {p, p - step}) {
        const Int3 v{static_cast<int>(std::floor(q.x + 0.5)),
                     static_cast<int>(std::floor(q.y + 0.5)),
                     static_cast<int>(std::floor(q.z + 0.5))};
        if (!bundle->grid.contains(v.x, v.y, v.z)) continue;
        const std::optional<SkinPlane> skin = skin_plane_of(bundle, v);
        if (!skin) continue;
        const double rate = dot(skin->inward, step);
        if (rate > kLeastSlope * length) return std::clamp(-skin->inside(p) / rate, -most, most);
    }
    return 0;
}

}  // namespace sonocase::runtime::press
