// SPDX-License-Identifier: Apache-2.0

// What a stage is: one descriptor, which serves everything that deals with stages.
//
// A case is cooked by the stages of a StageTable in their order. Each takes results by their roles
// ("labels", "skin") and provides one under a role; where several provide the same role, a later
// stage gets that of the last before it. The descriptor gives
//
//     the recipe's sections and keys, --set, and `build --list-options`
//     the chain of stages that `build` runs, each through the cache (stage_runner.h)
//     the keys of the cache and of a build farm's plan (stage_runner.h)
//     the verb of the stage, files in and files out (pipeline/verbs/stage_verb.h)
//     the knobs that `tradeoff` sweeps, and the tables of options in the documents
//
// To add a stage, write one file as in pipeline/stages and name it in built_in_stages.cpp;
// docs/extending.md has a worked example.
#pragma once

#include <algorithm>
#include <any>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "pipeline/base/progress.h"
#include "pipeline/stages/option.h"
#include "pipeline/stages/recipe.h"

namespace sonocase {
class TomlTable;
}

namespace sonocase::pipeline::inline stages {

// The name under which one stage provides a result and others take it, with the result's type.
// roles.h has those of the built-in stages.
template <class T>
struct Role {
    const char* name;

    operator std::string() const { return name; }
};

// A result of a stage as it goes from stage to stage. Copies share the result.
class StageValue {
  public:
    template <class T>
    static StageValue of(const Role<T>&, std::type_identity_t<T> value) {
        StageValue result;
        result.value_ = std::make_shared<std::any>(std::move(value));
        return result;
    }

    explicit operator bool() const { return value_ != nullptr; }

    // The result. It must have been made for a role of this type.
    template <class T>
    const T& as(const Role<T>&) const {
        const T* const value = std::any_cast<T>(value_.get());
        assert(value != nullptr && "a stage's result is not of the type of its role");
        return *value;
    }
    // Moves the result out; other copies of the StageValue must no longer be read.
    template <class T>
    T take(const Role<T>&) {
        T* const value = std::any_cast<T>(value_.get());
        assert(value != nullptr && "a stage's result is not of the type of its role");
        return std::move(*value);
    }

  private:
    std::shared_ptr<std::any> value_;
};

// What a stage's `run` is given: the recipe with the options, and the results that it takes.
class StageInputs {
  public:
    using Find = std::function<Result<StageValue>(const std::string& role)>;

    // find      finds the result under a role
    // reported  what the stages so far have reported
    StageInputs(const Recipe& recipe, Find find, std::vector<StageReport> reported = {})
        : recipe_(recipe), find_(std::move(find)), reported_(std::move(reported)) {}

    const Recipe& recipe() const { return recipe_; }
    const std::vector<StageReport>& reported() const { return reported_; }

    template <class Options>
    const Options& options() const {
        return recipe_.settings.of<Options>();
    }

    // The result under one of the roles that the stage takes. It may still be in the cache, and is
    // read or made when it is asked for; errors are those of the stage that makes it.
    template <class T>
    Result<const T*> get(const Role<T>& role) {
        SONOCASE_TRY(auto value, find_(role));
        held_.push_back(value);
        return &held_.back().as(role);
    }

  private:
    const Recipe& recipe_;
    Find find_;
    std::vector<StageReport> reported_;
    std::vector<StageValue> held_;  // keeps what was asked for alive
};

using Bytes = std::vector<std::uint8_t>;

// A result as bytes in the cache and back. The bytes must not depend on seconds, so that the same
// inputs give the same bytes, and a later stage's key changes only where the result did.
struct StageCodec {
    std::function<Bytes(const StageValue& value)> encode;
    std::function<Result<StageValue>(const Bytes& bytes, const std::string& where)> decode;

    explicit operator bool() const { return encode != nullptr; }
};
template <class T>
StageCodec codec_of(const Role<T>& role,
                    Bytes (*encode)(const T& value),
                    Result<T> (*decode)(const Bytes& bytes, const std::string& where)) {
    return {[role, encode](const StageValue& value) { return encode(value.as(role)); },
            [role, decode](const Bytes& bytes, const std::string& where) -> Result<StageValue> {
                SONOCASE_TRY(auto value, decode(bytes, where));
                return StageValue::of(role, std::move(value));
            }};
}

// For StageDescriptor::reports: what a result holds in its member `reports`, or `report`.
template <class T>
std::function<std::vector<StageReport>(const StageValue& value)> reports_of(const Role<T>& role) {
    return [role](const StageValue& value) -> std::vector<StageReport> {
        const T& result = value.as(role);
        if constexpr (requires { result.reports; })
            return result.reports;
        else
            return {result.report};
    };
}

// The reports with their seconds set to zero: what a stage's bytes hold of them.
// Nor do they hold the word that anatomy agrees, or that a GLB lies as its format has it; what does
// not agree stays.
std::vector<StageReport> without_seconds(std::vector<StageReport> reports);

// What the stages of a case are sized by.
struct CaseSize {
    double label_mb = 0;       // voxels of the label map in the file's own type
    double label_voxels = 0;   // millions
    double cooked_voxels = 0;  // millions, without those of a region
    double cooked_mm = 1;      // edge of a cooked voxel
    // Millions of nodes between thick slices that are interpolated; 0: none are.
    double interpolated_nodes = 0;
    // Of them those of a column of 64 x 64, as long as the stack, with what is measured beside it.
    double column_nodes = 0;
    // Millions of faces between nodes of different labels; of a torso where nobody has counted.
    double surfaces = 0;
    // Area of these faces, and what they enclose; of a torso where nobody has counted.
    double surface_mm2 = kTorsoSurfaceMm2, body_mm3 = kTorsoMm3;
    // Distances that resampling holds, and the most while it measures them, MB (LabelField::need);
    // 0: nobody has counted.
    double held_mb = 0, measured_mb = 0;
    double region_voxels = 0;          // millions
    double mesh_voxels = 0;            // those of label_voxels that organ meshes become
    double lesions = 0, pools = 0;     // numbers of pathologies: of a place, and of free fluid
    double texture_edge = 64;          // voxels, of the solid textures
    double labels = kUsualLabels;      // number
    double textures = kUsualTextures;  // number that their tissues name
    double sampling_s = 0;             // processor seconds of sampling an analytic body
    double image_mb = 0;               // libraries that read the images textures are learnt from

