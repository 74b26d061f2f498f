// SPDX-License-Identifier: Apache-2.0

// sonocase register, align, warp: the patient's skin onto the mannequin, in one call or stage by
// stage.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <optional>

#include "formats/files/registration_file.h"
#include "formats/registration/registration_json.h"
#include "pipeline/base/parallel.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/registration/fit_pictures.h"
#include "pipeline/registration/organ_pictures.h"
#include "pipeline/registration/rank_mannequins.h"
#include "pipeline/verbs/register_inputs.h"

namespace sonocase::pipeline {
namespace {

// What sets the three verbs apart.
struct FitVerb {
    const char* name;
    const char* about;
    bool from_rigid;     // starts from a registration that align wrote
    bool whole;          // surface to warp: draws pictures, and may write nothing
    const char* writes;  // help of -o
    std::function<Result<RegisterResult>(
        const RegisterInputs& inputs, const Registration& rigid, const Progress& progress)>
        fit;
};

struct FitArguments {
    RegisterArguments common;
    std::string rigid, pictures;
};

void add_options(CLI::App& app, const FitVerb& verb, FitArguments& arguments) {
    if (verb.from_rigid)
        app.add_option("registration", arguments.rigid, "What align wrote")
            ->type_name("REG.json")
            ->required();
    add_register_options(app, arguments.common, verb.whole);
    app.add_option("-o,--output", arguments.common.out, verb.writes)
        ->type_name("REG.json")
        ->required(!verb.whole);
    if (verb.whole)
        app.add_option("--pictures", arguments.pictures, "Write pictures of the fit to this folder")
            ->type_name("DIR");
}

struct Fitted {
    RegisterInputs inputs;
    RegisterResult result;
};

// Fits the other mannequins as well; the best fit and its mannequin stay. The report has the order.
Status try_others(const FitVerb& verb,
                  const FitArguments& arguments,
                  const Registration& rigid,
                  const Progress& progress,
                  RegisterInputs& inputs,
                  RegisterResult& fitted) {
    const std::vector<std::string>& names = arguments.common.surfaces;
    if (names.size() < 2) return Done{};
    std::vector<RegisterResult> results{std::move(fitted)};
    std::vector<Surface> mannequins{inputs.mannequin};
    for (std::size_t n = 1; n < names.size(); ++n) {
        if (auto status = read_other_mannequin(arguments.common, names[n], inputs); !status)
            return status;
        mannequins.push_back(inputs.mannequin);
        auto other = verb.fit(inputs, rigid, progress);
        if (!other) {
            Error error = other.error();
            if (error.where.empty()) error.where = names[n];
            return error;
        }
        results.push_back(std::move(*other));
    }
    const std::vector<std::size_t> order = rank_results(results);
    MeasureGroup ranking{"misfit", {}};
    std::printf("misfit  skin  volume  shape  coverage  (1 or less is good; best first)\n");
    for (const std::size_t n : order) {
        const Misfit m = misfit_of(results[n]);
        std::printf("%6.2f  %4.2f  %6.2f  %5.2f  %8.2f  %s%s\n", m.worst(), m.skin, m.volume,
                    m.shape, m.coverage, names[n].c_str(), m.proven ? "" : "  (not proven)");
        ranking.values.push_back({names[n], m.worst()});
    }
    inputs.mannequin = std::move(mannequins[order[0]]);
    fitted = std::move(results[order[0]]);
    fitted.report.notes.push_back({"mannequin", names[order[0]]});
    fitted.report.groups.push_back(std::move(ranking));
    return Done{};
}

Result<Fitted> fit(const FitVerb& verb, const FitArguments& arguments) {
    ProgressBar bar(arguments.common.common);
    Registration rigid;
    if (verb.from_rigid) {
        auto start = load_registration(arguments.rigid);
        if (!start) return start.error();
        rigid = std::move(*start);
    }
    auto inputs = read_register_inputs(arguments.common, bar.progress());
    if (!inputs) return inputs.error();
    auto fitted = verb.fit(*inputs, rigid, bar.progress());
    if (!fitted) {
        Error error = fitted.error();
        if (error.where.empty()) error.where = arguments.common.surfaces.front();
        return error;
    }
    if (auto status = try_others(verb, arguments, rigid, bar.progress(), *inputs, *fitted); !status)
        return status.error();
    std::vector<StageReport>& reports = fitted->registration.reports;
    reports.insert(reports.begin(), rigid.reports.begin(), rigid.reports.end());
    return Fitted{std::move(*inputs), std::move(*fitted)};
}

Status write_fit(const FitArguments& arguments, Fitted& fitted) {
    Registration& registration = fitted.result.registration;
    if (!arguments.pictures.empty()) {
        auto status = write_fit_pictures(fitted.inputs.skin, fitted.inputs.mannequin, registration,
                                         arguments.pictures);
        if (!status) return status;
        status = write_organ_pictures(fitted.inputs.labels, fitted.inputs.mannequin, registration,
                                      fitted.result.organs, arguments.pictures);
        if (!status) return status;
    }
    // The file holds no seconds, so that the same inputs give the same bytes; they go to --report.
    for (StageReport& report : registration.reports) report.seconds = 0;
    if (!arguments.common.out.empty())
        if (auto status = save_registration(registration, arguments.common.out); !status)
            return status;
    return write_report(arguments.common.common, fitted.result.report);
}

int run_fit_verb(const FitVerb& verb, int argc, char** argv) {
    CLI::App app(verb.about);
    FitArguments arguments;
    if (const auto status = take_recipe(argc, argv, arguments.common); !status)
        return fail(verb.name, status.error());
    add_options(app, verb, arguments);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(arguments.common.common.threads);
    auto fitted = fit(verb, arguments);
    if (!fitted) return fail(verb.name, fitted.error());
    add_input_reports(fitted->inputs, fitted->result.report);
    if (auto status = write_fit(arguments, *fitted); !status)
        return fail(verb.name, status.error());
    print_warnings(verb.name, fitted->result.report);
    print_fit(fitted->result);
    return kDone;
}

}  // namespace

int verb_register(int argc, char** argv) {
    const FitVerb verb{
        "register",
        "Lay the patient's skin on the mannequin: surface, align and warp in one call",
        false,
        true,
        "Where to write the registration",
        [](const RegisterInputs& in, const Registration&, const Progress& progress) {
            return register_surfaces({in.skin, in.mannequin, &in.labels}, in.options, progress);
        }};
    return run_fit_verb(verb, argc, argv);
}

int verb_align(int argc, char** argv) {
    const FitVerb verb{
        "align",
        "Find the rigid motion that lays the patient's skin on the mannequin",
        false,
        false,
        "Where to write the rigid registration",
        [](const RegisterInputs& in, const Registration&, const Progress& progress) {
            return align_surfaces({in.skin, in.mannequin, &in.labels}, in.options, progress);
        }};
    return run_fit_verb(verb, argc, argv);
}

int verb_warp(int argc, char** argv) {
    const FitVerb verb{
        "warp",
        "From a rigid registration to the quadratic and residual warps",
        true,
        false,
        "Where to write the registration",
        [](const RegisterInputs& in, const Registration& rigid, const Progress& progress) {
            return warp_surfaces({in.skin, in.mannequin, &in.labels}, rigid.mannequin_from_ct,
                                 in.options, progress);
        }};
    return run_fit_verb(verb, argc, argv);
}

}  // namespace sonocase::pipeline
