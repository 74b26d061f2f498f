// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/cook_case.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>

#include "formats/bundle/stage_files.h"
#include "formats/exercise/exercise.h"
#include "pipeline/base/parallel.h"
#include "pipeline/export/export_files.h"
#include "pipeline/export/inspect_case.h"
#include "pipeline/import/label_map.h"
#include "pipeline/import/surface/surface_file.h"
#include "pipeline/pack/exercise_frame.h"
#include "pipeline/recipe/read_recipe.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;

// The demonstration at coarse voxels: every stage runs, in seconds.
Result<Recipe> coarse_recipe(const std::string& extra = "", std::vector<std::string> sets = {}) {
    const std::string text =
        "name = \"coarse\"\npreset = \"draft\"\n[analytic]\nvoxel_mm = 6\nslice_mm = 6\n"
        "points = 800\nknown_map = true\n[resample]\nvoxel_mm = 4\n[texture]\nedge = 16\n"
        "speckle_edge = 16\n" +
        extra;
    const std::vector<EmbeddedExercise> exercises{
        {"aim",
         "frame = \"ct\"\nname = \"aim\"\nno_go = [\"aorta\"]\n[[targets]]\nname = \"t\"\n"
         "centre = [80, 20, 70]\ninside = \"liver\"\n[[sweeps]]\nname = \"s\"\n[[sweeps.keys]]\n"
         "time_s = 0\nprobe = [80, 130, 70]\nbeam = [0, -1, 0]\nlateral = [1, 0, 0]\n"
         "needle_tip = [85, 60, 70]\nneedle_direction = [0, -1, 0]\n"}};
    RecipeOverrides overrides;
    overrides.sets = std::move(sets);
    return parse_recipe(text, "coarse.toml", overrides, &exercises);
}

// One cache for the tests that are not about it, so that the coarse case is cooked once.
CookOptions shared_cache() {
    static const TemporaryFolder folder;
    CookOptions options;
    options.cache_folder = folder.path();
    return options;
}

std::map<std::string, bool> from_cache(const CookResult& cooked) {
    std::map<std::string, bool> map;
    for (const StageRun& run : cooked.stages)
        if (!run.key.empty()) map[run.report.stage] = run.from_cache;
    return map;
}

TEST(CookCase, SameBytesOnAnyNumberOfThreadsWithAndWithoutCache) {
    const TemporaryFolder folder;
    const auto recipe = coarse_recipe();
    ASSERT_TRUE(recipe.has_value()) << recipe.error().message();
    const auto bytes_with = [&](int threads, const std::string& cache) {
        const ThreadLimit limit(threads);
        CookOptions options;
        options.cache_folder = cache;
        const auto cooked = cook_case(*recipe, options);
        EXPECT_TRUE(cooked.has_value()) << cooked.error().message();
        return write_bundle(cooked->bundle);
    };
    const auto plain = bytes_with(1, "");
    EXPECT_EQ(plain, bytes_with(2, "")) << "two threads";
    EXPECT_EQ(plain, bytes_with(2, folder.path())) << "cold cache";
    EXPECT_EQ(plain, bytes_with(1, folder.path())) << "warm cache";
}

