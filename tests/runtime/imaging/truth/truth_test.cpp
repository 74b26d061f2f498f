// SPDX-License-Identifier: Apache-2.0

// The truth beside a picture against the label volume, by a computation of its own: the plane by
// the probe's definition, the tissue by CaseAnatomy, one pixel after the other.
#include "runtime/imaging/truth/frame_truth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "../pressed_block.h"
#include "formats/files/load_save.h"
#include "formats/scoring/anatomy.h"
#include "support/hard_case.h"
#include "support/temporary_folder.h"
#include "truth_support.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::HardCase;

// Pixel by pixel: the label must be the one of the volume wherever that is the same everywhere
// within `clear_mm`. Returns the share of pixels that were compared.
double compare_labels(const CaseBundle& bundle,
                      const Exercise& exercise,
                      const RenderOptions& options,
                      const FrameInput& input,
                      const Renderer::Layout& layout,
                      const Planes& planes,
                      const BreathingMotion& breathing,
                      double clear_mm) {
    const CaseAnatomy anatomy(bundle, breathing);
    int scanned = 0, compared = 0, wrong = 0;
    for (int row = 0; row < options.height_px; ++row) {
        for (int column = 0; column < options.width_px; ++column) {
            const double x = (column - layout.origin_x_px) * layout.mm_per_px,
                         z = (row - layout.origin_y_px) * layout.mm_per_px;
            if (depth_along(exercise.probe, x, z) < 0) continue;
            ++scanned;
            const Point3 now = input.mannequin_from_probe * Point3{x, 0, z};
            const Point3 rest = anatomy.at_rest(now, input.time_s);
            const int label = anatomy.label(rest);
            bool clear = true;
            for (int axis = 0; axis < 3; ++axis) {
                for (const double step : {-clear_mm, clear_mm}) {
                    Point3 beside = rest;
                    beside[axis] += step;
                    clear = clear && anatomy.label(beside) == label;
                }
            }
            if (!clear) continue;
            ++compared;
            wrong += planes.labels[planes.at(column, row)] != label;
        }
    }
    EXPECT_EQ(wrong, 0) << "of " << compared;
    return static_cast<double>(compared) / scanned;
}

TEST(Truth, LabelsAreThoseOfTheVolumeForEveryProbeAndPose) {
    const CaseBundle& bundle = phantom();
    const std::uint64_t seed = 24;
    SCOPED_TRACE(seed);
    HardCase compared("share of pixels 0.1 mm from surfaces, whose labels are all the volume's",
                      HardCase::at_least, 0.8, "");
    Random random(seed);
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        Exercise exercise = phantom_exercise();
        exercise.probe.shape = shape;
        exercise.breathing.amplitude_mm = 12;
        exercise.breathing.direction = {0, 0.6, 0.8};
        // Without contact and pressing, which have tests of their own, the plane is flat.
        const RenderOptions options = picture(150, 130, {"-contact", "-deformation"});
        auto truth = truth_of(bundle, exercise, options);
        auto renderer = Renderer::create(bundle, exercise, options);
        ASSERT_TRUE(renderer);
        for (int n = 0; n < 6; ++n) {
            FrameInput input;
            input.mannequin_from_probe = random_pose(random);
            input.time_s = n < 2 ? 0 : random.uniform(0, 8);
            Planes planes(options);
            ASSERT_TRUE(truth.render(input, planes.spans()).posed);
            const double share =
                compare_labels(bundle, exercise, options, input, renderer->layout(), planes,
                               exercise.breathing, 0.1);
            compared.see(share);
        }
    }
}

