// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/read_recipe.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "../import/three_boxes.h"
#include "pipeline/anatomy/torso_model.h"
#include "pipeline/cook/unnamed_inputs.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/import_stage.h"
#include "support/hard_case.h"
#include "support/paths.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;

const char* const kGood = R"(name = "x"
preset = "draft"

[inputs]
labels = "a.nii"
surface = "b.ply"

[labels]
kidney_left = "liver"

[tissues.liver]
echo_db = 3.5

[resample]
sigma_vx = 0.5
)";

Result<Recipe> parse(const std::string& text, const RecipeOverrides& overrides = {}) {
    const std::vector<EmbeddedExercise> none;
    return parse_recipe(text, "dir/case.toml", overrides, &none);
}

std::string with(const std::string& line) {
    return std::string(kGood) + line + "\n";
}

const ResampleOptions& resample_of(const Result<Recipe>& recipe) {
    return recipe->settings.of<ResampleOptions>();
}

TEST(Recipe, ReadsInputsLabelsTissuesAndOptions) {
    const auto recipe = parse(kGood);
    ASSERT_TRUE(recipe.has_value()) << recipe.error().message();
    EXPECT_EQ(recipe->name, "x");
    EXPECT_EQ(recipe->inputs.labels, "a.nii");
    EXPECT_EQ(recipe->labels.size(), 1u);
    EXPECT_EQ(resample_of(recipe).sigma_vx, 0.5);
    for (const Tissue& tissue : recipe->tissues)
        if (tissue.name == "liver") {
            EXPECT_EQ(tissue.echo_db, 3.5);
            EXPECT_EQ(tissue.texture, "liver");  // the rest stays as built in
        }
}

TEST(Recipe, CommandLineBeatsRecipeAndRecipeBeatsPreset) {
    RecipeOverrides overrides;
    EXPECT_EQ(resample_of(parse(kGood)).voxel_mm, 2);  // draft
    overrides.preset = "balanced";
    EXPECT_EQ(resample_of(parse(kGood, overrides)).voxel_mm, 1);
    EXPECT_EQ(resample_of(parse(with("voxel_mm = 3"), overrides)).voxel_mm, 3);
    overrides.sets = {"resample.voxel_mm=4", "resample.sigma_vx=1.5"};
    const auto recipe = parse(with("voxel_mm = 3"), overrides);
    EXPECT_EQ(resample_of(recipe).voxel_mm, 4);
    EXPECT_EQ(resample_of(recipe).sigma_vx, 1.5);
}

TEST(Recipe, NewTissueStartsFromAnother) {
    const auto recipe = parse(with("[tissues.fatty_liver]\nlike = \"liver\"\necho_db = 6"));
    ASSERT_TRUE(recipe.has_value()) << recipe.error().message();
    EXPECT_EQ(recipe->tissues.back().name, "fatty_liver");
    EXPECT_EQ(recipe->tissues.back().echo_db, 6);
    EXPECT_EQ(recipe->tissues.back().texture, "liver");
}

TEST(Recipe, MechanicsStartFromTheTissueAndAreAbsentWhereNothingIsSaid) {
    const auto of = [](const std::string& text) {
        const auto recipe = parse(with(text));
        EXPECT_TRUE(recipe) << recipe.error().message();
        return recipe->tissues.back();
    };
    EXPECT_EQ(of("[tissues.firm]\nlike = \"liver\"\nstiffness_kpa = 20").mechanics,
              (TissueMechanics{20, false, 0.1, false}));
    EXPECT_EQ(of("[tissues.fatty_liver]\nlike = \"liver\"").mechanics,
              (TissueMechanics{6, false, 0.1, false}));
    EXPECT_EQ(of("[tissues.graft]\nlike = \"vein\"\npuncture_n = 2").mechanics,
              (TissueMechanics{0.6, true, 2, false}));
    EXPECT_EQ(of("[tissues.plain]\necho_db = 1").mechanics, std::nullopt);
    const auto recipe = parse(kGood);
    for (const Tissue& tissue : recipe->tissues) EXPECT_FALSE(tissue.mechanics) << tissue.name;
}

