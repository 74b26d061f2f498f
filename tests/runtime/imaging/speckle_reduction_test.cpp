// SPDX-License-Identifier: Apache-2.0

// Adaptive speckle reduction: smooth regions beside busy ones, each in its place in the tissue.
#include "runtime/imaging/physical/fast/cell_rows.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "cell_bench.h"
#include "formats/machine/machine.h"
#include "imaging_support.h"

namespace sonocase::runtime {
namespace {

using namespace physical;
using namespace sonocase::testing;

struct Bench : CellBench {
    NodeLattice nodes;
    std::vector<int> node_of;
    std::vector<float> node_part;
    ContrastRows contrast;

    Bench() {
        nodes.create(geometry, tables);
        for (int l = 0; l < kLines; ++l) {
            node_of.push_back(nodes.spacing.node_of(l));
            node_part.push_back(nodes.spacing.part(l));
        }
        contrast.resize(kRows, cells.stride, nodes);
    }
    void run(float envelope, float noise) {
        fill(kHazeCell * envelope);
        std::fill(contrast.noise.begin(), contrast.noise.end(), noise);
        contrast.make(available_simd_targets().front(), {&cells, nullptr, &geometry, &tables,
                                                         &nodes, node_of.data(), node_part.data()});
    }
};

TEST(SpeckleReduction, DetailIsTakenFromTheMeanPowerNearby) {
    Bench b;
    for (const float envelope : {1e-3f, 1.0f, 300.0f}) {
        b.run(envelope, 1);
        for (int row = 0; row < 64; ++row) {
            for (int l = 0; l < 192; ++l)
                // log2 of single precision: 5e-5
                ASSERT_NEAR(b.contrast.middle_row(row)[l], 2 * std::log2(envelope) + kDetailMiddle,
                            2e-4);
        }
    }
    b.run(0, 1);
    EXPECT_TRUE(std::isfinite(b.contrast.middle_row(30)[100]));
}

TEST(SpeckleReduction, ContrastFollowsTheNoiseFromItsDepthOnAndWithinLimits) {
    Bench b;
    b.tables.machine.speckle_reduction = {0.3, 20};
    const int shallow = 7, deep = 40;  // 18 and 95 mm
    for (const float noise : {-1.5f, 0.0f, 2.0f}) {
        b.run(1, noise);
        EXPECT_EQ(b.contrast.change_row(shallow)[100], 0);
        EXPECT_NEAR(b.contrast.change_row(deep)[100], 0.3 * static_cast<double>(noise), 1e-6);
    }
    for (const float noise : {-40.0f, 40.0f}) {
        b.run(1, noise);
        EXPECT_NEAR(1 + b.contrast.change_row(deep)[100], noise < 0 ? kMinContrast : kMaxContrast,
                    1e-6);
    }
}

constexpr int kSide = 384, kPatch = 24;

// A linear scan of liver alone, 100 mm wide and deep: speckle alone, below the knee of the grey
// map.
class Scan {
  public:
    explicit Scan(double variation) {
        exercise_ = phantom_linear_exercise();
        exercise_.probe.width_mm = exercise_.probe.depth_mm = 100;
        exercise_.probe.frequency_mhz = 3.5;
        RenderOptions options;
        options.width_px = options.height_px = kSide;
        options.machine = Machine{};
        options.machine->speckle_reduction = {variation, 0};
        options.machine->beam.lines = 256;
        options.effects = {"-parenchyma", "-streaks", "-structure", "-contact"};
        auto renderer = Renderer::create(liver(), exercise_, options);
        EXPECT_TRUE(renderer.has_value());
        renderer_.emplace(std::move(*renderer));
    }
    void show(Vector3 moved_mm) {
        FrameInput input;
        input.settings.gain_db = -6;
        input.mannequin_from_probe.translation = moved_mm;
        pixels_.resize(kSide * kSide);
        EXPECT_EQ(renderer_->render(input, pixels_), FrameStatus::rendered);
    }
    double mm_per_px() const { return renderer_->layout().mm_per_px; }
    double mean() const {
        double sum = 0, n = 0;
        for (int y = kSide / 5; y < kSide - kPatch; ++y) {
            for (int x = kSide / 6; x < 5 * kSide / 6; ++x, ++n)
                sum += pixels_[static_cast<std::size_t>(y * kSide + x)];
        }
        return sum / n;
    }
    // Deviations of patches, `x_px` to the right of where they lie otherwise.
    std::vector<double> deviations(int x_px = 0) const {
        std::vector<double> all;
        for (int y = kSide / 5; y + kPatch < kSide - kPatch; y += kPatch / 2) {
            for (int x = kSide / 6; x + kPatch < 5 * kSide / 6; x += kPatch / 2) {
                double sum = 0, square = 0;
                for (int j = 0; j < kPatch; ++j) {
                    for (int i = 0; i < kPatch; ++i) {
                        const double v =
                            pixels_[static_cast<std::size_t>((y + j) * kSide + x + x_px + i)];
                        sum += v;
                        square += v * v;
                    }
                }
                constexpr double n = kPatch * kPatch;
                all.push_back(std::sqrt(square / n - sum / n * sum / n));
            }
        }
        return all;
    }

