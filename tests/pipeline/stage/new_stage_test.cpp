// SPDX-License-Identifier: Apache-2.0

// The worked stage of docs/extending.md, written in one file: everything that goes by the table of
// stages knows it as soon as the table does.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "documents/examples/crop_labels.h"
#include "formats/bundle/stage_files.h"
#include "formats/files/load_save.h"
#include "pipeline/cook/cook_case.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/tradeoff/suites.h"
#include "pipeline/verbs/stage_verb.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {

StageDescriptor crop_stage();  // tests/documents/examples/crop_stage.cpp

namespace {

using testing::TemporaryFolder;

// The built-in stages with crop after import.
const StageTable& table_with_crop() {
    static const StageTable table = [] {
        StageTable all = built_in_stages();
        const auto import =
            std::find_if(all.stages.begin(), all.stages.end(),
                         [](const StageDescriptor& stage) { return stage.name == "import"; });
        all.stages.insert(import + 1, crop_stage());
        return all;
    }();
    return table;
}

const char* const kRecipe =
    "preset = \"draft\"\nexercises = []\n[analytic]\nvoxel_mm = 8\nslice_mm = 8\npoints = 600\n"
    "known_map = true\n[resample]\nvoxel_mm = 6\n[texture]\nedge = 8\nspeckle_edge = 8\n";

Result<Recipe> recipe_with(const std::string& more, std::vector<std::string> sets = {}) {
    const std::vector<EmbeddedExercise> none;
    RecipeOverrides overrides;
    overrides.sets = std::move(sets);
    return parse_recipe(kRecipe + more, "case.toml", overrides, &none, table_with_crop());
}

double margin_of(const Result<Recipe>& recipe) {
    EXPECT_TRUE(recipe.has_value()) << recipe.error().message();
    return recipe->settings.of<CropOptions>().margin_mm;
}

TEST(NewStage, OptionsAreSetByTheRecipeAndOnTheCommandLine) {
    EXPECT_EQ(margin_of(recipe_with("")), 5);
    EXPECT_EQ(margin_of(recipe_with("[crop]\nmargin_mm = 7\n")), 7);
    EXPECT_EQ(margin_of(recipe_with("[crop]\nmargin_mm = 7\n", {"crop.margin_mm=9"})), 9);
    const auto typo = recipe_with("[crop]\nmargn_mm = 7\n");
    ASSERT_FALSE(typo.has_value());
    EXPECT_NE(typo.error().message().find("did you mean 'margin_mm'?"), std::string::npos);
    EXPECT_FALSE(recipe_with("[crop]\nmargin_mm = 51\n").has_value());
    EXPECT_FALSE(recipe_with("", {"crop.margin_mm=51"}).has_value());
}

TEST(NewStage, OptionsAreListedForPeopleAndInDocuments) {
    const std::string list = list_options(table_with_crop());
    EXPECT_NE(list.find("[crop]\n  margin_mm "), std::string::npos);
    EXPECT_NE(list.find("air kept round the body; 0 to 50 mm"), std::string::npos);
    EXPECT_NE(options_markdown(table_with_crop())
                  .find("| `crop.margin_mm` | 5 | 0 to 50 mm | air kept round the body |"),
              std::string::npos);
}

TEST(NewStage, IsPlannedWithAKeyThatItsOptionsChange) {
    const auto plan_of = [](const Result<Recipe>& recipe) {
        std::map<std::string, PlannedStage> map;
        for (PlannedStage& stage : plan_stages(*recipe, {})) map[stage.stage] = stage;
        return map;
    };
    const auto recipe = recipe_with(""), other = recipe_with("", {"crop.margin_mm=9"});
    auto before = plan_of(recipe), after = plan_of(other);
    ASSERT_TRUE(before.contains("crop"));
    EXPECT_EQ(before["crop"].needs, std::vector<std::string>{"import"});
    EXPECT_EQ(before["surface"].needs, std::vector<std::string>{"crop"});
    EXPECT_EQ(before["import"].plan_key, after["import"].plan_key);
    for (const char* stage : {"crop", "surface", "resample", "pack"})
        EXPECT_NE(before[stage].plan_key, after[stage].plan_key) << stage;
}

TEST(NewStage, RunsInItsPlaceThroughTheCacheAndIsReported) {
    const TemporaryFolder folder;
    CookOptions options;
    options.cache_folder = folder.path();
    const auto cook = [&](const Result<Recipe>& recipe) {
        auto cooked = cook_case(*recipe, options);
        EXPECT_TRUE(cooked.has_value()) << cooked.error().message();
        return std::move(*cooked);
    };
    const CookResult first = cook(recipe_with(""));
    ASSERT_GE(first.bundle.manifest.stages.size(), 3u);
    EXPECT_EQ(first.bundle.manifest.stages[0].stage, "import");
    EXPECT_EQ(first.bundle.manifest.stages[1].stage, "crop");
    EXPECT_EQ(first.bundle.manifest.stages[2].stage, "surface");
    EXPECT_FALSE(first.stages[1].from_cache);
    EXPECT_TRUE(cook(recipe_with("")).stages[1].from_cache);
    const CookResult other = cook(recipe_with("", {"crop.margin_mm=20"}));
    EXPECT_TRUE(other.stages[0].from_cache);
    EXPECT_FALSE(other.stages[1].from_cache);
    options.until = "crop";
    const CookResult alone = cook(recipe_with(""));
    ASSERT_EQ(alone.stages.size(), 1u);
    EXPECT_TRUE(alone.stages[0].from_cache);
    EXPECT_FALSE(alone.digest.empty());
}

TEST(NewStage, IsAKnobOfTheSuiteThatItNames) {
    const std::vector<Knob> knobs = knobs_of(table_with_crop(), "case");
    const auto found = std::find_if(knobs.begin(), knobs.end(),
                                    [](const Knob& k) { return k.key == "crop.margin_mm"; });
    ASSERT_NE(found, knobs.end());
    EXPECT_EQ(found->standard, "5");
    EXPECT_EQ(found->unit, "mm");
}

// argv as the program gets it, changed by nobody.
int run_verb(std::vector<std::string> words) {
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    const StageTable& table = table_with_crop();
    return run_stage_verb(table, *table.find(words[0]), static_cast<int>(argv.size()), argv.data());
}

TEST(NewStage, HasAVerbWithItsOptionsAsFlags) {
    const TemporaryFolder folder;
    LabelFile input;
    input.frame = "ct";
    input.volume = sample_analytic_torso(analytic_torso_grid({8, 8, 8}));
    const std::string in = folder / "in.labels", out = folder / "out.labels",
                      report = folder / "report.json";
    ASSERT_TRUE(save_label_file(input, in).has_value());
    ASSERT_EQ(run_verb({"crop", in, "--margin-mm", "20", "-o", out, "--report", report}), 0);
    const auto cropped = load_label_file(out);
    ASSERT_TRUE(cropped.has_value()) << cropped.error().message();
    const auto expected = crop_labels(input.volume, {.margin_mm = 20});
    EXPECT_EQ(cropped->volume.voxels, expected->volume.voxels);
    EXPECT_NE(testing::read_text(report).find("share_kept"), std::string::npos);
    EXPECT_EQ(run_verb({"crop", in, "--margin-mm", "51", "-o", out}), 2);
    EXPECT_EQ(run_verb({"crop", in}), 2);
    EXPECT_EQ(run_verb({"crop", folder / "none.labels", "-o", out}), 1);
}

}  // namespace
}  // namespace sonocase::pipeline
