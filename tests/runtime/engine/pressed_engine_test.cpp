// SPDX-License-Identifier: Apache-2.0

// The engine on tissue that yields: force out of a frame and into it, and vessels punctured.
#include <gtest/gtest.h>

#include <vector>

#include "runtime/engine/scan_engine.h"
#include "support/phantom_bundle.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

// Skin, fat, muscle and liver below a slightly curved skin; a vein of 8 mm radius at (5, y, 75).
CaseBundle phantom_with_vein() {
    PhantomOptions options;
    options.voxel_mm = 1.5;
    options.ribs = options.gas = options.kidney = false;
    options.structure = options.boundaries = false;
    CaseBundle bundle = Phantom(options).bundle();
    bundle.labels[Phantom::blood].name = "hepatic_vein";
    return bundle;
}

class PressedEngine : public ::testing::Test {
  protected:
    void SetUp() override {
        exercise_ = phantom_linear_exercise();
        exercise_.probe.depth_mm = 90;
        options_.render.width_px = options_.render.height_px = 48;
        options_.render.scanlines = 32;
        options_.render.samples = 64;
    }
    ScanEngine engine() {
        auto made = ScanEngine::create(bundle_, exercise_, options_);
        EXPECT_TRUE(made.has_value());
        return std::move(*made);
    }
    static TrackerReading reading(std::uint64_t n, double tip_z) {
        TrackerReading r;
        r.sequence = n;
        r.time_s = 0.01 * static_cast<double>(n);
        r.in_mannequin = true;
        r.sensor_count = 2;
        r.sensors[0].state = r.sensors[1].state = SensorState::ok;
        r.sensors[1].world_from_sensor.translation = {5, 0, tip_z};
        return r;
    }
    struct Punctures {
        std::vector<NeedleEvent> events;
        double deepest_tent_mm = 0;
    };
    // The needle goes straight down to 90 mm in `steps` frames.
    Punctures insert(int steps, double press_mm) {
        ScanEngine e = engine();
        e.begin_session(0);
        ImageSettings settings;
        settings.press_mm = press_mm;
        Punctures out;
        for (int n = 0; n <= steps; ++n) {
            e.observe(reading(static_cast<std::uint64_t>(n + 1), -10 + 100.0 * n / steps), false);
            e.frame(0.01 * n, settings, pixels_);
            const PunctureReport& p = e.last().puncture;
            out.deepest_tent_mm = std::max(out.deepest_tent_mm, p.tent_mm);
            out.events.insert(out.events.end(), p.events.begin(), p.events.begin() + p.event_count);
        }
        return out;
    }

    const CaseBundle bundle_ = phantom_with_vein();
    Exercise exercise_;
    EngineOptions options_;
    std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(48 * 48);
};

TEST_F(PressedEngine, ForceRisesWithDepthAndIsInvertedByASensor) {
    ScanEngine e = engine();
    e.observe(reading(1, -40), false);
    ImageSettings settings;
    double before = 0;
    for (const double mm : {2.0, 4.0, 8.0, 12.0, 20.0}) {
        settings.press_mm = mm;
        e.frame(0, settings, pixels_);
        EXPECT_TRUE(e.last().press.pressed);
        EXPECT_GT(e.last().press.force_n, before) << mm;
        EXPECT_GT(e.last().press.pressure_kpa, 0);
        before = e.last().press.force_n;
    }
    // A sensor that feels 6 N: the picture is that of the depth at which the face would feel them.
    TrackerReading felt = reading(2, -40);
    for (int n = 0; n < 40; ++n) {
        felt.sequence++;
        felt.time_s += 0.02;
        felt.force_n = std::min(6.0, 0.3 * n);
        e.observe(felt, true);
        e.frame(felt.time_s, {}, pixels_);
    }
    EXPECT_NEAR(e.last().press.force_n, 6, 0.3);  // six steps of the inversion
    EXPECT_GT(e.last().input.settings.press_mm, 1);
}

TEST_F(PressedEngine, PuncturesAreTheSameAtAnyFrameRate) {
    const Punctures slow = insert(50, 0), fast = insert(400, 0);
    ASSERT_EQ(slow.events.size(), fast.events.size());
    for (std::size_t n = 0; n < slow.events.size(); ++n) {
        EXPECT_EQ(slow.events[n].kind, fast.events[n].kind);
        EXPECT_EQ(slow.events[n].layer, fast.events[n].layer);
        // Multiples of the step below the skin that the frame found, to a hundredth of a mm.
        EXPECT_NEAR(slow.events[n].depth_mm, fast.events[n].depth_mm, 0.11);
    }
    EXPECT_GT(fast.deepest_tent_mm, 0.2);
    int vein = 0, far_wall = 0;
    for (const NeedleEvent& event : fast.events) {
        if (event.layer != Phantom::blood) continue;
        vein += event.kind == NeedleEventKind::puncture;
        far_wall += event.kind == NeedleEventKind::posterior_wall;
    }
    EXPECT_EQ(vein, 1);
    EXPECT_EQ(far_wall, 1);  // to 90 mm: through and out again
}

TEST_F(PressedEngine, AReplayIsBitExact) {
    exercise_.deformation.press_offset_mm = 6;
    const Punctures once = insert(120, 6), again = insert(120, 6);
    ASSERT_EQ(once.events.size(), again.events.size());
    for (std::size_t n = 0; n < once.events.size(); ++n) {
        EXPECT_EQ(once.events[n].depth_mm, again.events[n].depth_mm);
        EXPECT_EQ(once.events[n].force_n, again.events[n].force_n);
    }
}

}  // namespace
}  // namespace sonocase::runtime
