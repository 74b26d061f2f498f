// SPDX-License-Identifier: Apache-2.0

#include "pipeline/verbs/stage/option_flags.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <string>
#include <vector>

namespace sonocase::pipeline {
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

void add(CLI::App& app, const Option& option, double* value) {
    app.add_option("--" + option.flag, *value, description(option))
        ->check(CLI::Range(option.low, option.high))
        ->capture_default_str()
        ->group(option.help_group.empty() ? "Options" : option.help_group);
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
    flag->capture_default_str()->group(option.help_group.empty() ? "Options" : option.help_group);
}

void add(CLI::App& app, const Option& option, bool* value) {
    const std::string on = *value ? "; on by default" : "";
    app.add_flag("--" + option.flag + ",!--no-" + option.flag, *value, description(option) + on)
        ->group(option.help_group.empty() ? "Options" : option.help_group);
}

void add(CLI::App& app, const Option& option, std::string* value) {
    app.add_option("--" + option.flag, *value, description(option))
        ->check(CLI::IsMember(option.choices))
        ->capture_default_str()
        ->group(option.help_group.empty() ? "Options" : option.help_group);
}

}  // namespace

void add_option_flag(CLI::App& app, const Option& option, std::any& values) {
    std::visit([&](auto* slot) { add(app, option, slot); }, option.slot(values));
}

void add_option_flags(CLI::App& app, const OptionGroup& group, std::any& values) {
    for (const Option& option : group.options) add_option_flag(app, option, values);
}

}  // namespace sonocase::pipeline
