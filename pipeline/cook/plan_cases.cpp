// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/plan_cases.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "pipeline/cook/case_cost.h"
#include "pipeline/cook/input_digests.h"

namespace sonocase::pipeline::inline cook {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::string state_name(const PlannedStage& stage) {
    return stage.stage + "." + stage.plan_key + ".json";
}

bool is_file_name(const std::string& name) {
    return !name.empty() && name[0] != '.' && name[0] != '-' &&
           std::all_of(name.begin(), name.end(), [](unsigned char c) {
               return std::isalnum(c) != 0 || c == '-' || c == '_' || c == '.';
           });
}

// The digest in a state file; empty where the file holds none.
std::string recorded_digest(const fs::path& state) {
    auto text = read_text_file(state.string());
    if (!text) return {};
    const Json json = Json::parse(*text, nullptr, false);
    return json.is_object() && json.contains("digest") && json["digest"].is_string()
               ? json["digest"].get<std::string>()
               : "";
}

// Which stages are done, by the state files; state files of other keys are removed.
void compare(CasePlan& plan, const fs::path& folder, DigestMemo& memo) {
    const fs::path states = folder / "state" / plan.name;
    const fs::path bundle = folder / "cases" / (plan.name + ".sonocase");
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(states, code)) {
        const std::string name = entry.path().filename().string();
        const auto current =
            std::find_if(plan.stages.begin(), plan.stages.end(),
                         [&](const PlannedStage& stage) { return state_name(stage) == name; });
        bool good = current != plan.stages.end();
        if (good && &*current == &plan.stages.back()) {
            const auto digest =
                fs::exists(bundle, code) ? memo.digest(bundle.string()) : Result<std::string>("");
            good = digest && !digest->empty() && *digest == recorded_digest(entry.path());
            plan.done = good;
        }
        std::error_code remove_code;
        if (!good) fs::remove(entry.path(), remove_code);
    }
}

Result<CasePlan> plan_case(const std::string& path,
                           const RecipeOverrides& overrides,
                           const fs::path& folder,
                           const StageTable& table,
                           DigestMemo& memo,
                           std::map<std::string, std::string>& recipe_of) {
    SONOCASE_TRY(auto recipe, load_recipe(path, overrides, table));
    if (!is_file_name(recipe.name))
        return Error{"name '" + recipe.name + "' cannot be a file name", path,
                     "expected letters, digits, '-', '_' and '.'"};
    const auto [named, fresh] = recipe_of.emplace(recipe.name, path);
    if (!fresh)
        return Error{"another case is called '" + recipe.name + "'", path,
                     "that of " + named->second + "; give one of them another name"};
    SONOCASE_TRY(auto inputs,
                 digest_inputs(recipe, [&](const std::string& file) { return memo.digest(file); }));
    CasePlan plan;
    plan.name = recipe.name;
    plan.stages = plan_stages(recipe, inputs);
    std::erase_if(plan.stages, [](const PlannedStage& stage) { return stage.is_step(); });
    compare(plan, folder, memo);
    if (!plan.done) plan.size = case_size(recipe);
    return plan;
}

}  // namespace

Result<std::vector<CasePlan>> plan_cases(const std::vector<std::string>& recipes,
                                         const RecipeOverrides& overrides,
                                         const std::string& folder,
                                         const StageTable& table) {
    DigestMemo memo((fs::path(folder) / "digests").string());
    std::vector<CasePlan> plans;
    std::map<std::string, std::string> recipe_of;  // by name of the case
    for (const std::string& given : recipes) {
        const std::string path = fs::absolute(given).lexically_normal().string();
        auto plan = plan_case(path, overrides, folder, table, memo, recipe_of);
        if (!plan) {
            const fs::path file(path);
            CasePlan bad;
            bad.name = file.filename() == "case.toml" ? file.parent_path().filename().string()
                                                      : file.stem().string();
            bad.error = plan.error().message();
            plan = std::move(bad);
        }
        plan->recipe = path;
        plans.push_back(std::move(*plan));
    }
    SONOCASE_TRY_DONE(memo.save());
    return plans;
}

std::string plan_json(const std::vector<CasePlan>& plans, const RecipeOverrides& overrides) {
    Json json;
    Json& arguments = json["arguments"] = Json::array();
    if (!overrides.data.empty())
        arguments.insert(arguments.end(), {"--data", fs::absolute(overrides.data).string()});
    if (!overrides.preset.empty())
        arguments.insert(arguments.end(), {"--preset", overrides.preset});
    for (const std::string& set : overrides.sets) arguments.insert(arguments.end(), {"--set", set});
    json["cases"] = Json::array();
    for (const CasePlan& plan : plans) {
        Json entry{{"name", plan.name}, {"recipe", plan.recipe}};
        if (!plan.error.empty()) {
            entry["error"] = plan.error;
        } else {
            entry["done"] = plan.done;
            entry["stages"] = Json::array();
            for (const PlannedStage& stage : plan.stages) {
                Json one{{"stage", stage.stage}, {"key", stage.plan_key}, {"needs", stage.needs}};
                if (!plan.done) {
                    one["threads"] = stage.descriptor->cost.threads;
                    one["memory_mb"] = stage.descriptor->cost.memory_mb(plan.size);
                }
                entry["stages"].push_back(std::move(one));
            }
        }
        json["cases"].push_back(std::move(entry));
    }
    return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace sonocase::pipeline::inline cook