TEST(Recipe, EveryFaultNamesFileLineKeyAndWhatWouldDo) {
    testing::HardCase least("softest tissue that a recipe may name", testing::HardCase::at_least,
                            0.05, "kPa");
    for (double kpa = 1; kpa > 1e-3; kpa *= 0.999)
        if (parse(
                with("[tissues.liver2]\nlike = \"liver\"\nstiffness_kpa = " + std::to_string(kpa))))
            least.see(kpa);
    struct Case {
        const char* line;
        const char* what;
        const char* expected;
    };
    for (const Case& c : {
             Case{"voxle_mm = 1", "resample.voxle_mm", "did you mean 'voxel_mm'?"},
             {"voxel_mm = 99", "99", "0.2 to 10"},
             {"voxel_mm = \"one\"", "one", "a number"},
             {"volume_iterations = 1.5", "1.5", "whole number"},
             {"method = \"shapes\"", "shapes", "did you mean 'shape'?"},
             {"[smoth]\nx = 1", "smoth", "did you mean 'smooth'?"},
             {"[tissues.liver2]\necho = 1", "tissues.liver2.echo", "echo_db"},
             {"[tissues.liver2]\nlike = \"livr\"", "livr", "did you mean 'liver'?"},
             {"[tissues.liver2]\nkind = \"sofd\"", "sofd", "did you mean 'soft'?"},
             {"[tissues.liver2]\nstiffness_kpa = 0", "stiffness_kpa", "0.05 to 10000"},
             {"[tissues.liver2]\nstiffness_kpa = nan", "stiffness_kpa", "0.05 to 10000"},
             {"[tissues.liver2]\npuncture_n = -1", "puncture_n", "0 to 100"},
             {"[tissues.liver2]\ndrains = 1", "drains", "true or false"},
             {"follow_shift = 1", "1", "true or false"},
         }) {
        const auto recipe = parse(with(c.line));
        ASSERT_FALSE(recipe.has_value()) << c.line;
        const Error& error = recipe.error();
        EXPECT_TRUE(error.where.starts_with("dir/case.toml:")) << error.message();
        const int line = std::atoi(error.where.c_str() + std::string("dir/case.toml:").size());
        EXPECT_GE(line, 16) << error.message();
        EXPECT_LE(line, 17) << error.message();
        EXPECT_NE(error.what.find(c.what), std::string::npos) << error.message();
        EXPECT_NE(error.expected.find(c.expected), std::string::npos) << error.message();
    }
}

TEST(Recipe, FaultsOfTheHeadAndOfTheCommandLine) {
    EXPECT_NE(parse("lables = 1").error().message().find("did you mean 'labels'?"),
              std::string::npos);
    EXPECT_NE(parse("preset = \"fast\"").error().message().find("draft"), std::string::npos);
    EXPECT_NE(parse("[inputs]\nlabels = \"a\"").error().message().find("inputs.surface"),
              std::string::npos);
    EXPECT_NE(parse("[inputs]\nsurface = \"a\"").error().message().find("inputs.labels"),
              std::string::npos);
    EXPECT_NE(parse("[analytic]\n[inputs]\nlabels = \"a\"").error().message().find("keep one"),
              std::string::npos);
    EXPECT_NE(parse("name = ").error().where.find("case.toml:1"), std::string::npos);
    RecipeOverrides overrides;
    overrides.sets = {"resample.voxl_mm=1"};
    EXPECT_NE(parse(kGood, overrides).error().message().find("did you mean 'resample.voxel_mm'?"),
              std::string::npos);
    overrides.sets = {"resample"};
    EXPECT_FALSE(parse(kGood, overrides).has_value());
    overrides.sets = {};
    overrides.preset = "acurate";
    EXPECT_NE(parse(kGood, overrides).error().message().find("accurate"), std::string::npos);
}

TEST(Recipe, OwnSkinStandsForTheMannequinUntilThereIsOne) {
    const std::string own = "[inputs]\nlabels = \"a.nii\"\nscan = \"ct\"\nown_skin = true\n";
    const auto recipe = parse(own);
    ASSERT_TRUE(recipe.has_value()) << recipe.error().message();
    EXPECT_TRUE(recipe->inputs.own_skin);
    EXPECT_EQ(recipe->inputs.scan, "ct");
    EXPECT_NE(parse(own + "surface = \"b.ply\"\n").error().message().find("own_skin"),
              std::string::npos);
    RecipeOverrides overrides;
    overrides.surface = "b.ply";  // --surface
    const auto fitted = parse(own, overrides);
    ASSERT_TRUE(fitted.has_value()) << fitted.error().message();
    EXPECT_FALSE(fitted->inputs.own_skin);
}