    // Millions, in the box of the body, which fills little of that of organ meshes.
    double nodes() const { return std::max(label_voxels - 0.4 * mesh_voxels, interpolated_nodes); }
    // Surfaces over those of a torso on as many nodes, which go with its area.
    double surface_share() const {
        return surfaces > 0 ? surfaces / (kTorsoSurfaces * std::cbrt(nodes() * nodes())) : 1;
    }
    static constexpr double kTorsoSurfaces = 0.2116;
    // Of a torso, where nobody has counted.
    static constexpr double kUsualLabels = 60, kUsualTextures = 14;
    static constexpr double kTorsoSurfaceMm2 = 3.6e6, kTorsoMm3 = 24e6;
};

// Cores that a stage's job asks a build farm for, and its peak memory in MB: base + a * MB of the
// label file + b * million voxels of the label map (+ b' where meshes become it) + c * million
// cooked voxels + d * million voxels of the region + what the stage says itself. docs/farm.md has
// the measurements.
struct StageCost {
    int threads = 1;
    double base_mb = 98;  // of which some 80 are the program's libraries
    double per_label_mb = 0, per_label_voxel = 0, per_cooked_voxel = 0;
    double per_region_voxel = 0;
    double per_mesh_voxel = 0;
    double per_pool_voxel = 0;  // beside per_cooked_voxel, for each pool of free fluid
    // What no sum of these is, MB; `least`: what suffices where memory is short. Null: nothing.
    double (*more_mb)(const CaseSize& size, bool least) = nullptr;

    int memory_mb(const CaseSize& size, bool least = false) const;
};

// A flag of a stage's verb that says what a recipe's [inputs] would.
struct VerbInput {
    std::string flags;  // "--table"; a name without dashes is positional
    std::string type_name;
    std::string meaning;
    bool required = false;
    std::variant<std::string RecipeInputs::*, double RecipeInputs::*, bool RecipeInputs::*> to;
    std::vector<std::string> choices = {};  // of a text; empty: any
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
    std::string name;                // "resample"
    int version = 1;                 // raised whenever the same inputs and options give other bytes
    std::string summary;             // of its verb, in the list of verbs
    std::string about;               // first sentence of its verb's help
    std::vector<std::string> takes;  // roles
    std::string provides;            // a role
    OptionGroup options;
    bool seeded = false;  // depends on the table's common options as well: [case] seed

    // Reads sections of the recipe that are more than options: [[pathology]], [[region]]. Called
    // after [labels] and before [tissues], to whose tissues it may add. Empty: there are none.
    std::function<void(const TomlTable& root, Recipe& recipe)> read_sections;

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

    // Stands for the result in the keys of later stages, for a step whose result may stay the same
    // when what it takes changes. Empty: the step's own key does.
    std::function<std::string(const StageValue& value)> digest;
    // The warnings of a step, which become part of the next stage's report. Empty: none.
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

    const Preset* find_preset(const std::string& name) const;     // null: no such preset
    const StageDescriptor* find(const std::string& stage) const;  // null: no such stage
    // The options of the stage whose struct this is. Some stage must have it.
    template <class Options>
    const OptionGroup& options_of() const {
        return group_of(typeid(Options));
    }
    const OptionGroup& group_of(std::type_index type) const;
    std::vector<std::string> preset_names() const;

    // The groups of the stages in their order, then the common ones; those without options are left
    // out.
    std::vector<const OptionGroup*> option_groups() const;
    std::vector<std::string> sections() const;
};

// Every option with its default and range: for `build --list-options`, and as rows of a Markdown
// table for docs/accuracy.md.
std::string list_options(const StageTable& table);
std::string options_markdown(const StageTable& table);

// Numbers as text for the keys of stages, every one to its last bit and the same on every machine:
// "text 1.5 0.10000000000000001".
inline std::string key_text(std::string text, std::initializer_list<double> values) {
    for (const double value : values) {
        char digits[40];
        std::snprintf(digits, sizeof digits, " %.17g", value);
        text += digits;
    }
    return text;
}

}  // namespace sonocase::pipeline::inline stages