TEST(Truth, LabelsAreThoseOfThePhantomItself) {
    const Phantom body;
    const CaseBundle& bundle = phantom();
    const Exercise exercise = phantom_exercise();
    const RenderOptions options = picture(256, 256, {"-contact"});
    auto truth = truth_of(bundle, exercise, options);
    FrameInput input;
    Planes planes(options);
    truth.render(input, planes.spans());
    auto renderer = Renderer::create(bundle, exercise, options);
    ASSERT_TRUE(renderer);
    const auto layout = renderer->layout();
    int compared = 0, wrong = 0;
    for (int row = 0; row < 256; ++row) {
        for (int column = 0; column < 256; ++column) {
            const double x = (column - layout.origin_x_px) * layout.mm_per_px,
                         z = (row - layout.origin_y_px) * layout.mm_per_px;
            if (depth_along(exercise.probe, x, z) < 0) continue;
            // Two surfaces within a voxel of 1 mm are one record.
            bool clear = z < 168 && std::abs(x) < 88;  // where the volume ends
            for (int shape = 1; shape < Phantom::count; ++shape)
                clear = clear && std::abs(body.distance(shape, {x, 0, z})) > 1.0;
            if (!clear) continue;
            ++compared;
            wrong += planes.labels[planes.at(column, row)] != body.label({x, 0, z});
        }
    }
    EXPECT_GT(compared, 20000);
    EXPECT_EQ(wrong, 0);
}

// Lifted, tilted by 50 degrees, on its side, upside down and seen from the other side.
TEST(Truth, AnyProbeHasTheLabelsOfThePlacesThatItsPixelsShow) {
    const Phantom body;
    const CaseBundle& bundle = phantom();
    const Exercise exercise = phantom_exercise();
    const RenderOptions options = picture(160, 160, {"-contact", "-deformation"});
    auto truth = truth_of(bundle, exercise, options);
    auto renderer = Renderer::create(bundle, exercise, options);
    ASSERT_TRUE(renderer);
    const auto layout = renderer->layout();
    HardCase other("of pixels 1 mm from surfaces, of any probe, with another label",
                   HardCase::at_most, 0, "");
    Planes planes(options);
    for (const auto& [axis, angle, lift_mm, flipped] :
         {std::tuple{Vector3{1, 0, 0}, 0.0, -6.0, false},
          {{1, 0, 0}, 0.9, 0.0, false},
          {{0, 0, 1}, 1.57, 0.0, false},
          {{0, 0, 1}, 3.14, 0.0, true},
          {{0, 1, 0}, 0.5, 2.0, true}}) {
        FrameInput input;
        input.mannequin_from_probe.rotation = rotation_about(axis, angle);
        input.mannequin_from_probe.translation = {2, -3, lift_mm};
        input.settings.flip_left_right = flipped;
        truth.render(input, planes.spans());
        int wrong = 0, compared = 0;
        for (int row = 0; row < options.height_px; ++row) {
            for (int column = 0; column < options.width_px; ++column) {
                const double x = (column - layout.origin_x_px) * layout.mm_per_px,
                             z = (row - layout.origin_y_px) * layout.mm_per_px;
                if (depth_along(exercise.probe, x, z) < 0) continue;
                const Point3 at = input.mannequin_from_probe * Point3{flipped ? -x : x, 0, z};
                // Where the volume ends, and two surfaces within a voxel, are left out.
                bool clear = true;
                for (int a = 0; a < 3; ++a) {
                    const double from = at[a] - bundle.grid.origin_mm[a],
                                 end = (bundle.grid.size[a] - 1) * bundle.grid.spacing_mm[a];
                    clear = clear && from > 2 && from < end - 2;
                }
                for (int shape = 1; shape < Phantom::count; ++shape)
                    clear = clear && std::abs(body.distance(shape, at)) > 1.0;
                if (!clear) continue;
                ++compared;
                wrong += planes.labels[planes.at(column, row)] != body.label(at);
            }
        }
        EXPECT_GT(compared, 1000);
        other.see(wrong);
    }
}

