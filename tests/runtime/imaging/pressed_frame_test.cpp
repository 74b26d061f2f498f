// SPDX-License-Identifier: Apache-2.0

// Effect deformation in pictures: what both models show of tissue that yields to the probe.
#include <gtest/gtest.h>

#include <cmath>

#include "pressed_block.h"
#include "support/hard_case.h"
#include "support/whole_sets.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

FrameInput pressed_input(double mm) {
    FrameInput input = needle_input();
    input.mannequin_from_probe = pressed_by(mm);
    input.needle.tip = {4, 0.2, 26};
    return input;
}

// As for frames without pressing: single precision against double, where speckle nulls and grains
// whose look-up rounds the other way differ. The reference of model `paper` works by pixels and not
// by beams: it differs as much as it does where nothing is pressed. Effect wall is worked out at
// nodes 1.6 mm apart, and tissue under the face is pressed more unevenly than that. The fast
// renderer's shift is linear between nodes 0.7 columns apart, up to 0.1 mm off where the stiffness
// changes from column to column: grains of speckle without a point spread show it, and nothing
// else.
TEST(PressedFrame, FastAndSlowRenderersAgreeEffectByEffect) {
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper}) {
        std::vector<std::vector<std::string>> rows{{"auto"}, {"deformation"}};
        for (const char* name : effect_names(model)) rows.push_back({"deformation", name});
        for (const Exercise& exercise : block_exercises())
            for (const auto& effects : half_with_sanitizers(rows)) {
                if (effects != rows.front() && exercise.probe.shape != ProbeShape::linear) continue;
                RenderOptions fast = block_picture(model),
                              slow = block_picture(model, 96, RendererKind::reference);
                fast.effects = slow.effects = effects;
                const FrameInput input = pressed_input(8);
                const Difference d = compare(draw(exercise, fast, input, pressed_block()),
                                             draw(exercise, slow, input, pressed_block()));
                std::printf("%d %d %-16s mean %.3f bias %+.3f worst %d\n", int(model),
                            int(exercise.probe.shape), effects.back().c_str(), d.mean, d.bias,
                            d.worst);
                double before = 0;
                if (model == ImageModel::paper)
                    before = compare(draw(exercise, fast, pressed_input(-1), pressed_block()),
                                     draw(exercise, slow, pressed_input(-1), pressed_block()))
                                 .mean;
                const double grains = effects.back() == "speckle" ? 0.3 : 0;
                EXPECT_LT(d.mean, 0.5 + grains + 1.1 * before) << effects.back();
                EXPECT_LT(std::abs(d.bias), 0.15) << effects.back();
            }
    }
}

TEST(PressedFrame, AgreementHoldsOverRandomPosesOfAPhantom) {
    HardCase mean("fast off slow renderer, pressed, random poses", HardCase::at_most, 0.5, "grey");
    HardCase bias("its bias", HardCase::at_most, 0.15, "grey");
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        Random random(seed);
        FrameInput input = random_input(random, static_cast<std::uint32_t>(seed));
        input.mannequin_from_probe.translation.z = random.uniform(2, 14);
        input.time_s = 1.1;
        Exercise exercise = phantom_exercise();
        exercise.probe.shape = static_cast<ProbeShape>(seed % 3);
        exercise.probe.width_mm = 38;
        exercise.pulsation.amplitude_mm = 1;
        RenderOptions fast = block_picture(ImageModel::physical), slow = fast;
        slow.kind = RendererKind::reference;
        const Difference d = compare(draw(exercise, fast, input), draw(exercise, slow, input));
        std::printf("seed %d mean %.3f bias %+.3f worst %d\n", int(seed), d.mean, d.bias, d.worst);
        mean.see(d.mean);
        bias.see(std::abs(d.bias));
    }
}

TEST(PressedFrame, PixelsAreTheSameOnEveryInstructionSetAndThreadCount) {
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper})
        for (Exercise exercise : block_exercises()) {
            exercise.breathing.amplitude_mm = 4;
            FrameInput input = pressed_input(9);
            input.time_s = 1.3;
            RenderOptions options = block_picture(model);
            options.host = thread_host();
            options.scanlines = 101;
            const auto expected = draw(exercise, options, input, pressed_block());
            for (const std::string& simd : simd_targets()) {
                options.simd = simd;
                for (const int threads : {1, 2, 3}) {
                    options.threads = threads;
                    EXPECT_TRUE(draw(exercise, options, input, pressed_block()) == expected)
                        << simd << " " << threads;
                }
            }
        }
}

