// SPDX-License-Identifier: Apache-2.0

// The scores of realism on pictures that the player shows, with the machines that it shows them
// with. Limits are those of a living liver (formats/image_scores/realism_scores.h); a test of
// sonocase look holds the real frames to the same limits with the same functions. A phantom has no
// streaks, wall or diaphragm: what they decide is judged on whole cases (docs/realism.md).
#include <cstdio>

#include "formats/image_scores/realism_scores.h"
#include "formats/image_scores/smooth.h"
#include "formats/machine/machine.h"
#include "imaging_support.h"

namespace sonocase::runtime {
namespace {

using namespace sonocase::testing;

constexpr int kWidth = 764, kHeight = 617;  // 0.315 mm a pixel, as in the real sweep

// Frames of one case, as the scores see them.
class View {
  public:
    View(const CaseBundle& bundle, const Exercise& exercise, const std::string& machine) {
        RenderOptions options;
        options.width_px = kWidth;
        options.height_px = kHeight;
        options.machine = *built_in_machine(machine);
        auto renderer = Renderer::create(bundle, exercise, options);
        EXPECT_TRUE(renderer.has_value());
        renderer_.emplace(std::move(*renderer));
        const auto layout = renderer_->layout();
        place_.mm_per_px = layout.mm_per_px;
        place_.depth_mm = exercise.probe.depth_mm;
        place_.apex_x_px = layout.origin_x_px;
        place_.apex_y_px = layout.origin_y_px;
        if (exercise.probe.shape == ProbeShape::linear) {
            place_.width_mm = exercise.probe.width_mm;
        } else {
            place_.radius_mm = exercise.probe.radius_mm;
            place_.half_angle_rad = exercise.probe.field_of_view_rad / 2;
            place_.apex_y_px -= place_.radius_mm / place_.mm_per_px;
        }
    }
    BeamImage at(Vector3 moved_mm = {}, double gain_db = 0) {
        FrameInput input;
        input.settings.gain_db = gain_db;
        input.mannequin_from_probe.translation = moved_mm;
        input.frame = frame_++;
        std::vector<std::uint8_t> pixels(kWidth * kHeight);
        EXPECT_EQ(renderer_->render(input, pixels), FrameStatus::rendered);
        return beam_from_picture(pixels, kWidth, kHeight, place_);
    }

