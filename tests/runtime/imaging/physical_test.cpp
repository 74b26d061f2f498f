// SPDX-License-Identifier: Apache-2.0

// Model `physical`: the vectorised renderer against the slow one, and its own truths.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/constants.h"
#include "formats/machine/machine.h"
#include "imaging_support.h"
#include "support/hard_case.h"
#include "support/whole_sets.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

RenderOptions physical_options(RendererKind kind = RendererKind::fast) {
    RenderOptions o;
    o.kind = kind;
    o.width_px = o.height_px = 256;
    return o;
}

// Single precision against double: speckle nulls and grains whose look-up rounds the other way
// differ; all the rest agrees to a grey level.
TEST(PhysicalModel, AgreesWithTheSlowRendererEffectByEffect) {
    std::vector<std::vector<std::string>> rows{{"none"}, {"auto"}};
    for (const char* name : effect_names(ImageModel::physical)) {
        rows.push_back({name});
        rows.push_back({std::string("-") + name});
    }
    Exercise exercise = phantom_exercise();
    exercise.pulsation.amplitude_mm = 1;
    for (const TargetLook look :
         {TargetLook::lesion, TargetLook::cyst, TargetLook::abscess, TargetLook::marker}) {
        Target target;
        target.centre = {-30 + 15.0 * static_cast<double>(exercise.targets.size()), 1, 60};
        target.look = look;
        exercise.targets.push_back(target);
    }
    FrameInput input = needle_input();
    input.time_s = 1.3;
    for (const auto& effects : half_with_sanitizers(rows)) {
        RenderOptions fast = physical_options(), slow = physical_options(RendererKind::reference);
        fast.effects = slow.effects = effects;
        fast.samples = slow.samples = 200;
        fast.scanlines = slow.scanlines = 64;
        fast.width_px = fast.height_px = slow.width_px = slow.height_px = 128;
        const auto a = draw(exercise, fast, input);
        const auto b = draw(exercise, slow, input);
        const Difference d = compare(a, b);
        std::printf("%-16s mean %.3f bias %+.3f worst %d\n", effects.front().c_str(), d.mean,
                    d.bias, d.worst);
        EXPECT_LT(d.mean, 0.35) << effects.front();
        EXPECT_LT(std::abs(d.bias), 0.1) << effects.front();
    }
}

// Nested ellipsoids of a kind: halo, lesion and core, each over the one before.
TEST(PhysicalModel, LesionsOfAKindAgreeWithTheSlowRenderer) {
    Exercise exercise = phantom_exercise();
    const Matrix3 turned = rotation_about(normalized(Vector3{1, 2, -1}), 0.7);
    for (const char* kind : {"metastasis", "hcc", "simple_cyst", "lymph_node", "adenoma"}) {
        Finding finding;
        finding.lesion.look = TargetLook::lesion;
        finding.lesion.kind = kind;
        finding.lesion.radius_mm = 6;
        finding.lesion.axes = {turned, {1.25, 0.8, 1}};
        finding.lesion.centre = {-36 + 18.0 * static_cast<double>(exercise.findings.size()), 1, 60};
        exercise.findings.push_back(finding);
    }
    const FrameInput input;
    const auto plain = draw(phantom_exercise(), physical_options(), input);
    const auto fast = draw(exercise, physical_options(), input);
    const Difference d =
        compare(fast, draw(exercise, physical_options(RendererKind::reference), input));
    std::printf("lesions mean %.3f bias %+.3f worst %d\n", d.mean, d.bias, d.worst);
    EXPECT_LT(d.mean, 0.35);
    EXPECT_LT(std::abs(d.bias), 0.1);
    EXPECT_GT(compare(fast, plain).mean, 0.2);  // five lesions in one picture
}

