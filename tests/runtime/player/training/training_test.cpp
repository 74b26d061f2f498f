// SPDX-License-Identifier: Apache-2.0

// The guided start, the film of the cine loop, the cards of cases.
#include <gif_lib.h>
#include <gtest/gtest.h>

#include "formats/files/load_save.h"
#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_cards.h"
#include "runtime/player/app/clip_saver.h"
#include "runtime/player/session/gif_file.h"
#include "runtime/tracking/guided_start.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

TEST(GuidedStart, GoesOnWhenWhatItAsksForWasDoneAndNotBefore) {
    GuidedStart guide;
    GuideSight sight;
    sight.has_probe = true;
    EXPECT_FALSE(guide.observe(sight));
    sight.frozen = true;  // not what is asked for
    EXPECT_FALSE(guide.observe(sight));
    sight.frozen = false;
    sight.mannequin_from_probe.translation = {24, 0, 0};
    EXPECT_FALSE(guide.observe(sight));
    sight.mannequin_from_probe.translation = {26, 0, 0};
    EXPECT_TRUE(guide.observe(sight));
    EXPECT_EQ(guide.step(), GuideStep::tilt);
    EXPECT_FALSE(guide.observe(sight));
    sight.mannequin_from_probe.rotation = rotation_about({1, 0, 0}, 0.2);
    EXPECT_TRUE(guide.observe(sight));
    EXPECT_EQ(guide.step(), GuideStep::freeze);
    sight.frozen = true;
    EXPECT_FALSE(guide.observe(sight));
    sight.frozen = false;
    EXPECT_TRUE(guide.observe(sight));
    sight.has_needle = true;
    EXPECT_TRUE(guide.observe(sight));
    sight.needle_depth_mm = 19;
    EXPECT_FALSE(guide.observe(sight));
    sight.needle_depth_mm = 21;
    EXPECT_TRUE(guide.observe(sight));
    EXPECT_EQ(guide.step(), GuideStep::done);
    EXPECT_FALSE(guide.observe(sight));
    guide.skip();
    EXPECT_EQ(guide.step(), GuideStep::done);
}

TEST(GuidedStart, EveryStepHasWordsAndCanBeSkipped) {
    GuidedStart guide;
    for (int i = 0; i <= kGuideSteps; ++i) {
        EXPECT_NE(guide_title(guide.step())[0], 0) << i;
        EXPECT_NE(guide_words(guide.step())[0], 0) << i;
        guide.skip();
    }
    EXPECT_EQ(guide.step(), GuideStep::done);
}

// A lost probe is not a movement.
TEST(GuidedStart, WaitsForAProbe) {
    GuidedStart guide;
    GuideSight sight;
    sight.mannequin_from_probe.translation = {500, 0, 0};
    EXPECT_FALSE(guide.observe(sight));
    sight.has_probe = true;
    EXPECT_FALSE(guide.observe(sight));  // begins here
    EXPECT_EQ(guide.step(), GuideStep::slide);
}

// The exercise before is still shown when the guided start begins.
TEST(GuidedStart, AJumpToAnotherStartIsNoSlide) {
    GuidedStart guide;
    GuideSight sight;
    sight.has_probe = true;
    EXPECT_FALSE(guide.observe(sight));
    sight.mannequin_from_probe.translation = {120, 0, 0};
    EXPECT_FALSE(guide.observe(sight));
    sight.mannequin_from_probe.translation = {130, 0, 0};
    EXPECT_FALSE(guide.observe(sight));
    sight.mannequin_from_probe.translation = {146, 0, 0};
    EXPECT_TRUE(guide.observe(sight));
}

TEST(GifFile, IsReadBackByTheLibraryWithEveryGreyAndTime) {
    const testing::TemporaryFolder folder;
    constexpr int kWidth = 16, kHeight = 20;
    std::vector<std::vector<std::uint8_t>> frames(3);
    for (std::size_t f = 0; f < frames.size(); ++f) {
        for (int i = 0; i < kWidth * kHeight; ++i)
            frames[f].push_back(static_cast<std::uint8_t>(i + 40 * static_cast<int>(f)));
    }
    GifColours greys;
    for (std::size_t i = 0; i < greys.size(); ++i) greys[i].fill(static_cast<std::uint8_t>(i));
    ASSERT_TRUE(write_gif(folder / "film.gif", kWidth, kHeight, greys, frames, {10, 20, 30}));
    int fault = 0;
    GifFileType* gif = DGifOpenFileName((folder / "film.gif").c_str(), &fault);
    ASSERT_NE(gif, nullptr);
    ASSERT_EQ(DGifSlurp(gif), GIF_OK);
    ASSERT_EQ(gif->ImageCount, 3);
    for (int f = 0; f < 3; ++f) {
        GraphicsControlBlock control{};
        ASSERT_EQ(DGifSavedExtensionToGCB(gif, f, &control), GIF_OK);
        EXPECT_EQ(control.DelayTime, 10 * (f + 1));
        for (int i = 0; i < kWidth * kHeight; ++i) {
            const int index = gif->SavedImages[f].RasterBits[i];
            ASSERT_EQ(gif->SColorMap->Colors[index].Green, frames[f][i]);
        }
    }
    DGifCloseFile(gif, &fault);
    EXPECT_FALSE(write_gif(folder.path(), kWidth, kHeight, greys, frames, {1, 1, 1}));
}