TEST(PressedFrame, LiftedTheFrameOfBeforeComesBackByteForByte) {
    HardCase trace("change of a frame after 25 mm of pressing, lifted again", HardCase::at_most, 0,
                   "grey");
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper})
        for (const RendererKind kind : {RendererKind::fast, RendererKind::reference}) {
            RenderOptions options = block_picture(model, 96, kind);
            if (kind == RendererKind::reference) options.width_px = options.height_px = 64;
            auto renderer = Renderer::create(pressed_block(), pressed_exercise(), options);
            ASSERT_TRUE(renderer.has_value());
            const auto frame = [&](double mm) {
                std::vector<std::uint8_t> pixels(static_cast<std::size_t>(options.width_px) *
                                                 options.height_px);
                renderer->render(pressed_input(mm), pixels);
                return pixels;
            };
            const auto before = frame(-0.5), pressed = frame(6), deep = frame(25);
            EXPECT_GT(renderer->press().force_n, 5);
            trace.see(compare(frame(-0.5), before).worst);
            EXPECT_FALSE(renderer->press().pressed);
            EXPECT_EQ(renderer->press().force_n, 0);
            EXPECT_TRUE(frame(6) == pressed);
            EXPECT_FALSE(pressed == before);
            EXPECT_FALSE(deep == pressed);
        }
}

TEST(PressedFrame, WhereNothingIsPressedTheEffectChangesNoPixelAndSaysSo) {
    HardCase changed("pixels that the effect changes where nothing is pressed", HardCase::at_most,
                     0, "");
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper}) {
        RenderOptions with = block_picture(model), without = with;
        without.effects = {"-deformation"};
        const auto a = draw(pressed_exercise(), with, pressed_input(-1), pressed_block()),
                   b = draw(pressed_exercise(), without, pressed_input(-1), pressed_block());
        ASSERT_EQ(a.size(), b.size());
        int off = 0;
        for (std::size_t n = 0; n < a.size(); ++n) off += a[n] != b[n];
        changed.see(off);
        auto renderer = Renderer::create(pressed_block(), pressed_exercise(), with);
        ASSERT_TRUE(renderer.has_value());
        std::vector<std::uint8_t> pixels(160 * 160);
        const auto said = [&](double mm) {
            renderer->render(pressed_input(mm), pixels);
            for (const EffectCost& cost : renderer->costs())
                if (std::string(cost.name) == "deformation") return std::string(cost.why);
            return std::string("no such effect");
        };
        EXPECT_EQ(said(-1), "nothing is pressed");
        EXPECT_EQ(said(5), "the probe presses");
    }
}

// Counts the pixels of a picture of labels alone that are darker than the muscle around a vessel.
int dark_pixels(const std::vector<std::uint8_t>& pixels,
                const Renderer::Layout& layout,
                Point3 middle,
                double reach_mm,
                int width) {
    int dark = 0;
    for (int y = 0; y < width; ++y)
        for (int x = 0; x < width; ++x) {
            const double px = (x - layout.origin_x_px) * layout.mm_per_px - middle.x,
                         pz = (y - layout.origin_y_px) * layout.mm_per_px - middle.z;
            if (std::abs(px) < reach_mm && std::abs(pz) < reach_mm &&
                pixels[static_cast<std::size_t>(y * width + x)] < 40)
                ++dark;
        }
    return dark;
}

