// SPDX-License-Identifier: Apache-2.0

// Pass marks that an educator changes: the exercise is the same but for them.
#include "runtime/player/app/own_exercises.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "formats/files/load_save.h"
#include "runtime/player/app/sound_steps.h"
#include "runtime/player/session/open_case.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

const std::string kToml = std::string(testing::small_exercise_toml()) + R"(
[[pass_marks]]
metric = "insertions"
at_most = 2
  [[pass_marks]]
metric = "final_tip_to_target_mm"
at_most = 5
[breathing]
amplitude_mm = 4
)";

TEST(Marks, OthersReplaceThoseThatAreWrittenAndNothingElseChanges) {
    const auto before = parse_exercise(kToml, "before");
    ASSERT_TRUE(before) << before.error().message();
    ASSERT_EQ(before->pass_marks.size(), 2u);
    std::vector<Exercise::PassMark> marks = before->pass_marks;
    step_mark(marks[0], -1);
    step_mark(marks[1], 2);
    Exercise::PassMark share;
    share.metric = "tip_in_view_at_advance_fraction";
    share.at_least = 0.5;
    step_mark(share, 1);
    marks.push_back(share);
    const auto after = parse_exercise(toml_with_marks(kToml, marks), "after");
    ASSERT_TRUE(after) << after.error().message();
    ASSERT_EQ(after->pass_marks.size(), 3u);
    EXPECT_EQ(after->pass_marks[0].at_most, 1);
    EXPECT_EQ(after->pass_marks[1].at_most, 7);
    EXPECT_NEAR(after->pass_marks[2].at_least, 0.55, 1e-12);
    EXPECT_EQ(after->breathing.amplitude_mm, 4);
    EXPECT_EQ(after->sweeps.size(), before->sweeps.size());
    EXPECT_EQ(toml_with_marks(kToml, {}).find("pass_marks"), std::string::npos);
}

TEST(Marks, StayInTheirRange) {
    Exercise::PassMark share;
    share.metric = "tip_in_view_at_advance_fraction";
    share.at_least = 0.95;
    step_mark(share, 3);
    EXPECT_EQ(share.at_least, 1);
    EXPECT_TRUE(std::isinf(share.at_most));  // a limit that there is not stays so
    Exercise::PassMark count;
    count.metric = "insertions";
    count.at_most = 1;
    step_mark(count, -5);
    EXPECT_EQ(count.at_most, 0);
}

// A file of the same name beside the case takes the place of the exercise in it.
TEST(Marks, SavedBesideTheCaseTakeThePlaceOfItsOwn) {
    const testing::TemporaryFolder folder;
    const std::string path = folder / "case.sonocase";
    ASSERT_TRUE(save_bundle(testing::small_case(), path));
    Exercise::PassMark mark;
    mark.metric = "insertions";
    mark.at_most = 3;
    folder.write("case.sonocase.exercises/scan.toml",
                 toml_with_marks(testing::small_exercise_toml(), {mark}));
    const auto open = open_case(path);
    ASSERT_TRUE(open);
    ASSERT_EQ((*open)->exercises.size(), 1u);
    ASSERT_EQ((*open)->exercises[0].pass_marks.size(), 1u);
    EXPECT_EQ((*open)->exercises[0].pass_marks[0].at_most, 3);
}

TEST(Sounds, AreHeardOnceOnTargetAndOnHarmAndNotForTargetsInAnExam) {
    EXPECT_TRUE(heard_target({0, false}, {1, false}, false));
    EXPECT_FALSE(heard_target({1, false}, {1, false}, false));
    EXPECT_FALSE(heard_target({2, false}, {0, false}, false));  // a new attempt
    EXPECT_FALSE(heard_target({0, false}, {1, false}, true));
    EXPECT_TRUE(heard_harm({0, false}, {0, true}));
    EXPECT_FALSE(heard_harm({0, true}, {0, true}));
}

}  // namespace
}  // namespace sonocase::runtime