// What acts have put into the tissue, and free fluid below a slanting level among the ribs.
TEST(PhysicalModel, WhatActsPutIntoTheTissueAgreesWithTheSlowRenderer) {
    Exercise exercise = phantom_exercise();
    exercise.procedure.items.emplace_back();
    FreeFluid& free = exercise.free_fluids.emplace_back();
    free.ml = 100;
    free.lies_in = "liver";
    free.centre = {5, 0, 70};
    free.half_mm = {40, 30, 25};
    FrameInput input;
    const auto plain = draw(exercise, physical_options(), input);
    SceneChange& change = input.change;
    change.level_count = 1;
    change.levels[0] = {normalized(Vector3{0.3, 0.1, -1}), 4};
    const auto fluid = draw(exercise, physical_options(), input);
    change.pool_count = 2;
    change.pools[0] = {{-25, 1, 35}, 5, false};
    change.pools[1] = {{30, 0, 40}, 7, true};
    change.wire = {true, {-30, 0, 5}, {-5, 0, 60}, {10, 1, 80}};
    change.catheter = {true, {25, 0, 5}, {15, 0, 50}, {15, 0, 75}};
    const auto all = draw(exercise, physical_options(), input);
    const Difference d =
        compare(all, draw(exercise, physical_options(RendererKind::reference), input));
    std::printf("acts mean %.3f bias %+.3f worst %d\n", d.mean, d.bias, d.worst);
    EXPECT_LT(d.mean, 0.35);
    EXPECT_LT(std::abs(d.bias), 0.1);
    EXPECT_GT(compare(fluid, plain).mean, 1);
    EXPECT_GT(compare(all, fluid).mean, 0.2);
    // Below the level it is black, above it and in other tissue nothing has changed.
    auto renderer = Renderer::create(phantom(), exercise, physical_options());
    ASSERT_TRUE(renderer.has_value());
    const auto layout = renderer->layout();
    const auto mean_about = [&](const std::vector<std::uint8_t>& picture, double x, double z) {
        const int column = static_cast<int>(std::lround(layout.origin_x_px + x / layout.mm_per_px)),
                  row = static_cast<int>(std::lround(layout.origin_y_px + z / layout.mm_per_px));
        double sum = 0;
        for (int r = -2; r <= 2; ++r)
            for (int c = -2; c <= 2; ++c)
                sum += picture[static_cast<std::size_t>((row + r) * 256 + column + c)];
        return sum / 25;
    };
    EXPECT_LT(mean_about(fluid, -10, 75), 0.5 * mean_about(plain, -10, 75));
    EXPECT_EQ(mean_about(fluid, 5, 35), mean_about(plain, 5, 35));
}