TEST(Truth, OnePixelAsksTheSameAsAllTogether) {
    const CaseBundle& bundle = phantom();
    Exercise exercise = phantom_exercise();
    exercise.breathing.amplitude_mm = 10;
    const RenderOptions options = picture(97, 83);
    auto truth = truth_of(bundle, exercise, options);
    for (const bool flipped : {false, true}) {
        FrameInput input;
        input.mannequin_from_probe.translation = {3, 2, -9};  // a gap to close
        input.mannequin_from_probe.rotation = rotation_about({0, 0, 1}, 0.4);
        input.time_s = 1.3;
        input.settings.flip_left_right = flipped;
        Planes planes(options);
        truth.render(input, planes.spans());
        int differ = 0, scanned = 0;
        for (int row = 0; row < options.height_px; ++row) {
            for (int column = 0; column < options.width_px; ++column) {
                const PixelTruth pixel = truth.at(input, column, row);
                const std::size_t n = planes.at(column, row);
                if (!pixel.scanned) {
                    EXPECT_EQ(planes.labels[n], 0);
                    EXPECT_TRUE(std::isnan(planes.depth[n]));
                    continue;
                }
                ++scanned;
                differ += planes.labels[n] != pixel.label;
                // Single precision.
                if (!std::isnan(pixel.skin_depth_mm)) {
                    EXPECT_NEAR(planes.depth[n], pixel.skin_depth_mm, 0.02);
                }
            }
        }
        EXPECT_GT(scanned, 2000);
        EXPECT_LE(differ, scanned / 1000);  // on a surface to within single precision
    }
}

// Places that follow from those of a tile's points are off by kMaxOffMm at most where that is
// tried, and by less than twice that in between: a pixel has the label of a place so near. One
// place alone takes the gap of the nearest ray, half of 0.33 mm away at most, where gaps rise by
// 0.1 mm per mm.
TEST(Truth, PixelsOfATileHaveTheLabelsOfTheirOwnPlaces) {
    const CaseBundle& bundle = phantom();
    const CaseAnatomy anatomy(bundle);
    const double near_mm = 2 * 0.02 + 0.5 * 0.33 * 0.1;
    const std::uint64_t seed = 47;
    SCOPED_TRACE(seed);
    HardCase off("pixels with a label that no place within 0.06 mm of theirs has",
                 HardCase::at_most, 0, "");
    HardCase share("pixels whose own place has another label, share", HardCase::at_most, 0.001, "");
    Random random(seed);
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        Exercise exercise = phantom_exercise();
        exercise.probe.shape = shape;
        exercise.breathing.amplitude_mm = 12;
        exercise.breathing.direction = {0, 0.6, 0.8};
        const RenderOptions options = picture(512, 400, {"-deformation"});
        auto truth = truth_of(bundle, exercise, options);
        for (int n = 0; n < 4; ++n) {
            FrameInput input;  // lifted and turned: gaps to close, and beams in air
            input.mannequin_from_probe.translation = {random.uniform(-10, 10), 2,
                                                      random.uniform(-9, 2)};
            input.mannequin_from_probe.rotation =
                rotation_about({0, 1, 0}, random.uniform(-0.1, 0.1)) *
                rotation_about({0, 0, 1}, random.uniform(0, 3));
            input.time_s = random.uniform(0, 8);
            Planes planes(options);
            truth.render(input, planes.spans());
            int scanned = 0, differ = 0, far = 0;
            for (int row = 0; row < options.height_px;
                 row += 5)  // of every column and row of tiles
                for (int column = 0; column < options.width_px; column += 5) {
                    const PixelTruth pixel = truth.at(input, column, row);
                    if (!pixel.scanned) continue;
                    ++scanned;
                    const int label = planes.labels[planes.at(column, row)];
                    if (label == pixel.label) continue;
                    ++differ;
                    bool found = false;
                    for (int step = 0; step < 27 && !found; ++step) {
                        const Vector3 by{step % 3 - 1.0, step / 3 % 3 - 1.0, step / 9 - 1.0};
                        found = anatomy.label(pixel.rest + near_mm * by) == label;
                    }
                    far += !found;
                }
            off.see(far);
            share.see(static_cast<double>(differ) / scanned);
        }
    }
}

