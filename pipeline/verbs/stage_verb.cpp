// SPDX-License-Identifier: Apache-2.0

#include "pipeline/verbs/stage_verb.h"

#include <algorithm>
#include <cassert>
#include <cctype>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/parallel.h"
#include "pipeline/verbs/verb_common.h"

namespace sonocase::pipeline::inline verbs {

namespace {

// "Reach of the boundary records (voxels); 0: none"
std::string description(const Option& option) {
    std::string text = option.meaning;
    if (!text.empty())
        text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
    if (!option.unit.empty())
        text.insert(std::min(text.find(';'), text.size()), " (" + option.unit + ")");
    return text;
}

std::string heading(const Option& option) {
    return option.help_group.empty() ? "Options" : option.help_group;
}

void add(CLI::App& app, const Option& option, double* value) {
    app.add_option("--" + option.flag, *value, description(option))
        ->check(CLI::Range(option.low, option.high))
        ->capture_default_str()
        ->group(heading(option));
}

void add(CLI::App& app, const Option& option, int* value) {
    auto* flag = app.add_option("--" + option.flag, *value, description(option));
    if (option.choices.empty()) {
        flag->check(CLI::Range(static_cast<int>(option.low), static_cast<int>(option.high)));
    } else {
        std::vector<int> choices;
        for (const std::string& choice : option.choices) choices.push_back(std::stoi(choice));
        flag->check(CLI::IsMember(choices));
    }
    flag->capture_default_str()->group(heading(option));
}

void add(CLI::App& app, const Option& option, bool* value) {
    const std::string on = *value ? "; on by default" : "";
    app.add_flag("--" + option.flag + ",!--no-" + option.flag, *value, description(option) + on)
        ->group(heading(option));
}

void add(CLI::App& app, const Option& option, std::string* value) {
    app.add_option("--" + option.flag, *value, description(option))
        ->check(CLI::IsMember(option.choices))
        ->capture_default_str()
        ->group(heading(option));
}

struct VerbArguments {
    std::vector<std::string> files;  // # StageVerb::files
    std::string out;
    std::string pictures;
    CommonOptions common;
};

void add_inputs(CLI::App& app, const StageVerb& verb, RecipeInputs& inputs) {
    for (const VerbInput& input : verb.inputs) {
        CLI::Option* option = nullptr;
        if (const auto text = std::get_if<std::string RecipeInputs::*>(&input.to)) {
            option = app.add_option(input.flags, inputs.**text, input.meaning);
            if (!input.choices.empty())
                option->check(CLI::IsMember(input.choices))->capture_default_str();
        } else if (const auto flag = std::get_if<bool RecipeInputs::*>(&input.to)) {
            option = app.add_flag(input.flags, inputs.**flag, input.meaning);
        } else {
            option = app.add_option(input.flags, inputs.*std::get<double RecipeInputs::*>(input.to),
                                    input.meaning)
                         ->check(CLI::Range(kMinScale, kMaxScale))
                         ->capture_default_str();
        }
        if (!input.type_name.empty()) option->type_name(input.type_name);
        option->required(input.required);
    }
}

void add_flags(CLI::App& app,
               const StageDescriptor& stage,
               Recipe& recipe,
               VerbArguments& arguments) {
    const StageVerb& verb = *stage.verb;
    add_inputs(app, verb, recipe.inputs);
    arguments.files.resize(verb.files.size());
    for (std::size_t i = 0; i < verb.files.size(); ++i)
        app.add_option(verb.files[i].flags, arguments.files[i], verb.files[i].meaning)
            ->type_name(verb.files[i].type_name)
            ->required();
    app.add_option("-o,--output", arguments.out, verb.output_meaning)
        ->type_name(verb.output_type)
        ->required();
    add_option_flags(app, stage.options, recipe.settings);
    if (stage.seeded) add_option_flags(app, recipe.settings.table().common, recipe.settings);
    if (verb.draw)
        app.add_option("--pictures", arguments.pictures, verb.pictures_meaning)->type_name("DIR");
    add_common_options(app, arguments.common);
}

// The results of one run of a verb: read from the files given, or made by the stages before.
class VerbResults {
  public:
    VerbResults(const Recipe& recipe, const char* verb, const Progress& progress)
        : recipe_(recipe), verb_(verb), progress_(progress) {}

