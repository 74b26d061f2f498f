// SPDX-License-Identifier: Apache-2.0

// The truth of tissue that yields: what the picture shows, and not what lies there at rest.
#include <optional>

#include "../pressed_block.h"
#include "runtime/imaging/core/image_formation.h"
#include "runtime/imaging/core/needle_shift.h"
#include "support/hard_case.h"
#include "truth_support.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

FrameInput pressed_input(double mm, double tent_mm = 0) {
    FrameInput input;
    input.mannequin_from_probe = pressed_by(mm);
    input.has_needle = tent_mm > 0;
    input.needle = {{-6, 0, 15.5}, {0, 0, 1}, tent_mm, 0.4};
    return input;
}

// The body's own shape at the place to which the three-dimensional map pulls a pixel back: another
// way than that of the planes, which go by tables along the beams.
TEST(TruthPressed, LabelsAreThoseOfThePlacesThatTheFieldPullsBack) {
    const PressedBlock shape;
    HardCase off("pressed labels that differ from the pulled back, share", HardCase::at_most, 0.004,
                 "");
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper})
        for (const Exercise& exercise : block_exercises()) {
            RenderOptions options = picture(260, 260);
            options.model = model;
            auto truth = truth_of(pressed_block(), exercise, options);
            auto renderer = Renderer::create(pressed_block(), exercise, options);
            ASSERT_TRUE(renderer);
            for (const double mm : {4.0, 9.0, 16.0}) {
                Planes planes(options);
                const FrameInput input = pressed_input(mm);
                const FrameTruth& facts = truth.render(input, planes.spans());
                renderer->press_probe(input);
                EXPECT_EQ(facts.press.force_n, renderer->press().force_n);
                EXPECT_GT(facts.press.force_n, 0.5);
                EXPECT_TRUE(facts.mannequin_from_probe == renderer->shown_pose());
                const auto layout = renderer->layout();
                int compared = 0, wrong = 0, at_rest_wrong = 0, vein = 0;
                for (int row = 0; row < 260; ++row)
                    for (int column = 0; column < 260; ++column) {
                        const double x = (column - layout.origin_x_px) * layout.mm_per_px,
                                     z = (row - layout.origin_y_px) * layout.mm_per_px;
                        if (depth_along(exercise.probe, x, z) < 0.5 || z > 45) continue;
                        const Point3 now = renderer->shown_pose() * Point3{x, 0, z};
                        const Point3 rest = renderer->at_rest(now);
                        if (renderer->closed(rest)) continue;
                        const int label = planes.labels[planes.at(column, row)];
                        ++compared;
                        wrong += label != shape.label(rest);
                        at_rest_wrong += label != shape.label(now);
                        vein += label == PressedBlock::vein_label;
                    }
                std::printf("%d %d %2.0f mm: %d of %d differ, %d from rest, vein %d\n", int(model),
                            int(exercise.probe.shape), mm, wrong, compared, at_rest_wrong, vein);
                // Surfaces that the nodes between beams move by a fraction of a pixel.
                off.see(static_cast<double>(wrong) / compared);
                EXPECT_GT(at_rest_wrong, 3 * wrong) << mm;
            }
        }
}

TEST(TruthPressed, OnePixelAsksTheSameAsAllTogether) {
    HardCase off("labels of single pixels that differ from the planes', share", HardCase::at_most,
                 0.01, "");
    for (const Exercise& exercise : block_exercises())
        for (const double tent_mm : {0.0, 2.5}) {
            const RenderOptions options = picture(110, 120);
            auto truth = truth_of(pressed_block(), exercise, options);
            for (const double mm : {-1.0, 12.0}) {
                Planes planes(options);
                const FrameInput input = pressed_input(mm, tent_mm);
                truth.render(input, planes.spans());
                int scanned = 0, differ = 0;
                for (int row = 0; row < 120; ++row)
                    for (int column = 0; column < 110; ++column) {
                        const PixelTruth pixel = truth.at(input, column, row);
                        if (!pixel.scanned) continue;
                        ++scanned;
                        differ += pixel.label != planes.labels[planes.at(column, row)];
                        if (!std::isnan(pixel.skin_depth_mm)) {
                            EXPECT_NEAR(planes.depth[planes.at(column, row)], pixel.skin_depth_mm,
                                        0.05);
                        }
                        // The skin lies at a flat face that presses.
                        if (mm > 0 && exercise.probe.shape == ProbeShape::linear) {
                            EXPECT_NEAR(pixel.skin_depth_mm, pixel.shown.z - mm, 0.05);
                        }
                    }
                // Between nodes four beams apart at most, surfaces lie 0.1 mm off at most.
                off.see(static_cast<double>(differ) / scanned);
            }
        }
}

