// SPDX-License-Identifier: Apache-2.0

// What a stage is: one descriptor, which everything else goes by.
//
// A case is cooked by the stages of a StageTable in their order. Each takes results by their roles
// ("labels", "skin") and provides one under a role; where several provide the same role, a later
// stage gets that of the last before it. From the descriptor follow
//
//     the recipe's section and keys, --set, and `build --list-options`
//     the chain of stages that `build` runs, each through the cache (stage_runner.h)
//     the keys of the cache and of a build farm's plan (stage_plan.h)
//     the verb of the stage, files in and files out (pipeline/verbs/stage/stage_verb.h)
//     the knobs that `tradeoff` sweeps, and the tables of options in the documents
//
// To add a stage, write one file as in pipeline/stages and name it in built_in_stages.cpp;
// docs/extending.md has a worked example.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "pipeline/base/progress.h"
#include "pipeline/stage/option.h"
#include "pipeline/stage/recipe.h"
#include "pipeline/stage/stage_inputs.h"
#include "pipeline/stage/stage_value.h"

namespace sonocase::pipeline {

using Bytes = std::vector<std::uint8_t>;

// A result as bytes in the cache and back. The bytes must not depend on seconds, so that the same
// inputs give the same bytes, and a later stage's key changes only where the result did.
struct StageCodec {
    std::function<Bytes(const StageValue& value)> encode;
    std::function<Result<StageValue>(const Bytes& bytes, const std::string& where)> decode;

    explicit operator bool() const { return encode != nullptr; }
};
template <class T>
StageCodec codec_of(Bytes (*encode)(const T& value),
                    Result<T> (*decode)(const Bytes& bytes, const std::string& where)) {
    return {[encode](const StageValue& value) { return encode(value.as<T>()); },
            [decode](const Bytes& bytes, const std::string& where) -> Result<StageValue> {
                auto value = decode(bytes, where);
                if (!value) return value.error();
                return StageValue::of(std::move(*value));
            }};
}

// The reports with their seconds set to zero: what a stage's bytes hold of them.
std::vector<StageReport> without_seconds(std::vector<StageReport> reports);

// What the stages of a case are sized by.
struct CaseSize {
    double label_mb = 0;       // voxels of the label map in the file's own type
    double label_voxels = 0;   // millions
    double cooked_voxels = 0;  // millions, without those of a region
    // Millions of nodes between thick slices that are interpolated; 0: none are.
    double interpolated_nodes = 0;
    double region_voxels = 0;  // millions
};

// Cores that a stage's job asks a build farm for, and its peak memory in MB: base + a * MB of the
// label file + b * million voxels of the label map + c * million cooked voxels + d * million voxels
// of the region; for a stage that works through large maps piece by piece, the voxels count at most
// large_mb + e * million voxels. docs/farm.md has the measurements.
struct StageCost {
    int threads = 1;
    double base_mb = 240, per_label_mb = 0, per_label_voxel = 0, per_cooked_voxel = 0;
    double large_mb = 0, per_large_voxel = 0;  // large_mb 0: no map is worked through in pieces
    double per_streamed_voxel = 0;  // in place of per_large_voxel where memory is short; 0: as that
    double per_interpolated_node = 0;  // beside base_mb and no other, up to ten million nodes
    double per_region_voxel = 0;

    int memory_mb(const CaseSize& size) const;
    int least_mb(const CaseSize& size) const;  // where memory is short
};

// A flag of a stage's verb that says what a recipe's [inputs] would.
struct VerbInput {
    std::string flags;  // "--table"; a name without dashes is positional
    std::string type_name;
    std::string meaning;
    bool required = false;
    std::variant<std::string RecipeInputs::*, double RecipeInputs::*> to;
};

// A flag of a stage's verb that names the file of a result that the stage takes. A role without a
// file is made by the stages before, from the inputs.
struct VerbFile {
    std::string role;
    std::string flags;
    std::string type_name;
    std::string meaning;
    std::function<Result<StageValue>(const std::string& path)> load;
};

struct StageVerb {
    std::vector<VerbInput> inputs;
    std::vector<VerbFile> files;
    std::string output_type;     // "OUT.labels"
    std::string output_meaning;  // "Where to write"
    std::function<Status(StageInputs& inputs, const StageValue& value, const std::string& path)>
        save;
    // --pictures DIR; empty: the verb draws none.
    std::function<Status(StageInputs& inputs, const StageValue& value, const std::string& folder)>
        draw;
    std::string pictures_meaning;
};

struct StageDescriptor {
    std::string name;     // "resample"
    int version = 1;      // raised whenever the same inputs and options give other bytes
    std::string summary;  // of its verb, in the list of verbs
    std::string about;    // first sentence of its verb's help
    std::vector<std::string> takes;
    std::string provides;
    OptionGroup options;
    bool seeded = false;  // depends on the table's common options as well: [case] seed

    // Texts and digests of the recipe and its files that the result depends on, besides the options
    // and the results taken. Empty: none.
    std::function<std::vector<std::string>(const Recipe& recipe, const InputDigests& inputs)>
        key_texts;
    // Whether a case has the stage. Empty: every case has it.
    std::function<bool(const Recipe& recipe)> active;
    // What the recipe asks of the stage that it cannot do; asked where the case has the stage, when
    // the recipe is read. Empty: nothing.
    std::function<Status(const Recipe& recipe)> can_do;

    std::function<Result<StageValue>(StageInputs& inputs, const Progress& progress)> run;

    // Empty: the result is not kept in the cache but made whenever it is needed.
    StageCodec codec;
    // The reports in a result. Empty: the "stage" is a step, too quick to plan, time or report.
    std::function<std::vector<StageReport>(const StageValue& value)> reports;

    // Of a step whose result may stay the same when what it takes changes: stands for the result in
    // the keys of later stages. Empty: its own key does.
    std::function<std::string(const StageValue& value)> digest;
    // Of a step: warnings, which become part of the next stage's report. Empty: none.
    std::function<std::vector<std::string>(const StageValue& value)> warnings;
    // What the recipe says that the result must agree with; called when the result is there,
    // whether it was made or read. Empty: nothing.
    std::function<Status(const Recipe& recipe, const StageValue& value)> check;

    double share = 0;  // of the time of a whole build, for its progress bar
    StageCost cost;
    std::optional<StageVerb> verb;
};

// "section.key" and value of every option that a preset sets.
struct Preset {
    std::string name;
    std::vector<std::pair<std::string, std::string>> settings;
};

struct StageTable {
    std::vector<StageDescriptor> stages;  // in the order in which they run; the last makes the case
    OptionGroup common;                   // [case]: of more than one stage
    std::vector<Preset> presets;

    const StageDescriptor* find(const std::string& stage) const;  // null: no such stage
    const Preset* find_preset(const std::string& name) const;     // null: no such preset
    std::vector<std::string> preset_names() const;

    // Of the stages in their order, then the common ones; groups without options are left out.
    std::vector<const OptionGroup*> option_groups() const;
    std::vector<std::string> sections() const;
};

// Every option with its default and range: for `build --list-options`, and as rows of a Markdown
// table for docs/accuracy.md.
std::string list_options(const StageTable& table);
std::string options_markdown(const StageTable& table);

}  // namespace sonocase::pipeline
