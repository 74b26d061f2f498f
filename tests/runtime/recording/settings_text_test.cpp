// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/session_words.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

TEST(SettingsText, ComesBackAsTheSameDoubles) {
    ImageSettings s;
    s.gain_db = 1.0 / 3;
    s.dynamic_range_db = 55;
    for (std::size_t i = 0; i < s.tgc_db.size(); ++i)
        s.tgc_db[i] = 0.1 * static_cast<double>(i) - 0.3;
    s.flip_left_right = true;
    ImageSettings back;
    apply_settings_text(settings_text(s), back);
    EXPECT_EQ(back.gain_db, s.gain_db);
    EXPECT_EQ(back.dynamic_range_db, 55);
    EXPECT_EQ(back.tgc_db, s.tgc_db);
    EXPECT_TRUE(back.flip_left_right);
    EXPECT_LT(settings_text(s).size(), 640u);  // fits a RecordedFrame
}

TEST(SettingsText, MalformedWordsChangeNothing) {
    ImageSettings s;
    s.gain_db = 2;
    for (const char* text :
         {"", "gain_db=", "gain_db=x", "gain_db=nan", "tgc_db=,,", "nonsense", "flip"}) {
        apply_settings_text(text, s);
        EXPECT_EQ(s.gain_db, 2) << text;
        EXPECT_FALSE(s.flip_left_right);
    }
    apply_settings_text("tgc_db=1,2", s);
    EXPECT_EQ(s.tgc_db[1], 2);
    EXPECT_EQ(s.tgc_db[2], 0);
}

}  // namespace
}  // namespace sonocase::runtime
