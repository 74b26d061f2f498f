// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/plan_cases.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"
#include "pipeline/base/text.h"
#include "pipeline/cook/case_cost.h"
#include "pipeline/cook/input_digests.h"
#include "pipeline/segmentation/resample_labels.h"

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

// What the last plan knew of this case: by stage, its key and what it is and was made of.
struct Remembered {
    std::string key;
    StageFacts made_of, was;
};
using Memory = std::map<std::string, Remembered>;

StageFacts facts_in(const Json& json, const char* name) {
    StageFacts facts;
    if (!json.contains(name) || !json[name].is_object()) return facts;
    for (const auto& [key, value] : json[name].items())
        if (value.is_string()) facts[key] = value.get<std::string>();
    return facts;
}

// By name of the case; nothing where there is no plan, or one of a program that remembered less.
std::map<std::string, Memory> remembered(const fs::path& folder) {
    std::map<std::string, Memory> cases;
    const auto text = read_text_file((folder / "plan.json").string());
    if (!text) return cases;
    const Json json = Json::parse(*text, nullptr, false);
    if (!json.is_object() || !json.contains("cases") || !json["cases"].is_array()) return cases;
    for (const Json& entry : json["cases"]) {
        if (!entry.is_object() || !entry.contains("stages") || !entry["stages"].is_array())
            continue;
        for (const Json& stage : entry["stages"])
            if (stage.is_object())
                cases[entry.value("name", "")][stage.value("stage", "")] = {
                    stage.value("key", ""), facts_in(stage, "made_of"), facts_in(stage, "was")};
    }
    return cases;
}

// Of a stage, and of the steps that run with it under "STEP ".
void add_facts(const PlannedStage& stage,
               const std::vector<PlannedStage>& plan,
               const Recipe& recipe,
               const std::string& prefix,
               StageFacts& facts) {
    const StageDescriptor& descriptor = *stage.descriptor;
    facts[prefix + "version"] = std::to_string(descriptor.version);
    std::size_t inputs = stage.own.size();
    const auto add_options = [&](const OptionGroup& group) {
        --inputs;
        for (const Option& option : group.options)
            facts[option.name()] = option_value(option, recipe.settings.values(group));
    };
    const OptionGroup& common = recipe.settings.table().common;
    if (!descriptor.options.options.empty()) add_options(descriptor.options);
    if (descriptor.seeded && !common.options.empty()) add_options(common);
    Digest digest;
    for (std::size_t i = 0; i < inputs; ++i) digest.add(std::string_view(stage.own[i]));
    if (inputs > 0) facts[prefix + "inputs"] = digest.hex();
    for (const std::size_t i : stage.inputs)
        if (plan[i].is_step()) add_facts(plan[i], plan, recipe, plan[i].stage + " ", facts);
}

constexpr std::string_view kFile = "file ";

bool ends_with_word(const std::string& name, std::string_view word) {
    return name == word || name.ends_with(" " + std::string(word));
}

std::string changed_files(const StageFacts& now, const StageFacts& was) {
    std::string names;
    for (const auto& [name, digest] : now) {
        if (!name.starts_with(kFile)) continue;
        const auto before = was.find(name);
        if (before != was.end() && before->second == digest) continue;
        names += (names.empty() ? "" : ", ") + name.substr(kFile.size());
    }
    return names;
}

// "" where they are equal.
std::string difference(const StageFacts& now, const StageFacts& was) {
    std::string text;
    const auto add = [&](const std::string& phrase) {
        text += (text.empty() ? "" : "; ") + phrase;
    };
    bool inputs = false;
    for (const auto& [name, value] : now) {
        const auto before = was.find(name);
        if (name.starts_with(kFile) || (before != was.end() && before->second == value)) continue;
        if (ends_with_word(name, "inputs")) {
            inputs = true;
        } else if (ends_with_word(name, "version")) {
            add("the program computes it in another way (" + name + " " + value +
                (before == was.end() ? "" : ", was " + before->second) + ")");
        } else {
            add(name + " = " + value + (before == was.end() ? "" : ", was " + before->second));
        }
    }
    for (const auto& [name, value] : was)
        if (!name.starts_with(kFile) && !now.contains(name)) add(name + " is no longer given");
    if (inputs) {
        const std::string files = changed_files(now, was);
        add(files.empty() ? "recipe or exercises have changed" : files + " changed");
    }
    return text;
}

