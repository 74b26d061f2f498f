// SPDX-License-Identifier: Apache-2.0

// A page's player whose case arrives in segments: the pictures of the whole case wherever its
// blocks are there, something to look at where they are not, and a plan that brings what a picture
// lacks first.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "runtime/web/page_player.h"
#include "support/random.h"
#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

constexpr std::size_t kSegment = 1024;
using Bytes = std::vector<std::uint8_t>;

// Structure everywhere, so that a block that is missing shows.
Bytes case_bytes() {
    CaseBundle bundle = testing::small_case();
    testing::Random random(3);
    std::vector<std::int8_t> echo(bundle.grid.voxel_count());
    for (std::int8_t& value : echo) value = static_cast<std::int8_t>(random.uniform(-60, 60));
    bundle.echo_offset = bricks_from_dense<std::int8_t>(echo, bundle.grid.size);
    SolidTexture grain{"grain", 16, 1.0, {}};
    for (int n = 0; n < 16 * 16 * 16; ++n)
        grain.voxels.push_back(static_cast<std::uint8_t>(random.uniform(0, 255)));
    bundle.textures = {grain};
    std::string& toml = bundle.exercises[0].toml;
    const std::string paper = "model = \"paper\"";
    toml.replace(toml.find(paper), paper.size(), "model = \"physical\"");
    auto bytes = arranged_for_loading(write_bundle(bundle), false, "small");
    EXPECT_TRUE(bytes);
    return *bytes;
}

struct Visit {
    Visit() : file(case_bytes()) {
        Arrivals arrivals(file.size(), kSegment);
        RawVector<std::uint8_t> bytes(file.size(), std::uint8_t{0});
        const auto parts = parts_to_open(file, "small");
        EXPECT_TRUE(parts);
        for (const ByteRange& r : *parts) {
            for (std::size_t n = r.at / kSegment; n * kSegment < r.end(); ++n) {
                copy(arrivals.range(n), bytes.data());
                arrivals.add(n);
            }
        }
        auto opened = PagePlayer::open_in_parts(std::move(bytes), std::move(arrivals), "small");
        EXPECT_TRUE(opened) << opened.error().message();
        player = std::move(*opened);
        EXPECT_TRUE(player->choose_exercise(0, 128, 128));
        whole = std::move(*PagePlayer::open({file.begin(), file.end()}, "whole"));
        EXPECT_TRUE(whole->choose_exercise(0, 128, 128));
    }
    void copy(ByteRange r, std::uint8_t* to) const {
        std::copy_n(file.begin() + static_cast<std::ptrdiff_t>(r.at), r.count, to + r.at);
    }
    std::size_t bring(const std::vector<SegmentRun>& runs) {
        std::size_t count = 0;
        for (const SegmentRun& run : runs) {
            for (std::uint32_t n = run.first; n < run.first + run.count; ++n, ++count) {
                copy(player->bundle().arrivals()->range(n), player->bytes().data());
                player->arrived(n);
            }
        }
        EXPECT_TRUE(player->look_again());
        return count;
    }
    // The next picture of both; true if they are the same.
    bool same_picture() {
        player->frame(time_s, {});
        whole->frame(time_s, {});
        time_s += 0.05;
        return std::equal(player->pixels().begin(), player->pixels().end(),
                          whole->pixels().begin());
    }
    void slide(double mm) {
        player->hands().slide(0, mm);
        whole->hands().slide(0, mm);
    }

    Bytes file;
    std::unique_ptr<PagePlayer> player, whole;
    double time_s = 0;
};

