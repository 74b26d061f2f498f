// SPDX-License-Identifier: Apache-2.0

// Options and inputs that register, align and warp have in common.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/command_line/command_line.h"
#include "pipeline/registration/register_surfaces.h"
#include "pipeline/stage/recipe.h"

namespace sonocase::pipeline {

struct RegisterArguments {
    RegisterArguments();  // options at their defaults

    Recipe recipe;                      // inputs, and the options of the stage "warp"
    std::vector<std::string> surfaces;  // mannequins; the first is that of the recipe
    std::string out, up;
    std::string recipe_path, data;
    CommonOptions common;
};

// "X,Y,Z" of a flag. Error: no three numbers, or a vector without a length.
Result<Vector3> parse_direction(const std::string& text, const char* flag);

// Where the command line says --recipe CASE.toml (and --data DIR): its [inputs], [import], [body]
// and fit options become the defaults of the flags, paths resolved. Call it before
// add_register_options.
Status take_recipe(int argc, char** argv, RegisterArguments& arguments);

// Inputs, every option of the stage "warp", --seed, and what all verbs have.
// several  --surface takes more than one
void add_register_options(CLI::App& app, RegisterArguments& arguments, bool several);

// Label map, skin and mannequin as read, hints parsed; with the warnings of all of them.
struct RegisterInputs {
    LabelVolume labels;
    SkinSurfaceResult skin;
    Surface mannequin;
    RegisterOptions options;
    double import_seconds = 0;
    std::vector<Measure> reduction;  // of a dense mannequin, as import_surface reports it
    std::vector<std::string> warnings;
};
Result<RegisterInputs> read_register_inputs(const RegisterArguments& arguments,
                                            const Progress& progress);

// The same for another mannequin: the patient stays.
Status read_other_mannequin(const RegisterArguments& arguments,
                            const std::string& path,
                            RegisterInputs& inputs);

// Adds to the stage's report what was reported when the inputs were read and the skin extracted.
void add_input_reports(const RegisterInputs& inputs, StageReport& report);

// A table of the fit's distances for people, on standard output.
void print_fit(const RegisterResult& result);

}  // namespace sonocase::pipeline
