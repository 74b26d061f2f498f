// SPDX-License-Identifier: Apache-2.0

// A box of the case on smaller voxels: seen where it lies, not seen where it ends.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "imaging_support.h"
#include "runtime/imaging/truth/frame_truth.h"
#include "support/phantom_region.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

const Box3 kBox{{0.2, -8.1, 3.3}, {29.7, 8.4, 36.2}};

CaseBundle with_region(CaseBundle bundle, const Box3& box, double voxel_mm = 0.3) {
    bundle.region = phantom_region({}, box, voxel_mm);
    return bundle;
}

const CaseBundle& regional() {
    static const CaseBundle bundle = with_region(phantom(), kBox);
    return bundle;
}

RenderOptions options_of(std::vector<std::string> effects, RendererKind kind = RendererKind::fast) {
    RenderOptions o;
    o.kind = kind;
    o.width_px = o.height_px = 192;
    o.effects = std::move(effects);
    return o;
}

Renderer::Layout layout_of(const Exercise& exercise, const RenderOptions& options) {
    return Renderer::create(phantom(), exercise, options)->layout();
}

TEST(FineRegion, FastAgreesWithSlow) {
    Exercise pulsing = phantom_linear_exercise();
    pulsing.pulsation.amplitude_mm = 1;
    const std::vector<std::vector<std::string>> rows{{"none"},       {"auto"},
                                                     {"all"},        {"-boundaries"},
                                                     {"boundaries"}, {"interfaces", "boundaries"},
                                                     {"-structure"}, {"-elevation"}};
    for (const auto& effects : rows) {
        for (const Exercise& exercise : {pulsing, phantom_exercise()}) {
            FrameInput input = needle_input();
            input.time_s = 1.3;
            RenderOptions fast = options_of(effects),
                          slow = options_of(effects, RendererKind::reference);
            fast.samples = slow.samples = 240;
            fast.scanlines = slow.scanlines = 96;
            const Difference d = compare(draw(exercise, fast, input, regional()),
                                         draw(exercise, slow, input, regional()));
            std::printf("%-12s mean %.3f bias %+.3f worst %d\n", effects.front().c_str(), d.mean,
                        d.bias, d.worst);
            EXPECT_LT(d.mean, 0.35) << effects.front();
            EXPECT_LT(std::abs(d.bias), 0.1) << effects.front();
        }
    }
}

TEST(FineRegion, SamePixelsOnEveryInstructionSetAndInARegionBeyondTheFrame) {
    Random random(5);
    const CaseBundle far = with_region(phantom(), {{60, 0, 120}, {70, 10, 130}}, 0.5);
    for (int n = 0; n < 3; ++n) {
        const FrameInput input = random_input(random, static_cast<std::uint32_t>(n));
        const Exercise exercise = n == 0 ? phantom_exercise() : phantom_linear_exercise();
        const auto best = draw(exercise, options_of({"auto"}), input, regional());
        EXPECT_NE(best, draw(exercise, options_of({"auto"}), input));
        for (const std::string& simd : simd_targets()) {
            RenderOptions options = options_of({"auto"});
            options.simd = simd;
            EXPECT_EQ(draw(exercise, options, input, regional()), best) << simd;
        }
        if (n == 0) continue;
        EXPECT_EQ(draw(exercise, options_of({"auto"}), input, far),
                  draw(exercise, options_of({"auto"}), input));
    }
}

// Columns and rows of a linear probe's picture are x and z of the phantom.
struct Strip {
    double sum = 0, square = 0;
    int count = 0;
    void add(double v) {
        sum += v;
        square += v * v;
        ++count;
    }
    double mean() const { return sum / count; }
    double rms() const { return std::sqrt(square / count); }
};