  private:
    static const CaseBundle& liver() {
        static const CaseBundle bundle = liver_alone({-80, -10, -10}, {80, 10, 110}, 1);
        return bundle;
    }

    Exercise exercise_;
    std::optional<Renderer> renderer_;
    std::vector<std::uint8_t> pixels_;
};

// Contrast of each patch: its deviation over that without the effect.
std::vector<double> contrasts(Scan& with, Scan& without, Vector3 moved_mm, int x_px) {
    with.show(moved_mm);
    without.show(moved_mm);
    std::vector<double> ratio = with.deviations(x_px);
    const std::vector<double> plain = without.deviations(x_px);
    for (std::size_t i = 0; i < ratio.size(); ++i) ratio[i] /= plain[i];
    return ratio;
}

TEST(SpeckleReduction, MeanGreyStaysAndContrastVaries) {
    Scan with(0.4), without(0);
    const std::vector<double> ratio = contrasts(with, without, {}, 0);
    const double least = *std::min_element(ratio.begin(), ratio.end()),
                 most = *std::max_element(ratio.begin(), ratio.end());
    std::printf("contrast %.2f to %.2f; mean grey %.1f, %.1f without\n", least, most, with.mean(),
                without.mean());
    // Two deviations of the noise to either side.
    EXPECT_LT(least, 0.6);
    EXPECT_GT(most, 1.4);
    EXPECT_NEAR(with.mean() / without.mean(), 1, 0.03);
}

TEST(SpeckleReduction, BelongsToTheTissue) {
    Scan with(0.4), without(0);
    const int moved_px = 48;
    const double moved_mm = moved_px * with.mm_per_px();
    const std::vector<double> before = contrasts(with, without, {}, 0),
                              tissue = contrasts(with, without, {moved_mm, 0, 0}, -moved_px),
                              picture = contrasts(with, without, {moved_mm, 0, 0}, 0);
    std::printf("%.1f mm along the face: %.2f in the tissue, %.2f in the picture\n", moved_mm,
                correlation(before, tissue), correlation(before, picture));
    EXPECT_GT(correlation(before, tissue), 0.9);
    EXPECT_LT(correlation(before, picture), 0.6);
}

TEST(SpeckleReduction, IsNotThereWithoutVariation) {
    Bench b;
    EXPECT_TRUE(has_speckle_reduction(b.tables));
    b.tables.machine.speckle_reduction.variation = 0;
    EXPECT_FALSE(has_speckle_reduction(b.tables));
    for (const char* name : {"classic", "modern-linear"})
        EXPECT_EQ(built_in_machine(name)->speckle_reduction.variation, 0) << name;
}

}  // namespace
}  // namespace sonocase::runtime
