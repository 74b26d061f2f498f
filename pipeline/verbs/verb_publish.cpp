// SPDX-License-Identifier: Apache-2.0

// sonocase publish: cases as a site for browsers.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "pipeline/command_line/command_line.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/publish/publish.h"

namespace sonocase::pipeline {

int verb_publish(int argc, char** argv) {
    CLI::App app(
        "Write a site for browsers: page, program and cases, for any static host, without a\n"
        "request to others. See docs/browser.md");
    std::vector<std::string> cases;
    std::string site;
    PublishOptions options;
    app.add_option("CASE", cases, "Case bundles, in the order of the page")->required();
    app.add_option("-o,--output", site, "Folder of the site, or the page of --single-file")
        ->type_name("SITE")
        ->required();
    app.add_flag("--single-file", options.single_file,
                 "One .html with one case inside, which opens from disk");
    app.add_option("--xapi", options.xapi,
                   "Learning record store that takes the results; the page says so")
        ->type_name("ENDPOINT");
    app.add_option("--poses", options.poses,
                   "Pose server (sonoplay --serve-poses) that the page may connect to with ?poses=")
        ->type_name("ws://HOST:PORT");
    app.add_option("--program", options.program_folder,
                   "Folder with the player for browsers, as scripts/web builds it")
        ->type_name("DIR");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const auto published = publish(cases, site, options);
    if (!published) return fail("publish", published.error());
    for (const std::string& warning : published->warnings)
        std::fprintf(stderr, "sonocase publish: warning: %s\n", warning.c_str());
    for (const std::string& file : published->files) std::printf("%s\n", file.c_str());
    return kDone;
}

}  // namespace sonocase::pipeline
