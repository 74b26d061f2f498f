// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/sound_out.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <thread>

#include "support/hard_case.h"
#include "support/paths.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

const char* const kFake = SONOCASE_FAKE_ALSA;

// The samples of the file, as soon as it holds so many pairs.
std::vector<std::int16_t> samples(const std::string& file, std::size_t pairs) {
    std::error_code ignored;
    while (!std::filesystem::exists(file) || std::filesystem::file_size(file, ignored) < 4 * pairs)
        std::this_thread::yield();
    const std::string bytes = sonocase::testing::read_text(file);
    std::vector<std::int16_t> out(bytes.size() / 2);
    std::memcpy(out.data(), bytes.data(), 2 * out.size());
    return out;
}

TEST(SoundOut, HandsEverySampleToTheDeviceAlsoAfterItRanDry) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string file = folder / "samples";
    auto out = SoundOut::open({kFake, "file:" + file});
    ASSERT_TRUE(out) << out.error().message();
    const std::vector<float> wanted = tone(Tone::target);
    (*out)->play(std::span(wanted).first(2 * 5000), kToneHz);
    const auto heard = samples(file, 5000);
    ASSERT_EQ(heard.size(), 2u * 5000);
    for (std::size_t i = 0; i < heard.size(); ++i)
        ASSERT_NEAR(heard[i], 32000 * wanted[i], 0.5 + 1e-6) << i;  // rounded
}

TEST(SoundOut, BringsAnotherRateToItsOwn) {
    const sonocase::testing::TemporaryFolder folder;
    const std::string file = folder / "samples";
    auto out = SoundOut::open({kFake, "file:" + file});
    ASSERT_TRUE(out);
    std::vector<float> ramp;  // 400 pairs at 8 kHz: 50 ms, 1200 pairs at 24 kHz
    for (int i = 0; i < 400; ++i) {
        ramp.push_back(static_cast<float>(i) / 400);
        ramp.push_back(0);
    }
    (*out)->play(ramp, 8000);
    const auto heard = samples(file, 1200);
    EXPECT_NEAR(static_cast<double>(heard.size()), 2 * 1200, 2);  // the last may be rounded
    sonocase::testing::HardCase off("sound at three times its rate, off",
                                    sonocase::testing::HardCase::at_most, 1, "of 32,000");
    for (int i = 0; i < 1190; ++i) {
        off.see(std::abs(heard[2 * i] - 32000 * (i / 3.0) / 400));
        EXPECT_EQ(heard[2 * i + 1], 0);
    }
}

TEST(SoundOut, WhatDoesNotFitIsDroppedAndNothingWaits) {
    const sonocase::testing::TemporaryFolder folder;
    auto out = SoundOut::open({kFake, "file:" + (folder / "samples")});
    ASSERT_TRUE(out);
    const std::vector<float> second(2 * 24000, 0.1f);
    for (int i = 0; i < 20; ++i) (*out)->play(second, kToneHz);
    (*out)->play({}, kToneHz);
    (*out)->play(second, 0);
    (*out)->play_evened(std::vector<float>(200, 0.0f), kToneHz);  // silence stays silent
}

TEST(SoundOut, WithoutLibraryOrDeviceSaysSo) {
    const auto none = SoundOut::open({"libthereisnone.so.9", "default"});
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().message().find("libthereisnone"), std::string::npos);
    EXPECT_EQ(none.error().message().find("there is no sound: "), 0u);
    const auto closed = SoundOut::open({kFake, "no such device"});
    ASSERT_FALSE(closed);
    EXPECT_NE(closed.error().message().find("no such device"), std::string::npos);
    EXPECT_FALSE(SoundOut::open({"libz.so.1", "default"}));  // a library of another kind
}

TEST(Tones, BeginAndEndSilentlyAndDiffer) {
    for (const Tone what : {Tone::target, Tone::harm}) {
        const std::vector<float> pairs = tone(what);
        EXPECT_EQ(pairs.size() % 2, 0u);
        EXPECT_NEAR(pairs.front(), 0, 1e-6);
        EXPECT_NEAR(pairs.back(), 0, 1e-3);
        for (const float v : pairs) ASSERT_LE(std::abs(v), 0.3f);
    }
    EXPECT_NE(tone(Tone::target), tone(Tone::harm));
}

}  // namespace
}  // namespace sonocase::runtime