// The planes below a pool move by the volume injected, as measured in the picture alone. The fast
// renderer finds the sheets of the wall on straight lines between nodes that lie up to 2.5 mm
// apart, and beside the pool tissue is bent more than they follow: without the wall both agree to
// 0.04 grey, with it to the limits below.
TEST(PhysicalModel, PoolsPushPlanesAsideByWhatWasInjected) {
    Exercise exercise = phantom_exercise();
    exercise.procedure.items.emplace_back();
    exercise.probe.shape = ProbeShape::linear;
    exercise.probe.width_mm = 40;
    exercise.probe.depth_mm = 50;
    exercise.probe.frequency_mhz = 10;
    exercise.probe.focus_mm = 20;
    exercise.probe.elevation_mm = 1.5;
    const Point3 centre{4, 0.2, 14};
    const auto pool_of = [&](double ml) {
        FrameInput input;
        input.change.pool_count = 1;
        input.change.pools[0] = {centre, std::cbrt(3000 * ml / (4 * kPi)), false};
        return input;
    };
    RenderOptions fine = physical_options();  // 0.1 mm per pixel
    fine.width_px = fine.height_px = 512;
    const auto plain = draw(exercise, fine, FrameInput{});
    const auto renderer = Renderer::create(phantom(), exercise, fine);
    ASSERT_TRUE(renderer.has_value());
    const auto layout = renderer->layout();
    // A strip below the pool, as a profile along the depth.
    const auto profile = [&](const std::vector<std::uint8_t>& picture, double z) {
        const int column = static_cast<int>(layout.origin_x_px + centre.x / layout.mm_per_px),
                  row = static_cast<int>(layout.origin_y_px + z / layout.mm_per_px);
        double sum = 0;
        for (int c = -8; c <= 8; ++c) sum += picture[row * 512 + column + c];
        return sum;
    };
    // How like the strip below the pool is to the one without, moved by a share of the volume.
    const auto likeness = [&](const std::vector<std::uint8_t>& picture, double radius_mm,
                              double share) {
        double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
        for (double rho = 4; rho < 12; rho += 0.1) {
            const double r = std::cbrt(std::pow(rho, 3) + share * std::pow(radius_mm, 3));
            const double x = profile(plain, centre.z + rho), y = profile(picture, centre.z + r);
            n += 1, a += x, b += y, aa += x * x, bb += y * y, ab += x * y;
        }
        return (n * ab - a * b) / std::sqrt((n * aa - a * a) * (n * bb - b * b));
    };
    HardCase pushed("planes pushed aside, off .94 of the volume", HardCase::at_most, 0.06, "");
    for (const double ml : {0.5, 1.0, 1.5}) {
        const auto fast = draw(exercise, fine, pool_of(ml));
        const double radius_mm = std::cbrt(3000 * ml / (4 * kPi));
        double best = -1, volume = 0;
        for (double share = 0; share < 1.5; share += 0.02)
            if (const double here = likeness(fast, radius_mm, share); here > best)
                best = here, volume = share;
        std::printf("%.1f ml: planes move by %.2f of it, likeness %.2f\n", ml, volume, best);
        pushed.see(std::abs(volume - 0.94));  // what the pool itself covers is not pushed
        EXPECT_GT(best, 0.6);                 // without the pool: about 0
    }
    // A wire through the pool is as thick as one through tissue: fluid does not stretch metal.
    const auto thickness = [&](FrameInput input) {
        input.change.wire = {true, {-20, 0, 14}, {4, 0, 14}, {20, 0, 14}};
        const auto picture = draw(exercise, fine, input);
        const int column = static_cast<int>(layout.origin_x_px + 2 / layout.mm_per_px);
        const auto row_at = [&](double z) {
            return static_cast<int>(layout.origin_y_px + z / layout.mm_per_px);
        };
        int bright = 0;
        for (int row = row_at(12); row < row_at(18); ++row)
            bright += picture[row * 512 + column] > 200;
        return bright * layout.mm_per_px;
    };
    const double in_tissue = thickness({}), in_pool = thickness(pool_of(1.5));
    std::printf("wire %.2f mm thick in tissue, %.2f mm in the pool\n", in_tissue, in_pool);
    EXPECT_GT(in_tissue, 0.5);
    HardCase wire("a wire's thickness in a pool over that in tissue, off 1", HardCase::at_most, 0.3,
                  "");
    wire.see(std::abs(in_pool / in_tissue - 1));  // stretched it would be 2.5
    RenderOptions quick = physical_options(), slow = physical_options(RendererKind::reference);
    quick.samples = slow.samples = 200;
    quick.scanlines = slow.scanlines = 64;
    const auto fast = draw(exercise, quick, pool_of(1.5));
    const Difference d = compare(fast, draw(exercise, slow, pool_of(1.5)));
    std::printf("pool mean %.3f bias %+.3f worst %d\n", d.mean, d.bias, d.worst);
    EXPECT_LT(d.mean, 0.5);
    EXPECT_LT(std::abs(d.bias), 0.2);
    EXPECT_GT(compare(fast, draw(exercise, quick, FrameInput{})).mean, 1);
}

