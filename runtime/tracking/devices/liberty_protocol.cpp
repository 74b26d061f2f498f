// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/liberty_protocol.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "runtime/tracking/devices/byte_stream.h"

namespace sonocase::runtime::liberty {

bool RecordReader::next(Record& record) {
    for (auto b = stream_.rest(); b.size() >= kHead; b = stream_.rest()) {
        // LY Liberty, LU Latus, PA Patriot. Answers to commands come in the same framing, with
        // another command and size.
        const bool head =
            (b[0] == 'L' && (b[1] == 'Y' || b[1] == 'U')) || (b[0] == 'P' && b[1] == 'A');
        const bool ours = head && u16_le(b, 6) == kBody && b[2] >= 1 && b[2] <= kMaxSensors;
        if (!ours) {
            stream_.skip();
            continue;
        }
        if (b.size() < kHead + kBody) return false;
        record = {};
        record.station = b[2];
        record.device_ms = u32_le(b, 8);
        record.frame = u32_le(b, 12);
        const auto distortion = static_cast<std::int32_t>(u32_le(b, 16));
        double v[7];
        for (std::size_t i = 0; i < 7; ++i) v[i] = f32_le(b, 20 + 4 * i);
        stream_.take(kHead + kBody);
        SensorReading& out = record.reading;
        out.world_from_sensor.translation = {10 * v[0], 10 * v[1], 10 * v[2]};  // from cm
        const double length = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
        const bool unit = std::abs(length - 1) < 0.05;
        if (unit)
            out.world_from_sensor.rotation = rotation_from_quaternion({v[3], v[4], v[5], v[6]});
        const bool fine = unit && is_finite(out.world_from_sensor) && b[4] == ' ';
        if (!is_finite(out.world_from_sensor)) out.world_from_sensor = {};
        out.state = fine ? SensorState::ok : SensorState::lost;
        // The device's measure of distortion has no documented maximum; 100 is far beyond use.
        const double bent = std::min(std::abs(static_cast<double>(distortion)) / 100, 1.0);
        out.quality = static_cast<float>(1 - bent);
        if (fine && bent > 0.5) out.state = SensorState::poor;
        return true;
    }
    return false;
}

}  // namespace sonocase::runtime::liberty
