// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/plan_cases.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <set>

#include "formats/text/number_text.h"
#include "pipeline/cook/input_digests.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;
namespace fs = std::filesystem;

const std::string kRecipe = "name = \"one\"\n[inputs]\nlabels = \"l.nrrd\"\nsurface = \"s.csv\"\n";

std::map<std::string, std::string> keys(const Recipe& recipe, const InputDigests& inputs) {
    std::map<std::string, std::string> map;
    for (const PlannedStage& stage : plan_stages(recipe, inputs))
        if (!stage.is_step()) map[stage.stage] = stage.plan_key;
    return map;
}

std::set<std::string> changed(const std::string& extra,
                              const InputDigests& inputs,
                              std::vector<std::string> sets = {}) {
    const std::vector<EmbeddedExercise> none;
    RecipeOverrides overrides;
    overrides.sets = std::move(sets);
    const auto before =
        keys(*parse_recipe(kRecipe, "r.toml", {}, &none), {"L", "", "S", "", "", {}, ""});
    const auto recipe = parse_recipe(kRecipe + extra, "r.toml", overrides, &none);
    EXPECT_TRUE(recipe.has_value()) << recipe.error().message();
    std::set<std::string> names;
    for (const auto& [stage, key] : keys(*recipe, inputs))
        if (!before.contains(stage) || before.at(stage) != key) names.insert(stage);
    return names;
}

using Names = std::set<std::string>;
const InputDigests kInputs{"L", "", "S", "", "", {}, ""};

TEST(PlanStages, ChangeReachesItsStageAndAllThatFollow) {
    EXPECT_EQ(changed("", kInputs), Names{});
    EXPECT_EQ(
        changed("", {"other", "", "S", "", "", {}, ""}),
        (Names{"import", "surface", "warp", "resample", "texture", "structure", "flow", "pack"}));
    EXPECT_EQ(changed("", {"L", "", "other", "", "", {}, ""}),
              (Names{"warp", "resample", "texture", "structure", "flow", "pack"}));
    EXPECT_EQ(changed("", {"L", "", "S", "other", "", {}, ""}), (Names{"texture", "pack"}));
    EXPECT_EQ(changed("", kInputs, {"structure.kidney=false"}), (Names{"structure", "pack"}));
    EXPECT_EQ(changed("", kInputs, {"smooth.method=joint"}),
              (Names{"smooth", "texture", "structure", "flow", "pack"}));
    EXPECT_EQ(changed("# a comment\n", kInputs), Names{"pack"});  // the bundle holds the recipe
    EXPECT_EQ(changed("[labels]\nspleen = \"liver\"\n", kInputs),
              (Names{"texture", "structure", "flow", "pack"}));
}

TEST(PlanStages, EveryStageNeedsThoseWhoseResultsItTakes) {
    const std::vector<EmbeddedExercise> none;
    const auto recipe = parse_recipe(kRecipe, "r.toml", {}, &none);
    std::map<std::string, std::vector<std::string>> needs;
    for (const PlannedStage& stage : plan_stages(*recipe, kInputs))
        if (!stage.is_step()) needs[stage.stage] = stage.needs;
    using List = std::vector<std::string>;
    EXPECT_EQ(needs["import"], List{});
    EXPECT_EQ(needs["warp"], (List{"import", "surface"}));
    EXPECT_EQ(needs["resample"], (List{"import", "warp"}));
    EXPECT_EQ(needs["texture"], List{"resample"});  // through the step "tissues"
    EXPECT_EQ(needs["structure"], List{"resample"});
    EXPECT_EQ(needs["flow"], List{"resample"});
    EXPECT_EQ(needs["pack"], (List{"surface", "warp", "resample", "texture", "structure", "flow"}));
}

// Values that an option may take.
std::vector<std::string> values_of(const Option& option) {
    if (!option.choices.empty()) return option.choices;
    std::vector<std::string> values{"true", "false"};
    for (const double value : {option.low, option.high}) values.push_back(number_text(value));
    return values;
}