// A ball and an ellipsoid in muscle, by their own formulas at the place that each pixel has at
// rest.
TEST(TruthPressed, LesionsAndPlacesAtRestAreThoseOfEachPixel) {
    for (Exercise exercise : block_exercises()) {
        Finding finding;
        finding.lesion.name = "oval";
        finding.lesion.centre = {-7, 1, 31};
        finding.lesion.radius_mm = 4;
        finding.lesion.look = TargetLook::cyst;
        finding.lesion.axes.axes = rotation_about({0, 1, 0}, 0.5);
        finding.lesion.axes.lengths = {1.6, 0.8, 1 / (1.6 * 0.8)};
        exercise.findings = {finding};
        Target ball;
        ball.name = "ball";
        ball.centre = {4, 0, 29};
        ball.radius_mm = 6;
        ball.look = TargetLook::cyst;
        exercise.targets = {ball};
        for (const bool mirrored : {false, true}) {
            const RenderOptions options = picture(110, 120);
            auto truth = truth_of(pressed_block(), exercise, options);
            for (const double mm : {-1.0, 12.0}) {
                Planes planes(options);
                FrameInput input = pressed_input(mm, 2.5);
                input.settings.flip_left_right = mirrored;
                input.change.target_scale[0] = 0.8;  // of the ball
                const FrameTruth& facts = truth.render(input, planes.spans());
                int scanned = 0, differ = 0;
                std::uint32_t pixels[3] = {};
                for (int row = 0; row < 120; ++row)
                    for (int column = 0; column < 110; ++column) {
                        const std::size_t at = planes.at(column, row);
                        const PixelTruth pixel = truth.at(input, column, row);
                        const auto [x, y, z] = planes.rest[at];
                        if (pixel.label > 0) {
                            ASSERT_FALSE(std::isnan(x));
                        }
                        ASSERT_LT(planes.lesions[at], 3);
                        ++pixels[planes.lesions[at]];
                        if (!pixel.scanned) {
                            ASSERT_TRUE(std::isnan(x));
                            continue;
                        }
                        ++scanned;
                        // Nodes of the press field are a few beams apart, and end at the sector's
                        // edge.
                        EXPECT_TRUE(!(distance(pixel.rest, {x, y, z}) >= 0.4) ||
                                    !truth.at(input, column - 2, row).scanned ||
                                    !truth.at(input, column + 2, row).scanned)
                            << int(exercise.probe.shape) << ": " << column << " " << row;
                        int expected = 0;
                        if (pixel.label == PressedBlock::muscle) {
                            const Vector3 f = transpose(finding.lesion.axes.axes) *
                                              (pixel.rest - finding.lesion.centre);
                            const Vector3 half = 4 * finding.lesion.axes.lengths;
                            if (norm(Vector3{f.x / half.x, f.y / half.y, f.z / half.z}) < 1)
                                expected = 1;
                            if (distance(pixel.rest, ball.centre) < 0.8 * 6) expected = 2;
                        }
                        differ += planes.lesions[at] != expected;
                    }
                EXPECT_LT(differ, 0.01 * scanned);
                EXPECT_EQ(facts.pixels_of_lesion, (std::vector{pixels[1], pixels[2]}));
                EXPECT_GT(pixels[1] * facts.mm2_per_px, 20);
                EXPECT_GT(pixels[2] * facts.mm2_per_px, 40);
            }
        }
    }
}

// A vein under a probe is a slit that closes from its ends, without holes or stripes of wall in it.
TEST(TruthPressed, AVeinIsWholeHoweverDeepItIsPressed) {
    const RenderOptions options = picture(260, 260);
    auto truth = truth_of(pressed_block(), pressed_exercise(), options);
    Planes planes(options);
    int open = 0, shut = 0;
    for (int mm = 0; mm <= 24; mm += 2) {
        truth.render(pressed_input(mm), planes.spans());
        int vein = 0, in_two = 0;
        for (int column = 0; column < 260; ++column) {
            int begins = 0;
            for (int row = 1; row < 260; ++row) {
                const auto is_vein = [&](int r) {
                    return planes.labels[planes.at(column, r)] == PressedBlock::vein_label;
                };
                vein += is_vein(row);
                begins += is_vein(row) && !is_vein(row - 1);
            }
            in_two += begins > 1;
        }
        EXPECT_LE(in_two, 3) << mm;  // a node's width where the slit ends
        open += vein > 500;
        shut += vein < 50;
    }
    EXPECT_GT(open, 3);
    EXPECT_GT(shut, 0);
}

