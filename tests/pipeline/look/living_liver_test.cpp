// SPDX-License-Identifier: Apache-2.0

// The scores of a living liver: blocks of a real sweep lie inside the limits of
// formats/image_scores/realism_scores.h, and the medians are those found for it by another program.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "formats/image_scores/realism_scores.h"
#include "formats/image_scores/smooth.h"
#include "pipeline/base/text.h"
#include "pipeline/look/find_scan.h"
#include "pipeline/look/look.h"
#include "pipeline/look/look_frames.h"
#include "support/paths.h"

namespace sonocase::pipeline {
namespace {

// Rectangles of liver, chosen by eye: indices into the frames that are used (first, end), samples,
// lines on the grid of the scores.
struct LiverRectangle {
    int first, end, s0, s1, l0, l1;
};
constexpr std::array<LiverRectangle, 10> kLiver{{{12, 17, 105, 200, 35, 150},
                                                 {18, 25, 110, 255, 45, 145},
                                                 {26, 31, 110, 250, 60, 140},
                                                 {32, 37, 110, 240, 60, 145},
                                                 {38, 43, 115, 240, 60, 115},
                                                 {44, 49, 105, 235, 60, 125},
                                                 {50, 55, 100, 225, 50, 105},
                                                 {50, 57, 98, 146, 150, 235},
                                                 {56, 60, 100, 200, 45, 105},
                                                 {58, 60, 172, 236, 178, 235}}};

class LivingLiver : public ::testing::Test {
  protected:
    static constexpr const char* kFolder = SONOCASE_DATA "/ultrasound/liver_sweep";