TEST(PlanStages, EveryOptionIsInTheKeyOfItsStage) {
    const std::map<std::string, std::string> stage_of{
        {"align", "warp"}, {"body", "import"}, {"case", "warp"}};
    for (const OptionGroup* group : built_in_stages().option_groups())
        for (const Option& option : group->options) {
            const std::vector<EmbeddedExercise> none;
            // A recipe that has all stages.
            const auto recipe =
                parse_recipe(kRecipe + "[smooth]\nmethod = \"joint\"\n", "r.toml", {}, &none);
            ASSERT_TRUE(recipe.has_value());
            const auto before = keys(*recipe, kInputs);
            const std::string stage =
                stage_of.contains(option.section) ? stage_of.at(option.section) : option.section;
            bool changed = false;
            for (const std::string& value : values_of(option)) {
                Recipe other = *recipe;
                if (!other.settings.set(option.name(), value, "test")) continue;
                const auto after = keys(other, kInputs);
                if (option_value(option, other.settings.values(*group)) ==
                        option_value(option, recipe->settings.values(*group)) ||
                    !after.contains("smooth"))
                    continue;
                changed = true;
                EXPECT_NE(after.at(stage), before.at(stage)) << option.name();
                EXPECT_NE(after.at("pack"), before.at("pack")) << option.name();
                if (stage != "import") {
                    EXPECT_EQ(after.at("import"), before.at("import")) << option.name();
                }
            }
            EXPECT_TRUE(changed) << option.name();
        }
}

// A farm's folder with one case of two input files.
struct Farm {
    TemporaryFolder folder;
    std::string recipe = folder.write("one.toml", kRecipe);
    std::string out = folder / "farm";

    Farm() {
        folder.write("l.nrrd", "labels");
        folder.write("s.csv", "surface");
    }
    CasePlan plan(const RecipeOverrides& overrides = {}, bool dry = false) const {
        auto plans = plan_cases({recipe}, overrides, out, {.dry = dry, .speed = 1});
        EXPECT_TRUE(plans.has_value()) << plans.error().message();
        if (!dry) folder.write("farm/plan.json", plan_json(*plans, overrides));
        return (*plans)[0];
    }
    // What the jobs would leave if they had run.
    void finish() const {
        const CasePlan plan = this->plan();
        folder.write("farm/cases/one.sonocase", "bundle");
        for (const PlannedStage& stage : plan.stages)
            folder.write("farm/state/one/" + stage.stage + "." + stage.plan_key + ".json",
                         "{\"digest\": \"" + *digest_of_input(out + "/cases/one.sonocase") + "\"}");
    }
    std::size_t states() const {
        return static_cast<std::size_t>(
            std::distance(fs::directory_iterator(out + "/state/one"), fs::directory_iterator()));
    }
};

TEST(PlanCases, ContentDecidesAndTimesDoNot) {
    const Farm farm;
    EXPECT_FALSE(farm.plan().done);
    EXPECT_GT(farm.plan().stages[0].descriptor->cost.memory_mb(farm.plan().size), 0);
    farm.finish();
    EXPECT_TRUE(farm.plan().done);
    for (const char* name : {"l.nrrd", "s.csv", "one.toml"})
        fs::last_write_time(farm.folder / name, fs::file_time_type::clock::now());
    EXPECT_TRUE(farm.plan().done);
    // Same size, same modification time, other bytes.
    const auto time = fs::last_write_time(farm.folder / "s.csv");
    farm.folder.write("s.csv", "SURFACE");
    fs::last_write_time(farm.folder / "s.csv", time);
    EXPECT_FALSE(farm.plan().done);
    EXPECT_EQ(farm.states(), 2u);  // import and surface stay done
}

TEST(PlanCases, ChangeThatIsTakenBackIsBuiltAgain) {
    const Farm farm;
    farm.finish();
    farm.folder.write("l.nrrd", "others");
    EXPECT_FALSE(farm.plan().done);
    farm.folder.write("l.nrrd", "labels");
    EXPECT_FALSE(farm.plan().done);
}

