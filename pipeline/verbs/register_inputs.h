// SPDX-License-Identifier: Apache-2.0

// Options and inputs that register, align and warp have in common.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "pipeline/command_line/command_line.h"
#include "pipeline/registration/register_surfaces.h"

namespace sonocase::pipeline {

struct RegisterArguments {
    std::string labels, table, surface, out, up, landmarks;
    double labels_scale = 1, surface_scale = 1;
    std::uint64_t seed = 1;
    bool no_residual = false, paper = false;
    CommonOptions common;
};

void add_register_options(CLI::App& app, RegisterArguments& arguments);

// Label map, skin and mannequin read, hints parsed; warnings of all of them gathered.
struct RegisterInputs {
    SkinSurfaceResult skin;
    Surface mannequin;
    RegisterOptions options;
    double import_seconds = 0;
    std::vector<std::string> warnings;
};
Result<RegisterInputs> read_register_inputs(const RegisterArguments& arguments,
                                            const Progress& progress);

// Adds what reading and the skin had to say to the stage's report.
void add_input_reports(const RegisterInputs& inputs, StageReport& report);

// "name  value" lines of a fit for people, on standard output.
void print_fit(const RegisterResult& result);

}  // namespace sonocase::pipeline
