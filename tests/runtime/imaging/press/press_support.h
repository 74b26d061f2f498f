// SPDX-License-Identifier: Apache-2.0

// Bodies to press in tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "runtime/imaging/press/press_field.h"
#include "support/paths.h"
#include "support/random.h"

namespace sonocase::testing {

inline constexpr std::uint8_t kAir = 0, kSkin = 1, kFat = 2, kMuscle = 3, kVein = 4, kArtery = 5,
                              kBone = 6, kGas = 7, kThrombus = 8;

inline std::vector<runtime::press::PressTissue> body_tissues() {
    return {{2, true, false, false, false},    {60, false, false, false, true},
            {4, false, false, false, false},   {15, false, false, false, false},
            {0.6f, false, true, false, false}, {60, false, false, false, false},
            {1e4f, false, false, true, false}, {2, false, false, false, false},
            {10, false, false, false, false}};
}

// A tube along y, or a ball.
struct Lump {
    Point3 centre;
    double radius_mm = 5;
    std::uint8_t tissue = kVein;
    bool ball = false;
    bool holds(Point3 p) const {
        const double dx = p.x - centre.x, dy = ball ? p.y - centre.y : 0, dz = p.z - centre.z;
        return dx * dx + dy * dy + dz * dz <= radius_mm * radius_mm;
    }
};

// Layers below a plane that may be tilted, with lumps; z is depth, the face at `face_mm`.
struct Body {
    double pressed_mm = 0;          // depth of the face where the skin is at x = y = 0
    double tilt_x = 0, tilt_y = 0;  // rise of the skin per mm
    double fat_mm = 12, skin_mm = 2;
    double shift_x_mm = 0;  // of the probe along the skin
    std::vector<Lump> lumps;
    double begin_x = -1e9, end_x = 1e9;  // the body ends there

    std::uint8_t at_rest(Point3 p) const {
        const double depth = p.z - tilt_x * p.x - tilt_y * p.y;
        if (depth < 0 || p.x < begin_x || p.x > end_x) return kAir;
        for (const Lump& lump : lumps)
            if (lump.holds(p)) return lump.tissue;
        return depth < skin_mm ? kSkin : depth < fat_mm ? kFat : kMuscle;
    }
    std::uint8_t operator()(Point3 probe) const {
        return at_rest({probe.x + shift_x_mm, probe.y, probe.z + pressed_mm});
    }
};

inline bool press(runtime::press::PressField& field,
                  const Body& body,
                  const runtime::press::PressOptions& options = {},
                  std::size_t target = 0) {
    static const auto tissues = body_tissues();
    const auto targets = runtime::available_simd_targets();
    return field.press(targets[target], {tissues, runtime::press::lookup_of(body)}, options);
}

// Vein and artery side by side, as in the groin.
inline Body vessels(double pressed_mm) {
    Body body;
    body.pressed_mm = pressed_mm;
    body.lumps = {{{-6, 0, 20}, 5.5, kVein, false}, {{7, 0, 21}, 4.2, kArtery, false}};
    return body;
}

// Bone, lumens, gas, thick and thin layers, tilted skin, pressed by up to 30 mm.
inline Body random_body(Random& random) {
    Body body;
    body.pressed_mm = random.uniform(0.5, 30);
    body.tilt_x = random.uniform(-0.3, 0.3);
    body.tilt_y = random.uniform(-0.3, 0.3);
    body.skin_mm = random.uniform(1, 3);
    body.fat_mm = body.skin_mm + random.uniform(0, 30);
    const std::uint8_t kinds[] = {kVein, kVein, kArtery, kBone, kGas, kThrombus, kFat, kMuscle};
    const int count = static_cast<int>(random.uniform(0, 7));
    for (int n = 0; n < count; ++n) {
        Lump lump;
        lump.tissue = kinds[static_cast<std::size_t>(random.uniform(0, 8))];
        lump.ball = random.uniform(0, 1) < 0.5;
        lump.radius_mm = random.uniform(1.5, lump.tissue == kBone ? 20 : 9);
        const double x = random.uniform(-25, 25);
        lump.centre = {x, random.uniform(-10, 10),
                       body.tilt_x * x + random.uniform(3, 60) + lump.radius_mm * 0.8};
        body.lumps.push_back(lump);
    }
    return body;
}

}  // namespace sonocase::testing