// The fast renderer works out the breathing weight on a coarse lattice. Where it is a hundredth
// off, 8 mm of breathing shift the tissue by a quarter of a scatterer: one grain in four differs.
TEST(PhysicalModel, AgreesWithTheSlowRendererWhileBreathing) {
    Exercise exercise = phantom_exercise();
    exercise.breathing.amplitude_mm = 8;
    FrameInput input = needle_input();
    input.time_s = 1.3;
    const Difference d = compare(draw(exercise, physical_options(), input),
                                 draw(exercise, physical_options(RendererKind::reference), input));
    std::printf("breathing mean %.3f bias %+.3f worst %d\n", d.mean, d.bias, d.worst);
    EXPECT_LT(d.mean, 1.5);
    EXPECT_LT(std::abs(d.bias), 0.2);
    FrameInput still = input;
    still.time_s = 0;
    EXPECT_GT(compare(draw(exercise, physical_options(), input),
                      draw(exercise, physical_options(), still))
                  .mean,
              1.0);  // of a liver at 48 grey
}

TEST(PhysicalModel, AgreementHoldsOverRandomPosesProbesAndBundles) {
    PhantomOptions plain;
    plain.voxel_mm = 2;
    plain.boundaries = plain.structure = false;
    const CaseBundle other = Phantom(plain).bundle();
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        Random random(seed);
        FrameInput input = random_input(random, static_cast<std::uint32_t>(seed));
        input.settings.gain_db = random.uniform(-6, 6);
        input.settings.dynamic_range_db = random.uniform(40, 80);
        Exercise exercise = seed % 4 == 3 ? phantom_linear_exercise() : phantom_exercise();
        exercise.probe.shape = static_cast<ProbeShape>(seed % 3);
        const CaseBundle& bundle = seed % 2 ? phantom() : other;
        const Difference d =
            compare(draw(exercise, physical_options(), input, bundle),
                    draw(exercise, physical_options(RendererKind::reference), input, bundle));
        std::printf("seed %d mean %.3f bias %+.3f worst %d\n", int(seed), d.mean, d.bias, d.worst);
        EXPECT_LT(d.mean, 0.5) << "seed " << seed;
        EXPECT_LT(std::abs(d.bias), 0.15) << "seed " << seed;
    }
}

TEST(PhysicalModel, PixelsAreTheSameOnEveryInstructionSetAndThreadCount) {
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        for (const int lines : {192, 101}) {
            Exercise exercise = phantom_exercise();
            exercise.probe.shape = shape;
            exercise.breathing.amplitude_mm = 8;
            exercise.pulsation.amplitude_mm = 1;
            FrameInput input = needle_input();
            input.time_s = 1.3;
            RenderOptions options = physical_options();
            options.host = thread_host();
            options.scanlines = lines;
            const auto expected = draw(exercise, options, input);
            for (const std::string& simd : simd_targets()) {
                options.simd = simd;
                for (const int threads : {1, 2, 3}) {
                    options.threads = threads;
                    EXPECT_TRUE(draw(exercise, options, input) == expected)
                        << simd << " " << threads;
                }
            }
        }
    }
}

// Levels of the machine of before: liver is above 60 grey, a cyst below 35.
TEST(PhysicalModel, TargetsShowWhereTheyAreAndNowhereElse) {
    RenderOptions options = physical_options();
    options.machine = *built_in_machine("classic");
    Exercise exercise = phantom_exercise();
    FrameInput input;
    const auto without = draw(exercise, options, input);
    Target cyst;
    cyst.centre = {20, 0, 50};
    cyst.radius_mm = 9;
    cyst.look = TargetLook::cyst;
    exercise.targets = {cyst};
    auto renderer = Renderer::create(phantom(), exercise, options);
    ASSERT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> with(256 * 256);
    renderer->render(input, with);
    const auto layout = renderer->layout();
    double inside = 0, before = 0;
    int n = 0;
    for (int row = 0; row < 256; ++row) {
        for (int column = 0; column < 256; ++column) {
            const double x = (column - layout.origin_x_px) * layout.mm_per_px,
                         z = (row - layout.origin_y_px) * layout.mm_per_px;
            const std::size_t i = static_cast<std::size_t>(row * 256 + column);
            if (std::hypot(x - 20, z - 50) < 6) {
                inside += with[i];
                before += without[i];
                ++n;
            }
            // Above it, out of the point spread's and the haze's reach, nothing changes.
            if (z < 25) {
                ASSERT_EQ(with[i], without[i]);
            }
        }
    }
    EXPECT_LT(inside / n, 35);
    EXPECT_GT(before / n, 60);
    // Far from the slab it is pruned, and the picture is the plain one.
    exercise.targets[0].centre.y = 25;
    EXPECT_TRUE(draw(exercise, options, input) == without);
}