TEST(Truth, EveryInstructionSetAndAStreamedBundleGiveTheSameBytes) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string path = folder / "phantom.sonocase";
    ASSERT_TRUE(save_bundle(phantom(), path));
    const auto whole = load_bundle(path);
    ASSERT_TRUE(whole);
    Exercise exercise = phantom_exercise();
    exercise.breathing.amplitude_mm = 12;
    exercise.pulsation.amplitude_mm = 1;
    FrameInput input;
    input.mannequin_from_probe.translation = {1, 2, -6};
    input.time_s = 2.2;
    input.has_needle = true;
    input.needle = {{10, 0.5, 60}, normalized(Vector3{0.4, 0, 0.9})};
    std::optional<Planes> first;
    for (const std::string& simd : simd_targets()) {
        for (const bool streamed : {false, true}) {
            RenderOptions options = picture(161, 150);
            options.simd = simd;
            Planes planes(options);
            if (streamed) {
                const auto parts = open_bundle(path);
                ASSERT_TRUE(parts);
                truth_of(*parts, exercise, options).render(input, planes.spans());
            } else {
                truth_of(*whole, exercise, options).render(input, planes.spans());
            }
            if (!first) first = planes;
            EXPECT_TRUE(planes == *first) << simd << streamed;
        }
    }
}

// A vein whose walls have moved counts as many pixels as its radius says; the artery stays.
TEST(Truth, WallsOfVeinsMoveWithTheirFilling) {
    using sonocase::testing::PressedBlock;
    const PressedBlock shape;
    const Exercise exercise = sonocase::testing::pressed_exercise();
    const RenderOptions options = picture(300, 300);
    auto truth = truth_of(sonocase::testing::pressed_block(), exercise, options);
    Planes planes(options);
    const auto pixels = [&](double wall_mm, int label) {
        FrameInput input;
        input.mannequin_from_probe = sonocase::testing::pressed_by(-1);
        input.change.vein_wall_mm = wall_mm;
        return static_cast<double>(
            truth.render(input, planes.spans()).pixels_of_label[static_cast<std::size_t>(label)]);
    };
    const double vein = pixels(0, PressedBlock::vein_label),
                 artery = pixels(0, PressedBlock::artery_label);
    ASSERT_GT(vein, 500);
    for (const double wall_mm : {-0.65, 0.9}) {
        const double wider = 1 + wall_mm / shape.vein_radius_mm;
        EXPECT_NEAR(pixels(wall_mm, PressedBlock::vein_label) / vein, wider * wider, 0.02);
        EXPECT_EQ(pixels(wall_mm, PressedBlock::artery_label), artery);
    }
}

TEST(Truth, HardCases) {
    const CaseBundle& bundle = phantom();
    Exercise exercise = phantom_exercise();
    for (const auto& [w, h] : {std::pair{1, 1}, {1, 40}, {40, 1}, {7, 5}}) {
        const RenderOptions options = picture(w, h);
        auto truth = truth_of(bundle, exercise, options);
        Planes planes(options);
        EXPECT_TRUE(truth.render({}, planes.spans()).posed);
    }
    const RenderOptions options = picture(50, 50);
    auto truth = truth_of(bundle, exercise, options);
    Planes planes(options);
    const Planes untouched = planes;
    FrameInput bad;
    bad.mannequin_from_probe.translation.x = NAN;
    EXPECT_FALSE(truth.render(bad, planes.spans()).posed);
    EXPECT_TRUE(planes == untouched);
    EXPECT_FALSE(truth.at(bad, 25, 25).scanned);
    // Far away, at a time that is none, and with a needle that is none.
    FrameInput far;
    far.mannequin_from_probe.translation = {1e12, -1e12, 1e12};
    far.time_s = NAN;
    far.has_needle = true;
    far.needle = {{NAN, 0, 0}, {0, 0, 0}};
    const FrameTruth& frame = truth.render(far, planes.spans());
    EXPECT_FALSE(frame.has_needle);
    for (const std::uint8_t label : planes.labels) EXPECT_EQ(label, 0);
    // A bundle without surfaces inside voxels.
    CaseBundle plain = phantom();
    plain.boundary = {};
    truth_of(plain, exercise, options).render({}, planes.spans());
    const auto wrong = TruthRenderer::create(bundle, exercise, picture(50, 50, {"glitter"}));
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().message().find("glitter"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::runtime