// A plane across the border: against the whole volume on the region's voxels, and against the
// case's own alone. The whole volume is once a case of such voxels and once a region that is larger
// than the picture: in the former, surfaces echo only where its records reach (0.45 mm), which is
// another picture on both sides of the border.
TEST(FineRegion, BorderCannotBeSeen) {
    PhantomOptions size;
    size.lower = {-24, -5, -6};
    size.upper = {24, 5, 48};
    CaseBundle own = Phantom(size).bundle();
    own.boundary = within_band(own.boundary, 1.5);
    CaseBundle both = own, wide = own;
    both.region = phantom_region(size, {{0.2, -4.9, -3}, {22.6, 4.9, 47.3}}, 0.3);
    wide.region = phantom_region(size, {{-23.9, -4.9, -5.9}, {23.9, 4.9, 47.3}}, 0.3);
    size.voxel_mm = 0.3;
    CaseBundle fine = Phantom(size).bundle();
    fine.boundary = within_band(fine.boundary, 1.5);
    const Exercise exercise = phantom_linear_exercise();
    const struct {
        std::vector<std::string> effects;
        bool against_case;  // of the region's voxels: labels alone
        double rms;         // grey
    } rows[] = {{{"boundaries"}, true, 1.5}, {{"boundaries"}, false, 0.5}, {{"auto"}, false, 1.5}};
    for (const auto& row : rows) {
        const RenderOptions options = options_of(row.effects);
        const FrameInput input;
        const auto r = draw(exercise, options, input, both);
        const auto f = draw(exercise, options, input, row.against_case ? fine : wide);
        const auto c = draw(exercise, options, input, own);
        const Renderer::Layout px = layout_of(exercise, options);
        Strip left, right, at_border, inside, plain;
        for (int y = 0; y < 192; ++y) {
            for (int x = 0; x < 192; ++x) {
                const auto i = static_cast<std::size_t>(192 * y + x);
                const double e = double(r[i]) - double(f[i]), own_e = double(c[i]) - double(f[i]);
                const double d = (x - px.origin_x_px) * px.mm_per_px - 0.2;
                if (d > -1 && d <= 0) left.add(e);
                if (d > 0 && d < 1) right.add(e);
                if (std::abs(d) < 1) at_border.add(e);
                if (d > 2 && d < 18) inside.add(e);
                if (std::abs(d) < 18) plain.add(own_e);
            }
        }
        const double step = right.mean() - left.mean();
        std::printf("%-10s border rms %.2f, step %.3f; inside rms %.2f; without region %.2f\n",
                    row.effects.front().c_str(), at_border.rms(), step, inside.rms(), plain.rms());
        EXPECT_LT(std::abs(step), 0.25);
        EXPECT_LT(at_border.rms(), plain.rms());
        EXPECT_LT(at_border.rms(), row.rms);
        if (row.against_case) continue;
        EXPECT_LT(inside.rms(), 0.1);
    }
}

// What the case's own voxels do not hold shows in the box and nowhere else.
TEST(FineRegion, ShowsWhatOnlyTheRegionHolds) {
    PhantomOptions liver;
    liver.vessels = liver.ribs = liver.gas = liver.kidney = liver.layers = false;
    CaseBundle bundle = Phantom(liver).bundle();
    const CaseBundle plain = bundle;
    PhantomOptions layers = liver;
    layers.layers = true;
    bundle.region = phantom_region(layers, {{-15, -10, 4}, {-5, 10, 20}}, 0.4);
    const Exercise exercise = phantom_linear_exercise();
    const RenderOptions options = options_of({"boundaries"});
    const FrameInput input;
    const auto with = draw(exercise, options, input, bundle),
               without = draw(exercise, options, input, plain);
    auto truth = TruthRenderer::create(bundle, exercise, options);
    ASSERT_TRUE(truth);
    std::vector<std::uint8_t> labels(with.size()), needle(labels), shadowed(labels);
    std::vector<float> depth(labels.size());
    truth->render(input, {labels, needle, shadowed, depth});
    const Renderer::Layout px = layout_of(exercise, options);
    int inside = 0, outside = 0, in_truth = 0, beyond = 0;
    for (int y = 0; y < 192; ++y) {
        for (int x = 0; x < 192; ++x) {
            const auto i = static_cast<std::size_t>(192 * y + x);
            const double at = (x - px.origin_x_px) * px.mm_per_px;
            const bool box = at > -16.5 && at < -3.5;
            (box ? inside : outside) += with[i] != without[i];
            const bool layer = labels[i] == Phantom::fat || labels[i] == Phantom::muscle;
            const bool exact = at > -15.2 && at < -4.8;
            (exact ? in_truth : beyond) += layer;
        }
    }
    std::printf("%d pixels differ inside, %d outside; truth has layers in %d and %d\n", inside,
                outside, in_truth, beyond);
    EXPECT_GT(inside, 500);
    EXPECT_EQ(outside, 0);
    EXPECT_GT(in_truth, 500);
    EXPECT_EQ(beyond, 0);
}

TEST(FineRegion, OtherModelsShowTheCasesOwnVoxels) {
    const Exercise exercise = phantom_exercise();
    RenderOptions options = options_of({"auto"});
    options.model = ImageModel::paper;
    EXPECT_EQ(draw(exercise, options, {}, regional()), draw(exercise, options, {}));
}

}  // namespace
}  // namespace sonocase::runtime