TEST(Recipe, PathsStartFromDataThenFromTheRecipe) {
    const TemporaryFolder folder;
    folder.write("data/in_data.nii", "x");
    folder.write("recipe/beside.nii", "x");
    Recipe recipe;
    recipe.folder = folder / "recipe";
    EXPECT_EQ(recipe.resolve("beside.nii"), folder / "recipe/beside.nii");
    recipe.data = folder / "data";
    EXPECT_EQ(recipe.resolve("in_data.nii"), folder / "data/in_data.nii");
    EXPECT_EQ(recipe.resolve("beside.nii"), folder / "recipe/beside.nii");
    EXPECT_EQ(recipe.resolve("neither.nii"),
              folder / "data/neither.nii");  // as the error will name it
    EXPECT_EQ(recipe.resolve("/abs.nii"), "/abs.nii");
}

TEST(Recipe, ExercisesBesideTheRecipeAreChecked) {
    const TemporaryFolder folder;
    const std::string path = folder.write("case.toml", "[analytic]\n");
    folder.write("b.toml", "name = \"b\"\nframe = \"ct\"\n");
    folder.write("a.toml", "name = \"a\"\n");
    auto recipe = load_recipe(path);
    ASSERT_TRUE(recipe.has_value()) << recipe.error().message();
    ASSERT_EQ(recipe->exercises.size(), 2u);
    EXPECT_EQ(recipe->exercises[0].name, "a");
    folder.write("b.toml", "name = \"b\"\nframe = \"ct\"\ndificulty = 2\n");
    recipe = load_recipe(path);
    ASSERT_FALSE(recipe.has_value());
    EXPECT_NE(recipe.error().message().find("b.toml"), std::string::npos);
    EXPECT_NE(recipe.error().message().find("3"), std::string::npos) << recipe.error().message();
    EXPECT_NE(recipe.error().message().find("difficulty"), std::string::npos);
}

// What file managers of other systems and editors leave.
TEST(Recipe, HiddenFilesBesideTheRecipeAreNoExercises) {
    const TemporaryFolder folder;
    folder.write("case.toml", "[analytic]\n");
    folder.write("._liver-biopsy.toml", std::string("\0\5\x16\7", 4));
    std::filesystem::create_symlink("erika@host.4711", folder / ".#liver-biopsy.toml");
    const auto recipe = load_recipe(folder.path());
    ASSERT_TRUE(recipe) << recipe.error().message();
    EXPECT_TRUE(recipe->exercises.empty());
}

TEST(Recipe, EmbeddedDemoIsTheOneInScenarios) {
    const auto embedded = embedded_recipe();
    const auto file = load_recipe(std::string(SONOCASE_SOURCE) + "/scenarios/demo-torso");
    ASSERT_TRUE(embedded.has_value()) << embedded.error().message();
    ASSERT_TRUE(file.has_value()) << file.error().message();
    EXPECT_EQ(embedded->text, file->text);
    ASSERT_GE(embedded->exercises.size(), 2u);
    ASSERT_EQ(file->exercises.size(), embedded->exercises.size());
    for (std::size_t i = 0; i < file->exercises.size(); ++i)
        EXPECT_EQ(embedded->exercises[i].toml, file->exercises[i].toml);
}

TEST(Recipe, AnalyticBodiesAndHintsAreNamed) {
    const auto parse_text = [](const std::string& text) {
        const std::vector<EmbeddedExercise> none;
        return parse_recipe(text, "x.toml", {}, &none);
    };
    const auto good = parse_text(
        "exercises = []\n[analytic]\ndepth_scale = 1.1\nbody = \"slender\"\nup = [0, 2, 0]\n"
        "landmarks = 4\nlandmark_noise_mm = 2\n");
    ASSERT_TRUE(good.has_value()) << good.error().message();
    const AnalyticInput& in = good->inputs.torso;
    EXPECT_EQ(in.body.warp, analytic_body("slender")->warp);
    EXPECT_EQ(in.body.width_scale, analytic_body("slender")->width_scale);
    EXPECT_EQ(in.body.depth_scale, 1.1);  // wherever it stands, it changes the named body
    ASSERT_TRUE(good->inputs.up.has_value());
    EXPECT_EQ(good->inputs.up->y, 1);
    EXPECT_EQ(in.landmarks, 4);
    EXPECT_EQ(in.landmark_noise_mm, 2);
    const auto bad = parse_text("exercises = []\n[analytic]\nbody = \"slendr\"\n");
    ASSERT_FALSE(bad.has_value());
    EXPECT_NE(bad.error().message().find("slender"), std::string::npos) << bad.error().message();
    EXPECT_NE(bad.error().message().find("x.toml:3"), std::string::npos) << bad.error().message();
}