TEST(CookCase, OnlyWhatAChangeReachesIsMadeAgain) {
    const TemporaryFolder folder;
    CookOptions options;
    options.cache_folder = folder.path();
    const auto cook = [&](const std::string& extra, std::vector<std::string> sets = {}) {
        const auto recipe = coarse_recipe(extra, std::move(sets));
        EXPECT_TRUE(recipe.has_value()) << recipe.error().message();
        auto cooked = cook_case(*recipe, options);
        EXPECT_TRUE(cooked.has_value()) << cooked.error().message();
        return from_cache(*cooked);
    };
    using Map = std::map<std::string, bool>;
    const Map nothing = cook("");
    EXPECT_EQ(nothing, (Map{{"import", false},
                            {"surface", false},
                            {"warp", false},
                            {"resample", false},
                            {"texture", false},
                            {"structure", false}}));
    EXPECT_EQ(cook(""), (Map{{"import", true},
                             {"surface", true},
                             {"warp", true},
                             {"resample", true},
                             {"texture", true},
                             {"structure", true}}));
    EXPECT_EQ(cook("", {"structure.kidney=false"}), (Map{{"import", true},
                                                         {"surface", true},
                                                         {"warp", true},
                                                         {"resample", true},
                                                         {"texture", true},
                                                         {"structure", false}}));
    EXPECT_EQ(cook("", {"resample.voxel_mm=5"}), (Map{{"import", true},
                                                      {"surface", true},
                                                      {"warp", true},
                                                      {"resample", false},
                                                      {"texture", true},
                                                      {"structure", false}}));
    // Early cut-off: another way of fitting that comes to the same map stops there.
    EXPECT_EQ(cook("", {"warp.trials=7"}), (Map{{"import", true},
                                                {"surface", true},
                                                {"warp", false},
                                                {"resample", true},
                                                {"texture", true},
                                                {"structure", true}}));
    // Another tissue for a label reaches textures and structure, not the volumes.
    EXPECT_EQ(cook("[labels]\nspleen = \"liver\"\n"), (Map{{"import", true},
                                                           {"surface", true},
                                                           {"warp", true},
                                                           {"resample", true},
                                                           {"texture", false},
                                                           {"structure", false}}));
}

// Whichever recipe fills a cache, the next one gets its own tissues.
TEST(CookCase, TissuesOfAnotherRecipeDoNotComeThroughTheCache) {
    const TemporaryFolder folder;
    CookOptions options;
    options.cache_folder = folder.path();
    ASSERT_TRUE(cook_case(*coarse_recipe("[labels]\nspleen = \"liver\"\n"), options).has_value());
    const auto after = cook_case(*coarse_recipe(), options);
    ASSERT_TRUE(after.has_value()) << after.error().message();
    EXPECT_EQ(write_bundle(after->bundle), write_bundle(cook_case(*coarse_recipe())->bundle));
}

TEST(CookCase, StageByStageThroughTheCacheGivesTheSameBundle) {
    const TemporaryFolder folder;
    const auto recipe = coarse_recipe("[smooth]\nmethod = \"joint\"\n");
    ASSERT_TRUE(recipe.has_value());
    CookOptions options;
    options.cache_folder = folder.path();
    for (const char* stage :
         {"import", "surface", "warp", "resample", "smooth", "texture", "structure"}) {
        options.until = stage;
        const auto made = cook_case(*recipe, options);
        ASSERT_TRUE(made.has_value()) << stage << ": " << made.error().message();
        ASSERT_FALSE(made->stages.empty());
        EXPECT_EQ(made->stages.back().report.stage, stage);
        // What stands in the cache is used and not made again.
        for (std::size_t i = 0; i + 1 < made->stages.size(); ++i)
            EXPECT_TRUE(made->stages[i].from_cache) << stage;
        EXPECT_FALSE(made->stages.back().from_cache) << stage;
        EXPECT_FALSE(made->digest.empty());
        const auto again = cook_case(*recipe, options);
        ASSERT_TRUE(again.has_value());
        EXPECT_TRUE(again->stages.back().from_cache) << stage;
        EXPECT_EQ(again->digest, made->digest);
    }
    options.until = "pack";
    const auto packed = cook_case(*recipe, options);
    ASSERT_TRUE(packed.has_value()) << packed.error().message();
    EXPECT_EQ(write_bundle(packed->bundle), write_bundle(cook_case(*recipe)->bundle));
}

TEST(CookCase, StageRunsThoughWhatItNeedsHasLeftTheCache) {
    const TemporaryFolder folder;
    const auto recipe = coarse_recipe();
    CookOptions options;
    options.cache_folder = folder.path();
    options.until = "structure";
    const auto first = cook_case(*recipe, options);
    ASSERT_TRUE(first.has_value());
    for (const char* stage : {"import", "resample", "structure"})
        std::filesystem::remove_all(folder / stage);
    const auto second = cook_case(*recipe, options);
    ASSERT_TRUE(second.has_value()) << second.error().message();
    EXPECT_EQ(second->digest, first->digest);
}

