// SPDX-License-Identifier: Apache-2.0

// Reading of procedures: what makes no sense is refused with file and line. Acts as text.
#include "formats/exercise/procedure.h"

#include <gtest/gtest.h>

#include <string>

#include "formats/exercise/exercise.h"
#include "formats/exercise/exercise_texts.h"
#include "formats/volume/label_volume.h"

namespace sonocase {
namespace {

constexpr const char* kHead = "name = \"x\"\n";
constexpr const char* kLook =
    "[[steps]]\nname = \"look\"\ndone = { shows = \"liver\", hold_s = 1 }\n";

std::string fault_of(const std::string& lines) {
    const auto exercise = parse_exercise(kHead + lines, "x.toml");
    return exercise ? "" : exercise.error().message();
}

void expect_fault(const std::string& lines, int line, const std::string& words) {
    const std::string fault = fault_of(lines);
    EXPECT_NE(fault.find("x.toml:" + std::to_string(line)), std::string::npos) << fault;
    EXPECT_NE(fault.find(words), std::string::npos) << fault;
}

TEST(ReadProcedure, TakesStepsItemsAndCut) {
    const auto exercise = parse_exercise(
        std::string(kHead) + kLook +
            "[[items]]\nname = \"seen\"\ncritical = true\nweight = 2\nstep = \"look\"\n"
            "[procedure]\ncut = 2\n",
        "x.toml");
    ASSERT_TRUE(exercise) << exercise.error().message();
    const Procedure& p = exercise->procedure;
    ASSERT_EQ(p.steps.size(), 1u);
    ASSERT_EQ(p.items.size(), 1u);
    EXPECT_EQ(p.items[0].step, 0);
    EXPECT_TRUE(p.items[0].critical);
    EXPECT_EQ(p.points(), 2);
    EXPECT_FALSE(parse_exercise(kHead, "x.toml")->procedure.given());
}

TEST(ReadProcedure, RefusesWhatMakesNoSense) {
    const std::string look = kLook;
    expect_fault("[[steps]]\nname = \"a\"\n", 2, "can never end");
    expect_fault(look + look, 6, "given twice");
    expect_fault("[[steps]]\nname = \"a\"\ndone = { needle_in = false, tip_in = \"liver\" }\n", 4,
                 "never holds");
    expect_fault(
        "[[steps]]\nname = \"a\"\nentry = { needle_in = true }\ndone = { needle_in = true }\n", 5,
        "ends before it begins");
    expect_fault("[[steps]]\nname = \"a\"\nentry = { step = \"b\" }\ndone = { needle_in = true }\n",
                 4, "is not an earlier step");
    expect_fault(look + "[[items]]\nname = \"i\"\nstep = \"lok\"\n", 7, "did you mean 'look'?");
    expect_fault(look + "[[items]]\nname = \"i\"\n", 6, "has no rule");
    expect_fault(look + "[[items]]\nname = \"i\"\nstep = \"look\"\n[procedure]\ncut = 2\n", 9,
                 "above the sum of all weights");
    expect_fault("[[steps]]\nname = \"a\"\ndone = { act = \"injekt\" }\n", 4, "injekt");
}

TEST(ReadProcedure, FindsARegionThatTheCaseLacks) {
    const auto exercise = parse_exercise(std::string(kHead) + kLook, "x.toml");
    ASSERT_TRUE(exercise);
    Label outside, liver, lung;
    liver.name = "liver";
    lung.name = "lung_lower_lobe_right";
    EXPECT_EQ(unknown_region(*exercise, {outside, liver}), "");
    EXPECT_EQ(unknown_region(*exercise, {outside, lung}), "liver");
    EXPECT_TRUE(region_names_label("lung*", lung.name));
    EXPECT_FALSE(region_names_label("lung", lung.name));
}

TEST(ProcedureTray, HoldsWhatIsAskedForAndWhatUndoesIt) {
    const auto exercise = parse_exercise(
        std::string(kHead) + kLook +
            "[[steps]]\nname = \"a\"\ndone = { act = \"inject\", at_least = 5 }\n"
            "[[steps]]\nname = \"b\"\nentry = { wire_in = true }\ndone = { act = \"compress\" }\n"
            "[[items]]\nname = \"i\"\nwhen = { aspirated = \"blood\" }\n",
        "x.toml");
    ASSERT_TRUE(exercise) << exercise.error().message();
    std::string tray;
    for (const TrayAct& one : procedure_tray(exercise->procedure)) {
        ActList list;
        list.add(one.act);
        tray += acts_text(list) + ";";
    }
    EXPECT_EQ(tray, "inject=1;aspirate=1;wire=20;wire=-20;compress=1;compress=0;");
    EXPECT_TRUE(procedure_tray(Procedure{}).empty());
}

TEST(ProcedureTexts, AreReadInAnotherLanguageByName) {
    const std::string text =
        std::string(kHead) + "title = \"X\"\n" + kLook +
        "[[items]]\nname = \"q\"\nquestion = \"Free fluid?\"\noptions = [\"Yes\", \"No\"]\n"
        "answer = 1\n"
        "[[texts.de.steps]]\nname = \"look\"\ntitle = \"Schauen\"\n"
        "[[texts.de.items]]\nname = \"q\"\nquestion = \"Freie Flüssigkeit?\"\n"
        "options = [\"Ja\", \"Nein\"]\n";
    const auto exercise = parse_exercise(text, "x.toml");
    ASSERT_TRUE(exercise) << exercise.error().message();
    const auto texts = parse_exercise_texts(text, "x.toml");
    ASSERT_TRUE(texts) << texts.error().message();
    const ExerciseTexts german = texts_in(*exercise, *texts, "de");
    ASSERT_EQ(german.steps.size(), 1u);
    ASSERT_EQ(german.items.size(), 1u);
    EXPECT_EQ(german.steps[0].title, "Schauen");
    EXPECT_EQ(german.steps[0].instruction, exercise->procedure.steps[0].instruction);
    EXPECT_EQ(german.items[0].question, "Freie Flüssigkeit?");
    EXPECT_EQ(german.items[0].options, (std::vector<std::string>{"Ja", "Nein"}));
    EXPECT_EQ(texts_in(*exercise, *texts, "en").items[0].options,
              exercise->procedure.items[0].options);
    expect_fault(kLook + std::string("[[texts.de.steps]]\nname = \"lok\"\n"), 6,
                 "is not in the procedure");
    const std::string three = text + "[[texts.fr.items]]\nname = \"q\"\noptions = [\"Oui\"]\n";
    EXPECT_FALSE(parse_exercise(three, "x.toml"));
}

TEST(Acts, ComeBackFromTheirText) {
    ActList acts;
    acts.add({ActKind::inject, 0, 2.5});
    acts.add({ActKind::answer, 3, 1});
    EXPECT_EQ(acts_text(acts), "inject=2.5;answer:3=1");
    EXPECT_EQ(acts_of(acts_text(acts)), acts);
}

TEST(Acts, WhatCannotBeReadIsLeftOutAndNamed) {
    for (const std::string bad : {"injekt=1", "inject=x", "inject=nan", "answer:-1=0", "=3"}) {
        std::string unread;
        EXPECT_EQ(acts_of("drain=4;" + bad, &unread).count, 1) << bad;
        EXPECT_EQ(unread, bad);
    }
    EXPECT_EQ(acts_of("").count, 0);
    EXPECT_EQ(acts_of("drain=1;drain=1;drain=1;drain=1;drain=1").count, ActList::kMaxActs);
}

TEST(ReadProcedure, FreeFluidIsReadAndRefusedWhereItMakesNoSense) {
    const std::string look = kLook;
    const std::string fluid =
        "[free_fluid]\nml = 900\nlies_in = \"fat\"\ncentre = [1, 2, 3]\nhalf_mm = [120, 60, 90]\n";
    const auto exercise = parse_exercise(kHead + look + fluid, "x.toml");
    ASSERT_TRUE(exercise) << exercise.error().message();
    EXPECT_EQ(exercise->free_fluids.front().ml, 900);
    EXPECT_EQ(exercise->free_fluids.front().half_mm.y, 60);
    EXPECT_TRUE(parse_exercise(kHead + look, "x.toml")->free_fluids.empty());
    expect_fault(fluid, 2, "stands alone");
    expect_fault(look + "[free_fluid]\nlies_in = \"fat\"\n", 5, "free_fluid.ml is missing");
    expect_fault(look + "[free_fluid]\nml = 900\n", 5, "free_fluid.lies_in is missing");
    expect_fault(look + "[free_fluid]\nml = 900\nlies_in = \"fat\"\ncentre = [0, 0, 0]\n", 5,
                 "three lengths");
    expect_fault(look + fluid + "up = [0, 0, 1]\n", 5, "almost along up");
    expect_fault(look + fluid + "level_mm = 3\n", 10, "level_mm");
    // Several have names, and each may be there or not.
    const std::string one = "[" + fluid.substr(0, 12) + "]\nchance = 0.5\n" + fluid.substr(13);
    const auto two = parse_exercise(
        kHead + look + one + "name = \"left\"\n" + one + "name = \"right\"\n", "x.toml");
    ASSERT_TRUE(two) << two.error().message();
    ASSERT_EQ(two->free_fluids.size(), 2u);
    EXPECT_EQ(two->free_fluids[1].name, "right");
    EXPECT_EQ(two->free_fluids[1].chance, 0.5);
    expect_fault(look + one, 5, "name is missing");
    expect_fault(look + one + "name = \"left\"\n" + one + "name = \"left\"\n", 18, "twice");
    std::string many;
    for (int i = 0; i < 5; ++i) many += one + "name = \"" + std::to_string(i) + "\"\n";
    expect_fault(look + many, 5, "5 times");
    // Only where there is some is it a region, and bags are emptied, not syringes.
    Label fat;
    fat.name = "fat";
    const std::string drain =
        "[[steps]]\nname = \"run\"\ndone = { act = \"drain\", tip_in = \"free_fluid\" }\n";
    EXPECT_EQ(unknown_region(*parse_exercise(kHead + drain, "x.toml"), {Label{}, fat}),
              "free_fluid");
    EXPECT_EQ(unknown_region(*parse_exercise(kHead + drain + fluid, "x.toml"), {Label{}, fat}), "");
    const auto portion = [&](const std::string& lines) {
        return procedure_tray(parse_exercise(kHead + lines, "x.toml")->procedure).at(0).act.amount;
    };
    EXPECT_EQ(portion(drain), 5);
    EXPECT_EQ(portion(drain + fluid), 250);
}

}  // namespace
}  // namespace sonocase