TEST(PlanCases, BundleThatIsMissingOrNotTheOneWrittenIsPackedAgain) {
    const Farm farm;
    farm.finish();
    farm.folder.write("farm/cases/one.sonocase", "bundlE");
    EXPECT_FALSE(farm.plan().done);
    EXPECT_EQ(farm.states(), 7u);
    farm.finish();
    EXPECT_TRUE(farm.plan().done);
    fs::remove(farm.out + "/cases/one.sonocase");
    EXPECT_FALSE(farm.plan().done);
}

TEST(PlanCases, BadRecipeIsItsCasesFaultAlone) {
    const Farm farm;
    const std::string typo = farm.folder.write("typo.toml", "nam = \"x\"\n");
    const std::string missing = farm.folder.write(
        "missing.toml", "name = \"m\"\n[inputs]\nlabels = \"no\"\nsurface = \"s.csv\"\n");
    const std::string twin = farm.folder.write("twin.toml", kRecipe);
    const std::string path =
        farm.folder.write("path.toml", "name = \"../x\"\n" + kRecipe.substr(kRecipe.find('[')));
    const auto plans =
        plan_cases({farm.recipe, typo, missing, twin, path}, {}, farm.out, {.speed = 1});
    ASSERT_TRUE(plans.has_value());
    EXPECT_EQ((*plans)[0].error, "");
    EXPECT_NE((*plans)[1].error.find("unknown key 'nam'"), std::string::npos);
    EXPECT_NE((*plans)[2].error.find("no such file"), std::string::npos);
    EXPECT_NE((*plans)[3].error.find("another case is called 'one'"), std::string::npos);
    EXPECT_NE((*plans)[4].error.find("file name"), std::string::npos);
}

std::map<std::string, std::string> reasons(const CasePlan& plan) {
    std::map<std::string, std::string> why;
    for (std::size_t i = 0; i < plan.stages.size(); ++i)
        if (!plan.needs[i].done) why[plan.stages[i].stage] = plan.needs[i].why;
    return why;
}

RecipeOverrides with(const std::string& set) {
    RecipeOverrides overrides;
    overrides.sets = {set};
    return overrides;
}

using Reasons = std::map<std::string, std::string>;

TEST(PlanCases, WhatIsStaleSaysWhy) {
    const Farm farm;
    for (const auto& [stage, why] : reasons(farm.plan())) EXPECT_EQ(why, "not built yet") << stage;
    farm.finish();
    EXPECT_EQ(reasons(farm.plan()), Reasons{});
    farm.folder.write("s.csv", "SURFACE");
    const Reasons surface{{"flow", "after resample"},    {"pack", "s.csv changed"},
                          {"resample", "after warp"},    {"structure", "after resample"},
                          {"texture", "after resample"}, {"warp", "s.csv changed"}};
    EXPECT_EQ(reasons(farm.plan()), surface);
    // Planned again before anything ran: what it was made of when it was done is not forgotten.
    EXPECT_EQ(reasons(farm.plan()), surface);
    farm.folder.write("s.csv", "surface");
    farm.finish();
    EXPECT_EQ(reasons(farm.plan(with("resample.voxel_mm=3"))).at("resample"),
              "resample.voxel_mm = 3, was " + farm.plan().needs[3].made_of.at("resample.voxel_mm"));
    // Taken back: as it was when it was done, but its result has gone.
    EXPECT_EQ(reasons(farm.plan()).at("resample"), "did not finish");
    farm.finish();
    farm.folder.write("one.toml", kRecipe + "# a comment\n");
    EXPECT_EQ(reasons(farm.plan()), (Reasons{{"pack", "recipe or exercises have changed"}}));
    farm.finish();
    fs::remove(farm.out + "/cases/one.sonocase");
    EXPECT_EQ(reasons(farm.plan()),
              (Reasons{{"pack", "the bundle is missing, or is not the one that was written"}}));
    // A plan that cannot be read remembers nothing.
    farm.folder.write("farm/plan.json", "{\"cases\": [3, {\"stages\": [3, {}]}]");
    EXPECT_EQ(reasons(farm.plan()), (Reasons{{"pack", "not built yet"}}));
}

