// SPDX-License-Identifier: Apache-2.0

// The Doppler modes of a page's player: those of the desktop, in a recording too, and not before
// the flow of blood has arrived.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "formats/scoring/anatomy.h"
#include "runtime/web/page_player.h"
#include "support/flowing_case.h"

namespace sonocase::runtime {
namespace {

RawVector<std::uint8_t> file_of(const CaseBundle& bundle) {
    const std::vector<std::uint8_t> bytes = write_bundle(bundle);
    return {bytes.begin(), bytes.end()};
}

std::unique_ptr<PagePlayer> open_tube() {
    auto player = PagePlayer::open(file_of(testing::flowing_case()), "tube");
    EXPECT_TRUE(player);
    EXPECT_TRUE((*player)->choose_exercise(0, 128));
    return std::move(*player);
}

ImageSettings settings_of(PagePlayer& player, DopplerMode mode) {
    ImageSettings settings;
    settings.doppler.mode = mode;
    EXPECT_TRUE(player.begin_doppler());
    settings.doppler = player.doppler().aimed(player.engine(), settings.doppler);
    return settings;
}

long coloured(const PagePlayer& player) {
    const auto overlay = player.doppler().overlay();
    return std::count_if(overlay.begin(), overlay.end(), [](std::uint8_t i) { return i != 0; });
}

TEST(PageDoppler, ShowsNothingUntilItIsBegunAndEachModeItsOwnPart) {
    const auto player = open_tube();
    player->hands().rotate(1.57);
    player->frame(0, {});
    ImageSettings early;
    early.doppler.mode = DopplerMode::colour;
    player->frame(0.1, early);
    EXPECT_TRUE(player->doppler().overlay().empty());
    EXPECT_FALSE(player->doppler().report().on);

    player->frame(0.2, settings_of(*player, DopplerMode::colour));
    EXPECT_TRUE(player->doppler().has_flow());
    EXPECT_GT(coloured(*player), 50);
    EXPECT_TRUE(player->doppler().strip(64, 16).empty());
    EXPECT_TRUE(player->doppler().sound().empty());

    const ImageSettings spectral = settings_of(*player, DopplerMode::spectral);
    for (int n = 0; n < 30; ++n) player->frame(0.3 + 0.1 * n, spectral);
    EXPECT_TRUE(player->doppler().overlay().empty());
    EXPECT_EQ(player->doppler().strip(64, 16).size(), 64u * 16u);
    EXPECT_FALSE(player->doppler().sound().empty());
    EXPECT_GT(player->doppler().measures().psv_cm_s, 1);

    player->frame(4, {});
    EXPECT_TRUE(player->doppler().strip(64, 16).empty());
    EXPECT_FALSE(player->doppler().report().on);
}

// A kept picture has its colours again; the strip stays as it was frozen.
TEST(PageDoppler, AKeptPictureIsShownInItsColours) {
    const auto player = open_tube();
    player->hands().rotate(1.57);
    player->frame(0, {});
    const ImageSettings settings = settings_of(*player, DopplerMode::colour);
    std::vector<std::vector<std::uint8_t>> shown;
    for (int n = 0; n < 4; ++n) {
        player->hands().slide(0, 2);
        player->frame(1 + 0.1 * n, settings);
        shown.emplace_back(player->doppler().overlay().begin(), player->doppler().overlay().end());
    }
    player->frame_again(2, settings);
    const auto overlay = player->doppler().overlay();
    EXPECT_TRUE(std::equal(overlay.begin(), overlay.end(), shown[1].begin(), shown[1].end()));
}

// Another depth makes another view; the mode goes on in it.
TEST(PageDoppler, AnotherImageGoesOnInTheMode) {
    const auto player = open_tube();
    player->hands().rotate(1.57);
    player->frame(0, {});
    const ImageSettings settings = settings_of(*player, DopplerMode::power);
    player->frame(0.1, settings);
    EXPECT_GT(coloured(*player), 50);
    PageImage image = player->image();
    image.depth_mm = 80;
    image.side_px = 192;
    ASSERT_TRUE(player->set_image(image));
    player->frame(0.2, settings);
    EXPECT_EQ(player->doppler().overlay().size(), 192u * 192u);
    EXPECT_GT(coloured(*player), 50);
}

TEST(PageDoppler, ARecordingKeepsWhatWasShownAndIsScoredAsOnTheDesktop) {
    const auto player = open_tube();
    player->hands().rotate(1.57);
    player->frame(0, {});
    const ImageSettings colour = settings_of(*player, DopplerMode::colour),
                        spectral = settings_of(*player, DopplerMode::spectral);
    ASSERT_TRUE(player->start_attempt("somebody", "2026-01-31T12:00:00Z", 10));
    for (int n = 0; n < 20; ++n) player->frame(10 + 0.1 * n, colour);
    for (int n = 0; n < 60; ++n) player->frame(12 + 0.1 * n, spectral);
    const auto finished = player->finish_attempt();
    ASSERT_TRUE(finished);
    const auto sequence = read_sequence(finished->recording, "");
    ASSERT_TRUE(sequence);
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), "");
    ASSERT_TRUE(session);
    const SessionSample& first = session->samples[10];
    EXPECT_TRUE(first.has_doppler);
    EXPECT_EQ(first.doppler.coloured, std::vector<std::string>{"vessel"});
    const SessionSample& last = session->samples.back();
    EXPECT_EQ(last.doppler.gate, "vessel");
    EXPECT_GT(last.doppler.beats, 0);
    EXPECT_GT(last.doppler.psv_cm_s, 1);
    const auto whole = testing::flowing_case();
    const CaseAnatomy anatomy(whole, breathing_shown(player->exercises()[0], session->header));
    EXPECT_EQ(score_json(score_session(*session, player->exercises()[0], &anatomy, whole.labels),
                         player->exercises()[0]),
              finished->score_json);
}