TEST(ArrivingPlayer, ShowsAPictureAtOnceAndTheWholeOnesPixelsOnceItsBlocksAreThere) {
    Visit visit;
    int exact_before_whole = 0;
    for (int n = 0; n < 8 && !visit.player->is_whole(); ++n) {
        visit.slide(4);
        visit.same_picture();
        const auto lit = std::count_if(visit.player->pixels().begin(), visit.player->pixels().end(),
                                       [](std::uint8_t grey) { return grey > 20; });
        EXPECT_GT(lit, 1000) << "there is a picture before its blocks are";
        if (visit.player->missing_blocks() > 0) visit.bring(visit.player->next_runs(0));
        visit.same_picture();  // the first after that blends with one before (persistence)
        for (int settle = 0; settle < 12; ++settle) visit.same_picture();
        EXPECT_EQ(visit.player->missing_blocks(), 0);
        EXPECT_TRUE(visit.same_picture()) << n;
        exact_before_whole += !visit.player->is_whole();
    }
    EXPECT_GT(exact_before_whole, 0);
}

TEST(ArrivingPlayer, ABlockThatIsMissingShowsAndIsSaidToBe) {
    Visit visit;
    EXPECT_FALSE(visit.same_picture());
    EXPECT_GT(visit.player->missing_blocks(), 0);
    EXPECT_EQ(visit.whole->missing_blocks(), 0);
}

TEST(ArrivingPlayer, ThePlanBringsEverySegmentOnceAndThoseOfThePictureFirst) {
    Visit visit;
    visit.same_picture();
    std::set<std::uint32_t> given;
    const auto take = [&](const std::vector<SegmentRun>& runs) {
        for (const SegmentRun& run : runs) {
            for (std::uint32_t n = run.first; n < run.first + run.count; ++n) {
                EXPECT_TRUE(given.insert(n).second) << n << " is given twice";
                EXPECT_FALSE(visit.player->bundle().arrivals()->has_segment(n));
            }
        }
    };
    auto urgent = visit.player->next_runs(0);
    ASSERT_FALSE(urgent.empty());
    take(urgent);
    // Asked for, not there yet: nothing more for this picture.
    EXPECT_TRUE(visit.player->next_runs(0).empty());
    // A request that failed is given again.
    visit.player->ask_again(urgent.front());
    for (std::uint32_t n = 0; n < urgent.front().count; ++n) given.erase(urgent.front().first + n);
    const auto again = visit.player->next_runs(0);
    ASSERT_EQ(again.size(), 1u);
    EXPECT_EQ(again.front(), urgent.front());
    take(again);
    visit.bring(urgent);
    visit.same_picture();
    EXPECT_EQ(visit.player->missing_blocks(), 0);
    while (!visit.player->is_whole()) {
        const auto runs = visit.player->next_runs(8);
        ASSERT_FALSE(runs.empty());
        take(runs);
        EXPECT_GE(visit.bring(runs), 1u);
    }
    EXPECT_TRUE(visit.player->next_runs(8).empty());
    EXPECT_TRUE(visit.player->bundle().has_textures());
}

TEST(ArrivingPlayer, AnAttemptIsScoredOnlyOnceTheCaseIsWhole) {
    Visit visit;
    // A draw would look at what is not here yet.
    EXPECT_FALSE(visit.player->start_attempt("somebody", "2026-01-31T12:00:00Z", 0, 7));
    EXPECT_EQ(visit.player->attempt(), nullptr);
    ASSERT_TRUE(visit.player->start_attempt("somebody", "2026-01-31T12:00:00Z", 0));
    visit.same_picture();
    const auto early = visit.player->finish_attempt();
    ASSERT_FALSE(early);
    EXPECT_NE(early.error().message().find("still loading"), std::string::npos);
    ASSERT_TRUE(visit.player->attempt()) << "the attempt goes on";
    while (!visit.player->is_whole()) visit.bring(visit.player->next_runs(100));
    EXPECT_TRUE(visit.player->finish_attempt());
}

TEST(ArrivingPlayer, ThePlainPictureWaitsForItsTextures) {
    Visit visit;
    PageImage image = visit.player->image();
    image.model = ImageModel::paper;
    EXPECT_FALSE(visit.player->bundle().has_textures());
    EXPECT_FALSE(visit.player->set_image(image));
    EXPECT_EQ(visit.player->image().model, ImageModel::physical);
    while (!visit.player->is_whole()) visit.bring(visit.player->next_runs(100));
    EXPECT_TRUE(visit.player->set_image(image));
}

}  // namespace
}  // namespace sonocase::runtime
