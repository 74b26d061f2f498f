// SPDX-License-Identifier: Apache-2.0

// The truth beside a picture against the label volume, by a computation of its own: the plane by
// the probe's definition, the tissue by CaseAnatomy, one pixel after the other.
#include "runtime/imaging/truth/frame_truth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <optional>

#include "formats/files/bundle_file.h"
#include "formats/scoring/anatomy.h"
#include "imaging_support.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

struct Planes {
    explicit Planes(const RenderOptions& o)
        : width(o.width_px),
          labels(static_cast<std::size_t>(o.width_px) * static_cast<std::size_t>(o.height_px), 77),
          needle(labels.size(), 77),
          shadowed(labels.size(), 77),
          depth(labels.size(), -77.0f) {}
    TruthPlanes spans() { return {labels, needle, shadowed, depth}; }
    std::size_t at(int column, int row) const {
        return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
               static_cast<std::size_t>(column);
    }
    bool operator==(const Planes& o) const {
        // Bit by bit: NaN equals itself.
        return labels == o.labels && needle == o.needle && shadowed == o.shadowed &&
               std::memcmp(depth.data(), o.depth.data(), 4 * depth.size()) == 0;
    }
    int width;
    std::vector<std::uint8_t> labels, needle, shadowed;
    std::vector<float> depth;
};

TruthRenderer truth_of(CaseView bundle, const Exercise& exercise, const RenderOptions& options) {
    auto truth = TruthRenderer::create(bundle, exercise, options);
    EXPECT_TRUE(truth) << truth.error().message();
    return std::move(*truth);
}

RenderOptions picture(int width, int height, std::vector<std::string> effects = {"auto"}) {
    RenderOptions options;
    options.width_px = width;
    options.height_px = height;
    options.effects = std::move(effects);
    return options;
}

// Depth along its beam of a point of the plane; negative: outside the scanned area.
double depth_along(const Probe& probe, double x, double z) {
    if (probe.shape == ProbeShape::linear)
        return std::abs(x) <= 0.5 * probe.width_mm && z >= 0 && z <= probe.depth_mm ? z : -1;
    const double radius = probe.shape == ProbeShape::phased ? 0 : probe.radius_mm;
    const double r = std::hypot(x, z + radius) - radius;
    const bool in = std::abs(std::atan2(x, z + radius)) <= 0.5 * probe.field_of_view_rad;
    return in && r >= 0 && r <= probe.depth_mm ? r : -1;
}

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
    Random random(seed);
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        Exercise exercise = phantom_exercise();
        exercise.probe.shape = shape;
        exercise.breathing.amplitude_mm = 12;
        exercise.breathing.direction = {0, 0.6, 0.8};
        // Without contact, which has a test of its own, the plane is flat.
        const RenderOptions options = picture(150, 130, {"-contact"});
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
            EXPECT_GT(share, 0.8);  // surfaces are that rare
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
    EXPECT_TRUE(frame.tip_in_plane);
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
    for (const std::uint8_t n : planes.needle) EXPECT_EQ(n, 0);
}

TEST(Truth, ShadowsLieBehindBoneAndGasAlongTheBeam) {
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
        EXPECT_LT(wrong, scanned / 50);
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
    const RenderOptions options = picture(128, 200);
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