TEST(Recipe, ReadsAFineRegion) {
    EXPECT_FALSE(resample_of(parse(kGood)).region);
    const auto boxed =
        parse(with("[[region]]\nvoxel_mm = 0.25\ncentre = [1, 2, 3]\nsize_mm = [120, 80, 60]"));
    ASSERT_TRUE(boxed) << boxed.error().message();
    const auto& region = resample_of(boxed).region;
    ASSERT_TRUE(region);
    EXPECT_EQ(region->voxel_mm, 0.25);
    EXPECT_EQ(region->centre, (Point3{1, 2, 3}));
    EXPECT_EQ(region->size_mm, (Vector3{120, 80, 60}));
    EXPECT_FALSE(region->in_ct);
    const auto label = parse(with("[[region]]\nlabel = \"aorta\"\nmargin_mm = 12"));
    ASSERT_TRUE(label) << label.error().message();
    EXPECT_EQ(resample_of(label).region->margin_mm, 12);

    const std::vector<EmbeddedExercise> exercises{
        {"one",
         "name = \"one\"\nframe = \"ct\"\n[[targets]]\nname = \"node\"\ncentre = [4, 5, 6]\n"}};
    const auto round = parse_recipe(with("[[region]]\ntarget = \"node\"\nradius_mm = 30"),
                                    "dir/case.toml", {}, &exercises);
    ASSERT_TRUE(round) << round.error().message();
    EXPECT_EQ(resample_of(round).region->centre, (Point3{4, 5, 6}));
    EXPECT_TRUE(resample_of(round).region->in_ct);
    EXPECT_EQ(resample_of(round).region->size_mm, (Vector3{60, 60, 60}));
    const auto missing = parse_recipe(with("[[region]]\ntarget = \"nod\"\nradius_mm = 30"),
                                      "dir/case.toml", {}, &exercises);
    ASSERT_FALSE(missing);
    EXPECT_NE(missing.error().message().find("node"), std::string::npos);
}

TEST(Recipe, TwoExercisesOfOneNameAreRefused) {
    const std::vector<EmbeddedExercise> exercises{{"one", "name = \"same\"\n"},
                                                  {"two", "name = \"same\"\n"}};
    const auto recipe = parse_recipe(kGood, "dir/case.toml", {}, &exercises);
    ASSERT_FALSE(recipe);
    const std::string said(recipe.error().message().text());
    EXPECT_NE(said.find("dir/two.toml"), std::string::npos) << said;
    EXPECT_NE(said.find("dir/one.toml"), std::string::npos) << said;
}

TEST(Recipe, RefusesFineRegionsThatDoNotAddUp) {
    const std::pair<const char*, const char*> cases[] = {
        {"size_mm = [1, 2, 3]", "expected one of centre, label and target"},
        {"centre = [0, 0, 0]", "expected size_mm = [x, y, z] or radius_mm"},
        {"centre = [0, 0, 0]\nradius_mm = 5\nsize_mm = [5, 5, 5]", "beside radius_mm"},
        {"centre = [0, 0, 0]\nlabel = \"liver\"", "beside another place"},
        {"label = \"liver\"\nvoxel_mm = 0.05", "voxel_mm"},
        {"label = \"liver\"\nvoxels = 1", "voxel"},
        {"label = \"liver\"\n[[region]]\nlabel = \"spleen\"", "one [[region]] a case"},
    };
    for (const auto& [text, expected] : cases) {
        const auto recipe = parse(with(std::string("[[region]]\n") + text));
        ASSERT_FALSE(recipe) << text;
        EXPECT_NE(recipe.error().message().find(expected), std::string::npos)
            << recipe.error().message();
        EXPECT_EQ(recipe.error().message().find('\n'), std::string::npos);
    }
}