// The vein closes and the artery does not, as far as the field says.
TEST(PressedFrame, TheVeinClosesAndTheArteryStaysRound) {
    const PressedBlock shape;
    HardCase closed("vein left open by 18 mm, of its area", HardCase::at_most, 0.05, "");
    HardCase field("vein and artery shown, off the field, of their area", HardCase::at_most, 0.02,
                   "");
    const RenderOptions options = field_picture();
    auto renderer = Renderer::create(pressed_block(), pressed_exercise(), options);
    ASSERT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> pixels(400 * 400);
    double vein_rest = 0, artery_rest = 0;
    for (const double mm : {-1.0, 4.0, 8.0, 12.0, 18.0}) {
        renderer->render(pressed_input(mm), pixels);
        const auto layout = renderer->layout();
        // Area of the vessels according to the field: places of the picture whose tissue is one.
        int expected_vein = 0, expected_artery = 0;
        const Rigid& pose = renderer->shown_pose();
        for (int y = 0; y < 400; ++y)
            for (int x = 0; x < 400; ++x) {
                const Point3 p{(x - layout.origin_x_px) * layout.mm_per_px, 0,
                               (y - layout.origin_y_px) * layout.mm_per_px};
                if (p.z < 0 || p.z > 50 || std::abs(p.x) > 20) continue;
                const Point3 rest = renderer->at_rest(pose * p);
                const std::uint8_t label = shape.label(rest);
                if (label == PressedBlock::vein_label && !renderer->closed(rest)) ++expected_vein;
                if (label == PressedBlock::artery_label) ++expected_artery;
            }
        const Point3 vein = renderer->current_position(shape.vein),
                     artery = renderer->current_position(shape.artery);
        const auto at = [&](Point3 p) { return Point3{p.x, 0, p.z - mm}; };
        const int vein_pixels = dark_pixels(pixels, layout, at(vein), 6.2, 400),
                  artery_pixels = dark_pixels(pixels, layout, at(artery), 5.5, 400);
        if (mm < 0) {
            vein_rest = vein_pixels;
            artery_rest = artery_pixels;
        }
        std::printf("%5.1f mm: vein %.3f (field %.3f), artery %.3f (field %.3f)\n", mm,
                    vein_pixels / vein_rest, expected_vein / vein_rest, artery_pixels / artery_rest,
                    expected_artery / artery_rest);
        field.see(std::abs(vein_pixels - expected_vein) / vein_rest);
        field.see(std::abs(artery_pixels - expected_artery) / artery_rest);
        if (mm >= 8) {
            EXPECT_LT(vein_pixels / vein_rest, 0.62);
            EXPECT_GT(artery_pixels / artery_rest, 0.8);
        }
        if (mm >= 18) closed.see(vein_pixels / vein_rest);
    }
}

// A vein that is fuller, or emptier: both renderers move its walls, pressed or not.
TEST(PressedFrame, WallsOfVeinsMoveInBothRenderers) {
    const RenderOptions fast = block_picture(ImageModel::physical),
                        slow = block_picture(ImageModel::physical, 96, RendererKind::reference);
    for (const double mm : {-1.0, 5.0}) {
        FrameInput input = pressed_input(mm);
        const auto at_rest = draw(pressed_exercise(), fast, input, pressed_block());
        for (const double wall_mm : {-0.65, 0.9}) {
            input.change.vein_wall_mm = wall_mm;
            const auto moved = draw(pressed_exercise(), fast, input, pressed_block());
            const Difference d =
                compare(moved, draw(pressed_exercise(), slow, input, pressed_block()));
            EXPECT_LT(d.mean, 0.5) << mm << " " << wall_mm;  // as above
            EXPECT_GT(compare(moved, at_rest).mean, 0.3) << mm << " " << wall_mm;
        }
    }
}

TEST(PressedFrame, AHigherPressureInTheVeinKeepsItOpen) {
    auto renderer = Renderer::create(pressed_block(), pressed_exercise(), field_picture());
    ASSERT_TRUE(renderer.has_value());
    const auto open_at = [&](double mmhg) {
        FrameInput input = pressed_input(8);
        input.change.venous_pressure_mmhg = mmhg;
        renderer->press_probe(input);
        return renderer->press().vein_open;
    };
    const double as_written = open_at(0);
    EXPECT_EQ(open_at(8), as_written);  // that of the exercise
    // The face is as deep as before, and the tissue above yields as well: a vein of three times the
    // stiffness gives way by a tenth less.
    EXPECT_LT(open_at(4), as_written - 0.01);
    EXPECT_GT(open_at(24), as_written + 0.03);
    EXPECT_EQ(open_at(0), as_written);
}