TEST(TruthPressed, ALesionLiesWhereThePictureHasIt) {
    Exercise exercise = pressed_exercise();
    Target cyst;
    cyst.centre = {0, 0, 32};
    cyst.radius_mm = 6;
    cyst.look = TargetLook::cyst;
    exercise.targets = {cyst};
    for (const double mm : {0.0, 8.0}) {
        const FrameInput input = pressed_input(mm);
        const auto drawn = [&](const char* effects, Planes& planes) {
            const RenderOptions options = picture(200, 250, {effects});
            auto renderer = Renderer::create(pressed_block(), exercise, options);
            EXPECT_TRUE(renderer);
            std::vector<std::uint8_t> pixels(planes.labels.size());
            renderer->render(input, pixels);
            truth_of(pressed_block(), exercise, options).render(input, planes.spans());
            return pixels;
        };
        Planes with(picture(200, 250)), without(picture(200, 250));
        const auto shown = drawn("all", with), plain = drawn("-targets", without);
        double sum[2] = {}, count[2] = {};  // change of grey inside, and beside it at its depths
        for (int row = 0; row < 250; ++row)
            for (int column = 0; column < 200; ++column) {
                const std::size_t at = with.at(column, row);
                EXPECT_EQ(without.lesions[at], 0);
                if (std::isnan(with.rest[at][0])) continue;
                const auto [x, y, z] = with.rest[at];
                const double from = distance(Point3{x, y, z}, cyst.centre);
                if (std::abs(from - 6) < 1 || from > 9 || std::abs(z - 32) > 4) continue;
                EXPECT_EQ(with.lesions[at], from < 6 ? 1 : 0);
                sum[from < 6] += plain[at] - shown[at];
                ++count[from < 6];
            }
        EXPECT_GT(sum[1] / count[1], 15);
        EXPECT_NEAR(sum[0] / count[0], 0, 4);
    }
}

TEST(TruthPressed, AnAdvancingNeedleDentsTheWallBeforeIt) {
    const PressedBlock shape;
    const RenderOptions options = picture(260, 260, {"-contact"});
    auto truth = truth_of(pressed_block(), pressed_exercise(), options);
    auto renderer = Renderer::create(pressed_block(), pressed_exercise(), options);
    ASSERT_TRUE(renderer);
    const auto layout = renderer->layout();
    const FrameInput input = pressed_input(-1, 2.5);
    Planes planes(options);
    truth.render(input, planes.spans());
    const Rigid& pose = input.mannequin_from_probe;
    NeedleDent dent{input.needle.tip, input.needle.direction, 2.5, 0.4};
    int compared = 0, wrong = 0, moved = 0;
    for (int row = 0; row < 260; ++row)
        for (int column = 0; column < 260; ++column) {
            const Point3 now = pose * Point3{(column - layout.origin_x_px) * layout.mm_per_px, 0,
                                             (row - layout.origin_y_px) * layout.mm_per_px};
            if (now.z < 0.5 || now.z > 45 || std::abs(now.x) > 19) continue;
            const Vector3 u = dent_shift(dent, now);
            const int expected = shape.label(now - u);
            ++compared;
            wrong += planes.labels[planes.at(column, row)] != expected;
            moved += expected != shape.label(now);
        }
    std::printf("%d of %d differ, %d moved\n", wrong, compared, moved);
    EXPECT_GT(moved, 50);
    EXPECT_LT(wrong, 0.005 * compared);
}

