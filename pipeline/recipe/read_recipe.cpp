// SPDX-License-Identifier: Apache-2.0

#include "pipeline/recipe/read_recipe.h"

#include <algorithm>
#include <filesystem>

#include "formats/exercise/exercise.h"
#include "formats/files/atomic_file.h"
#include "formats/text/nearest_name.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/pack/exercise_frame.h"
#include "pipeline/pathology/pathology.h"
#include "pipeline/recipe/embedded_scenario.h"
#include "pipeline/recipe/recipe_sections.h"
#include "pipeline/segmentation/resample_labels.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

// Null: the recipe's stages do not include it.
PathologyOptions* pathology_options(StageSettings& settings) {
    if (settings.table().find("pathology") == nullptr) return nullptr;
    return &settings.of<PathologyOptions>("pathology");
}
const PathologyOptions* pathology_options(const StageSettings& settings) {
    if (settings.table().find("pathology") == nullptr) return nullptr;
    return &settings.of<PathologyOptions>("pathology");
}

// Everything but the options of the stages, which come after the preset.
void read_contents(const TomlTable& root, Recipe& recipe, std::vector<std::string>* exercises) {
    std::string title;  // for people
    root.text("name", recipe.name);
    root.text("title", title);
    root.text("preset", recipe.preset, recipe.settings.table().preset_names());
    root.texts("exercises", *exercises);
    if (const auto table = root.table("inputs")) read_inputs(*table, recipe.inputs);
    if (const auto table = root.table("analytic")) read_analytic(*table, recipe.inputs);
    if (const auto table = root.table("labels")) read_labels(*table, recipe.labels);
    if (PathologyOptions* pathology = pathology_options(recipe.settings))
        read_pathology(root, pathology->requests, recipe.tissues);
    if (recipe.settings.table().find("resample") != nullptr)
        read_region(root, recipe.settings.of<ResampleOptions>("resample").region);
    if (const auto table = root.table("tissues")) read_tissues(*table, recipe.tissues);
}

void read_options(const TomlTable& root, StageSettings& settings) {
    for (const std::string& section : settings.table().sections()) {
        const auto table = root.table(section);
        if (!table) continue;
        for (const OptionGroup* group : settings.table().option_groups())
            for (const Option& option : group->options) {
                if (option.section != section) continue;
                const auto value = table->plain_value(option.key);
                if (!value) continue;
                const Status set = set_option(option, *value, settings.options(group->name),
                                              table->place(option.key));
                if (!set) table->keep(set.error());
            }
        table->finish();
    }
}

Status apply_preset(const std::string& name, StageSettings& settings) {
    const StageTable& table = settings.table();
    const Preset* preset = table.find_preset(name);
    if (preset == nullptr)
        return Error{"unknown preset '" + name + "'", "--preset",
                     suggest_name(name, table.preset_names())};
    for (const auto& [option, value] : preset->settings)
        if (auto status = settings.set(option, value, "preset " + name); !status) return status;
    return Done{};
}

Status apply_sets(const std::vector<std::string>& sets, StageSettings& settings) {
    for (const std::string& set : sets) {
        const std::size_t equals = set.find('=');
        if (equals == std::string::npos)
            return Error{"'" + set + "' has no '='", "--set", "expected --set section.key=value"};
        auto status = settings.set(set.substr(0, equals), set.substr(equals + 1), "--set");
        if (!status) return status;
    }
    return Done{};
}

Status check_inputs(const Recipe& recipe) {
    const RecipeInputs& in = recipe.inputs;
    if (in.analytic && (!in.labels.empty() || !in.surface.empty()))
        return Error{"both [analytic] and files in [inputs]", recipe.path, "keep one of the two"};
    if (in.analytic) return Done{};
    if (in.labels.empty())
        return Error{"no inputs.labels", recipe.path, "expected the label map of a torso"};
    if (in.surface.empty())
        return Error{"no inputs.surface", recipe.path, "expected the digitised mannequin"};
    return Done{};
}

// Exercises beside the recipe: those it names, or all others beside a case.toml.
Status load_exercises(Recipe& recipe, std::vector<std::string> names) {
    if (names.empty() && fs::path(recipe.path).filename() == "case.toml") {
        std::error_code code;
        for (const auto& entry :
             fs::directory_iterator(recipe.folder.empty() ? "." : recipe.folder, code))
            if (entry.path().extension() == ".toml" && entry.path().filename() != "case.toml" &&
                !fs::equivalent(entry.path(), recipe.path, code))
                names.push_back(entry.path().stem().string());
        std::sort(names.begin(), names.end());
    }
    for (const std::string& name : names) {
        const std::string path = (fs::path(recipe.folder) / (name + ".toml")).string();
        auto text = read_text_file(path);
        if (!text) return text.error();
        recipe.exercises.push_back({name, std::move(*text)});
    }
    return Done{};
}

// The named ones, in that order; all where none is named.
std::vector<EmbeddedExercise> chosen(const std::vector<EmbeddedExercise>& all,
                                     const std::vector<std::string>& named) {
    if (named.empty()) return all;
    std::vector<EmbeddedExercise> result;
    for (const std::string& name : named)
        for (const EmbeddedExercise& exercise : all)
            if (exercise.name == name) result.push_back(exercise);
    return result;
}