// A simple cyst covers the area of its ellipse in the scan plane, and the tissue behind it is
// brighter than beside it.
TEST(PhysicalModel, ACystIsTheEllipseOfItsAxesAndEnhances) {
    RenderOptions options = physical_options();
    options.machine = *built_in_machine("classic");
    Exercise exercise = phantom_exercise();
    const auto without = draw(exercise, options, FrameInput{});
    Finding finding;
    finding.lesion.centre = {20, 0, 50};
    finding.lesion.radius_mm = 9;
    finding.lesion.look = TargetLook::lesion;
    finding.lesion.kind = "simple_cyst";
    finding.lesion.axes.lengths = {1.6, 1 / 1.6, 1};  // 14.4 mm along x, 9 along z
    exercise.findings = {finding};
    auto renderer = Renderer::create(phantom(), exercise, options);
    ASSERT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> with(256 * 256);
    renderer->render(FrameInput{}, with);
    const auto layout = renderer->layout();
    double inside = 0, beside = 0, beside_before = 0, behind = 0, behind_before = 0;
    int n_inside = 0, n_beside = 0, n_behind = 0;
    for (int row = 0; row < 256; ++row) {
        for (int column = 0; column < 256; ++column) {
            const double x = (column - layout.origin_x_px) * layout.mm_per_px - 20,
                         z = (row - layout.origin_y_px) * layout.mm_per_px - 50;
            const std::size_t i = static_cast<std::size_t>(row * 256 + column);
            const double rank = std::hypot(x / 14.4, z / 9);
            if (rank < 0.75) inside += with[i], ++n_inside;
            if (rank > 1.35 && rank < 1.6 && z < 0)
                beside += with[i], beside_before += without[i], ++n_beside;
            if (std::abs(x) < 6 && z > 16 && z < 26)
                behind += with[i], behind_before += without[i], ++n_behind;
        }
    }
    EXPECT_LT(inside / n_inside, 35);
    EXPECT_NEAR(beside / n_beside, beside_before / n_beside, 4);
    EXPECT_GT(behind / n_behind, behind_before / n_behind + 3);
}

TEST(PhysicalModel, PicturesForTheEye) {
    Exercise curved = phantom_exercise(), linear = phantom_linear_exercise();
    RenderOptions o = physical_options();
    o.width_px = o.height_px = 512;
    write_pgm(::testing::TempDir() + "physical_curved.pgm", draw(curved, o, needle_input()), 512,
              512);
    FrameInput input;
    write_pgm(::testing::TempDir() + "physical_linear.pgm", draw(linear, o, input), 512, 512);
    o.machine = *built_in_machine("classic");
    const auto pixels = draw(curved, o, input);
    EXPECT_GT(*std::max_element(pixels.begin(), pixels.end()), 200);
    // The map of `modern` is less steep above its knee.
    o.machine = Machine{};
    const auto modern = draw(curved, o, input);
    EXPECT_GT(*std::max_element(modern.begin(), modern.end()), 150);
}

}  // namespace
}  // namespace sonocase::runtime
