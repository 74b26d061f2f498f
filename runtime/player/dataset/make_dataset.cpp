// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/dataset/make_dataset.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "formats/files/atomic_file.h"
#include "formats/files/machine_file.h"
#include "runtime/player/dataset/dataset_chunk.h"
#include "runtime/player/session/case_set_up.h"

namespace sonocase::runtime {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// How many records a chunk has; 0: none yet.
std::uint64_t records_of(const DatasetPlan& plan, std::uint64_t chunk) {
    const Result<std::string> text = read_text_file(plan.records_path(chunk));
    if (!text) return 0;
    return static_cast<std::uint64_t>(std::count(text->begin(), text->end(), '\n'));
}

bool is_whole(const DatasetPlan& plan, std::uint64_t chunk) {
    return records_of(plan, chunk) == plan.last(chunk) - plan.first(chunk);
}

Result<std::vector<DatasetSource>> open_sources(const DatasetPlan& plan,
                                                const std::string& recipe_path) {
    const fs::path beside = fs::path(recipe_path).parent_path();
    std::vector<DatasetSource> sources;
    std::shared_ptr<const PhysicalTextures> textures;
    for (const DatasetCase& one : plan.recipe.cases) {
        const fs::path path(one.bundle);
        auto open = open_case((path.is_absolute() ? path : beside / path).string());
        if (!open) return open.error();
        if (textures == nullptr && plan.recipe.model == "physical")
            textures = make_physical_textures();
        (*open)->textures = textures;
        for (const std::string& name : one.exercises) {
            const Result<int> found = find_exercise(**open, name);
            if (!found) return found.error();
        }
        DatasetSource source{one, std::move(*open), nullptr};
        source.areas = std::make_unique<SkinAreas>(source.open->bundle->patient_skin);
        if (plan.recipe.region == "skin" && source.areas->sums.empty()) {
            return Error{"the bundle holds no skin surface", source.open->path,
                         "use region = \"sweeps\", or cook the case again"};
        }
        sources.push_back(std::move(source));
    }
    return sources;
}

// What the whole data set has in common; the same bytes for every shard.
std::string description_of(const DatasetPlan& plan,
                           const std::string& recipe_text,
                           const std::vector<DatasetSource>& sources) {
    Json cases = Json::array();
    for (const DatasetSource& source : sources) {
        Json labels = Json::array();
        for (const Label& label : source.open->bundle->labels)
            labels.push_back({{"name", label.name}, {"tissue", label.tissue}});
        cases.push_back({{"bundle", source.of.bundle},
                         {"name", source.open->bundle->manifest.case_name},
                         {"split", source.of.split},
                         {"labels", std::move(labels)}});
    }
    const Json description = {{"name", plan.recipe.name},
                              {"seed", plan.seed},
                              {"size", {plan.recipe.width_px, plan.recipe.height_px}},
                              {"format", plan.recipe.format},
                              {"cases", std::move(cases)},
                              {"recipe", recipe_text}};
    return description.dump(2) + "\n";
}

Status describe(const DatasetPlan& plan, const std::string& text) {
    const std::string path = plan.folder + "/dataset.json";
    std::error_code failed;
    if (fs::exists(path, failed)) {
        const Result<std::string> before = read_text_file(path);
        if (!before) return before.error();
        if (*before == text) return Done{};
        return Error{"the folder holds another data set", path,
                     "give the recipe, cases and seed that it was begun with, or another folder"};
    }
    return write_file(path, text);
}

// All records in order, once every chunk is whole.
Status write_manifest(const DatasetPlan& plan) {
    std::string manifest;
    for (std::uint64_t chunk = 0; chunk < plan.chunks(); ++chunk) {
        if (!is_whole(plan, chunk)) return Done{};  // another shard is at work
        const Result<std::string> records = read_text_file(plan.records_path(chunk));
        if (!records) return records.error();
        manifest += *records;
    }
    return write_file(plan.folder + "/manifest.jsonl", manifest);
}

Status make_folders(const DatasetPlan& plan) {
    for (const std::string& name :
         {std::string("records"), std::string(plan.recipe.format == "png" ? "frames" : "arrays")}) {
        std::error_code failed;
        fs::create_directories(plan.folder + "/" + name, failed);
        if (failed) {
            return Error{"cannot make the folder: " + failed.message(), plan.folder + "/" + name,
                         "check the path and its permissions"};
        }
    }
    remove_leftovers(plan.folder);
    return Done{};
}

}  // namespace

Status make_dataset(const DatasetArguments& arguments,
                    const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
    const Result<std::string> text = read_text_file(arguments.recipe);
    if (!text) return text.error();
    Result<DatasetRecipe> recipe = parse_dataset_recipe(*text, arguments.recipe);
    if (!recipe) return recipe.error();
    const DatasetPlan plan{std::move(*recipe), arguments.out, arguments.seed, arguments.frames};
    for (const std::string& machine : plan.recipe.machines) {
        if (const auto loaded = load_machine(machine); !loaded) return loaded.error();
    }
    Result<std::vector<DatasetSource>> sources = open_sources(plan, arguments.recipe);
    if (!sources) return sources.error();
    if (Status made = make_folders(plan); !made) return made;
    if (Status done = describe(plan, description_of(plan, *text, *sources)); !done) return done;

    const auto shards = static_cast<std::uint64_t>(arguments.shards);
    const auto first = static_cast<std::uint64_t>(arguments.shard - 1);
    const std::uint64_t mine =
        plan.chunks() > first ? (plan.chunks() - first + shards - 1) / shards : 0;
    for (std::uint64_t n = 0; n < mine; ++n) {
        const std::uint64_t chunk = first + n * shards;
        if (!is_whole(plan, chunk)) {
            if (Status done = make_chunk(plan, (*sources)[plan.case_of(chunk)], chunk); !done)
                return done;
        }
        if (progress) progress(n + 1, mine);
    }
    return write_manifest(plan);
}

}  // namespace sonocase::runtime
