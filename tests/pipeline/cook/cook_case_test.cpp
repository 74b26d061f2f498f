// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/cook_case.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>

#include "coarse_case.h"
#include "formats/bundle/stage_files.h"
#include "pipeline/base/parallel.h"
#include "pipeline/export/export_files.h"
#include "pipeline/stages/roles.h"

namespace sonocase::pipeline {
namespace {

using testing::coarse_recipe;
using testing::shared_cache;
using testing::TemporaryFolder;

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
                            {"structure", false},
                            {"flow", false}}));
    EXPECT_EQ(cook(""), (Map{{"import", true},
                             {"surface", true},
                             {"warp", true},
                             {"resample", true},
                             {"texture", true},
                             {"structure", true},
                             {"flow", true}}));
    EXPECT_EQ(cook("", {"structure.kidney=false"}), (Map{{"import", true},
                                                         {"surface", true},
                                                         {"warp", true},
                                                         {"resample", true},
                                                         {"texture", true},
                                                         {"structure", false},
                                                         {"flow", true}}));
    EXPECT_EQ(cook("", {"resample.voxel_mm=5"}), (Map{{"import", true},
                                                      {"surface", true},
                                                      {"warp", true},
                                                      {"resample", false},
                                                      {"texture", true},
                                                      {"structure", false},
                                                      {"flow", false}}));
    // Early cut-off: another way of fitting that comes to the same map stops there.
    EXPECT_EQ(cook("", {"warp.trials=7"}), (Map{{"import", true},
                                                {"surface", true},
                                                {"warp", false},
                                                {"resample", true},
                                                {"texture", true},
                                                {"structure", true},
                                                {"flow", true}}));
    // Another tissue for a label reaches textures and structure, not the volumes.
    EXPECT_EQ(cook("[labels]\nspleen = \"liver\"\n"), (Map{{"import", true},
                                                           {"surface", true},
                                                           {"warp", true},
                                                           {"resample", true},
                                                           {"texture", false},
                                                           {"structure", false},
                                                           {"flow", false}}));
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
         {"import", "surface", "warp", "resample", "smooth", "texture", "structure", "flow"}) {
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
            std::string bytes = sonocase::testing::read_text(folder / name);
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
    for (std::size_t i = 1; i < cooked->stages.size(); ++i)  // told once, not by every stage
        EXPECT_TRUE(cooked->stages[i].cache_notes.empty()) << i;
}

// A warning that happens to name the cache belongs to the bundle; notes on the cache do not.
TEST(CookCase, NotesOnTheCacheAreKeptApartFromTheWarningsOfTheBundle) {
    StageTable table = built_in_stages();
    for (StageDescriptor& stage : table.stages)
        if (stage.name == "import")
            stage.run = [run = stage.run](StageInputs& inputs, const Progress& progress) {
                auto value = run(inputs, progress);
                LabelFile file = value->take(kCtLabels);
                file.reports[0].warnings = {"a cache of gallstones lies in the label map"};
                return Result<StageValue>(StageValue::of(kCtLabels, std::move(file)));
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

}  // namespace
}  // namespace sonocase::pipeline