// Speckle belongs to the tissue: the pressed picture, pulled back, is the one at rest, less what
// the point spread blurs in another direction.
TEST(PressedFrame, SpeckleMovesWithTheTissue) {
    PressedBlock plain;
    plain.vessels = false;
    const CaseBundle bundle = plain.bundle();
    RenderOptions options = block_picture(ImageModel::physical);
    options.effects = {"deformation", "speckle", "point_spread"};
    options.width_px = options.height_px = 512;
    options.scanlines = 192;
    options.samples = 512;
    auto renderer = Renderer::create(bundle, pressed_exercise(), options);
    ASSERT_TRUE(renderer.has_value());
    const auto frame = [&](double mm) {
        std::vector<std::uint8_t> pixels(512 * 512);
        renderer->render(pressed_input(mm), pixels);
        return pixels;
    };
    const auto rest = frame(-0.4);
    ASSERT_FALSE(renderer->press().pressed);
    const auto layout = renderer->layout();
    const auto grey = [&](const std::vector<std::uint8_t>& of, double x, double z) {
        const double cx = x / layout.mm_per_px + layout.origin_x_px,
                     cy = z / layout.mm_per_px + layout.origin_y_px;
        const int i = static_cast<int>(cx), j = static_cast<int>(cy);
        const auto at = [&](int a, int b) {
            return double(of[static_cast<std::size_t>((j + b) * 512 + i + a)]);
        };
        const double u = cx - i, v = cy - j;
        return (at(0, 0) * (1 - u) + at(1, 0) * u) * (1 - v) +
               (at(0, 1) * (1 - u) + at(1, 1) * u) * v;
    };
    for (const double mm : {2.0, 4.0, 8.0}) {
        const auto pressed = frame(mm);
        double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0, moved = 0, still = 0;
        for (double z = 14; z < 36; z += 0.2)
            for (double x = -15; x < 15; x += 0.2) {
                const Point3 p = renderer->at_rest(pressed_by(mm) * Point3{x, 0, z});
                const double q = grey(pressed, x, z), r = grey(rest, p.x, p.z + 0.4),
                             s = grey(rest, x, z + mm + 0.4);
                ++n, a += q, b += r, aa += q * q, bb += r * r, ab += q * r;
                moved += (q - r) * (q - r);
                still += (q - s) * (q - s);
            }
        const double correlation =
            (ab - a * b / n) / std::sqrt((aa - a * a / n) * (bb - b * b / n));
        std::printf("%.0f mm: correlation %.3f\n", mm, correlation);
        EXPECT_GT(correlation, 0.8) << mm;
        EXPECT_LT(moved, still) << mm;
    }
}

// A pose beyond what bone allows shows what the face that bone holds shows.
TEST(PressedFrame, BoneHoldsTheFace) {
    PressedBlock shallow;
    shallow.bone_mm = 15;
    shallow.vessels = false;
    const CaseBundle bundle = shallow.bundle();
    auto renderer =
        Renderer::create(bundle, pressed_exercise(), block_picture(ImageModel::physical));
    ASSERT_TRUE(renderer.has_value());
    const auto frame = [&](double mm) {
        std::vector<std::uint8_t> pixels(160 * 160);
        FrameInput input;
        input.mannequin_from_probe = pressed_by(mm);
        renderer->render(input, pixels);
        return pixels;
    };
    const auto at_limit = frame(14);
    EXPECT_GT(renderer->press().excess_mm, 2);
    EXPECT_LT(renderer->press().deepest_mm, 0.71 * 15.5);
    const double force = renderer->press().force_n;
    HardCase off("force 3 mm beyond what bone allows, off", HardCase::at_most, 0.02, "");
    // The next whole voxels lie the same: 3 mm deeper.
    const auto beyond = frame(17);
    off.see(std::abs(renderer->press().force_n / force - 1));
    EXPECT_LT(compare(at_limit, beyond).mean, 2);
}

TEST(PressedFrame, AnyPoseGivesAPicture) {
    HardCase least("least force of 60 poses for each probe", HardCase::at_least, 0, "N");
    for (const ImageModel model : {ImageModel::physical, ImageModel::paper})
        for (const Exercise& exercise : block_exercises()) {
            auto renderer = Renderer::create(pressed_block(), exercise, block_picture(model));
            ASSERT_TRUE(renderer.has_value());
            std::vector<std::uint8_t> pixels(160 * 160);
            Random random(5);
            for (int n = 0; n < 60; ++n) {
                FrameInput input = needle_input();
                input.mannequin_from_probe = random.rigid(n < 40 ? 30 : 200);
                const FrameStatus status = renderer->render(input, pixels);
                EXPECT_NE(status, FrameStatus::held_bad_pose);
                EXPECT_TRUE(std::isfinite(renderer->press().force_n));
                least.see(renderer->press().force_n);
            }
            FrameInput bad;
            bad.mannequin_from_probe.translation.z = NAN;
            EXPECT_EQ(renderer->render(bad, pixels), FrameStatus::held_bad_pose);
        }
}

}  // namespace
}  // namespace sonocase::runtime
