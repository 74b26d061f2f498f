// SPDX-License-Identifier: Apache-2.0

// One option of a stage: its key in a recipe, its range, its meaning, and where its value is kept.
//
// This description serves everything that deals with options: the recipe reader, --set, the flags
// of a stage's verb, cache and plan keys, `build --list-options`, the sweeps of `tradeoff`, and the
// tables in the documents. A stage lists its options like this, under a section of the recipe:
//
//     OptionsOf<CropOptions>("crop")
//         .number("margin_mm", [](auto& o) { return &o.margin_mm; }, 0, 50, "mm",
//                 "air kept round the body")
//         .toggle("strict", [](auto& o) { return &o.strict; }, "refuse a body that was cut")
//
// The function returns the address of the value in the stage's options struct. That struct's type
// stands for the group of options wherever its values are read: settings.of<CropOptions>()
// (pipeline/stages/recipe.h).
#pragma once

#include <any>
#include <cassert>
#include <functional>
#include <string>
#include <typeindex>
#include <utility>
#include <variant>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline stages {

using OptionSlot = std::variant<double*, int*, bool*, std::string*>;

// How `tradeoff` sweeps an option, in one of its suites.
struct OptionSweep {
    std::string suite;                // "warp"
    std::vector<std::string> values;  // cheapest first; the default is among them
    std::string trades;               // the error that more time reduces
    std::string why_not_monotone;     // known reasons why more time need not mean less error
    // Why the default stays where a value beats it in a suite.
    std::string why_default = {};
};

struct Option {
    std::string section;               // of a recipe: "resample"
    std::string key;                   // "voxel_mm"
    std::string meaning;               // "edge of the cooked voxels"; starts in lower case
    std::string unit;                  // "mm"; empty: none
    double low = 0, high = 0;          // the range of a number, both ends included
    std::vector<std::string> choices;  // all values allowed, where a range does not say it
    // Where the value is kept in the group's options struct. A struct of another type is a mistake
    // of the caller: assert.
    std::function<OptionSlot(std::any& options)> slot;
    std::string flag;        // of the stage's verb, without "--": "voxel-mm"
    std::string help_group;  // heading of that flag in the verb's help; empty: the general one
    std::vector<OptionSweep> sweeps;

    std::string name() const { return section + "." + key; }
};

// Sets an option from text ("1.5", "true", "matched") as a recipe or --set gives it.
// Error: the value is not one that the option takes; says what is expected, with `where`.
Status set_option(const Option& option,
                  const std::string& value,
                  std::any& options,
                  const std::string& where);

// The value as set_option takes it, in its shortest form.
std::string option_value(const Option& option, const std::any& options);

// The values allowed, for people: "0.2 to 10 mm", "shape, nearest, paper", "true, false".
std::string option_range(const Option& option, const std::any& options);

// The options of one stage with the struct that holds their values. Each stage has a struct type of
// its own, which identifies the group.
struct OptionGroup {
    std::any defaults;  // the options struct; empty: the stage has no options
    std::vector<Option> options;

    std::type_index type() const { return defaults.type(); }

    // "key=value\n" of every option: what the stage's cache and plan keys hold of them.
    std::string text(const std::any& options_struct) const;
};

// Builds an OptionGroup; see the head of this file.
template <class Options>
class OptionsOf {
  public:
    explicit OptionsOf(const std::string& section) : section_(section) {
        group_.defaults = Options{};
    }
    // The section of the recipe for the options that follow.
    OptionsOf& section(const std::string& name) {
        section_ = name;
        return *this;
    }
    // Heading in the verb's help for the options that follow.
    OptionsOf& help_group(const std::string& heading) {
        help_group_ = heading;
        return *this;
    }

    template <class Slot>
    OptionsOf& number(const char* key,
                      Slot slot,
                      double low,
                      double high,
                      const char* unit,
                      const char* meaning) {
        Option& option = add(key, slot, unit, meaning);
        option.low = low;
        option.high = high;
        return *this;
    }
    template <class Slot>
    OptionsOf& choice(const char* key,
                      Slot slot,
                      const std::vector<std::string>& choices,
                      const char* unit,
                      const char* meaning) {
        add(key, slot, unit, meaning).choices = choices;
        return *this;
    }
    template <class Slot>
    OptionsOf& toggle(const char* key, Slot slot, const char* meaning) {
        add(key, slot, "", meaning);
        return *this;
    }

    // Gives the option before a flag other than its key.
    OptionsOf& flag(const std::string& name) {
        group_.options.back().flag = name;
        return *this;
    }
    OptionsOf& sweep(OptionSweep how) {
        group_.options.back().sweeps.push_back(std::move(how));
        return *this;
    }

    operator OptionGroup() const { return group_; }

  private:
    template <class Slot>
    Option& add(const std::string& key, Slot slot, const char* unit, const char* meaning) {
        Option option;
        option.section = section_;
        option.key = option.flag = key;
        for (char& c : option.flag)
            if (c == '_') c = '-';
        option.meaning = meaning;
        option.unit = unit;
        option.help_group = help_group_;
        option.slot = [slot](std::any& options) -> OptionSlot {
            Options* const values = std::any_cast<Options>(&options);
            assert(values != nullptr && "an option with the values of another stage");
            return slot(*values);
        };
        group_.options.push_back(std::move(option));
        return group_.options.back();
    }

    OptionGroup group_;
    std::string section_, help_group_;
};

}  // namespace sonocase::pipeline::inline stages