  private:
    std::optional<Renderer> renderer_;
    ScanPlace place_;
    std::uint32_t frame_ = 0;
};

// Liver alone, as far as the fan reaches.
const CaseBundle& liver() {
    static const CaseBundle bundle = liver_alone({-125, -16, -25}, {125, 16, 190}, 1.5);
    return bundle;
}

// Medians over the depths that the real limits were measured at, 33 to 91 mm.
PatchScores liver_scores(const BeamImage& image) {
    std::vector<PatchScores> scores;
    for (const PatchPlace p :
         patch_places(image, image.sample_of(33), image.sample_of(91), 30, 226, 24))
        scores.push_back(score_patch(image, p));
    return median_scores(scores);
}

void expect_inside(const char* name, double value) {
    const ScoreLimits& limits = limits_of(name);
    std::printf("%-24s %8.3f   %g to %g\n", name, value, limits.low, limits.high);
    EXPECT_TRUE(limits.holds(value)) << name << " " << value;
}

TEST(Realism, ModernLiverHasTheTextureOfALivingOne) {
    View view(liver(), sweep_exercise(), "modern");
    // No wall weakens this liver: an operator turns the gain down to where a living one lies.
    const PatchScores t = liver_scores(view.at({}, -5));
    const double black = built_in_machine("modern")->grey.floor;
    expect_inside("liver_mean", t.mean);
    expect_inside("local_sd", t.local_sd);
    expect_inside("local_sd_over_mean", t.local_sd / (t.mean - black));
    expect_inside("local_skew", t.local_skew);
    expect_inside("grain_along_mm", t.grain_along_mm);
    expect_inside("grain_across_mm", t.grain_across_mm);
    expect_inside("grain_ratio", t.grain_across_mm / t.grain_along_mm);
    expect_inside("local_kurtosis", t.local_kurtosis);
    expect_inside("gradient_kurtosis", t.gradient_kurtosis);
}

// 99th percentile of grey in a patch.
double patch_99th(const BeamImage& image, PatchPlace place) {
    std::vector<double> grey;
    for (int k = 0; k < kPatch; ++k)
        for (int l = 0; l < kPatch; ++l)
            grey.push_back(static_cast<double>(image.at(place.sample + k, place.line + l)));
    return quantile_of(grey, 0.99);
}

TEST(Realism, DetailHasALivingLiversContrastWhereGainIsTurnedToItsGrey) {
    // Medians of 303 patches of the living sweep's liver, 33 to 91 mm deep, by the same functions.
    constexpr double kMean = 34.1, kLocalSd = 8.03, k99th = 65.4;
    // Gain is a knob before the grey map: an offset or a factor of finished grey is another
    // picture.
    View view(liver(), sweep_exercise(), "modern");
    double low_db = -15, high_db = 0;
    PatchScores t;
    double bright = 0;
    for (int turn = 0; turn < 6; ++turn) {
        const double gain_db = 0.5 * (low_db + high_db);
        const BeamImage image = view.at({}, gain_db);
        t = liver_scores(image);
        std::vector<double> brightest;
        for (const PatchPlace p :
             patch_places(image, image.sample_of(33), image.sample_of(91), 30, 226, 24))
            brightest.push_back(patch_99th(image, p));
        bright = median_of(brightest);
        (t.mean > kMean ? high_db : low_db) = gain_db;
    }
    std::printf("at %.1f dB: mean %.1f, local sd %.2f (living %.2f), 99th percentile %.1f (%.1f)\n",
                high_db, t.mean, t.local_sd, kLocalSd, bright, k99th);
    ASSERT_NEAR(t.mean, kMean, 1);
    EXPECT_NEAR(t.local_sd, kLocalSd, 0.2 * kLocalSd);
    EXPECT_NEAR(bright, k99th, 0.2 * k99th);
}

TEST(Realism, ClassicLiverIsOutsideTheLimitsThatTellItApart) {
    // The limits judge: a machine of the nineties, which no longer passes for a living liver, fails
    // them.
    View view(liver(), sweep_exercise(), "classic");
    const PatchScores t = liver_scores(view.at());
    std::printf("classic: mean %.0f sd %.1f skew %.2f\n", t.mean, t.local_sd, t.local_skew);
    EXPECT_FALSE(limits_of("liver_mean").holds(t.mean));
    EXPECT_FALSE(limits_of("local_skew").holds(t.local_skew));
}

TEST(Realism, DetailLastsAcrossTheSliceAndAlongTheFace) {
    View view(liver(), sweep_exercise(), "modern");
    const BeamImage still = view.at();
    const auto correlation = [&](Vector3 by_mm) {
        const BeamImage moved = view.at(by_mm);
        std::vector<double> best;
        for (const PatchPlace p :
             patch_places(still, still.sample_of(35), still.sample_of(90), 40, 216, 48))
            best.push_back(match_detail(still, moved, p, 3).correlation);
        return median_of(best);
    };
    expect_inside("elevation_correlation", correlation({0, 0.3, 0}));
    expect_inside("lateral_correlation", correlation({0.22, 0, 0}));  // half a beam at 35 mm
    // Half of it within [0.8, 2.2] mm.
    EXPECT_GT(correlation({0, 0.8, 0}), 0.5);
    EXPECT_LT(correlation({0, 2.2, 0}), 0.5);
}

TEST(Realism, NothingIsDarkerThanTheMachinesBlackAndBlackIsFreeOfNoise) {
    const double floor = built_in_machine("modern")->grey.floor;
    // A cyst of 24 mm, 105 mm down its beam, and fluid in a vessel of 16 mm.
    View view(phantom(), phantom_exercise(), "modern");
    const BeamImage image = view.at();
    float darkest = 255;  // away from the border, where the picture's surroundings mix in
    for (int k = 3; k < image.samples - 3; ++k) {
        for (int l = 3; l < image.lines - 3; ++l) darkest = std::min(darkest, image.at(k, l));
    }
    EXPECT_GE(darkest, floor - 1);
    // The vessel's middle: 75 mm deep, 5 mm to the side of the axis.
    const int line = static_cast<int>(
        (std::atan2(5.0, 75.0 + image.radius_mm) + 0.5 * image.lines * image.line_step) /
        image.line_step);
    std::vector<float> lumen;
    for (int k = image.sample_of(72); k < image.sample_of(78); ++k) {
        for (int l = line - 4; l < line + 4; ++l) lumen.push_back(image.at(k, l));
    }
    const Moments m = moments_of(lumen);
    std::printf("vessel lumen %.1f grey, sd %.2f\n", m.mean, m.sd);
    EXPECT_LT(m.mean, 22);  // of living vessels: portal 15 to 17, hepatic veins 8 to 14
}

TEST(Realism, TheFaceStartsDarkerThanTheOldOneAndIsLined) {
    PhantomOptions o;
    o.ribs = o.gas = o.vessels = o.kidney = false;
    o.lower = {-60, -12, -20};
    o.upper = {60, 12, 70};
    const CaseBundle layers = Phantom(o).bundle();
    Exercise exercise = sweep_exercise();
    exercise.probe.depth_mm = 60;
    View modern(layers, exercise, "modern"), classic(layers, exercise, "classic");
    const BeamImage now = modern.at(), before = classic.at();
    std::printf("first 4 mm: %.0f grey, classic %.0f\n", mean_grey(now, 0, 4),
                mean_grey(before, 0, 4));
    expect_inside("near_grey", mean_grey(now, 0, 4));
    EXPECT_LT(mean_grey(now, 0, 0.7), mean_grey(before, 0, 0.7) - 40);
    // Lines of the probe's own face do not move with the tissue.
    const BeamImage moved = modern.at({6, 0, 0});
    double aa = 0, bb = 0, ab = 0;
    for (int k = 0; k < now.sample_of(4); ++k) {
        double a = 0, b = 0;
        for (int l = 64; l < 192; ++l) {
            a += static_cast<double>(now.at(k, l)) / 128;
            b += static_cast<double>(moved.at(k, l)) / 128;
        }
        aa += (a - 70) * (a - 70);
        bb += (b - 70) * (b - 70);
        ab += (a - 70) * (b - 70);
    }
    EXPECT_GT(ab / std::sqrt(aa * bb), 0.8);  // real frames 40 apart: 0.84
}

TEST(Realism, SpeckleOfALinearScanIsFinerAndAsSkewed) {
    View view(liver(), phantom_linear_exercise(), "modern-linear");
    // Fat and muscle, which such probes look at, scatter 7 to 8 dB less than liver.
    const BeamImage image = view.at({}, -8);
    std::vector<PatchScores> scores;
    for (const PatchPlace p :
         patch_places(image, image.sample_of(8), image.sample_of(30), 20, 236, 32))
        scores.push_back(score_patch(image, p));
    const PatchScores t = median_scores(scores);
    std::printf("linear: mean %.0f sd %.1f skew %.2f along %.2f across %.2f mm\n", t.mean,
                t.local_sd, t.local_skew, t.grain_along_mm, t.grain_across_mm);
    // Real, small-parts probe: 0.39 mm along, patch mean 51 at the most.
    EXPECT_GT(t.grain_along_mm, 0.25);
    EXPECT_LT(t.grain_along_mm, 0.5);
    EXPECT_GT(t.local_skew, 0.2);
    EXPECT_LT(t.mean, 80);
}

}  // namespace
}  // namespace sonocase::runtime
