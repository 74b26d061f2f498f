// SPDX-License-Identifier: Apache-2.0

// What a needle does to tissue in pictures, and small slides under pressure.
#include <gtest/gtest.h>

#include <cmath>

#include "pressed_block.h"
#include "runtime/imaging/core/needle_shift.h"
#include "support/hard_case.h"

namespace sonocase::runtime {
namespace {

using testing::HardCase;

using namespace sonocase::testing;

constexpr int kLines = 128;

// The tip at the near wall of the vein, which it has pushed ahead by tent_mm.
FrameInput dented(double pressed_mm, double tent_mm, double drag_mm = 0.4) {
    FrameInput input;
    input.mannequin_from_probe = pressed_by(pressed_mm);
    input.has_needle = true;
    const Vector3 axis = normalized(Vector3{0.4, 0, 1});
    input.needle = {Point3{-7, 0, 16}, axis, tent_mm, drag_mm};
    input.time_s = 0.7;
    return input;
}

// As in pressed_frame_test.cpp; nodes between which the probe's shift is linear move with the dent.
TEST(PressedNeedle, FastAndSlowRenderersAgree) {
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper})
        for (const Exercise& exercise : block_exercises())
            for (const double pressed_mm : {-1.0, 8.0}) {
                const auto fast = block_picture(model, kLines),
                           slow = block_picture(model, kLines, RendererKind::reference);
                const auto differ = [&](const FrameInput& input) {
                    return compare(draw(exercise, fast, input, pressed_block()),
                                   draw(exercise, slow, input, pressed_block()));
                };
                const Difference d = differ(dented(pressed_mm, 3)),
                                 plain = differ(dented(pressed_mm, 0, 0));
                std::printf("%d %d %+.0f: mean %.3f (without %.3f) bias %+.3f\n", int(model),
                            int(exercise.probe.shape), pressed_mm, d.mean, plain.mean, d.bias);
                EXPECT_LT(d.mean, 0.15 + 1.1 * plain.mean);
                EXPECT_LT(std::abs(d.bias), 0.15);
            }
}

TEST(PressedNeedle, PixelsAreTheSameOnEveryInstructionSetAndThreadCount) {
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper})
        for (const Exercise& exercise : block_exercises())
            for (const double pressed_mm : {-1.0, 9.0}) {
                RenderOptions options = block_picture(model, kLines);
                options.host = thread_host();
                options.scanlines = 101;
                const FrameInput input = dented(pressed_mm, 2.7);
                const auto expected = draw(exercise, options, input, pressed_block());
                for (const std::string& simd : simd_targets()) {
                    options.simd = simd;
                    for (const int threads : {1, 3}) {
                        options.threads = threads;
                        EXPECT_TRUE(draw(exercise, options, input, pressed_block()) == expected)
                            << simd;
                    }
                }
            }
}

TEST(PressedNeedle, WithoutADentOrWithoutTheEffectNoPixelChanges) {
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper}) {
        const RenderOptions on = block_picture(model, kLines);
        RenderOptions off = on;
        off.effects = {"-deformation"};
        const auto plain = draw(pressed_exercise(), off, dented(-1, 0, 0), pressed_block());
        EXPECT_TRUE(draw(pressed_exercise(), on, dented(-1, 0, 0), pressed_block()) == plain);
        EXPECT_TRUE(draw(pressed_exercise(), off, dented(-1, 3), pressed_block()) == plain);
        EXPECT_TRUE(draw(pressed_exercise(), on, dented(-1, NAN, 0.1), pressed_block()) == plain);
        EXPECT_FALSE(draw(pressed_exercise(), on, dented(-1, 3), pressed_block()) == plain);
        // Further than the dent reaches, every pixel is as it was.
        FrameInput away = dented(-1, 3);
        away.needle.tip.y = 17;
        FrameInput still = away;
        still.needle.tent_mm = still.needle.drag_mm = 0;
        EXPECT_TRUE(draw(pressed_exercise(), on, away, pressed_block()) ==
                    draw(pressed_exercise(), on, still, pressed_block()));
    }
}

// The near wall of the vein lies where the tip has pushed it.
TEST(PressedNeedle, TheWallOfAVeinIsPushedAhead) {
    const PressedBlock shape;
    const RenderOptions options = field_picture();
    auto renderer = Renderer::create(pressed_block(), pressed_exercise(), options);
    ASSERT_TRUE(renderer.has_value());
    const auto layout = renderer->layout();
    // Straight down on the middle of the vein, whose near wall lies at 14.5.
    const auto wall_at = [&](double tent_mm) {
        FrameInput input = dented(-1, tent_mm, 0);
        input.needle = {Point3{shape.vein.x, 0, 14.5 + tent_mm}, {0, 0, 1}, tent_mm, 0};
        std::vector<std::uint8_t> pixels(400 * 400);
        renderer->render(input, pixels);
        const int x = static_cast<int>(shape.vein.x / layout.mm_per_px + layout.origin_x_px + 0.5);
        const auto row = [&](double z) {
            return static_cast<int>((z + 1) / layout.mm_per_px + layout.origin_y_px + 0.5);
        };
        int y = row(20);
        while (y > row(8) && pixels[static_cast<std::size_t>(y * 400 + x)] < 40) --y;
        return (y + 0.5 - layout.origin_y_px) * layout.mm_per_px - 1;
    };
    const double rest = wall_at(0);
    HardCase off("wall of a vein that a tip pushes ahead, off the tip, two pixels",
                 HardCase::at_most, 0.25, "mm");
    for (const double tent_mm : {1.0, 2.0, 3.0}) {
        std::printf("%.0f mm: wall at %.2f, at rest %.2f\n", tent_mm, wall_at(tent_mm), rest);
        off.see(std::abs(wall_at(tent_mm) - rest - tent_mm));
    }
}

// A slide of 0.1 mm changes the pressed picture hardly more than the same slide changes it at rest:
// the tissue does not shiver beside it.
TEST(PressedNeedle, ASmallSlideUnderPressureIsASmallChange) {
    HardCase more("change by the slide beyond 1.2 times that at rest", HardCase::at_most, 0.2,
                  "grey");
    RenderOptions options = block_picture(ImageModel::physical, kLines);
    options.effects = {"auto", "-noise", "-persistence"};
    options.width_px = options.height_px = 400;
    options.scanlines = 192;
    options.samples = 512;
    const auto slide = [&](double pressed_mm, double by_mm) {
        double sum = 0;
        for (const double x : {-3.0, 1.3, 2.2}) {
            FrameInput a, b;
            a.mannequin_from_probe = b.mannequin_from_probe = pressed_by(pressed_mm);
            a.mannequin_from_probe.translation.x = x;
            b.mannequin_from_probe.translation.x = x + by_mm;
            sum += compare(draw(pressed_exercise(), options, a, pressed_block()),
                           draw(pressed_exercise(), options, b, pressed_block()))
                       .mean;
        }
        return sum / 3;
    };
    const double at_rest = slide(-0.5, 0.1), pressed = slide(8, 0.1);
    std::printf("0.1 mm: %.3f at rest, %.3f under 8 mm\n", at_rest, pressed);
    // 0.02 mm of tissue beyond the slide, the bar, is a fifth of it.
    more.see(pressed - 1.2 * at_rest);
}

}  // namespace
}  // namespace sonocase::runtime
