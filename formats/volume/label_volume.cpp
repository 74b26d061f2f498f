// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/label_volume.h"

namespace sonocase {

Point3 Grid::point_from_voxel(Point3 voxel) const {
    return origin_mm + direction * Vector3{voxel.x * spacing_mm.x, voxel.y * spacing_mm.y,
                                           voxel.z * spacing_mm.z};
}

Point3 Grid::voxel_from_point(Point3 point) const {
    const Vector3 v = point - origin_mm;  // its dot products are transpose(direction) * v
    return {dot(direction.column(0), v) / spacing_mm.x, dot(direction.column(1), v) / spacing_mm.y,
            dot(direction.column(2), v) / spacing_mm.z};
}

Box3 Grid::bounds() const {
    Box3 box;
    for (int corner = 0; corner < 8; ++corner) {
        box.include(
            point_from_voxel({(corner & 1) ? size.x - 1.0 : 0.0, (corner & 2) ? size.y - 1.0 : 0.0,
                              (corner & 4) ? size.z - 1.0 : 0.0}));
    }
    return box;
}

}  // namespace sonocase