TEST(PageDoppler, WaitsForTheFlowOfACaseThatArrives) {
    const auto file = arranged_for_loading(write_bundle(testing::flowing_case()), true, "tube");
    ASSERT_TRUE(file);
    constexpr std::size_t kSegment = 256;
    Arrivals arrivals(file->size(), kSegment);
    const auto parts = parts_to_open(*file, "tube");
    ASSERT_TRUE(parts);
    for (const ByteRange& range : *parts)
        for (std::size_t n = range.at / kSegment; n * kSegment < range.end(); ++n) arrivals.add(n);
    auto opened =
        PagePlayer::open_in_parts({file->begin(), file->end()}, std::move(arrivals), "tube");
    ASSERT_TRUE(opened) << opened.error().message();
    PagePlayer& player = **opened;
    ASSERT_TRUE(player.choose_exercise(0, 128));
    player.frame(0, {});
    const Status early = player.begin_doppler();
    ASSERT_FALSE(early);
    EXPECT_NE(early.error().message().find("loading"), std::string::npos);
    for (std::size_t n = 0; n < player.bundle().arrivals()->segments(); ++n) player.arrived(n);
    ASSERT_TRUE(player.look_again());
    EXPECT_TRUE(player.begin_doppler());
    EXPECT_TRUE(player.doppler().has_flow());
}

TEST(PageDoppler, ACaseWithoutFlowSaysSo) {
    auto opened = PagePlayer::open(file_of(testing::small_case()), "still");
    ASSERT_TRUE(opened);
    ASSERT_TRUE((*opened)->choose_exercise(0, 128));
    ASSERT_TRUE((*opened)->begin_doppler());
    EXPECT_FALSE((*opened)->doppler().has_flow());
    ImageSettings settings;
    settings.doppler.mode = DopplerMode::colour;
    (*opened)->frame(0, settings);
    EXPECT_EQ(coloured(**opened), 0);
}

}  // namespace
}  // namespace sonocase::runtime