TEST(UnnamedInputs, CommentsAndPathsOfTheRecipeStayWithTheAuthor) {
    const std::string text =
        "# Mustermann, Erika\n"
        "name = \"liver-7\"  # born 12.8.1964\n"
        "title = \"Case #7 of \\\"ours\\\"\"\n"
        "\n"
        "[inputs] # Mustermann\n"
        "labels = \"/data/Mustermann Erika/Mustermann.NII.gz\"\n"
        "scan = '/data/Mustermann.Erika'   # CT\n"
        "  # Mustermann\n"
        "own_skin = true\n";
    auto recipe = parse_recipe(text, "x.toml", {}, nullptr);
    ASSERT_TRUE(recipe) << recipe.error().message();
    const std::string kept = recipe_without_names(*recipe);
    EXPECT_EQ(kept,
              "name = \"liver-7\"\n"
              "title = \"Case #7 of \\\"ours\\\"\"\n"
              "\n"
              "[inputs]\n"
              "labels = \"labels.nii.gz\"\n"
              "scan = \"scan\"\n"
              "own_skin = true\n");
    EXPECT_TRUE(parse_recipe(kept, "x.toml", {}, nullptr));

    // Other ways to write the same.
    for (const char* other : {"inputs.labels = \"/a/Erika/m.nii\"\ninputs.own_skin = true\n",
                              "inputs = { labels = '/a/Erika/m.nii', own_skin = true }\n",
                              "[inputs]\nlabels = \"\"\"/a/Erika/m.nii\"\"\"\nown_skin = true\n",
                              "[inputs]\nlabels = \"/a/\\u0045rika/m.nii\"\nown_skin = true"}) {
        recipe = parse_recipe(other, "x.toml", {}, nullptr);
        ASSERT_TRUE(recipe) << other;
        const std::string without = recipe_without_names(*recipe);
        EXPECT_NE(without.find("\"labels.nii\""), std::string::npos) << without;
        EXPECT_EQ(without.find("rika"), std::string::npos) << without;
        EXPECT_TRUE(parse_recipe(without, "x.toml", {}, nullptr)) << without;
    }
}

TEST(UnnamedInputs, ReportsNameTheRolesOfFiles) {
    const TemporaryFolder folder;
    folder.write("Mustermann Erika/segs/Mustermann_liver.nii.gz", "");
    folder.write("Mustermann Erika/ct.mhd", "");
    auto recipe = parse_recipe("[inputs]\nlabels = \"" + (folder / "Mustermann Erika/segs") +
                                   "\"\nscan = \"" + (folder / "Mustermann Erika/ct.mhd") +
                                   "\"\nown_skin = true\n",
                               "x.toml", {}, nullptr);
    ASSERT_TRUE(recipe);
    CaseManifest manifest;
    manifest.inputs = {{recipe->inputs.labels, "1"}, {recipe->inputs.scan, "2"}};
    manifest.stages.emplace_back();
    manifest.stages[0].warnings = {"Mustermann_liver.nii.gz: has no orientation",
                                   "scan: " + recipe->inputs.scan + " is odd",
                                   "42 voxels of liver are odd"};
    manifest.stages[0].notes = {{"axes", "from " + (folder / "Mustermann Erika/ct.raw")}};
    leave_out_names(*recipe, manifest);
    EXPECT_EQ(manifest.inputs[0].path, "labels");
    EXPECT_EQ(manifest.inputs[0].digest, "1");
    EXPECT_EQ(manifest.inputs[1].path, "scan.mhd");
    EXPECT_EQ(manifest.stages[0].warnings,
              (std::vector<std::string>{"a file of labels: has no orientation",
                                        "scan: scan.mhd is odd", "42 voxels of liver are odd"}));
    EXPECT_EQ(manifest.stages[0].notes[0].text, "from ct.raw");
}

