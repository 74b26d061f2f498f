// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/exercise.h"

#include <gtest/gtest.h>

#include "formats/base/constants.h"
#include "formats/exercise/exercise_texts.h"

namespace sonocase {
namespace {

constexpr const char* kFull = R"(name = "liver-biopsy"
title = "Biopsy of a lesion in the liver"
description = "Deep, between two vessels."
kind = "biopsy"
difficulty = 3
model = "physical"
effects = ["speckle", "shadow"]
no_go = ["aorta", "bowel"]
start_probe = [10, 20.5, 30]
start_beam = [0, 0, -2]
start_lateral = [0, 3, 1]

[probe]
shape = "curvilinear"
radius_mm = 60
field_of_view_deg = 70
depth_mm = 160
frequency_mhz = 3.5

[needle]
gauge = 18
length_mm = 150
slab_mm = 2
tip_visibility = 0.9
bend_max_weight = 0.8

[[targets]]
name = "lesion"
centre = [1, 2, 3]
radius_mm = 8
look = "lesion"
inside = "liver"

[[targets]]
centre = [4, 5, 6]
hit_radius_mm = 2.5

[[sweeps]]
name = "scan"
snap_to_skin = true
[[sweeps.keys]]
time_s = 0
probe = [0, 0, 100]
[[sweeps.keys]]
time_s = 2.5
probe = [0, 10, 100]
beam = [0, 1, -1]
needle_tip = [1, 1, 1]
needle_direction = [0, 0, -3]

[breathing]
amplitude_mm = 8
period_s = 5

[pulsation]
amplitude_mm = 1

[[pass_marks]]
metric = "final_tip_to_target_mm"
at_most = 5
[[pass_marks]]
metric = "needle_in_beam_fraction"
at_least = 0.6
)";

TEST(Exercise, ReadsEveryKey) {
    const auto e = parse_exercise(kFull, "e.toml");
    ASSERT_TRUE(e) << e.error().message();
    EXPECT_EQ(e->name, "liver-biopsy");
    EXPECT_EQ(e->difficulty, 3);
    EXPECT_EQ(e->effects, (std::vector<std::string>{"speckle", "shadow"}));
    EXPECT_EQ(e->no_go.size(), 2u);
    EXPECT_EQ(e->start_beam, (Vector3{0, 0, -1}));
    EXPECT_EQ(start_pose(*e).rotation.column(0), (Vector3{0, 1, 0}));
    EXPECT_EQ(start_pose(*e).rotation.column(2), (Vector3{0, 0, -1}));
    EXPECT_NEAR(e->probe.field_of_view_rad, 70 * kRadPerDeg, 1e-12);
    EXPECT_EQ(e->probe.depth_mm, 160);
    EXPECT_EQ(e->needle.bend_max_weight, 0.8);
    ASSERT_EQ(e->targets.size(), 2u);
    EXPECT_EQ(e->targets[0].hit_radius_mm, 8);  // follows the radius where not given
    EXPECT_EQ(e->targets[0].look, TargetLook::lesion);
    EXPECT_EQ(e->targets[1].name, "target 2");
    EXPECT_EQ(e->targets[1].hit_radius_mm, 2.5);
    ASSERT_EQ(e->sweeps.size(), 1u);
    ASSERT_EQ(e->sweeps[0].keys.size(), 2u);
    EXPECT_FALSE(e->sweeps[0].keys[0].has_needle);
    EXPECT_TRUE(e->sweeps[0].keys[1].has_needle);
    EXPECT_EQ(e->breathing.amplitude_mm, 8);
    ASSERT_EQ(e->pass_marks.size(), 2u);
    EXPECT_EQ(e->pass_marks[0].at_most, 5);
    EXPECT_EQ(e->pass_marks[0].at_least, -INFINITY);
    EXPECT_EQ(e->pass_marks[1].at_least, 0.6);
    EXPECT_EQ(e->pass_marks[1].at_most, INFINITY);
}

TEST(Exercise, ANameIsEnough) {
    EXPECT_TRUE(parse_exercise("name = \"x\"\nframe = \"mannequin\"\n", "e.toml"));
    const auto ct = parse_exercise("name = \"x\"\nframe = \"ct\"\n", "e.toml");
    ASSERT_FALSE(ct);
    EXPECT_NE(ct.error().message().text().find("building moves them"), std::string::npos);
    const auto e = parse_exercise("name = \"x\"\neffects = \"all\"\n", "e.toml");
    ASSERT_TRUE(e) << e.error().message();
    EXPECT_EQ(e->title, "x");
    EXPECT_EQ(e->effects, std::vector<std::string>{"all"});
}

void expect_fault(const std::string& toml, const std::vector<std::string>& says) {
    const auto e = parse_exercise(toml, "cases/e.toml");
    ASSERT_FALSE(e) << toml;
    for (const std::string& word : says) {
        EXPECT_NE(e.error().message().find(word), std::string::npos) << e.error().message();
    }
}

TEST(Exercise, ATypoNamesFileLineKeyAndNearestKey) {
    expect_fault("name = \"x\"\n\n[probe]\ndepht_mm = 100\n",
                 {"cases/e.toml:4", "probe.depht_mm", "'depth_mm'"});
    expect_fault("name = \"x\"\ndificulty = 2\n", {"e.toml:2", "dificulty", "'difficulty'"});
    expect_fault("name = \"x\"\n[[targets]]\ncentre = [1,2,3]\ncolour = 3\n",
                 {"e.toml:4", "targets[0].colour"});
    expect_fault("name = \"x\"\n[probe]\nshape = \"curvlinear\"\n", {"e.toml:3", "'curvilinear'"});
}

TEST(Exercise, ALookMayBeAKindAndFindingsAreNoTargets) {
    const auto e = parse_exercise(
        "name = \"x\"\n[[targets]]\ncentre = [1, 2, 3]\nlook = \"metastasis\"\nradius_mm = 7\n"
        "[[findings]]\ncentre = [4, 5, 6]\nlook = \"simple_cyst\"\nchance = 0.5\n"
        "radius_spread = 0.3\n[[findings]]\ncentre = [4, 5, 6]\nlook = \"cyst\"\n",
        "e.toml");
    ASSERT_TRUE(e) << e.error().message();
    ASSERT_EQ(e->targets.size(), 1u);
    EXPECT_EQ(e->targets[0].look, TargetLook::lesion);
    EXPECT_EQ(e->targets[0].kind, "metastasis");
    EXPECT_EQ(outer_radius_mm(e->targets[0]), 10);  // its halo is 3 mm thick
    EXPECT_EQ(e->targets[0].hit_radius_mm, 7);
    ASSERT_EQ(e->findings.size(), 2u);
    EXPECT_EQ(e->findings[0].lesion.kind, "simple_cyst");
    EXPECT_EQ(e->findings[0].chance, 0.5);
    EXPECT_EQ(e->findings[1].lesion.look, TargetLook::cyst);
    const std::string start = "name = \"x\"\n[[findings]]\ncentre = [1, 2, 3]\n";
    expect_fault(start, {"findings[0].look", "simple_cyst"});
    expect_fault(start + "look = \"metastsis\"\n", {"e.toml:4", "'metastasis'"});
    // What settles, flows or has septa is painted by a recipe.
    expect_fault(start + "look = \"ascites\"\n", {"e.toml:4", "look"});
    expect_fault(start + "look = \"cyst\"\nchance = 0\n", {"e.toml:5", "out of range"});
    expect_fault(start + "look = \"cyst\"\nhit_radius_mm = 3\n", {"e.toml:5"});
}

TEST(Exercise, RangesAreChecked) {
    expect_fault("name = \"x\"\n[probe]\ndepth_mm = -1\n",
                 {"e.toml:3", "probe.depth_mm", "out of range"});
    expect_fault("name = \"x\"\n[probe]\ndepth_mm = nan\n", {"e.toml:3", "out of range"});
    expect_fault("name = \"x\"\ndifficulty = 2.5\n", {"whole"});
    expect_fault("name = \"x\"\nstart_beam = [0, 0, 0]\n", {"length zero"});
    expect_fault("name = \"x\"\n[[targets]]\nradius_mm = 2\n", {"centre is missing"});
    expect_fault("name = \"x\"\n[[targets]]\ncentre = [1, 2]\n", {"3 numbers"});
    expect_fault("name = \"x\"\n[[pass_marks]]\nmetric = \"elapsed_time_s\"\n", {"no limit"});
    expect_fault("name = \"x\"\n[[pass_marks]]\nmetric = \"elapsed_tme_s\"\nat_most = 3\n",
                 {"e.toml:3", "not a score", "'elapsed_time_s'"});
    const auto far = parse_exercise(
        "name = \"x\"\n[[pass_marks]]\nmetric = \"beauty\"\nat_most = 3\n", "e.toml");
    ASSERT_FALSE(far);
    EXPECT_NE(far.error().message().find("docs/metrics.md"), std::string::npos);
    EXPECT_LT(far.error().message().size(), 120u) << far.error().message();
    expect_fault("title = \"x\"\n", {"name is missing"});
    expect_fault("name = \"x\"\n[[sweeps]]\nname = \"s\"\n", {"keys is empty"});
    expect_fault(
        "name = \"x\"\n[[sweeps]]\nname = \"s\"\nkeys = [{time_s = 1, probe = [0,0,0]}, "
        "{time_s = 1, probe = [0,0,0]}]\n",
        {"does not increase"});
    expect_fault("name = \"x\"\nprobe = 3\n", {"not a table"});
    expect_fault("name = 'x'\n[probe]\nfield_of_view_deg = 60\nfield_of_view_rad = 1\n", {"twice"});
}

TEST(Exercise, TextThatIsNotTomlNamesItsLine) {
    expect_fault("name = \"x\"\nprobe = [\n", {"cases/e.toml:"});
    expect_fault("name = \"x\nfoo", {"e.toml:1"});
}

TEST(Exercise, EveryTruncationIsReadOrRefusedWithoutACrash) {
    const std::string text = kFull;
    for (std::size_t n = 0; n <= text.size(); ++n) (void)parse_exercise(text.substr(0, n), "cut");
}

TEST(Exercise, NeedleDiameterFollowsTheGauge) {
    EXPECT_DOUBLE_EQ(needle_diameter_mm({.gauge = 18}), 1.27);
    EXPECT_DOUBLE_EQ(needle_diameter_mm({.gauge = 18, .diameter_mm = 2}), 2);
    EXPECT_LT(needle_diameter_mm({.gauge = 23}), needle_diameter_mm({.gauge = 22}));
    EXPECT_DOUBLE_EQ(needle_diameter_mm({.gauge = 99}), 0.185);
}

TEST(Exercise, DescriptionsFlowWhateverTheLengthOfTheirLines) {
    const auto exercise = parse_exercise(
        "name = \"x\"\ndescription = \"\"\"\nFind the lesion\nand stop in it.  \n\n  Then "
        "wait.\n\"\"\"\n",
        "x.toml");
    ASSERT_TRUE(exercise);
    EXPECT_EQ(exercise->description, "Find the lesion and stop in it.\nThen wait.");
}

// What the text holds is quoted in the error: a line break or an escape sequence in it must not
// reach a terminal.
TEST(Exercise, ErrorsAreOneLineWhateverTheTextHolds) {
    const auto exercise = parse_exercise("[[sweeps]]\nsnap_to_skin = t\nname = \"tour\"", "x.toml");
    ASSERT_FALSE(exercise);
    for (const unsigned char c : exercise.error().message()) EXPECT_TRUE(c >= 32 && c != 127);
    EXPECT_EQ((Error{"a\nb\x1b[2J", "c\td", "e\rf"}.message()), "c d: a b [2J; e f");
}

TEST(Exercise, IsReadInAnotherLanguageWhereItHasThatAndElseInItsOwn) {
    const std::string text =
        "name = \"x\"\ntitle = \"Find it\"\ndescription = \"Look.\"\nhints = [\"Left.\", \"Up.\"]\n"
        "[texts.de]\ntitle = \"Suchen\"\nhints = [\"Links.\", \"Hoch.\"]\n";
    const auto exercise = parse_exercise(text, "x.toml");
    ASSERT_TRUE(exercise) << exercise.error().message();
    const auto texts = parse_exercise_texts(text, "x.toml");
    ASSERT_TRUE(texts);
    const ExerciseTexts german = texts_in(*exercise, *texts, "de");
    EXPECT_EQ(german.title, "Suchen");
    EXPECT_EQ(german.description, "Look.");
    EXPECT_EQ(german.hints, (std::vector<std::string>{"Links.", "Hoch."}));
    EXPECT_EQ(texts_in(*exercise, *texts, "fr").title, "Find it");
    EXPECT_EQ(texts_in(*exercise, {}, "de").hints, exercise->hints);
    // As many hints as the exercise has, and nothing that is no text of it.
    EXPECT_FALSE(parse_exercise(text.substr(0, text.size() - 11) + "]\n", "x.toml"));
    EXPECT_FALSE(parse_exercise("name = \"x\"\n[texts.de]\ntitel = \"y\"\n", "x.toml"));
    EXPECT_FALSE(parse_exercise("name = \"x\"\n[texts.german]\ntitle = \"y\"\n", "x.toml"));
}

}  // namespace
}  // namespace sonocase
