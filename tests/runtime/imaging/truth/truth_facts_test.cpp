// SPDX-License-Identifier: Apache-2.0

// Needle, shadows, depths and what a frame says as a whole, against bodies whose answer is known.
#include "support/hard_case.h"
#include "truth_support.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::HardCase;

TEST(Truth, TheNeedleIsWhereItsPoseSaysAndItsTipIsMarked) {
    const CaseBundle& bundle = phantom();
    const Exercise exercise = phantom_exercise();
    const RenderOptions options = picture(300, 300);
    auto truth = truth_of(bundle, exercise, options);
    auto renderer = Renderer::create(bundle, exercise, options);
    ASSERT_TRUE(renderer);
    const auto layout = renderer->layout();
    FrameInput input;
    input.has_needle = true;
    const Vector3 axis = normalized(Vector3{1, 0, 2});
    input.needle = {{12, 0, 60}, axis};
    Planes planes(options);
    const FrameTruth& frame = truth.render(input, planes.spans());
    EXPECT_TRUE(frame.tip_in_plane && frame.tip_visible);
    // So steep a shaft is lost in the liver but for its part in the wall.
    EXPECT_GT(frame.needle_visible_mm, 10);
    EXPECT_LT(frame.needle_visible_mm, frame.needle_in_image_mm);
    EXPECT_EQ(frame.tip_label, Phantom().label({12, 0, 60}));
    const double radius = 0.5 * needle_diameter_mm(exercise.needle);
    for (int row = 0; row < 300; ++row) {
        for (int column = 0; column < 300; ++column) {
            const double x = (column - layout.origin_x_px) * layout.mm_per_px,
                         z = (row - layout.origin_y_px) * layout.mm_per_px;
            if (depth_along(exercise.probe, x, z) < 0) continue;
            const Vector3 w{x - 12, 0, z - 60};
            const double along = dot(w, axis), away = norm(w - along * axis);
            if (std::abs(away - radius) < 1e-6 || std::abs(along) < 1e-6) continue;
            const bool on = away < radius && along < 0 && along > -exercise.needle.length_mm;
            const int expected = !on ? 0 : along > -kTipLengthMm ? 2 : 1;
            EXPECT_EQ(planes.needle[planes.at(column, row)], expected) << x << " " << z;
        }
    }
    // Out of the plane by more than the slab: nothing shows, and the distance says why.
    input.needle.tip.y = 20;
    const FrameTruth& aside = truth.render(input, planes.spans());
    EXPECT_FALSE(aside.tip_in_plane);
    EXPECT_EQ(aside.tip_probe.y, 20);
    EXPECT_EQ(aside.needle_in_image_mm, 0);
    EXPECT_FALSE(aside.tip_visible);
    EXPECT_EQ(aside.needle_visible_mm, 0);
    for (const std::uint8_t n : planes.needle) EXPECT_EQ(n, 0);
}

TEST(Truth, ShadowsLieBehindBoneAndGasAlongTheBeam) {
    HardCase edges("share of pixels whose shadow is another than a march up the beam meets",
                   HardCase::at_most, 0.02, "");
    const CaseBundle& bundle = phantom();
    Exercise exercise = phantom_exercise();
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        exercise.probe.shape = shape;
        exercise.probe.width_mm = 90;  // over the rib
        exercise.probe.field_of_view_rad = shape == ProbeShape::phased ? 2 : 1.2;
        const RenderOptions options = picture(220, 220, {"-contact"});
        auto truth = truth_of(bundle, exercise, options);
        auto renderer = Renderer::create(bundle, exercise, options);
        ASSERT_TRUE(renderer);
        const auto layout = renderer->layout();
        FrameInput input;
        Planes planes(options);
        const FrameTruth& frame = truth.render(input, planes.spans());
        const CaseAnatomy anatomy(bundle);
        const auto hard = [&](double x, double z) {
            const int label = anatomy.label({x, 0, z});
            return label == Phantom::bone || label == Phantom::gas;
        };
        int wrong = 0, scanned = 0, dark = 0;
        std::uint32_t shadowed = 0;
        for (int row = 0; row < 220; ++row) {
            for (int column = 0; column < 220; ++column) {
                const double x = (column - layout.origin_x_px) * layout.mm_per_px,
                             z = (row - layout.origin_y_px) * layout.mm_per_px;
                const double r = depth_along(exercise.probe, x, z);
                if (r < 0) continue;
                ++scanned;
                const double radius =
                    shape == ProbeShape::curvilinear ? exercise.probe.radius_mm : 0;
                const double away = std::max(r + radius, 1e-9);
                const double dx = shape == ProbeShape::linear ? 0 : x / away,
                             dz = shape == ProbeShape::linear ? 1 : (z + radius) / away;
                // March up the beam in steps of a fifth of a pixel, as far as the face.
                bool met = false;
                for (double back = 1.5 * layout.mm_per_px; back < r && !met; back += 0.1)
                    met = hard(x - back * dx, z - back * dz);
                const bool says = planes.shadowed[planes.at(column, row)] == 1;
                wrong += says != met;
                dark += met;
                shadowed += says;
            }
        }
        EXPECT_GT(dark, scanned / 20);
        // One or two pixels on each edge of a shadow, and one at the face.
        edges.see(static_cast<double>(wrong) / scanned);
        std::uint32_t sum = 0;
        for (const std::uint32_t n : frame.shadowed_pixels_of_label) sum += n;
        EXPECT_EQ(sum, shadowed);
    }
}