TEST(TruthPressed, TargetsAndTheTipAreWhereTissueIsNow) {
    Exercise exercise = pressed_exercise();
    exercise.targets.resize(1);
    exercise.targets[0].name = "vein";
    exercise.targets[0].centre = PressedBlock().vein;
    const RenderOptions options = picture(100, 100);
    auto truth = truth_of(pressed_block(), exercise, options);
    auto renderer = Renderer::create(pressed_block(), exercise, options);
    ASSERT_TRUE(renderer);
    FrameInput input = pressed_input(8, 0.01);
    renderer->press_probe(input);
    const Point3 now = renderer->current_position(exercise.targets[0].centre);
    EXPECT_GT(now.z, PressedBlock().vein.z + 1);
    input.needle.tip = now;
    const FrameTruth& facts = truth.render(input, {});
    EXPECT_NEAR(distance(facts.targets[0].centre, now), 0, 1e-9);
    EXPECT_NEAR(facts.targets[0].tip_mm, 0, 1e-9);
    EXPECT_EQ(facts.tip_label, PressedBlock::vein_label);
}

// The renderer has pressed the probe and found the beams' contact: its truth takes that over, with
// the bytes of a truth that finds all by itself. What the renderer did last must be that frame.
TEST(TruthPressed, WhatTheRendererHasFoundIsTakenOverWithTheSameBytes) {
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper})
        for (const Exercise& exercise : block_exercises()) {
            RenderOptions options = picture(180, 170);
            options.model = model;
            auto renderer = Renderer::create(pressed_block(), exercise, options);
            ASSERT_TRUE(renderer);
            auto alone = truth_of(pressed_block(), exercise, options),
                 beside = truth_of(pressed_block(), exercise, options);
            std::vector<std::uint8_t> pixels(180 * 170);
            const auto compare = [&](const FrameInput& input, bool found) {
                EXPECT_EQ(renderer->rendered(input).has_value(), found);
                Planes a(options), b(options);
                const FrameTruth facts = alone.render(input, a.spans());
                const FrameTruth& same = beside.render(input, b.spans(), &*renderer);
                EXPECT_TRUE(a == b);
                EXPECT_TRUE(facts.mannequin_from_probe == same.mannequin_from_probe);
                EXPECT_EQ(facts.press.force_n, same.press.force_n);
                EXPECT_EQ(facts.beams_touching, same.beams_touching);
                EXPECT_EQ(facts.tip_label, same.tip_label);
            };
            EXPECT_FALSE(renderer->rendered(pressed_input(9)));  // before the first frame
            for (const FrameInput& input :
                 {pressed_input(-3), pressed_input(9), pressed_input(9, 2.5), pressed_input(14)}) {
                renderer->render(input, pixels);
                compare(input, true);
                // The same tissue in another picture.
                FrameInput brighter = input;
                brighter.settings.gain_db = 9;
                brighter.frame = 5;
                compare(brighter, true);
            }
            FrameInput input = pressed_input(9);
            renderer->render(input, pixels);
            for (const auto change :
                 {+[](FrameInput& i) { i.settings.press_mm = 2; },
                  +[](FrameInput& i) { i.change.venous_pressure_mmhg = 2; },
                  +[](FrameInput& i) { i.change.pool_count = 1; },
                  +[](FrameInput& i) { i.has_needle = true; },
                  +[](FrameInput& i) { i.mannequin_from_probe.translation.x += 1; }}) {
                FrameInput other = input;
                change(other);
                compare(other, false);
            }
            compare(input, true);
            renderer->press_probe(pressed_input(4));  // asked for another pose since then
            compare(input, false);
            renderer->render(input, pixels);
            renderer->press_mm_for(input.mannequin_from_probe, 5, 3);
            compare(input, false);
            renderer->leave_out(-1);
            compare(input, false);
        }
}

TEST(TruthPressed, EveryInstructionSetGivesTheSameBytesAndWithoutTheEffectNothingMoves) {
    for (const Exercise& exercise : block_exercises()) {
        RenderOptions options = picture(150, 140);
        std::optional<Planes> first;
        for (const std::string& name : simd_targets()) {
            options.simd = name;
            auto truth = truth_of(pressed_block(), exercise, options);
            Planes planes(options);
            truth.render(pressed_input(11, 2), planes.spans());
            if (!first) first = planes;
            EXPECT_TRUE(planes == *first) << name;
        }
        options.effects = {"-deformation"};
        auto still = truth_of(pressed_block(), exercise, options);
        Planes planes(options), again(options);
        const FrameTruth& facts = still.render(pressed_input(11, 2), planes.spans());
        EXPECT_FALSE(facts.press.pressed);
        EXPECT_FALSE(planes == *first);
    }
}

}  // namespace
}  // namespace sonocase::runtime