    void SetUp() override {
        if (!std::filesystem::exists(kFolder))
            GTEST_SKIP() << "no liver sweep beside the checkout (../shared/data/ultrasound)";
        const auto text = read_text_file(std::string(kFolder) + "/geometry.json");
        ASSERT_TRUE(text);
        auto scan = parse_scan(*text, "geometry.json");
        ASSERT_TRUE(scan) << scan.error().message();
        scan_ = std::move(*scan);
        paths_ = *list_frames({std::string(kFolder) + "/frames"});
    }
    BeamImage image(std::size_t use) const {
        const auto frame = read_look_frame(paths_[scan_.use[use]]);
        EXPECT_TRUE(frame);
        return beam_from_picture(frame->grey, frame->width_px, frame->height_px, scan_.place);
    }
    std::vector<BeamImage> images(std::size_t first, std::size_t end) const {
        std::vector<BeamImage> all;
        for (std::size_t u = first; u < end; ++u) all.push_back(image(u));
        return all;
    }
    GivenScan scan_;
    std::vector<std::string> paths_;
};

void expect_inside(const char* name, double value) {
    const ScoreLimits& limits = limits_of(name);
    std::printf("%-24s %8.3f   %g to %g\n", name, value, limits.low, limits.high);
    EXPECT_TRUE(limits.holds(value)) << name << " " << value;
}

TEST_F(LivingLiver, LiesInsideItsLimitsAndGivesTheFiguresOfTheFindings) {
    const std::vector<BeamImage> frames = images(0, scan_.use.size());
    std::vector<PatchScores> patches;
    std::array<std::vector<PatchScores>, 3> bands;  // 33 to 52, 70, 91 mm
    StreakScore streaks;
    for (const LiverRectangle& r : kLiver) {
        for (int u = r.first; u < r.end; ++u) {
            const BeamImage& frame = frames[static_cast<std::size_t>(u)];
            for (const PatchPlace p : patch_places(frame, r.s0, r.s1, r.l0, r.l1, 24)) {
                patches.push_back(score_patch(frame, p));
                const double mm = patches.back().depth_mm;
                bands[mm < 52 ? 0 : mm < 70 ? 1 : 2].push_back(patches.back());
            }
            const StreakScore s = score_streaks(frame, r.s0, r.s1, r.l0, r.l1);
            streaks.count += s.count;
            streaks.area_cm2 += s.area_cm2;
        }
    }
    const PatchScores t = median_scores(patches);
    constexpr double kBlack = 8;
    expect_inside("liver_mean", t.mean);
    expect_inside("local_sd", t.local_sd);
    expect_inside("local_sd_over_mean", t.local_sd / (t.mean - kBlack));
    expect_inside("local_skew", t.local_skew);
    expect_inside("local_kurtosis", t.local_kurtosis);
    expect_inside("gradient_kurtosis", t.gradient_kurtosis);
    expect_inside("grain_along_mm", t.grain_along_mm);
    expect_inside("grain_across_mm", t.grain_across_mm);
    expect_inside("grain_ratio", t.grain_across_mm / t.grain_along_mm);
    expect_inside("streaks_per_cm2", streaks.per_cm2());

    // Measured independently on all 140 frames (of which 100 are here): sd, skew, kurtosis, grain
    // along and across at 33 to 52, 52 to 70, 70 to 91 mm. A third of the frames is missing, and
    // blocks of six differ by a fifth: 15 % for widths and sd, 0.2 for skew.
    constexpr double kFound[3][5] = {
        {8.8, 1.26, 3.6, 1.12, 2.48}, {7.7, 0.95, 1.9, 1.09, 2.20}, {8.7, 0.86, 2.7, 1.13, 2.69}};
    for (std::size_t b = 0; b < 3; ++b) {
        const PatchScores s = median_scores(bands[b]);
        std::printf("band %zu: sd %.2f skew %.2f kurtosis %.2f along %.2f across %.2f\n", b,
                    s.local_sd, s.local_skew, s.local_kurtosis, s.grain_along_mm,
                    s.grain_across_mm);
        EXPECT_NEAR(s.local_sd, kFound[b][0], 0.15 * kFound[b][0]);
        EXPECT_NEAR(s.local_skew, kFound[b][1], 0.2);
        EXPECT_NEAR(s.local_kurtosis, kFound[b][2], 0.9);
        EXPECT_NEAR(s.grain_along_mm, kFound[b][3], 0.15 * kFound[b][3]);
        EXPECT_NEAR(s.grain_across_mm, kFound[b][4], 0.15 * kFound[b][4]);
    }
}

TEST_F(LivingLiver, WallNearFieldAndDiaphragmLieInsideTheLimits) {
    std::vector<double> peak, width, black;
    for (std::size_t block = 0; block + 6 <= scan_.use.size(); block += 18) {
        std::vector<double> layers, across, near;
        for (const BeamImage& frame : images(block, block + 6)) {
            const WallScores wall = score_wall(frame);
            layers.push_back(wall.layers);
            across.push_back(wall.across[1]);
            near.push_back(mean_grey(frame, 0, 4));
            if (const auto d = score_diaphragm(frame)) {
                peak.push_back(d->peak_grey);
                width.push_back(d->width_mm);
                black.push_back(d->black_grey);
            }
        }
        expect_inside("wall_layers", median_of(layers));
        expect_inside("wall_across", median_of(across));
        expect_inside("near_grey", median_of(near));
    }
    // Over the whole sweep: it is bright where it faces the beam and less so elsewhere.
    ASSERT_GT(peak.size(), 12u);
    expect_inside("diaphragm_peak", median_of(peak));
    expect_inside("diaphragm_width_mm", median_of(width));
    expect_inside("black_grey", median_of(black));
}

// Movement of a point of the picture across the slice from one frame to another, mm. Picture axes:
// origin mid-picture, x right, y down, z across the slice.
double across_slice(const std::vector<double>& a, const std::vector<double>& b, PixelPoint p) {
    const double x = (p.x_px - 369) * 0.314818, y = (p.y_px - 296) * 0.314818;
    double across = 0;
    for (std::size_t row = 0; row < 3; ++row) {
        const auto at = [&](const std::vector<double>& m) {
            return m[4 * row] * x + m[4 * row + 1] * y + m[4 * row + 3];
        };
        across += (at(b) - at(a)) * a[4 * row + 2];
    }
    return std::abs(across);
}

TEST_F(LivingLiver, SpeckleLastsAcrossTheSliceAsTheFindingsSay) {
    const auto text = read_text_file(std::string(kFolder) + "/poses.csv");
    ASSERT_TRUE(text);
    std::vector<std::vector<double>> poses;
    for (const TextRow& row : split_rows(*text)) {
        if (row.cells.size() < 19 || !number_in(row.cells[0])) continue;
        std::vector<double> m;
        for (std::size_t i = 3; i < 19; ++i) m.push_back(*number_in(row.cells[i]));
        poses.push_back(m);
    }
    ASSERT_EQ(poses.size(), 100u);
    const std::vector<BeamImage> frames = images(0, scan_.use.size());
    constexpr std::array<double, 7> kEdges{0, 0.3, 0.6, 0.9, 1.3, 1.8, 2.5};
    std::array<std::vector<double>, 6> found;
    for (const LiverRectangle& r : kLiver) {
        for (int u = r.first; u + 1 < r.end; ++u) {
            for (int v = u + 1; v < std::min(u + 4, r.end); ++v) {
                const auto &a = frames[static_cast<std::size_t>(u)],
                           &b = frames[static_cast<std::size_t>(v)];
                for (const PatchPlace p : patch_places(a, r.s0, r.s1, r.l0, r.l1, 36)) {
                    const double moved =
                        across_slice(poses[scan_.use[static_cast<std::size_t>(u)]],
                                     poses[scan_.use[static_cast<std::size_t>(v)]],
                                     pixel_of(scan_.place, a, p.sample + 24, p.line + 24));
                    for (std::size_t i = 0; i < found.size(); ++i) {
                        if (moved >= kEdges[i] && moved < kEdges[i + 1])
                            found[i].push_back(match_detail(a, b, p, 3).correlation);
                    }
                }
            }
        }
    }
    for (std::size_t i = 0; i < found.size(); ++i)
        std::printf("%.1f to %.1f mm: correlation %.2f (%zu)\n", kEdges[i], kEdges[i + 1],
                    median_of(found[i]), found[i].size());
    ASSERT_FALSE(found[0].empty());
    expect_inside("elevation_correlation", median_of(found[0]));
    expect_inside("elevation_correlation", median_of(found[1]));
    // Found independently: 0.87 to 0.94, then 0.79 to 0.93, 0.33 to 0.46 at 1.8 to 2.5 mm.
    EXPECT_NEAR(median_of(found[0]), 0.9, 0.08);
    EXPECT_LT(median_of(found[5]), 0.55);
}

TEST_F(LivingLiver, LookFindsTheFanInThePixelsAndEveryScoreInsideItsLimits) {
    LookInput input;
    input.frames = {std::string(kFolder) + "/frames"};
    LookOptions options;
    options.depth_mm = scan_.place.depth_mm;
    options.frames = 16;
    const auto r = measure_look_of(input, options);
    ASSERT_TRUE(r) << r.error().message();
    // Against the geometry that was measured by hand, in pixels and degrees.
    EXPECT_NEAR(r->place.apex_x_px, scan_.place.apex_x_px, 1.5);
    EXPECT_NEAR(r->place.apex_y_px, scan_.place.apex_y_px, 3);
    EXPECT_NEAR(r->place.mm_per_px, scan_.place.mm_per_px, 0.002);
    EXPECT_NEAR(r->place.radius_mm, scan_.place.radius_mm, 1);
    EXPECT_NEAR(r->place.half_angle_rad, scan_.place.half_angle_rad, 0.006);
    for (const LookScore& score : r->scores)
        if (std::isfinite(score.real)) expect_inside(score.limits.name.data(), score.real);
    EXPECT_NEAR(r->fit.machine.grey.floor, 8.5, 1.5);
    EXPECT_TRUE(r->real.black_seen);
    // What the machine draws has the texture it was fitted to.
    const PatchScores &real = r->real.texture, &own = r->stand_in.texture;
    EXPECT_NEAR(own.grain_along_mm, real.grain_along_mm, 0.15 * real.grain_along_mm);
    EXPECT_NEAR(own.grain_across_mm, real.grain_across_mm, 0.2 * real.grain_across_mm);
    EXPECT_NEAR(own.mean, real.mean, 0.15 * real.mean);
    EXPECT_NEAR(own.local_sd, real.local_sd, 0.15 * real.local_sd);
    EXPECT_NEAR(r->stand_in.first_4_mm, r->real.first_4_mm, 5);
    // Below the liver lie diaphragm and lung: that their level falls is no far gain.
    EXPECT_EQ(r->fit.machine.gain, Machine{}.gain);
}

}  // namespace
}  // namespace sonocase::pipeline
