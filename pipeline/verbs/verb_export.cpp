// SPDX-License-Identifier: Apache-2.0

// sonocase export: a bundle's parts as files that other tools open.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "formats/files/bundle_file.h"
#include "pipeline/command_line/command_line.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/export/export_files.h"
#include "pipeline/export/export_level_sets.h"

namespace sonocase::pipeline {

int verb_export(int argc, char** argv) {
    CLI::App app(
        "Unpack a bundle into files for other tools (.seg.nrrd, NRRD, PLY, PNG, TOML, JSON)");
    std::string path, folder;
    CommonOptions common;
    app.add_option("BUNDLE", path, "The bundle")->required();
    app.add_option("-o,--output", folder, "Folder to write")->type_name("DIR")->required();
    bool level_sets = false;
    app.add_flag("--level-sets", level_sets, "Also labels.vdb: one OpenVDB level set per label");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    auto bundle = load_bundle(path);
    if (!bundle) return fail("export", bundle.error());
    auto names = export_case(*bundle, folder);
    if (!names) return fail("export", names.error());
    if (level_sets) {
        const LabelVolume labels{bundle->grid, dense_from_bricks(bundle->label_bricks),
                                 bundle->labels};
        ProgressBar bar(common);
        const auto status = export_level_sets(labels, folder + "/labels.vdb", {}, bar.progress());
        if (!status) return fail("export", status.error());
        names->push_back("labels.vdb");
    }
    for (const std::string& name : *names) std::printf("%s/%s\n", folder.c_str(), name.c_str());
    return kDone;
}

}  // namespace sonocase::pipeline
