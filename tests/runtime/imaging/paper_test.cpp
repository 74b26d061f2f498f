// SPDX-License-Identifier: Apache-2.0

// Model `paper`: the beam-space renderer against the literal one, and its own truths.
#include <gtest/gtest.h>

#include <cmath>

#include "imaging_support.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

RenderOptions paper_options(RendererKind kind = RendererKind::fast) {
    RenderOptions o;
    o.model = ImageModel::paper;
    o.kind = kind;
    o.width_px = o.height_px = 256;
    return o;
}

// The literal renderer looks up the voxel and texture cell at each pixel, the fast one at beam
// samples and blends four of them: they differ by a fraction of the texture's own contrast at each
// pixel and by more at the rims of labels, and nowhere on average.
TEST(PaperModel, BeamSpaceAgreesWithTheLiteralRendererEffectByEffect) {
    struct Row {
        std::vector<std::string> effects;
        double mean, bias;
    };
    const std::vector<Row> rows{
        {{"none"}, 1.0, 0.1},  {{"texture"}, 5.5, 0.2},         {{"needle"}, 1.2, 0.1},
        {{"noise"}, 5.5, 0.3}, {{"shadow"}, 1.2, 0.2},          {{"attenuation"}, 1.0, 0.2},
        {{"blur"}, 0.8, 0.2},  {{"texture", "blur"}, 2.5, 0.2}, {{"auto"}, 3.0, 0.5}};
    for (const Row& row : rows) {
        RenderOptions fast = paper_options(), slow = paper_options(RendererKind::reference);
        fast.effects = slow.effects = row.effects;
        const auto a = draw(phantom_exercise(), fast, needle_input());
        const auto b = draw(phantom_exercise(), slow, needle_input());
        const Difference d = compare(a, b);
        std::printf("%-12s mean %.3f bias %+.3f worst %d\n", row.effects.front().c_str(), d.mean,
                    d.bias, d.worst);
        EXPECT_LT(d.mean, row.mean) << row.effects.front();
        EXPECT_LT(std::abs(d.bias), row.bias) << row.effects.front();
        if (row.effects.front() == "auto") {
            write_pgm(::testing::TempDir() + "paper_fast.pgm", a, 256, 256);
            write_pgm(::testing::TempDir() + "paper_reference.pgm", b, 256, 256);
        }
    }
}

TEST(PaperModel, AgreementHoldsOverRandomPosesAndProbes) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        Random random(seed);
        FrameInput input = random_input(random, static_cast<std::uint32_t>(seed));
        input.settings.gain_db = random.uniform(-3, 3);
        Exercise exercise = phantom_exercise();
        exercise.probe.shape = static_cast<ProbeShape>(seed % 3);
        const auto a = draw(exercise, paper_options(), input);
        const auto b = draw(exercise, paper_options(RendererKind::reference), input);
        const Difference d = compare(a, b);
        EXPECT_LT(d.mean, 4.5) << "seed " << seed;
        EXPECT_LT(std::abs(d.bias), 0.6) << "seed " << seed;
    }
}

TEST(PaperModel, PixelsAreTheSameOnEveryInstructionSetAndThreadCount) {
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        Exercise exercise = phantom_exercise();
        exercise.probe.shape = shape;
        const auto expected = draw(exercise, paper_options(), needle_input());
        for (const std::string& simd : simd_targets()) {
            for (const int threads : {1, 2, 3}) {
                RenderOptions options = paper_options();
                options.host = thread_host();
                options.simd = simd;
                options.threads = threads;
                EXPECT_TRUE(draw(exercise, options, needle_input()) == expected)
                    << simd << " " << threads;
            }
        }
    }
}

TEST(PaperModel, NoiseHasTheStatedDeviation) {
    PhantomOptions options;
    options.ribs = options.gas = options.vessels = options.kidney = options.layers = false;
    options.lower = {-40, -10, -5};
    options.upper = {40, 10, 80};
    const CaseBundle bundle = Phantom(options).bundle();
    Exercise exercise = phantom_linear_exercise();
    RenderOptions o = paper_options();
    o.effects = {"noise"};
    o.width_px = o.height_px =
        1024;  // pixels finer than samples: bilinear blending of equal neighbours
    o.scanlines = o.samples = 64;
    const auto pixels = draw(exercise, o, {}, bundle);
    auto renderer = Renderer::create(bundle, exercise, o);
    const auto layout = renderer->layout();
    double sum = 0, square = 0;
    int n = 0;
    for (int l = 4; l < 60; ++l) {
        for (int k = 10; k < 60; ++k) {
            const double x = (l + 0.5) / 64 * 40 - 20, z = (k + 0.5) / 64 * 45;
            const auto c =
                static_cast<std::size_t>(std::lround(x / layout.mm_per_px + layout.origin_x_px));
            const auto r =
                static_cast<std::size_t>(std::lround(z / layout.mm_per_px + layout.origin_y_px));
            const double v = pixels[r * 1024 + c];
            sum += v;
            square += v * v;
            ++n;
        }
    }
    const double mean = sum / n, sd = std::sqrt(square / n - mean * mean);
    EXPECT_NEAR(mean, 105, 1.0);  // the liver's grey; standard error 0.3
    EXPECT_NEAR(sd, 15, 0.8);     // standard error 0.2, and a pixel lies up to 0.03 samples off
}

