// sonocase export: a bundle's parts as files that other tools open.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "pipeline/cook/export_files.h"
#include "pipeline/verbs/command_line.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline {

int verb_export(int argc, char** argv) {
    CLI::App app(
        "Unpack a bundle into files for other tools (.seg.nrrd, NRRD, PLY, PNG, TOML, JSON)");
    std::string path, folder;
    CommonOptions common;
    app.add_option("BUNDLE", path, "The bundle")->required();
    app.add_option("-o,--output", folder, "Folder to write")->type_name("DIR")->required();
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    auto bundle = load_bundle(path);
    if (!bundle) return fail("export", bundle.error());
    auto names = export_case(*bundle, folder);
    if (!names) return fail("export", names.error());
    for (const std::string& name : *names) std::printf("%s/%s\n", folder.c_str(), name.c_str());
    return kDone;
}

}  // namespace sonocase::pipeline
