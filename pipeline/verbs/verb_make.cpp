// SPDX-License-Identifier: Apache-2.0

// sonocase make: from a scan and its labels to a case that can be tried, in one command.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "formats/base/build_facts.h"
#include "formats/files/atomic_file.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/make/make_case.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

int verb_make(int argc, char** argv) {
    CLI::App app(
        "Turn a scan and its labels into a case to try: recognised, checked, cooked, with "
        "exercises\n"
        "and pictures. What is decided is printed with the option that decides otherwise; a "
        "second\n"
        "run does only what has changed. See docs/first-case.md");
    MakeOptions options;
    CommonOptions common;
    app.add_option("INPUT", options.inputs,
                   "DICOM folder with its segmentation, folder of masks, label map, CT; several "
                   "where labels and CT lie apart")
        ->required();
    app.add_option("-o,--output", options.out,
                   "The case; recipe, exercises, check and pictures lie in the folder of its name")
        ->type_name("NAME.sonocase")
        ->required();
    app.add_option("--publish", options.site, "Write a site for browsers as well")
        ->type_name("SITE");
    app.add_option("--scan", options.scan, "The CT, where the inputs do not tell")
        ->type_name("PATH");
    app.add_option("--table", options.table, "Names of the label values, as for import")
        ->type_name("FILE.csv");
    app.add_option("--names", options.names,
                   "Whose numbers the values are that neither the file nor a table names")
        ->check(CLI::IsMember(names_options()))
        ->capture_default_str();
    app.add_flag("--resample-shear", options.resample_shear,
                 "Resample a map whose axes are not at right angles; slices of a tilted gantry are "
                 "resampled without it");
    app.add_option("--surface", options.surface,
                   "Mannequin to fit to; without one the case lies on the patient's own skin")
        ->type_name("FILE");
    app.add_option("--up", options.up, "Where the head lies in the surface's frame")
        ->type_name("X,Y,Z");
    app.add_option("--preset", options.preset, "draft, balanced or accurate")->type_name("NAME");
    app.add_option("--set", options.sets, "Set an option of a stage; may be repeated")
        ->type_name("SECTION.KEY=VALUE")
        ->allow_extra_args(false);
    app.add_flag("--accept-faults", options.accept_faults,
                 "Go on, and publish, where the check finds faults");
    options.publish.add = true;  // a site grows case by case
    app.add_option("--program", options.publish.program_folder,
                   "Folder with the player for browsers, as scripts/web builds it")
        ->type_name("DIR");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    if (!options.out.ends_with(".sonocase"))
        return wrong_usage("make", "--output: expected a name that ends in .sonocase");
    options.producer = producer();
    const ThreadLimit limit(common.threads);
    const Stopwatch watch;
    Result<MadeCase> made = MadeCase{};
    std::vector<std::string> warnings;
    nlohmann::ordered_json report{{"decisions", nlohmann::ordered_json::array()}};
    {
        ProgressBar bar(common, true);
        const Progress progress = bar.progress();
        made = make_case(
            options,
            [&](const Decision& decision) {
                if (progress) std::fputs("\r\x1b[K", stderr);
                std::printf("%s  [%s]\n", decision.what.c_str(), decision.otherwise.c_str());
                std::fflush(stdout);
                report["decisions"].push_back(
                    {{"what", decision.what}, {"otherwise", decision.otherwise}});
            },
            progress, &warnings);
    }
    for (const std::string& warning : made ? made->warnings : warnings)
        std::fprintf(stderr, "sonocase make: warning: %s\n", warning.c_str());
    if (!made) return fail("make", made.error());
    for (const std::string& fault : made->faults)
        std::fprintf(stderr, "sonocase make: fault: %s\n", fault.c_str());
    report["bundle"] = made->bundle;
    report["seconds"] = watch.seconds();
    report["exercises"] = made->exercises;
    report["faults"] = made->faults;
    report["cooked"] = made->cooked;
    report["warnings"] = made->warnings;
    if (!common.report_path.empty())
        if (auto s = write_file(common.report_path, std::string_view(report.dump(2) + "\n")); !s)
            return fail("make", s.error());
    std::string cooked;
    for (const std::string& stage : made->cooked) cooked += (cooked.empty() ? "" : ", ") + stage;
    std::printf("%s  %zu exercises, %zu faults, cooked anew: %s, %.1f s\n", made->bundle.c_str(),
                made->exercises, made->faults.size(), cooked.empty() ? "nothing" : cooked.c_str(),
                watch.seconds());
    std::printf("look at: %s/check.html, %s/pictures.png\n", made->folder.c_str(),
                made->folder.c_str());
    if (!made->site.empty()) std::printf("page: %s/index.html\n", made->site.c_str());
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
