// SPDX-License-Identifier: Apache-2.0

// The values of all options of a case: one options struct per stage.
//
//     StageSettings settings(built_in_stages());
//     settings.set("resample.voxel_mm", "0.5", "--set");
//     settings.of<ResampleOptions>().voxel_mm;    // 0.5
#pragma once

#include <any>
#include <cassert>
#include <map>
#include <optional>
#include <string>
#include <typeindex>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/volume/tissue.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/stages/option.h"

namespace sonocase::pipeline::inline stages {

struct StageTable;

class StageSettings {
  public:
    StageSettings() = default;  // no stages, no options
    // Every option at its default. The table must outlive the settings.
    explicit StageSettings(const StageTable& table);

    const StageTable& table() const { return *table_; }

    // Whether a stage of the table, or the table itself for its common options, has this struct.
    template <class Options>
    bool has() const {
        return values_.contains(typeid(Options));
    }
    // The options struct of a stage, or that of the table's common options, by its type. The table
    // must have it.
    template <class Options>
    Options& of() {
        return *std::any_cast<Options>(&values_of(typeid(Options)));
    }
    template <class Options>
    const Options& of() const {
        return *std::any_cast<Options>(&values_of(typeid(Options)));
    }
    // The same struct for whoever goes by the table: with what an Option's slot finds its value.
    std::any& values(const OptionGroup& group) { return values_of(group.type()); }
    const std::any& values(const OptionGroup& group) const { return values_of(group.type()); }

    // Sets "section.key" from text. Errors: no such option, with the nearest; a value that the
    // option does not take.
    Status set(const std::string& name, const std::string& value, const std::string& where);

  private:
    std::any& values_of(std::type_index type) {
        assert(values_.contains(type) && "options of a stage that the table does not have");
        return values_.at(type);
    }
    const std::any& values_of(std::type_index type) const {
        assert(values_.contains(type) && "options of a stage that the table does not have");
        return values_.at(type);
    }

    const StageTable* table_ = nullptr;
    std::map<std::type_index, std::any> values_;  // each under the type that it holds
};

// What a case is made of and how: the contents of a recipe, scenarios/<name>/case.toml.
//
// read_recipe.h reads one from a file; a stage's verb fills one in from its flags.

// Millimetres per unit of an input file: what a recipe and --scale may say.
inline constexpr double kMinScale = 1e-6, kMaxScale = 1e6;

// The embedded torso as an input: sampling of its "CT" and readings of its mannequin.
struct AnalyticInput {
    AnalyticBody body;
    AnalyticMannequinOptions mannequin;
    double voxel_mm = 2;
    double slice_mm = 3;
    int landmarks = 0;             // marked on both bodies, see analytic_torso_landmarks
    double landmark_noise_mm = 1;  // of each landmark and axis, standard deviation
    bool known_map = false;        // take the map that made the mannequin instead of fitting one
};

struct RecipeInputs {
    bool analytic = false;
    AnalyticInput torso;  // where analytic
    std::string labels;   // as the recipe names them; Recipe::resolve finds the file
    std::string label_table;
    std::string scan;  // the CT that the map was drawn on: fills in the body; empty: none
    std::string surface;
    bool own_skin = false;  // no mannequin: the case lies on the patient's own skin, in `ct`
    std::string examples;   // folder of ultrasound patches; empty: synthetic examples
    std::string landmarks;  // CSV of name,ct_x,ct_y,ct_z,x,y,z; or the patient's marks alone, and
    std::string surface_landmarks;  // those of the same names on the surface
    std::string labels_axes = "file", surface_axes = "file";  // or "ras", "lps": told by hand
    double labels_scale = 1;
    std::string label_names = "auto";  // names_options()
    std::string orientation = "auto";  // of a NIfTI map: "auto", "sform" or "qform"
    bool resample_shear = false;       // of a map with slanted axes
    double surface_scale = 1;
    std::optional<Vector3> up;  // the patient's head direction in the surface's frame
};

// A line of [labels]: the tissue that a label is made of.
struct LabelChoice {
    std::string label;
    std::string tissue;
    int line = 0;
};

struct Recipe {
    std::string path;    // "(embedded)/case.toml" for the built-in one
    std::string folder;  // that holds the recipe
    std::string data;    // folder of --data; may be empty
    std::string text;    // as given
    std::string name;
    std::string preset = "balanced";
    RecipeInputs inputs;
    std::vector<LabelChoice> labels;
    std::vector<Tissue> tissues;  // the built-in ones with the recipe's changes, then its own ones;
                                  // [0] is the outside
    StageSettings settings;
    std::vector<EmbeddedExercise> exercises;  // checked

    // The file that a path of the recipe means: absolute, below --data, or beside the recipe.
    std::string resolve(const std::string& given) const;
};

// Content hashes of the files that a recipe names; empty where it names none.
struct InputDigests {
    std::string labels, label_table, surface, examples, landmarks;
    std::vector<InputHash> files;  // those named, in this order; the scan after the table
    std::string scan;
};

}  // namespace sonocase::pipeline::inline stages
