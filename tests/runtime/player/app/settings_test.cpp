// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/settings.h"

#include <gtest/gtest.h>

#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::TemporaryFolder;

TEST(Settings, ComeBackAsSaved) {
    const TemporaryFolder folder;
    Settings s;
    s.dynamic_range_db = 54.5;
    s.recent = {"/a b/c.sonocase", "/\"quoted\".sonocase"};
    s.tracker = "viper";
    s.needle_sensor = 4;
    ASSERT_TRUE(save_settings(s, folder / "deep/er/player.json"));
    std::string warning;
    const Settings read = load_settings(folder / "deep/er/player.json", warning);
    EXPECT_EQ(warning, "");
    EXPECT_EQ(read.dynamic_range_db, 54.5);
    EXPECT_EQ(read.recent, s.recent);
    EXPECT_EQ(read.tracker, "viper");
    EXPECT_EQ(read.needle_sensor, 4);
}

TEST(Settings, OfAMissingOrDamagedFileAreTheDefaults) {
    const TemporaryFolder folder;
    std::string warning;
    EXPECT_EQ(load_settings(folder / "absent.json", warning).window_width_px, 1280);
    EXPECT_EQ(warning, "");
    for (const char* text : {"", "{", "[1,2]", "null", "\x00\xFF"}) {
        folder.write("bad.json", text);
        EXPECT_EQ(load_settings(folder / "bad.json", warning).window_width_px, 1280);
        EXPECT_NE(warning, "") << text;
    }
}

TEST(Settings, HoldNothingOutOfRange) {
    const TemporaryFolder folder;
    folder.write(
        "odd.json",
        R"({"window_width_px": -5, "ui_scale": 1e9, "dynamic_range_db": "loud", "recent": 7,
                   "probe_sensor": 1000, "unknown": true})");
    std::string warning;
    const Settings s = load_settings(folder / "odd.json", warning);
    EXPECT_EQ(s.window_width_px, 960);
    EXPECT_EQ(s.ui_scale, 4);
    EXPECT_EQ(s.dynamic_range_db, 60);
    EXPECT_TRUE(s.recent.empty());
    EXPECT_EQ(s.probe_sensor, 15);
}

TEST(Settings, ThatCannotBeSavedSayWhy) {
    const Status saved = save_settings({}, "/proc/nothing/player.json");
    ASSERT_FALSE(saved);
    EXPECT_NE(saved.error().message().find("/proc/nothing"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::runtime