TEST(PlanCases, NewVersionOfAStageIsSaid) {
    const Farm farm;
    farm.finish();
    std::string plan = *read_text_file(farm.out + "/plan.json");
    const int version = farm.plan().stages[0].descriptor->version;
    const std::string now = "\"version\": \"" + std::to_string(version) + "\"";
    ASSERT_NE(plan.find(now), std::string::npos);
    plan.replace(plan.find(now), now.size(), "\"version\": \"0\"");
    // The key was that of the older version, too.
    const std::string key = farm.plan().stages[0].plan_key;
    plan.replace(plan.find(key), key.size(), "old");
    fs::rename(farm.out + "/state/one/import." + key + ".json",
               farm.out + "/state/one/import.old.json");
    farm.folder.write("farm/plan.json", plan);
    EXPECT_EQ(
        reasons(farm.plan({}, true)).at("import"),
        "the program computes it in another way (version " + std::to_string(version) + ", was 0)");
}

TEST(PlanCases, DryPlanWritesNothingAndSaysSecondsAndMegabytes) {
    const Farm farm;
    const CasePlan all = farm.plan({}, true);
    EXPECT_FALSE(fs::exists(farm.out));
    EXPECT_GT(all.processor_s(), 0);
    EXPECT_GT(all.memory_mb(), 0);
    farm.finish();
    farm.plan();
    farm.folder.write("s.csv", "SURFACE");
    std::set<std::string> before, after;
    for (const auto& entry : fs::recursive_directory_iterator(farm.out))
        before.insert(entry.path().string());
    const CasePlan part = farm.plan({}, true);
    for (const auto& entry : fs::recursive_directory_iterator(farm.out))
        after.insert(entry.path().string());
    EXPECT_EQ(before, after);
    // Import and surface stay, with a twentieth of the seconds.
    EXPECT_NEAR(part.processor_s() / all.processor_s(), 0.95, 0.02);
    for (std::size_t i = 0; i < part.stages.size(); ++i)
        EXPECT_EQ(part.needs[i].done, part.needs[i].processor_s == 0);
    const std::string text = plan_text({part});
    EXPECT_NE(text.find("one: 6 of 8 stages, about "), std::string::npos) << text;
    EXPECT_NE(text.find("    warp, pack: s.csv changed\n"), std::string::npos) << text;
    EXPECT_NE(text.find("    resample, texture, structure, flow follow\n"), std::string::npos)
        << text;
}

TEST(DigestMemo, RemembersOldFilesAndNeverFreshOnes) {
    const TemporaryFolder folder;
    const std::string file = folder.write("a", "text");
    const auto digest = digest_of_input(file);
    {
        DigestMemo memo(folder / "digests");
        EXPECT_EQ(*memo.digest(file), *digest);
        ASSERT_TRUE(memo.save().has_value());
    }
    EXPECT_FALSE(fs::exists(folder / "digests"));  // written just now: nothing to remember
    folder.write("digests", "strange\n\n");
    EXPECT_EQ(*DigestMemo(folder / "digests").digest(file), *digest);
    // A file of the system, older than any test: remembered, and read back.
    const std::string old = "/proc/self/exe";
    DigestMemo memo(folder / "digests");
    const auto first = memo.digest(fs::canonical(old).string());
    ASSERT_TRUE(first.has_value());
    EXPECT_EQ(*DigestMemo(folder / "digests").digest(fs::canonical(old).string()), *first);
    EXPECT_FALSE(memo.digest(folder / "none").has_value());
}

}  // namespace
}  // namespace sonocase::pipeline
