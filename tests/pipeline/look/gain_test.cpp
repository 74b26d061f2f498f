// SPDX-License-Identifier: Apache-2.0

// Far gain and grey map are told apart: both come back, and a tissue's level with them, whether or
// not the clip shows the machine's black.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formats/machine/machine.h"
#include "look_clip.h"
#include "pipeline/look/look.h"
#include "pipeline/look/look_frames.h"
#include "support/whole_sets.h"

namespace sonocase::pipeline {
namespace {

using namespace testing;

struct GainCase {
    const char* name;
    Machine truth;
    ScanPlace place;
    double tissue_db = 6;
    double tolerance_db = 1;  // one clip of four frames tells a level to half of it
    bool shadow = false;      // the machine's black is seen
};

// The first lines of the deeper part are in shadow: the machine's black.
void add_shadow(const Machine& machine, BeamImage& image) {
    for (int k = image.samples * 6 / 10; k < image.samples; ++k) {
        for (int l = 0; l < image.lines / 6; ++l)
            image.grey[image.index(k, l)] = static_cast<float>(machine.grey.floor);
    }
}

// Four frames of parenchyma with a place of other tissue in the middle, named by a rectangle.
LookResult look_at(const GainCase& c) {
    const sonocase::testing::TemporaryFolder folder(true);
    const int first = c.place.fan() ? 110 : 150, last = c.place.fan() ? 170 : 210;
    const int left = 100, right = 156;
    const double factor = std::pow(10.0, c.tissue_db / 20);
    LookInput input;
    BeamImage image;
    for (const std::uint32_t seed : {3u, 4u, 5u, 6u}) {
        image = stand_in(c.truth, c.place, Parenchyma{}, seed);
        for (int k = first; k < last; ++k) {
            for (int l = left; l < right; ++l) {
                float& grey = image.grey[image.index(k, l)];
                const double e = amplitude_of(c.truth.grey, static_cast<double>(grey));
                grey = static_cast<float>(grey_of(c.truth.grey, factor * e));
            }
        }
        if (c.shadow) add_shadow(c.truth, image);
        input.frames.push_back(
            write_grey(folder, "f" + std::to_string(seed) + ".png",
                       picture_from_beam(image, c.place, kClipWidth, kClipHeight)));
    }
    const PixelPoint corner = pixel_of(c.place, image, first + 5, left + 6),
                     far = pixel_of(c.place, image, last - 10, right - 10);
    input.rectangles = {{static_cast<int>(corner.x_px), static_cast<int>(corner.y_px),
                         static_cast<int>(far.x_px - corner.x_px),
                         static_cast<int>(far.y_px - corner.y_px), "spleen"}};
    LookOptions options;
    options.depth_mm = c.place.depth_mm;
    auto result = measure_look_of(input, options);
    EXPECT_TRUE(result) << result.error().message();
    return std::move(*result);
}

// Without what is bright under the face and dark at its ends.
Machine plain(Machine machine = {}) {
    machine.near_field.ring_level = 0;
    machine.contact.edge_db = 0;
    return machine;
}

Machine with(MachineGrey grey, MachineGain gain) {
    Machine machine = plain();
    machine.grey = grey;
    machine.gain = gain;
    if (grey.map == GreyMap::log) machine.looks = {1, 1, 0};
    return machine;
}

// At a level that keeps the tissue's grey below the knee, whatever `modern` has.
MachineGrey power(double exponent, double floor = 9) {
    MachineGrey grey;
    grey.level = 44;
    grey.exponent = exponent;
    grey.floor = floor;
    return grey;
}

const MachineGrey kLog60{GreyMap::log, 4, 120, 1, 255, 1, 60},
    kLog80{GreyMap::log, 4, 120, 1, 255, 1, 80};
const MachineGain kFar{0, 100, 1.6, 11}, kNone{0, 100, 0, 11}, kStrong{0, 50, 3, 12},
    kFromTheFirst{0, 30, 2, 40}, kEarly{0, 40, 2.5, 14};

std::vector<GainCase> gain_cases() {
    const Machine linear = plain(*built_in_machine("modern-linear"));
    Machine linear_flat = linear;
    linear_flat.gain.far_db_per_cm = 0;
    const ScanPlace fan = clip_fan(), rectangle = clip_linear();
    return {{"modern", plain(), fan},
            {"modern_with_shadow", plain(), fan, 6, 1, true},
            {"darker_tissue", plain(), fan, -6},
            {"no_gain", with(power(0.75), kNone), fan},
            {"strong_gain", with(power(0.75), kStrong), fan},
            {"strong_gain_with_shadow", with(power(0.75), kStrong), fan, 6, 1, true},
            {"gain_from_the_first_band", with(power(0.75), kFromTheFirst), fan},
            {"exponent_0.5", with(power(0.5), kEarly), fan},
            {"exponent_1.3", with(power(1.3), kFar), fan},
            {"floor_0", with(power(0.75, 0), kFar), fan},
            {"floor_25", with(power(0.75, 25), kFar), fan},
            {"log_60", with(kLog60, kFar), fan},
            {"log_80_early_gain", with(kLog80, kEarly), fan},
            {"linear", linear, rectangle},
            {"linear_no_gain", linear_flat, rectangle}};
}

class LookGain : public ::testing::TestWithParam<GainCase> {};

TEST_P(LookGain, MapGainAndATissuesLevelComeBack) {
    const GainCase& c = GetParam();
    const LookResult r = look_at(c);
    const Machine& m = r.fit.machine;
    const MachineGrey& grey = c.truth.grey;
    ASSERT_TRUE(m.tissue_db.contains("spleen"));
    EXPECT_NEAR(m.tissue_db.at("spleen"), c.tissue_db, c.tolerance_db);
    EXPECT_EQ(r.real.black_seen, c.shadow);
    EXPECT_EQ(m.grey.map, grey.map);
    // The grey of parenchyma above the fall: to an eleventh of its level, where the fall begins
    // above the first band; else to 3.
    EXPECT_NEAR(grey_of(m.grey, 1), grey_of(grey, 1), c.truth.gain.far_from_mm < 45 ? 5 : 3);
    if (grey.map == GreyMap::log) {
        EXPECT_NEAR(m.grey.dynamic_range_db, grey.dynamic_range_db, 6);
    } else {
        EXPECT_NEAR(m.grey.exponent, grey.exponent, 0.15);
        EXPECT_NEAR(m.grey.floor, grey.floor, c.shadow ? 1 : 7);
    }
    const double scale = c.place.fan() ? 1 : 0.3;  // of depths
    if (c.truth.gain.far_db_per_cm == 0) {
        EXPECT_EQ(m.gain.far_db_per_cm, 0);
    } else {
        EXPECT_NEAR(m.gain.far_from_mm, c.truth.gain.far_from_mm, 5 * scale);
        EXPECT_NEAR(m.gain.far_db_per_cm, c.truth.gain.far_db_per_cm,
                    0.2 * c.truth.gain.far_db_per_cm);
    }
    // Its end, if it lies well within what is bright enough to be seen.
    if (c.truth.gain == kStrong) {
        EXPECT_NEAR(m.gain.far_limit_db, 12, 1.5);
    }
}

std::string case_name(const ::testing::TestParamInfo<GainCase>& tested) {
    std::string name = tested.param.name;
    std::replace(name.begin(), name.end(), '.', '_');
    return name;
}

INSTANTIATE_TEST_SUITE_P(Machines,
                         LookGain,
                         ::testing::ValuesIn(sonocase::testing::half_of(gain_cases())),
                         case_name);

TEST(LookNearField, DarknessAndRingingAtTheFaceAreToldApart) {
    const LookResult r = look_at({"", Machine{}, clip_fan(), 6, 1, true});
    const MachineNearField &found = r.fit.machine.near_field, truth;
    EXPECT_NEAR(found.start, truth.start, 0.1);
    EXPECT_NEAR(found.ring_level, truth.ring_level, 0.4);
}

TEST(LookFarGain, AScanThatEndsAboveTheBasesFallKeepsIt) {
    ScanPlace shallow = clip_fan();
    shallow.depth_mm = 90;
    const sonocase::testing::TemporaryFolder folder(true);
    LookInput input;
    input.frames = write_clip(folder, plain(), shallow, 3);
    LookOptions options;
    options.depth_mm = 90;
    const auto r = measure_look_of(input, options);
    ASSERT_TRUE(r) << r.error().message();
    EXPECT_EQ(r->fit.machine.gain, Machine{}.gain);
    bool told = false;
    for (const std::string& kept : r->fit.kept) told = told || kept.starts_with("gain");
    EXPECT_TRUE(told);
}

// Independent speckle in few frames: some pixels stay by chance, and hide no parenchyma.
TEST(LookFrames, ChanceIsNotBurntIn) {
    FramePile pile;
    const Machine truth = with(kLog60, kFar);
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        LookFrame frame{kClipWidth, kClipHeight, clip_frame(truth, clip_fan(), seed), {}};
        frame.colour.assign(frame.grey.size(), 0);
        for (int y = 200; y < 212; ++y) {  // a stroke of three pixels
            for (int x = 250; x < 253; ++x)
                frame.grey[static_cast<std::size_t>(y * kClipWidth + x)] = 240;
        }
        ASSERT_TRUE(pile.add(frame, "frame"));
    }
    const auto mask = burnt_in(pile);
    std::size_t burnt = 0;
    for (const std::uint8_t m : mask) burnt += m;
    EXPECT_EQ(mask[pile.index(251, 205)], 1);
    EXPECT_LT(burnt, 16u * 7u + 300u);  // the stroke with its rim, and a few chance groups
}

}  // namespace
}  // namespace sonocase::pipeline