TEST(CookCase, StopsOnlyAtStagesThatTheCaseHasAndWithACache) {
    CookOptions options;
    options.until = "warp";
    const auto without = cook_case(*coarse_recipe(), options);
    ASSERT_FALSE(without.has_value());
    EXPECT_NE(without.error().message().find("--cache"), std::string::npos);
    const TemporaryFolder folder;
    options.cache_folder = folder.path();
    options.until = "smooth";
    EXPECT_FALSE(cook_case(*coarse_recipe(), options).has_value());
    options.until = "import";
    options.plan_key = "0123";
    const auto other = cook_case(*coarse_recipe(), options);
    ASSERT_FALSE(other.has_value());
    EXPECT_NE(other.error().message().find("plan again"), std::string::npos);
    EXPECT_TRUE(folder.names().empty());
}

TEST(CookCase, DamagedCacheEntryIsMadeAgainAndNoted) {
    const TemporaryFolder folder;
    CookOptions options;
    options.cache_folder = folder.path();
    const auto recipe = coarse_recipe();
    const auto first = cook_case(*recipe, options);
    ASSERT_TRUE(first.has_value());
    for (const std::string& name : folder.names())
        if (name.starts_with("resample/") && name.size() > 20) {
            std::string bytes = testing::read_text(folder / name);
            bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
            folder.write(name, bytes);
        }
    const auto second = cook_case(*recipe, options);
    ASSERT_TRUE(second.has_value());
    EXPECT_FALSE(from_cache(*second)["resample"]);
    EXPECT_TRUE(from_cache(*second)["structure"]);
    EXPECT_EQ(write_bundle(first->bundle), write_bundle(second->bundle));
    bool told = false;
    for (const StageRun& run : second->stages)
        for (const std::string& note : run.cache_notes)
            told = told || note.find("damaged cache entry") != std::string::npos;
    EXPECT_TRUE(told);
}

TEST(CookCase, CacheThatCannotBeWrittenCostsAWarningAndNotTheCase) {
    const TemporaryFolder folder;
    CookOptions options;
    options.cache_folder = folder.write("a-file", "x");  // no folder can be made below a file
    const auto cooked = cook_case(*coarse_recipe(), options);
    ASSERT_TRUE(cooked.has_value()) << cooked.error().message();
    EXPECT_FALSE(cooked->stages[0].cache_notes.empty());
}

// A warning that happens to name the cache belongs to the bundle; notes on the cache do not.
TEST(CookCase, NotesOnTheCacheAreKeptApartFromTheWarningsOfTheBundle) {
    StageTable table = built_in_stages();
    for (StageDescriptor& stage : table.stages)
        if (stage.name == "import")
            stage.run = [run = stage.run](StageInputs& inputs, const Progress& progress) {
                auto value = run(inputs, progress);
                LabelFile file = value->take<LabelFile>();
                file.reports[0].warnings = {"a cache of gallstones lies in the label map"};
                return Result<StageValue>(StageValue::of(std::move(file)));
            };
    const TemporaryFolder folder;
    CookOptions options;
    options.cache_folder = folder.write("a-file", "x");  // no folder can be made below a file
    const auto base = coarse_recipe();
    const std::vector<EmbeddedExercise> none;
    const auto recipe = parse_recipe(base->text, "coarse.toml", {}, &none, table);
    ASSERT_TRUE(recipe.has_value()) << recipe.error().message();
    const auto cooked = cook_case(*recipe, options);
    ASSERT_TRUE(cooked.has_value()) << cooked.error().message();
    EXPECT_FALSE(cooked->stages[0].cache_notes.empty());
    EXPECT_EQ(cooked->bundle.manifest.stages[0].warnings,
              (std::vector<std::string>{"a cache of gallstones lies in the label map"}));
}