TEST(Truth, AreasAreThoseOfTheLabels) {
    const CaseBundle& bundle = phantom();
    const RenderOptions options = picture(333, 200);
    auto truth = truth_of(bundle, phantom_exercise(), options);
    FrameInput input;
    Planes planes(options);
    const FrameTruth& frame = truth.render(input, planes.spans());
    std::array<std::uint32_t, 256> counted{};
    for (std::size_t n = 0; n < planes.labels.size(); ++n) {
        if (!std::isnan(planes.depth[n])) ++counted[planes.labels[n]];
    }
    EXPECT_EQ(frame.pixels_of_label, counted);
    // The cyst is a cylinder's cut: a disc of radius 12 mm at (-40, *, 100), if all of it shows.
    const double area = frame.pixels_of_label[Phantom::cyst] * frame.mm2_per_px;
    EXPECT_NEAR(area, std::acos(-1.0) * 144, 0.02 * 452);
}

TEST(Truth, ContactClosesTheGapAsThePictureDoes) {
    const CaseBundle& bundle = phantom();
    const Exercise exercise = phantom_exercise();
    const RenderOptions options = picture(200, 200);
    auto truth = truth_of(bundle, exercise, options);
    auto renderer = Renderer::create(bundle, exercise, options);
    ASSERT_TRUE(renderer);
    const int face_row = static_cast<int>(renderer->layout().origin_y_px) + 2;
    // At the probe's face: the skin itself, however far away it was, as far as gel and hand reach.
    for (const double away_mm : {0.0, 4.0, 12.0}) {
        FrameInput input;
        input.mannequin_from_probe.translation = {0, 0, -away_mm};
        const PixelTruth at_face = truth.at(input, 100, face_row);
        ASSERT_TRUE(at_face.scanned);
        EXPECT_NE(at_face.label, 0) << away_mm;
        Planes planes(options);
        EXPECT_GT(truth.render(input, planes.spans()).beams_touching, 100);
    }
    FrameInput input;
    input.mannequin_from_probe.translation = {0, 0, -60};
    Planes planes(options);
    const FrameTruth& frame = truth.render(input, planes.spans());
    EXPECT_EQ(frame.beams_touching, 0);
    for (const std::uint8_t label : planes.labels) EXPECT_EQ(label, 0);
}

TEST(Truth, DepthBelowTheSkinIsThatOfTheFlatBlock) {
    // The phantom's skin is z = (x^2 + y^2) / 900: at the middle beam the depth is z itself.
    const CaseBundle& bundle = phantom();
    Exercise exercise = phantom_exercise();
    exercise.probe.shape = ProbeShape::linear;
    const RenderOptions options = picture(128, 200, {"-deformation"});
    auto truth = truth_of(bundle, exercise, options);
    for (const double pressed_mm : {-5.0, 0.0, 8.0}) {
        FrameInput input;
        input.mannequin_from_probe.translation = {0, 0, pressed_mm};
        for (int row = 20; row < 190; row += 17) {
            const PixelTruth pixel = truth.at(input, 64, row);
            if (!pixel.scanned) continue;
            const double expected = pixel.shown.z - (pixel.shown.x * pixel.shown.x) / 900;
            EXPECT_NEAR(pixel.skin_depth_mm, expected, 0.6);  // whole voxels of 1 mm
        }
    }
}

TEST(Truth, TargetsMoveWithTheBreath) {
    const CaseBundle& bundle = phantom();
    Exercise exercise = phantom_exercise();
    Target target;
    target.name = "lesion";
    target.centre = {10, 0, 80};
    exercise.targets = {target};
    exercise.breathing.amplitude_mm = 10;
    exercise.breathing.direction = {0, 1, 0};
    auto truth = truth_of(bundle, exercise, picture(64, 64));
    FrameInput input;
    input.has_needle = true;
    input.needle = {{10, 0, 80}, {0, 0, 1}};
    const FrameTruth& rest = truth.render(input, {});
    EXPECT_EQ(rest.nearest_target, 0);
    EXPECT_NEAR(rest.targets[0].tip_mm, 0, 1e-9);
    EXPECT_TRUE(rest.targets[0].in_image);
    input.time_s = 0.5 * exercise.breathing.period_s;  // the end of inspiration
    const double moved_mm = truth.render(input, {}).targets[0].tip_mm;
    EXPECT_GT(moved_mm, 5);  // liver rides on the diaphragm
    EXPECT_NEAR(std::abs(truth.render(input, {}).targets[0].plane_mm), moved_mm, 1e-6);
}

}  // namespace
}  // namespace sonocase::runtime