TEST(ClipSaver, TakesTenFramesPerSecondFromTheOldestOn) {
    ClipSaver clip(120, 2, false);  // 60 per second
    ScanFrame frame;
    frame.width_px = frame.height_px = 960;
    frame.pixels.assign(960 * 960, 77);
    frame.frozen = true;
    int taken = 0, last = 1000;
    for (int guard = 0; guard < 1000; ++guard) {
        frame.cine_back = 999;  // not the one that it asks for
        EXPECT_TRUE(clip.take(frame));
        frame.cine_back = clip.wanted_back();
        EXPECT_LT(frame.cine_back, last);
        last = frame.cine_back;
        frame.record.input.time_s = 5 - frame.cine_back / 60.0;
        ++taken;
        if (!clip.take(frame)) break;
    }
    EXPECT_EQ(taken, 20);
    EXPECT_EQ(last, 0);
    const testing::TemporaryFolder folder;
    ASSERT_TRUE(clip.write(folder / "clip.gif"));
    int fault = 0;
    GifFileType* gif = DGifOpenFileName((folder / "clip.gif").c_str(), &fault);
    ASSERT_NE(gif, nullptr);
    ASSERT_EQ(DGifSlurp(gif), GIF_OK);
    EXPECT_EQ(gif->ImageCount, 20);
    EXPECT_EQ(gif->SWidth, 480);
    EXPECT_EQ(gif->SColorMap->Colors[gif->SavedImages[0].RasterBits[0]].Red, 76);  // 77 of 64 greys
    DGifCloseFile(gif, &fault);
}

// What was red and blue in the picture is so in the film, beside its greys.
TEST(ClipSaver, KeepsTheColoursOfDoppler) {
    ClipSaver clip(1, 0, false);
    ScanFrame frame;
    frame.width_px = frame.height_px = 64;
    frame.pixels.assign(64 * 64, 120);
    frame.frozen = true;
    frame.doppler.rgb.assign(3 * frame.pixels.size(), 120);
    const auto paint = [&](std::size_t i, const doppler::Rgb& c) {
        std::copy(c.begin(), c.end(), frame.doppler.rgb.begin() + static_cast<long>(3 * i));
    };
    const auto& map = doppler::palette(DopplerMode::colour);
    for (std::size_t i = 0; i < 64; ++i) {
        paint(i, map[200]);
        paint(64 + i, map[60]);
    }
    EXPECT_FALSE(clip.take(frame));
    const testing::TemporaryFolder folder;
    ASSERT_TRUE(clip.write(folder / "clip.gif"));
    int fault = 0;
    GifFileType* gif = DGifOpenFileName((folder / "clip.gif").c_str(), &fault);
    ASSERT_NE(gif, nullptr);
    ASSERT_EQ(DGifSlurp(gif), GIF_OK);
    const auto colour = [&](int i) {
        return gif->SColorMap->Colors[gif->SavedImages[0].RasterBits[i]];
    };
    // The nearest of 96 colours of the map: within one of its steps.
    EXPECT_NEAR(colour(5).Red, map[200][0], 12);
    EXPECT_NEAR(colour(5).Green, map[200][1], 12);
    EXPECT_NEAR(colour(5).Blue, map[200][2], 12);
    EXPECT_NEAR(colour(64 + 5).Blue, map[60][2], 12);
    EXPECT_LT(colour(64 + 5).Red, 60);
    EXPECT_EQ(colour(300).Red, 120);
    EXPECT_EQ(colour(300).Green, 120);
    DGifCloseFile(gif, &fault);
}

TEST(CaseCard, HasNameExercisesAndAPictureOfTheStart) {
    const testing::TemporaryFolder folder;
    const std::string path = folder / "small.sonocase";
    ASSERT_TRUE(save_bundle(testing::small_case(), path));
    const CaseCard card = make_case_card(path);
    EXPECT_EQ(card.fault, "");
    ASSERT_EQ(card.exercises.size(), 1u);
    EXPECT_EQ(title_of(card.exercises[0]), "Find the vessel");
    ASSERT_EQ(card.pixels.size(), static_cast<std::size_t>(card.width_px) * card.height_px);
    double sum = 0;
    for (const std::uint8_t level : card.pixels) sum += level;
    EXPECT_GT(sum / static_cast<double>(card.pixels.size()), 5);  // tissue, not black
}

TEST(CaseCard, OfADamagedFileSaysWhatIsWrong) {
    const testing::TemporaryFolder folder;
    folder.write("bad.sonocase", std::string("\x89SONO") + std::string(200, 'x'));
    const CaseCard card = make_case_card(folder / "bad.sonocase");
    EXPECT_NE(card.fault.find("bad.sonocase"), std::string::npos);
    EXPECT_TRUE(card.exercises.empty());
}

TEST(ReviewPage, WithoutTheProgramSaysSo) {
    const char* path = std::getenv("PATH");
    const std::string before = path ? path : "";
    ::setenv("PATH", "/nowhere", 1);
    const Status shown = show_review("/nowhere/s.igs.mha", "/nowhere/c.sonocase", "");
    ::setenv("PATH", before.c_str(), 1);
    // Beside the test program lies the program sonocase in some builds.
    if (!shown) {
        EXPECT_NE(shown.error().message().find("sonocase"), std::string::npos);
    }
}

}  // namespace
}  // namespace sonocase::runtime