TEST(CookCase, WrongLabelsAndTissuesOfTheRecipeNameTheLine) {
    const auto label = cook_case(*coarse_recipe("[labels]\nsplen = \"liver\"\n"), shared_cache());
    ASSERT_FALSE(label.has_value());
    EXPECT_EQ(label.error().message(),
              "coarse.toml:14: label 'splen' is not in the label map; did you mean 'spleen'?");
    const auto tissue = cook_case(*coarse_recipe("[labels]\nspleen = \"livre\"\n"), shared_cache());
    ASSERT_FALSE(tissue.has_value());
    EXPECT_EQ(tissue.error().message(),
              "coarse.toml:14: unknown tissue 'livre'; did you mean 'liver'?");
    // A class of TotalSegmentator that this patient lacks is not a fault.
    EXPECT_TRUE(
        cook_case(*coarse_recipe("[labels]\nbrain = \"liver\"\n"), shared_cache()).has_value());
}

TEST(CookCase, SurfaceInOtherUnitsThanTheBodyIsRefused) {
    const TemporaryFolder folder;
    const auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    Surface tiny = cooked->bundle.mannequin_skin;
    for (Point3& p : tiny.points) p = {p.x / 10, p.y / 10, p.z / 10};  // centimetres
    const auto ply = ply_file(tiny, "tiny");
    folder.write("tiny.ply", {reinterpret_cast<const char*>(ply.data()), ply.size()});
    ASSERT_TRUE(export_case(cooked->bundle, folder / "x").has_value());
    const std::vector<EmbeddedExercise> none;
    const auto files =
        parse_recipe("[inputs]\nlabels = \"x/labels.seg.nrrd\"\nsurface = \"tiny.ply\"\n",
                     folder / "case.toml", {}, &none);
    ASSERT_TRUE(files.has_value()) << files.error().message();
    const auto refused = cook_case(*files);
    ASSERT_FALSE(refused.has_value());
    EXPECT_NE(refused.error().message().find("inputs.surface_scale = 10"), std::string::npos)
        << refused.error().message();
}

TEST(ExportCase, VolumesAndSurfacesComeBackThroughImport) {
    const TemporaryFolder folder;
    const auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    const CaseBundle& bundle = cooked->bundle;
    ASSERT_TRUE(export_case(bundle, folder.path()).has_value());
    const auto labels = import_label_map(folder / "labels.seg.nrrd");
    ASSERT_TRUE(labels.has_value()) << labels.error().message();
    EXPECT_EQ(labels->labels.grid.size, bundle.grid.size);
    EXPECT_LT(distance(labels->labels.grid.origin_mm, bundle.grid.origin_mm), 1e-9);
    const auto dense = dense_from_bricks(bundle.label_bricks);
    std::size_t wrong = 0;
    for (std::size_t n = 0; n < dense.size(); ++n)
        wrong +=
            labels->labels.labels[labels->labels.voxels[n]].name != bundle.labels[dense[n]].name;
    EXPECT_EQ(wrong, 0u);
    for (const Label& label : labels->labels.labels)
        for (const Label& own : bundle.labels)
            if (label.name == own.name) {
                EXPECT_EQ(label.colour, own.colour) << label.name;
            }
    const auto mannequin = import_surface(folder / "mannequin.ply");
    ASSERT_TRUE(mannequin.has_value());
    ASSERT_EQ(mannequin->points.size(), bundle.mannequin_skin.points.size());
    for (std::size_t i = 0; i < mannequin->points.size(); ++i)  // float coordinates
        EXPECT_LT(distance(mannequin->points[i], bundle.mannequin_skin.points[i]), 1e-4);
}