void say_why(CasePlan& plan, bool bundle_lost) {
    std::map<std::string, bool> done;
    for (std::size_t i = 0; i < plan.stages.size(); ++i) {
        StageNeed& need = plan.needs[i];
        done[plan.stages[i].stage] = need.done;
        if (need.done) continue;
        std::string after;
        for (const std::string& name : plan.stages[i].needs)
            if (!done[name]) after += (after.empty() ? "after " : ", ") + name;
        need.why = need.was.empty() ? "not built yet" : difference(need.made_of, need.was);
        if (need.why.empty()) need.why = after;
        if (need.why.empty())
            need.why = bundle_lost && i + 1 == plan.stages.size()
                           ? "the bundle is missing, or is not the one that was written"
                           : "did not finish";
    }
}

// Which stages are done, by the state files, and what they were made of when they were last; state
// files of other keys are removed, unless dry.
void compare(
    CasePlan& plan, const Memory& memory, const fs::path& folder, DigestMemo& memo, bool dry) {
    const fs::path states = folder / "state" / plan.name;
    const fs::path bundle = folder / "cases" / (plan.name + ".sonocase");
    std::error_code code;
    for (std::size_t i = 0; i < plan.stages.size(); ++i) {
        const auto before = memory.find(plan.stages[i].stage);
        if (before == memory.end()) continue;
        const bool was_done =
            fs::exists(states / (before->first + "." + before->second.key + ".json"), code);
        plan.needs[i].was = was_done ? before->second.made_of : before->second.was;
    }
    bool bundle_lost = false;
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
            bundle_lost = !good;
        }
        if (good) {
            StageNeed& need = plan.needs[current - plan.stages.begin()];
            need.done = true;
            need.was = need.made_of;
        }
        std::error_code remove_code;
        if (!good && !dry) fs::remove(entry.path(), remove_code);
    }
    say_why(plan, bundle_lost);
}

void add_seconds(CasePlan& plan, const Recipe& recipe, double speed) {
    const double voxel_mm = recipe.settings.of<ResampleOptions>().voxel_mm;
    const double all_s = build_time(recipe, plan.size, voxel_mm, speed, 0).processor_s;
    double sum = 0;
    for (const PlannedStage& stage : plan.stages) sum += stage.descriptor->share;
    for (std::size_t i = 0; i < plan.stages.size(); ++i)
        if (!plan.needs[i].done)
            plan.needs[i].processor_s = all_s * plan.stages[i].descriptor->share / sum;
}

// What all cases share.
struct Planner {
    const RecipeOverrides& overrides;
    fs::path folder;
    bool dry;
    const StageTable& table;
    DigestMemo memo;
    std::map<std::string, Memory> memory;
    std::map<std::string, std::string> recipe_of;  // by name of the case
    double speed;                                  // 0: not measured yet
};

Result<CasePlan> plan_case(const std::string& path, Planner& all) {
    SONOCASE_TRY(auto recipe, load_recipe(path, all.overrides, all.table));
    if (!is_file_name(recipe.name))
        return Error{"name '" + recipe.name + "' cannot be a file name", path,
                     "expected letters, digits, '-', '_' and '.'"};
    const auto [named, fresh] = all.recipe_of.emplace(recipe.name, path);
    if (!fresh)
        return Error{"another case is called '" + recipe.name + "'", path,
                     "that of " + named->second + "; give one of them another name"};
    SONOCASE_TRY(auto inputs, digest_inputs(recipe, [&](const std::string& file) {
                     return all.memo.digest(file);
                 }));
    CasePlan plan;
    plan.name = recipe.name;
    const std::vector<PlannedStage> planned = plan_stages(recipe, inputs);
    for (const PlannedStage& stage : planned) {
        if (stage.is_step()) continue;
        StageNeed need;
        add_facts(stage, planned, recipe, "", need.made_of);
        for (const InputHash& file : inputs.files)
            need.made_of[std::string(kFile) + file.path] = file.digest;
        plan.stages.push_back(stage);
        plan.needs.push_back(std::move(need));
    }
    compare(plan, all.memory[plan.name], all.folder, all.memo, all.dry);
    if (plan.done) return plan;
    plan.size = case_size(recipe);
    if (all.speed == 0) all.speed = machine_speed();
    add_seconds(plan, recipe, all.speed);
    return plan;
}

}  // namespace