    void give(const std::string& role, StageValue value) { results_[role] = std::move(value); }

    Result<StageValue> run(const StageDescriptor& stage) {
        StageInputs inputs = inputs_of(stage);
        return stage.run(inputs, progress_);
    }
    StageInputs inputs_of(const StageDescriptor& stage) {
        return StageInputs(recipe_,
                           [this, &stage](const std::string& role) { return find(role, stage); });
    }

  private:
    Result<StageValue> find(const std::string& role, const StageDescriptor& consumer) {
        if (const auto known = results_.find(role); known != results_.end()) return known->second;
        const StageDescriptor* provider = nullptr;
        for (const StageDescriptor& stage : recipe_.settings.table().stages) {
            if (&stage == &consumer) break;
            if (stage.provides == role && (!stage.active || stage.active(recipe_)))
                provider = &stage;
        }
        assert(provider != nullptr && "a stage takes a role that no stage before it provides");
        auto value = run(*provider);
        if (!value) return value;
        if (provider->reports)
            for (const StageReport& report : provider->reports(*value))
                print_warnings(verb_, report);
        results_[role] = *value;
        return value;
    }

    const Recipe& recipe_;
    const char* verb_;
    const Progress& progress_;
    std::map<std::string, StageValue> results_;  // by role
};

// An error from inside the stage names the file that it is about.
Error at_first_file(Error error, const Recipe& recipe, const VerbArguments& arguments) {
    if (error.where.empty())
        error.where = arguments.files.empty() ? recipe.inputs.labels : arguments.files.front();
    return error;
}

Status load_files(const StageVerb& verb, const VerbArguments& arguments, VerbResults& results) {
    for (std::size_t i = 0; i < verb.files.size(); ++i) {
        SONOCASE_TRY(auto value, verb.files[i].load(arguments.files[i]));
        results.give(verb.files[i].role, std::move(value));
    }
    return Done{};
}

Status write_results(const StageDescriptor& stage,
                     const VerbArguments& arguments,
                     StageInputs& inputs,
                     const StageValue& value,
                     const StageReport& report) {
    const StageVerb& verb = *stage.verb;
    if (!arguments.pictures.empty())
        if (auto status = verb.draw(inputs, value, arguments.pictures); !status) return status;
    if (auto status = verb.save(inputs, value, arguments.out); !status) return status;
    return write_report(arguments.common, report);
}

}  // namespace

void add_option_flags(CLI::App& app, const OptionGroup& group, StageSettings& settings) {
    for (const Option& option : group.options)
        std::visit([&](auto* slot) { add(app, option, slot); },
                   option.slot(settings.values(group)));
}

int run_stage_verb(const StageTable& table, const StageDescriptor& stage, int argc, char** argv) {
    assert(stage.verb && stage.reports);
    const char* const name = stage.name.c_str();
    CLI::App app(stage.about);
    Recipe recipe;
    recipe.settings = StageSettings(table);
    const auto tissues = built_in_tissues();
    recipe.tissues.assign(tissues.begin(), tissues.end());
    VerbArguments arguments;
    add_flags(app, stage, recipe, arguments);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(arguments.common.threads);
    std::optional<ProgressBar> bar(std::in_place, arguments.common);
    const Progress progress = bar->progress();
    VerbResults results(recipe, name, progress);
    if (auto status = load_files(*stage.verb, arguments, results); !status)
        return fail(name, status.error());
    const Stopwatch watch;
    auto value = results.run(stage);
    if (!value) {
        bar.reset();
        return fail(name, at_first_file(value.error(), recipe, arguments));
    }
    StageReport report = stage.reports(*value).back();
    if (report.seconds <= 0) report.seconds = watch.seconds();
    StageInputs inputs = results.inputs_of(stage);
    const Status written = write_results(stage, arguments, inputs, *value, report);
    bar.reset();
    if (!written) return fail(name, written.error());
    print_notes(name, report);
    print_warnings(name, report);
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
