// SPDX-License-Identifier: Apache-2.0

// What scores call visible is what a frame shows: frames with and without the needle, over many
// poses of probe and needle, beside the verdicts of formats/scoring/sight.h.
#include "formats/scoring/sight.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "imaging_support.h"

namespace sonocase::runtime {
namespace {

constexpr int kPoses = 40;
constexpr double kStretchMm = 4;  // of the shaft, whose pixels are averaged
// The speckle of these pictures has a deviation of 13 grey: a rise well above it is seen, one well
// below it is not, and between them observers differ.
constexpr double kSeenGrey = 15, kClearlySeen = 25, kClearlyUnseen = 8;

struct Verdicts {
    int points = 0, agree = 0, shown = 0, seen = 0, clear = 0, clear_agree = 0;

    void add(double pixels, bool said, const char* what) {
        const bool sees = pixels >= kSeenGrey;
        const bool is_clear = pixels >= kClearlySeen || pixels <= kClearlyUnseen;
        ++points;
        agree += sees == said;
        clear += is_clear;
        clear_agree += is_clear && sees == said;
        shown += said;
        seen += sees;
        if (is_clear && sees != said) std::printf("%s: %.0f grey\n", what, pixels);
    }
    void report(const char* what) const {
        std::printf("%s: %d points, %d seen, %d said to be, %d agree; clear %d, %d agree\n", what,
                    points, seen, shown, agree, clear, clear_agree);
        EXPECT_GE(clear_agree, 0.95 * clear) << what;
        EXPECT_GE(agree, 0.85 * points) << what;
    }
};

// Grey levels by which the needle's own echo changes the picture along a stretch of its shaft.
double rise(const std::vector<std::uint8_t>& with,
            const std::vector<std::uint8_t>& without,
            const Renderer::Layout& layout,
            Point3 from,
            Point3 to) {
    double sum = 0;
    int n = 0;
    for (int i = 0; i < 9; ++i) {
        const Point3 p = from + (i + 0.5) / 9 * (to - from);
        const int x = static_cast<int>(layout.origin_x_px + p.x / layout.mm_per_px);
        const int y = static_cast<int>(layout.origin_y_px + p.z / layout.mm_per_px);
        int best = 0;
        for (int v = -1; v <= 1; ++v)
            for (int u = -1; u <= 1; ++u) {
                if (x + u < 0 || x + u > 511 || y + v < 0 || y + v > 511) continue;
                const std::size_t at = static_cast<std::size_t>((y + v) * 512 + x + u);
                best = std::max(best, int(with[at]) - int(without[at]));
            }
        sum += best;
        ++n;
    }
    return sum / n;
}

void compare_with_frames(const CaseBundle& bundle,
                         const Exercise& exercise,
                         Verdicts& shafts,
                         Verdicts& tips) {
    const CaseAnatomy anatomy(bundle);
    const NeedleSight sight(&anatomy, exercise);
    RenderOptions options;
    auto renderer = Renderer::create(bundle, exercise, options);
    ASSERT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> with(512 * 512), without(512 * 512);
    Random random(11);
    const double depth = exercise.probe.depth_mm;
    for (int n = 0; n < kPoses; ++n) {
        FrameInput input;
        input.mannequin_from_probe = random_pose(random);
        input.frame = static_cast<std::uint32_t>(n);
        // From beside the probe, or steeply through what lies before.
        const Point3 tip{random.uniform(-0.2, 0.2) * depth, random.uniform(-0.4, 0.4),
                         random.uniform(0.2, 0.8) * depth};
        const double side = random.uniform(0, 1) < 0.5 ? -1 : 1;
        const double steep = random.uniform(0.2, 1.45);
        const Vector3 axis = normalized({side * std::cos(steep), 0, std::sin(steep)});
        input.needle.tip = input.mannequin_from_probe * tip;
        input.needle.direction = input.mannequin_from_probe * axis;
        renderer->render(input, without);
        input.has_needle = true;
        renderer->render(input, with);
        const Rigid& pose = input.mannequin_from_probe;
        char what[80];
        std::snprintf(what, sizeof what, "pose %d, tip (%.0f, %.0f), steep %.2f", n, tip.x, tip.z,
                      steep);
        const Point3 end = tip - 2 * axis;
        if (in_image(exercise.probe, tip.x, tip.z) && in_image(exercise.probe, end.x, end.z))
            tips.add(rise(with, without, renderer->layout(), tip, end),
                     sight.tip_visible(pose, tip, axis, {0, 0, -1}, 0), what);
        for (double back = 3; back < 100; back += 2 * kStretchMm) {
            const Point3 a = tip - back * axis, b = tip - (back + kStretchMm) * axis;
            if (!in_image(exercise.probe, a.x, a.z) || !in_image(exercise.probe, b.x, b.z))
                continue;
            // A stretch across a shadow's edge goes by the larger part of it.
            int parts = 0;
            for (const double part : {0.1, 0.3, 0.5, 0.7, 0.9})
                parts += sight.contrast(pose, a + part * (b - a), axis, {0, 0, -1},
                                        back + part * kStretchMm, 0) >= NeedleSight::kShownGrey;
            shafts.add(rise(with, without, renderer->layout(), a, b), parts >= 3, what);
        }
    }
}

TEST(NeedleSight, SaysWhatFramesShow) {
    Verdicts shafts, tips;
    compare_with_frames(phantom(), phantom_exercise(), shafts, tips);
    Exercise thin = phantom_exercise();
    thin.needle.gauge = 21;
    thin.needle.slab_mm = 0.9;
    compare_with_frames(phantom(), thin, shafts, tips);
    compare_with_frames(phantom(), sonocase::testing::phantom_linear_exercise(), shafts, tips);
    EXPECT_LT(shafts.seen, 0.85 * shafts.points);  // ribs, gas, air and angles hide some of it
    EXPECT_GT(shafts.clear, 400);
    EXPECT_GT(tips.clear, 60);
    shafts.report("shafts");
    tips.report("tips");
}

}  // namespace
}  // namespace sonocase::runtime