TEST(InspectCase, VolumesAreThoseOfTheDenseVoxels) {
    const auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    const CaseBundle& bundle = cooked->bundle;
    std::vector<double> ml(bundle.labels.size(), 0);
    for (const std::uint8_t voxel : dense_from_bricks(bundle.label_bricks))
        ml[voxel] += bundle.grid.voxel_volume_mm3() / 1000;
    const LabelVolumes volumes = label_volumes(bundle);
    for (std::size_t i = 0; i < ml.size(); ++i)
        EXPECT_NEAR(volumes.ml[i], ml[i], 1e-9 * (1 + ml[i])) << bundle.labels[i].name;
}

TEST(ValidateCase, FindsWhatTheReaderCannot) {
    auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    const CaseBundle good = cooked->bundle;
    const auto errors = [](const CaseBundle& bundle) {
        std::string all;
        for (const Finding& finding : validate_case(bundle))
            if (finding.error) all += finding.text + "\n";
        return all;
    };
    EXPECT_EQ(errors(good), "");
    CaseBundle bad = good;
    bad.labels[2].name = bad.labels[1].name;
    EXPECT_NE(errors(bad).find("two labels"), std::string::npos);
    bad = good;
    bad.textures.clear();
    EXPECT_NE(errors(bad).find("missing texture"), std::string::npos);
    bad = good;
    for (Point3& p : bad.mannequin_skin.points) p.x += 5000;
    EXPECT_NE(errors(bad).find("frames are mixed up"), std::string::npos);
    bad = good;
    bad.exercises[0].toml = "name = \"x\"\n[[targets]]\ncentre = [0, 0, 9000]\n";
    EXPECT_NE(errors(bad).find("outside the body"), std::string::npos);
    bad = good;
    ASSERT_FALSE(bad.boundary.pool.empty());
    for (std::uint32_t& record : bad.boundary.pool) record = (record & ~0xFFu) | 200u;
    EXPECT_NE(errors(bad).find("beyond the palette"), std::string::npos);
}

TEST(ExerciseFrame, PositionsGoThroughTheMapAndTheNeedleStaysInThePlane) {
    const auto cooked = cook_case(*coarse_recipe(), shared_cache());
    ASSERT_TRUE(cooked.has_value());
    const auto exercise = parse_exercise(cooked->bundle.exercises[0].toml, "aim");
    ASSERT_TRUE(exercise.has_value()) << exercise.error().message();
    const Registration truth = analytic_torso_truth();
    EXPECT_LT(distance(exercise->targets[0].centre, mannequin_from_ct(truth, {80, 20, 70})), 1e-3);
    const SweepKey& key = exercise->sweeps[0].keys[0];
    EXPECT_LT(distance(key.probe, mannequin_from_ct(truth, {80, 130, 70})), 1e-3);
    const Vector3 normal = cross(key.beam, key.lateral);
    EXPECT_LT(std::abs(dot(key.needle_tip - key.probe, normal)), 2e-3);
    EXPECT_LT(std::abs(dot(key.needle_direction, normal)), 1e-5);
    // The plane passes where the anatomy in its middle went, 70 mm deep.
    EXPECT_LT(std::abs(dot(mannequin_from_ct(truth, {80, 60, 70}) - key.probe, normal)), 0.05);
    EXPECT_TRUE(cooked->stages.back().report.warnings.empty());  // the target lies in the liver
}

TEST(ExerciseFrame, FramesAreStrippedInPlaceAndStrangersRefused) {
    const auto framed = strip_frame("name = \"a\"\nframe = \"ct\"\ntitle = \"b\"\n", "a.toml");
    ASSERT_TRUE(framed.has_value());
    EXPECT_TRUE(framed->in_ct);
    EXPECT_EQ(framed->toml, "name = \"a\"\n\ntitle = \"b\"\n");
    const auto plain = strip_frame("name = \"a\"\n", "a.toml");
    EXPECT_FALSE(plain->in_ct);
    const auto wrong = strip_frame("name = \"a\"\nframe = \"world\"\n", "a.toml");
    ASSERT_FALSE(wrong.has_value());
    EXPECT_EQ(wrong.error().where, "a.toml:2");
}

}  // namespace
}  // namespace sonocase::pipeline
