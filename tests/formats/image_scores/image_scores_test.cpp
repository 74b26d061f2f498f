// SPDX-License-Identifier: Apache-2.0

// Scores of pictures whose scores are known.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/image_scores/realism_scores.h"
#include "formats/image_scores/smooth.h"
#include "support/random.h"

namespace sonocase {
namespace {

ScanPlace fan_place() {
    ScanPlace place;
    place.mm_per_px = 0.3;
    place.apex_x_px = 360;
    place.apex_y_px = -120;
    place.radius_mm = 50;
    place.half_angle_rad = 0.5;
    place.depth_mm = 150;
    return place;
}

ScanPlace linear_place() {
    ScanPlace place;
    place.mm_per_px = 0.1;
    place.apex_x_px = 199.5;
    place.apex_y_px = -0.5;
    place.width_mm = 40;
    place.depth_mm = 40;
    return place;
}

BeamImage flat(double grey, int samples = 300, int lines = 200) {
    BeamImage image = beam_grid(fan_place(), lines);
    image.samples = samples;
    image.grey.assign(static_cast<std::size_t>(samples) * static_cast<std::size_t>(lines),
                      static_cast<float>(grey));
    return image;
}

// Gaussian noise, smoothed with these sd (samples, lines), scaled to `sd` about `mean`.
BeamImage noise(double mean, double sd, double along, double across, std::uint64_t seed) {
    BeamImage image = flat(0);
    testing::Random random(seed);
    for (float& v : image.grey) v = static_cast<float>(random.gaussian());
    image.grey = gaussian_smoothed(image.grey, image.samples, image.lines, along, across);
    const double own = moments_of(image.grey).sd;
    for (float& v : image.grey) v = static_cast<float>(mean + sd / own * static_cast<double>(v));
    return image;
}

PatchScores median_of_all(const BeamImage& image) {
    std::vector<PatchScores> scores;
    for (const PatchPlace p : patch_places(image, 0, image.samples, 0, image.lines, 24))
        scores.push_back(score_patch(image, p));
    return median_scores(scores);
}

TEST(BeamImage, ARampInDepthComesBackFromThePictureOfIt) {
    for (const ScanPlace& place : {fan_place(), linear_place()}) {
        BeamImage image = beam_grid(place);
        for (int k = 0; k < image.samples; ++k) {
            for (int l = 0; l < image.lines; ++l)
                image.grey.push_back(static_cast<float>(200.0 * k / image.samples));
        }
        const auto picture = picture_from_beam(image, place, 720, 600);
        const BeamImage again = beam_from_picture(picture, 720, 600, place);
        ASSERT_EQ(again.samples, image.samples);
        for (int k = 4; k < image.samples - 4; ++k) {
            const PixelPoint p = pixel_of(place, image, k, 128);
            if (p.y_px > 595) break;
            // Half a grey of rounding, and a bilinear look-up of a curved ramp.
            EXPECT_NEAR(again.at(k, 128), image.at(k, 128), 0.8) << k;
            EXPECT_NEAR(again.at(k, 40), image.at(k, 40), 0.8) << k;
        }
    }
}

TEST(BeamImage, PixelsAndSamplesAreEachOthersInverse) {
    for (const ScanPlace& place : {fan_place(), linear_place()}) {
        const BeamImage grid = beam_grid(place);
        const PixelPoint pixel = pixel_of(place, grid, 101.25, 33.5);
        const BeamPoint back = beam_of(place, grid, pixel);
        EXPECT_NEAR(back.sample, 101.25, 1e-9);
        EXPECT_NEAR(back.line, 33.5, 1e-9);
        EXPECT_TRUE(in_grid(grid, back));
        EXPECT_FALSE(in_grid(grid, {-1, 5}));
    }
}

TEST(Smooth, KeepsAConstantAndTheMeanAndMatchesThePlainSum) {
    const BeamImage image = noise(50, 10, 0, 0, 1);
    const auto smooth = gaussian_smoothed(image.grey, image.samples, image.lines, 2, 3);
    // Mirrored edges lose and count nothing twice.
    EXPECT_NEAR(moments_of(smooth).mean, moments_of(image.grey).mean, 1e-4);
    double sum = 0, weight = 0;
    for (int k = -8; k <= 8; ++k) {
        for (int l = -12; l <= 12; ++l) {
            const double w = std::exp(-0.5 * (k * k / 4.0 + l * l / 9.0));
            sum += w * static_cast<double>(image.at(150 + k, 100 + l));
            weight += w;
        }
    }
    EXPECT_NEAR(smooth[image.index(150, 100)], sum / weight, 1e-3);
    for (const float v : gaussian_smoothed(flat(7, 20, 9).grey, 20, 9, 12, 12))
        EXPECT_NEAR(v, 7, 1e-5);
}

TEST(Smooth, MomentsAndQuantilesOfSmallSetsAreThoseOfTheBook) {
    const std::vector<float> values{1, 2, 3, 4, 10};
    const Moments m = moments_of(values);
    EXPECT_DOUBLE_EQ(m.mean, 4);
    EXPECT_DOUBLE_EQ(m.sd, std::sqrt(10.0));
    EXPECT_NEAR(m.skew, 180.0 / 5 / std::pow(10.0, 1.5), 1e-12);
    EXPECT_NEAR(m.kurtosis, (81 + 16 + 1 + 0 + 1296) / 5.0 / 100 - 3, 1e-12);
    EXPECT_DOUBLE_EQ(median_of({3, 1, 2}), 2);
    EXPECT_DOUBLE_EQ(quantile_of({0, 10}, 0.25), 2.5);
    EXPECT_TRUE(std::isnan(median_of({})));
}

TEST(PatchScores, OneGreyHasNoTexture) {
    const PatchScores s = score_patch(flat(40), {100, 100});
    EXPECT_NEAR(s.mean, 40, 1e-9);
    EXPECT_EQ(s.local_skew, 0);
    EXPECT_EQ(s.local_kurtosis, 0);
    EXPECT_EQ(s.grain_along_mm, 0);
    EXPECT_EQ(s.grain_across_mm, 0);
}

TEST(PatchScores, GrainOfSmoothedNoiseIsThatOfTheFilter) {
    // Noise smoothed with sd s has an autocorrelation of sd s sqrt 2: 3.33 s wide at half height.
    const double s = 1.6, expected = 2 * std::sqrt(2 * std::log(2.0)) * std::sqrt(2.0) * s;
    const BeamImage image = noise(100, 10, s, s, 3);
    const PatchScores score = median_of_all(image);
    // The trend takes some of the long waves, and the lags are divided by all samples: 4 % less.
    EXPECT_NEAR(score.grain_along_mm / image.sample_mm, 0.96 * expected, 0.06 * expected);
    EXPECT_NEAR(score.grain_across_mm / image.pitch_mm(150), 0.96 * expected, 0.1 * expected);
    EXPECT_NEAR(score.local_skew, 0, 0.15);
    EXPECT_NEAR(score.local_kurtosis, 0, 0.3);
    EXPECT_NEAR(score.gradient_kurtosis, 0, 0.2);
    EXPECT_NEAR(score.local_sd, 10, 0.6);
}

TEST(PatchScores, GreyLevelAndContrastDoNotChangeShapeOrGrain) {
    BeamImage image = noise(60, 8, 1.2, 2, 4);
    const PatchScores a = score_patch(image, {60, 60});
    for (float& v : image.grey) v = 30 + 2 * v;
    const PatchScores b = score_patch(image, {60, 60});
    EXPECT_NEAR(b.local_sd, 2 * a.local_sd, 1e-3);
    EXPECT_NEAR(b.local_skew, a.local_skew, 1e-4);
    EXPECT_NEAR(b.local_kurtosis, a.local_kurtosis, 1e-3);
    EXPECT_NEAR(b.grain_along_mm, a.grain_along_mm, 1e-4);
}

TEST(PatchScores, BrightDotsGiveSkewAndKurtosisAndDarkOnesTheOtherSign) {
    BeamImage image = flat(40);
    testing::Random random(5);
    for (float& v : image.grey) {  // exponential: skew 2, kurtosis 6
        v = static_cast<float>(40 - 5 * std::log(1 - random.uniform(0, 1)));
    }
    const PatchScores bright = median_of_all(image);
    EXPECT_NEAR(bright.local_skew, 2, 0.3);
    EXPECT_NEAR(bright.local_kurtosis, 6, 2.5);
    for (float& v : image.grey) v = 100 - v;
    EXPECT_NEAR(median_of_all(image).local_skew, -2, 0.3);
}

TEST(PatchScores, PlacesLieWhereEachSampleMayBeUsed) {
    const BeamImage image = flat(0, 100, 100);
    std::vector<std::uint8_t> use(image.grey.size(), 1);
    EXPECT_EQ(patch_places(image, 0, 100, 0, 100, 26).size(), 9u);
    use[image.index(50, 50)] = 0;  // in the middle one, and all that touch it
    for (const PatchPlace p : patch_places(image, 0, 100, 0, 100, 26, use)) {
        EXPECT_TRUE(p.sample > 50 || p.sample + kPatch <= 50 || p.line > 50 ||
                    p.line + kPatch <= 50);
    }
    EXPECT_TRUE(patch_places(image, 60, 100, 0, 100, 1).empty());
    EXPECT_TRUE(std::isnan(median_scores({}).mean));
}

TEST(StructureScores, PlantedStreaksAreFoundAndSpeckleHasHardlyAny) {
    BeamImage image = noise(60, 6, 1, 1.3, 6);
    const StreakScore none = score_streaks(image, 60, 260, 20, 180);
    EXPECT_LT(none.per_cm2(), 0.12);
    int planted = 0;
    for (int k = 70; k < 255; k += 18) {
        for (int l = 30; l < 170; l += 40, ++planted) {
            for (int i = 0; i < 14; ++i) {
                image.grey[image.index(k, l + i)] += 45;
                image.grey[image.index(k + 1, l + i)] += 25;
            }
        }
    }
    const StreakScore found = score_streaks(image, 60, 260, 20, 180);
    EXPECT_NEAR(found.count - none.count, planted, 0.15 * planted);
    const double length = 14 * image.pitch_mm(160);
    EXPECT_NEAR(found.length_mm, length, 0.35 * length);  // smoothing lengthens them a little
}

TEST(StructureScores, LayersOfAWallAreCountedAndMeasured) {
    BeamImage image = flat(30);
    for (int k = 0; k < image.samples; ++k) {
        const double mm = image.depth_mm(k);
        for (int i = 0; i < 6; ++i) {
            const double z = (mm - 5 - 3.9 * i) / (1.5 / 2.3548);
            for (int l = 0; l < image.lines; ++l)
                image.grey[image.index(k, l)] += static_cast<float>(100 * std::exp(-0.5 * z * z));
        }
    }
    const WallScores wall = score_wall(image);
    EXPECT_EQ(wall.layers, 6);
    EXPECT_NEAR(wall.thickness_mm, 1.5, 0.15);
    EXPECT_NEAR(wall.peak_grey, 130, 3);
    for (const double c : wall.across) EXPECT_NEAR(c, 1, 1e-3);  // the same in every beam
    EXPECT_NEAR(score_wall(noise(60, 10, 1, 1, 7)).across[2], 0, 0.1);
    EXPECT_NEAR(mean_grey(flat(33), 0, 4), 33, 1e-6);
}

TEST(StructureScores, ADiaphragmIsMeasuredAcrossItsSlope) {
    for (const double slope : {0.0, 0.6}) {
        BeamImage image = flat(9, 420, 256);
        for (int l = 0; l < image.lines; ++l) {
            for (int k = 0; k < image.samples; ++k) {
                const double across = (l - 128) * image.pitch_mm(280);
                const double off = image.depth_mm(k) - 100 - slope * across;
                const double z = off / std::sqrt(1 + slope * slope) / (3.5 / 2.3548);
                float& grey = image.grey[image.index(k, l)];
                if (off < 0) grey = 40;
                grey = std::max(grey, static_cast<float>(9 + 112 * std::exp(-0.5 * z * z)));
            }
        }
        const auto found = score_diaphragm(image);
        ASSERT_TRUE(found) << slope;
        EXPECT_NEAR(found->peak_grey, 121, 6);
        EXPECT_NEAR(found->width_mm, 3.6, 0.5) << slope;
        EXPECT_NEAR(found->black_grey, 9, 0.1);
        EXPECT_NEAR(found->black_sd, 0, 0.1);
    }
    EXPECT_FALSE(score_diaphragm(flat(40, 420)));
}

TEST(MotionScores, AShiftIsFoundAndUnrelatedSpeckleIsNotAlike) {
    const BeamImage a = noise(60, 8, 1.2, 1.5, 8), other = noise(60, 8, 1.2, 1.5, 9);
    BeamImage moved = a;
    for (int k = 0; k < a.samples - 3; ++k) {
        for (int l = 0; l < a.lines - 2; ++l) moved.grey[a.index(k + 3, l + 2)] = a.at(k, l);
    }
    const DetailMatch match = match_detail(a, moved, {100, 80});
    EXPECT_NEAR(match.correlation, 1, 0.01);  // the trend differs at the patch's rim
    EXPECT_EQ(match.samples, 3);
    EXPECT_EQ(match.lines, 2);
    EXPECT_GT(match_detail(a, a, {100, 80}).correlation, 0.9999);
    EXPECT_LT(match_detail(a, other, {100, 80}).correlation, 0.25);
    EXPECT_EQ(match_detail(flat(5), flat(5), {100, 80}).correlation, 0);
}

TEST(ScoreLimits, AreNamedOnceAndNotEmpty) {
    for (const ScoreLimits& limits : score_limits()) {
        EXPECT_LT(limits.low, limits.high) << limits.name;
        EXPECT_EQ(&limits_of(limits.name), &limits);
        EXPECT_TRUE(limits.holds(limits.low));
        EXPECT_FALSE(limits.holds(std::nan("")));
    }
}

}  // namespace
}  // namespace sonocase
