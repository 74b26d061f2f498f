// SPDX-License-Identifier: Apache-2.0

// sonocase register, align, warp: the patient's skin onto the mannequin, in one call or stage by
// stage.
#include <CLI/CLI.hpp>

#include "formats/files/registration_file.h"
#include "formats/registration/registration_json.h"
#include "pipeline/base/parallel.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/registration/fit_pictures.h"
#include "pipeline/verbs/register_inputs.h"

namespace sonocase::pipeline {
namespace {

Error at_surface(Error error, const RegisterArguments& arguments) {
    if (error.where.empty()) error.where = arguments.surface;
    return error;
}

int finish(const char* verb,
           const RegisterArguments& arguments,
           const RegisterInputs& inputs,
           RegisterResult& result) {
    add_input_reports(inputs, result.report);
    print_warnings(verb, result.report);
    // The file holds no seconds, so that the same inputs give the same bytes; they go to --report.
    for (StageReport& report : result.registration.reports) report.seconds = 0;
    if (!arguments.out.empty()) {
        if (auto s = save_registration(result.registration, arguments.out); !s) {
            return fail(verb, s.error());
        }
    }
    if (auto s = write_report(arguments.common, result.report); !s) return fail(verb, s.error());
    print_fit(result);
    return kDone;
}

}  // namespace

int verb_register(int argc, char** argv) {
    CLI::App app("Lay the patient's skin on the mannequin: surface, align and warp in one call");
    RegisterArguments arguments;
    std::string pictures;
    add_register_options(app, arguments);
    app.add_option("-o,--output", arguments.out, "Where to write the registration")
        ->type_name("REG.json");
    app.add_option("--pictures", pictures, "Write pictures of the fit into this folder")
        ->type_name("DIR");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(arguments.common.threads);
    std::optional<RegisterInputs> inputs;
    std::optional<RegisterResult> result;
    {
        ProgressBar bar(arguments.common);
        Result<RegisterInputs> read = read_register_inputs(arguments, bar.progress());
        if (!read) return fail("register", read.error());
        inputs = std::move(*read);
        Result<RegisterResult> fitted =
            register_surfaces({inputs->skin, inputs->mannequin}, inputs->options, bar.progress());
        if (!fitted) return fail("register", at_surface(fitted.error(), arguments));
        result = std::move(*fitted);
    }
    if (!pictures.empty()) {
        const Status drawn =
            write_fit_pictures(inputs->skin, inputs->mannequin, result->registration, pictures);
        if (!drawn) return fail("register", drawn.error());
    }
    return finish("register", arguments, *inputs, *result);
}

int verb_align(int argc, char** argv) {
    CLI::App app("Find the rigid motion that lays the patient's skin on the mannequin");
    RegisterArguments arguments;
    add_register_options(app, arguments);
    app.add_option("-o,--output", arguments.out, "Where to write the rigid registration")
        ->type_name("REG.json")
        ->required();
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(arguments.common.threads);
    std::optional<RegisterInputs> inputs;
    std::optional<RegisterResult> result;
    {
        ProgressBar bar(arguments.common);
        Result<RegisterInputs> read = read_register_inputs(arguments, bar.progress());
        if (!read) return fail("align", read.error());
        inputs = std::move(*read);
        Result<RegisterResult> fitted =
            align_surfaces({inputs->skin, inputs->mannequin}, inputs->options, bar.progress());
        if (!fitted) return fail("align", at_surface(fitted.error(), arguments));
        result = std::move(*fitted);
    }
    return finish("align", arguments, *inputs, *result);
}

int verb_warp(int argc, char** argv) {
    CLI::App app("From a rigid registration to the quadratic and residual warps");
    RegisterArguments arguments;
    std::string rigid;
    app.add_option("registration", rigid, "What align wrote")->type_name("REG.json")->required();
    add_register_options(app, arguments);
    app.add_option("-o,--output", arguments.out, "Where to write the registration")
        ->type_name("REG.json")
        ->required();
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(arguments.common.threads);
    std::optional<RegisterInputs> inputs;
    std::optional<RegisterResult> result;
    {
        ProgressBar bar(arguments.common);
        const Result<Registration> start = load_registration(rigid);
        if (!start) return fail("warp", start.error());
        Result<RegisterInputs> read = read_register_inputs(arguments, bar.progress());
        if (!read) return fail("warp", read.error());
        inputs = std::move(*read);
        Result<RegisterResult> fitted =
            warp_surfaces({inputs->skin, inputs->mannequin}, start->mannequin_from_ct,
                          inputs->options, bar.progress());
        if (!fitted) return fail("warp", at_surface(fitted.error(), arguments));
        result = std::move(*fitted);
        result->registration.reports.insert(result->registration.reports.begin(),
                                            start->reports.begin(), start->reports.end());
    }
    return finish("warp", arguments, *inputs, *result);
}

}  // namespace sonocase::pipeline