TEST(PaperModel, NeedleInThePlaneIsBrightAndOneOutsideTheSlabIsAbsent) {
    RenderOptions o = paper_options();
    o.effects = {"needle"};
    FrameInput input;
    const auto bare = draw(phantom_exercise(), o, input);
    input.has_needle = true;
    input.needle = {{0, 3, 60}, {0, 0, 1}};
    EXPECT_EQ(draw(phantom_exercise(), o, input), bare);
    input.needle.tip.y = 0;
    auto renderer = Renderer::create(phantom(), phantom_exercise(), o);
    const auto layout = renderer->layout();
    const auto with = draw(phantom_exercise(), o, input);
    const auto column = static_cast<std::size_t>(std::lround(layout.origin_x_px));
    const auto row =
        static_cast<std::size_t>(std::lround(layout.origin_y_px + 55 / layout.mm_per_px));
    EXPECT_GT(with[row * 256 + column], 200);
    const auto below =
        static_cast<std::size_t>(std::lround(layout.origin_y_px + 65 / layout.mm_per_px));
    EXPECT_EQ(with[below * 256 + column], bare[below * 256 + column]);
}

TEST(PaperModel, FlipMirrorsThePicture) {
    FrameInput input = needle_input();
    const auto plain = draw(phantom_exercise(), paper_options(), input);
    input.settings.flip_left_right = true;
    const auto flipped = draw(phantom_exercise(), paper_options(), input);
    for (std::size_t r = 0; r < 256; ++r) {
        for (std::size_t c = 0; c < 256; ++c)
            ASSERT_EQ(plain[r * 256 + c], flipped[r * 256 + 255 - c]);
    }
}

TEST(PaperModel, HardPosesAndSizesRender) {
    for (const Vector3 shift : {Vector3{1e6, 0, 0}, Vector3{0, 0, -500}, Vector3{0.5, 0.5, 0.5},
                                Vector3{90, 30, 170}, Vector3{-90.5, 0, 0}}) {
        FrameInput input = needle_input();
        input.mannequin_from_probe.translation = shift;
        for (const int size : {1, 3, 64}) {
            RenderOptions o = paper_options();
            o.width_px = o.height_px = size;
            draw(phantom_exercise(), o, input);
        }
    }
    for (const Vector3 axis : {Vector3{0, 1, 0}, Vector3{1, 0, 0}, Vector3{0, 0, 1}}) {
        FrameInput input = needle_input();
        input.needle.direction = axis;
        Exercise exercise = phantom_exercise();
        exercise.needle.slab_mm = 1e-12;
        exercise.needle.length_mm = 0.2;
        draw(exercise, paper_options(), input);
        draw(exercise, paper_options(RendererKind::reference), input);
    }
    for (const int lines : {1, 2, 17}) {
        RenderOptions o = paper_options();
        o.scanlines = lines;
        o.samples = lines;
        draw(phantom_exercise(), o, needle_input());
    }
}

TEST(Renderer, RefusesWhatCannotBeScanned) {
    Exercise e = phantom_exercise();
    e.probe.depth_mm = 0;
    EXPECT_FALSE(Renderer::create(phantom(), e, paper_options()).has_value());
    e = phantom_exercise();
    e.probe.field_of_view_rad = NAN;
    EXPECT_FALSE(Renderer::create(phantom(), e, paper_options()).has_value());
    RenderOptions o = paper_options();
    o.width_px = 0;
    EXPECT_FALSE(Renderer::create(phantom(), phantom_exercise(), o).has_value());
    o = paper_options();
    o.effects = {"shadows"};
    EXPECT_FALSE(Renderer::create(phantom(), phantom_exercise(), o).has_value());
    o = paper_options();
    o.simd = "MMX";
    EXPECT_FALSE(Renderer::create(phantom(), phantom_exercise(), o).has_value());
    const CaseBundle empty;
    EXPECT_FALSE(Renderer::create(empty, phantom_exercise(), paper_options()).has_value());
}

}  // namespace
}  // namespace sonocase::runtime