TEST(StandardName, IsFoundInOtherLettersAndNeverForASynonym) {
    for (const auto& [given, name] :
         std::map<std::string, std::string>{{"Liver", "liver"},
                                            {"Kidney right", "kidney_right"},
                                            {"right kidney", "kidney_right"},
                                            {"Kidney-RT", "kidney_right"},
                                            {"L_Kidney", "kidney_left"},
                                            {"LeftKidney", "kidney_left"},
                                            {"Gall Bladder", "gallbladder"},
                                            {"Adrenal gland (L)", "adrenal_gland_left"},
                                            {"Left rib 7", "rib_left_7"},
                                            {"Vertebrae L5", "vertebrae_L5"},
                                            {"lung upper lobe left", "lung_upper_lobe_left"},
                                            {"kidney_left", "kidney_left"}})
        EXPECT_EQ(standard_name(given), name) << given;
    for (const char* other : {"", "kidney", "right left kidney", "liver r", "hepar", "ileum",
                              "body", "label_5", "portal_vein", "Liver vessel", "left"})
        EXPECT_EQ(standard_name(other), "") << other;
}

class RenamedLabels : public ::testing::Test {
  protected:
    Result<ImportedLabels> import(
        const std::string& recipe_end = "",
        const std::string& names = "1,Spleen\n2,right kidney\n5,Liver\n") {
        folder_.write("map.nii", sonocase::testing::nifti_bytes(ras_volume()));
        folder_.write("names.csv", "value,name\n" + names);
        folder_.write(
            "case.toml",
            "name = \"case\"\n[inputs]\nlabels = \"map.nii\"\nlabel_table = \"names.csv\"\n"
            "own_skin = true\n" +
                recipe_end);
        auto recipe = load_recipe(folder_ / "case.toml");
        if (!recipe) return recipe.error();
        recipe_ = std::move(*recipe);
        return import_inputs(recipe_, {}, {});
    }
    static std::vector<std::string> names_of(const Result<ImportedLabels>& imported) {
        std::vector<std::string> names;
        if (!imported) {
            ADD_FAILURE() << imported.error().message();
            return names;
        }
        for (const Label& label : imported->labels.labels) names.push_back(label.name);
        return names;
    }
    using Names = std::vector<std::string>;
    TemporaryFolder folder_;
    Recipe recipe_;
};

TEST_F(RenamedLabels, AreToldOfInOneLine) {
    const auto imported = import();
    EXPECT_EQ(names_of(imported), (Names{"outside", "spleen", "kidney_right", "liver"}));
    EXPECT_EQ(imported->labels.labels[2].tissue, "kidney_cortex");
    EXPECT_EQ(std::count_if(imported->report.notes.begin(), imported->report.notes.end(),
                            [](const Note& note) {
                                return note.name == "renamed" &&
                                       note.text.find("'right kidney' is kidney_right") !=
                                           std::string::npos;
                            }),
              1);
    // Right names are not told of, and of two that mean the same none is changed.
    EXPECT_EQ(names_of(import("", "1,spleen\n2,Liver\n5,LIVER\n")),
              (Names{"outside", "spleen", "Liver", "LIVER"}));
    EXPECT_EQ(names_of(import("", "1,spleen\n2,Liver\n5,liver\n")),
              (Names{"outside", "spleen", "Liver", "liver"}));
}

TEST_F(RenamedLabels, AreStillFoundByTheWordsOfTheFile) {
    auto imported = import("[labels]\nLiver = \"spleen\"\n\"right kidney\" = \"fat\"\n");
    ASSERT_EQ(names_of(imported), (Names{"outside", "spleen", "kidney_right", "liver"}));
    ASSERT_TRUE(assign_tissues(recipe_, imported->labels.labels));
    EXPECT_EQ(imported->labels.labels[2].tissue, "fat");
    EXPECT_EQ(imported->labels.labels[3].tissue, "spleen");
    // A pattern of the file's words, and a name that an option or an exercise uses.
    imported = import("[labels]\n\"right*\" = \"fat\"\n");
    EXPECT_EQ(names_of(imported), (Names{"outside", "spleen", "right kidney", "liver"}));
    ASSERT_TRUE(assign_tissues(recipe_, imported->labels.labels));
    imported = import(
        "[[pathology]]\nname = \"cyst\"\nkind = \"simple_cyst\"\nhost = \"Liver\"\nvolume_ml = "
        "5\n");
    EXPECT_EQ(names_of(imported), (Names{"outside", "spleen", "kidney_right", "Liver"}));
}

}  // namespace
}  // namespace sonocase::pipeline
