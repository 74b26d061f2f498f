// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/boundary_record.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sonocase {
namespace {

std::uint32_t signed_byte(double value) {
    // Rounds to the nearest, halves away from zero.
    const auto r = static_cast<std::int32_t>(std::min(std::abs(value), 127.0) + 0.5);
    return static_cast<std::uint32_t>(value < 0 ? -r : r) & 0xFFu;
}

double from_signed_byte(std::uint32_t bits) {
    return static_cast<double>(static_cast<std::int8_t>(bits & 0xFFu));
}

}  // namespace

std::uint32_t pack_boundary(const BoundaryRecord& record) {
    assert(record.second_label < 255);
    const Vector3 n = record.normal;
    const double sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    double u = sum > 0 ? n.x / sum : 0, v = sum > 0 ? n.y / sum : 0;
    if (n.z < 0) {  // fold the lower half of the octahedron outwards
        const double u0 = u;
        u = (1 - std::abs(v)) * (u0 < 0 ? -1 : 1);
        v = (1 - std::abs(u0)) * (v < 0 ? -1 : 1);
    }
    return record.second_label | signed_byte(record.distance_vx * kBoundaryStepsPerVoxel) << 8 |
           signed_byte(u * 127) << 16 | signed_byte(v * 127) << 24;
}

BoundaryRecord unpack_boundary(std::uint32_t packed) {
    double x = from_signed_byte(packed >> 16), y = from_signed_byte(packed >> 24);
    const double z = 127 - std::abs(x) - std::abs(y);
    if (z < 0) {
        const double x0 = x;
        x = (127 - std::abs(y)) * (x0 < 0 ? -1 : 1);
        y = (127 - std::abs(x0)) * (y < 0 ? -1 : 1);
    }
    const double scale = 1 / std::sqrt(x * x + y * y + z * z);  // never 0: they add up to 127
    return {static_cast<std::uint8_t>(packed & 0xFFu),
            from_signed_byte(packed >> 8) / kBoundaryStepsPerVoxel,
            {scale * x, scale * y, scale * z}};
}

}  // namespace sonocase