double CasePlan::processor_s() const {
    double sum = 0;
    for (const StageNeed& need : needs) sum += need.processor_s;
    return sum;
}

int CasePlan::memory_mb() const {
    int most = 0;
    for (std::size_t i = 0; i < stages.size(); ++i)
        if (!needs[i].done) most = std::max(most, stages[i].descriptor->cost.memory_mb(size));
    return most;
}

Result<std::vector<CasePlan>> plan_cases(const std::vector<std::string>& recipes,
                                         const RecipeOverrides& overrides,
                                         const std::string& folder,
                                         const PlanOptions& options,
                                         const StageTable& table) {
    Planner all{overrides,
                folder,
                options.dry,
                table,
                DigestMemo((fs::path(folder) / "digests").string()),
                remembered(folder),
                {},
                options.speed};
    std::vector<CasePlan> plans;
    for (const std::string& given : recipes) {
        const std::string path = fs::absolute(given).lexically_normal().string();
        auto plan = plan_case(path, all);
        if (!plan) {
            const fs::path file(path);
            CasePlan bad;
            bad.name = file.filename() == "case.toml" ? file.parent_path().filename().string()
                                                      : file.stem().string();
            bad.error = plan.error().message().text();
            plan = std::move(bad);
        }
        plan->recipe = path;
        plans.push_back(std::move(*plan));
    }
    if (!options.dry) {
        SONOCASE_TRY_DONE(all.memo.save());
    }
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
            for (std::size_t i = 0; i < plan.stages.size(); ++i) {
                const PlannedStage& stage = plan.stages[i];
                const StageNeed& need = plan.needs[i];
                Json one{{"stage", stage.stage}, {"key", stage.plan_key}, {"needs", stage.needs}};
                if (!plan.done) {
                    one["threads"] = stage.descriptor->cost.threads;
                    one["memory_mb"] = stage.descriptor->cost.memory_mb(plan.size);
                }
                if (!need.done) {
                    one["seconds"] = std::round(10 * need.processor_s) / 10;
                    one["why"] = need.why;
                }
                one["made_of"] = need.made_of;
                if (!need.was.empty() && need.was != need.made_of) one["was"] = need.was;
                entry["stages"].push_back(std::move(one));
            }
        }
        json["cases"].push_back(std::move(entry));
    }
    return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string plan_text(const std::vector<CasePlan>& plans) {
    std::string lines;
    for (const CasePlan& plan : plans) {
        if (!plan.error.empty()) {
            lines += plan.name + ": left out: " + plan.error + "\n";
            continue;
        }
        if (plan.done) {
            lines += plan.name + ": done\n";
            continue;
        }
        // Stages of one reason together, in the order of the plan.
        std::vector<std::pair<std::string, std::string>> reasons;  // why, stages
        std::size_t stale = 0;
        for (std::size_t i = 0; i < plan.stages.size(); ++i) {
            if (plan.needs[i].done) continue;
            ++stale;
            const bool follows = plan.needs[i].why.starts_with("after ");
            const std::string& why = follows ? "follows" : plan.needs[i].why;
            const auto same = std::find_if(reasons.begin(), reasons.end(),
                                           [&](const auto& reason) { return reason.first == why; });
            if (same == reasons.end()) {
                reasons.emplace_back(why, plan.stages[i].stage);
            } else {
                same->second += ", " + plan.stages[i].stage;
            }
        }
        lines +=
            text("%s: %zu of %zu stages, about %.0f s of processors, %d MB\n", plan.name.c_str(),
                 stale, plan.stages.size(), plan.processor_s(), plan.memory_mb());
        for (const auto& [why, stages] : reasons)
            lines += "    " + stages + (why == "follows" ? " follow" : ": " + why) + "\n";
    }
    return lines;
}

}  // namespace sonocase::pipeline::inline cook