Status check_exercises(const Recipe& recipe) {
    for (const EmbeddedExercise& exercise : recipe.exercises) {
        const std::string where = (fs::path(recipe.folder) / (exercise.name + ".toml")).string();
        auto framed = strip_frame(exercise.toml, where);
        if (!framed) return framed.error();
        // Places are known once the lesions are there; names can be checked now.
        std::vector<KeyTarget> names;
        if (const PathologyOptions* pathology = pathology_options(recipe.settings))
            for (const PathologyRequest& request : pathology->requests)
                names.push_back({request.name, {}, 5, request.target});
        auto aimed = targets_from_key(framed->toml, where, names);
        if (!aimed) return aimed.error();
        if (auto parsed = parse_exercise(*aimed, where); !parsed) return parsed.error();
    }
    return Done{};
}

// A region round a target: its centre, in the frame of the exercise.
Status aim_region(Recipe& recipe) {
    if (recipe.settings.table().find("resample") == nullptr) return Done{};
    auto& region = recipe.settings.of<ResampleOptions>("resample").region;
    if (!region || region->target.empty()) return Done{};
    std::vector<std::string> names;
    for (const EmbeddedExercise& exercise : recipe.exercises) {
        const auto framed = strip_frame(exercise.toml, exercise.name);
        if (!framed) return framed.error();
        const auto parsed = parse_exercise(framed->toml, exercise.name);
        if (!parsed) continue;  // its targets are lesions, whose places are not known yet
        for (const Target& target : parsed->targets) {
            names.push_back(target.name);
            if (target.name != region->target) continue;
            region->centre = target.centre;
            region->in_ct = framed->in_ct;
            return Done{};
        }
    }
    return Error{"no target '" + region->target + "' with a centre in the exercises",
                 recipe.path + ": region.target", suggest_name(region->target, names)};
}

// What a stage cannot do is said before any of them runs.
Status check_stages(const Recipe& recipe) {
    for (const StageDescriptor& stage : recipe.settings.table().stages) {
        if (!stage.can_do || (stage.active && !stage.active(recipe))) continue;
        if (auto status = stage.can_do(recipe); !status) {
            Error error = status.error();
            error.where = recipe.path + ": " + error.where;
            return error;
        }
    }
    return Done{};
}

Status read_text(std::string_view text,
                 const RecipeOverrides& overrides,
                 Recipe& recipe,
                 std::vector<std::string>* exercises) {
    const auto root = TomlTable::parse(text, recipe.path);
    if (!root) return root.error();
    read_contents(*root, recipe, exercises);
    if (!root->fault()) {
        if (!overrides.preset.empty()) recipe.preset = overrides.preset;
        if (auto status = apply_preset(recipe.preset, recipe.settings); !status) return status;
        read_options(*root, recipe.settings);
        root->finish();
    }
    if (root->fault()) return *root->fault();
    if (auto status = apply_sets(overrides.sets, recipe.settings); !status) return status;
    if (!overrides.surface.empty()) {
        if (recipe.inputs.analytic)
            return Error{"the analytic torso makes its own mannequin", "--surface",
                         "take a recipe with [inputs]"};
        recipe.inputs.surface = fs::absolute(overrides.surface).string();
    }
    return check_inputs(recipe);
}

}  // namespace

Result<Recipe> parse_recipe(std::string_view text,
                            const std::string& path,
                            const RecipeOverrides& overrides,
                            const std::vector<EmbeddedExercise>* exercises,
                            const StageTable& table) {
    Recipe recipe;
    recipe.settings = StageSettings(table);
    recipe.path = path;
    recipe.folder = fs::path(path).parent_path().string();
    recipe.data = overrides.data;
    recipe.text = std::string(text);
    const auto built_in = built_in_tissues();
    recipe.tissues.assign(built_in.begin(), built_in.end());
    std::vector<std::string> named;
    if (auto status = read_text(text, overrides, recipe, &named); !status) return status.error();
    if (recipe.name.empty()) recipe.name = fs::path(recipe.folder).filename().string();
    if (recipe.name.empty()) recipe.name = "case";

    if (exercises != nullptr)
        recipe.exercises = chosen(*exercises, named);
    else if (auto status = load_exercises(recipe, named); !status)
        return status.error();
    if (auto status = check_exercises(recipe); !status) return status.error();
    if (auto status = aim_region(recipe); !status) return status.error();
    if (auto status = check_stages(recipe); !status) return status.error();
    return recipe;
}

Result<Recipe> load_recipe(const std::string& path,
                           const RecipeOverrides& overrides,
                           const StageTable& table) {
    std::error_code code;
    const std::string file =
        fs::is_directory(path, code) ? (fs::path(path) / "case.toml").string() : path;
    auto text = read_text_file(file);
    if (!text) return text.error();
    return parse_recipe(*text, file, overrides, nullptr, table);
}

Result<Recipe> embedded_recipe(const RecipeOverrides& overrides, const StageTable& table) {
    const std::vector<EmbeddedExercise> exercises = embedded_exercises();
    return parse_recipe(embedded_case_toml(), "(embedded)/case.toml", overrides, &exercises, table);
}

}  // namespace sonocase::pipeline
