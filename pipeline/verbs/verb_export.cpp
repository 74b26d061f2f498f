// SPDX-License-Identifier: Apache-2.0

// sonocase export: writes a bundle's parts as files that other tools open, or a session's pictures
// as DICOM. sonocase publish: writes cases as a site for browsers.
#include <cstdio>

#include <CLI/CLI.hpp>

#include "formats/files/load_save.h"
#include "pipeline/export/export_files.h"
#include "pipeline/export/export_level_sets.h"
#include "pipeline/export/publish.h"
#include "pipeline/export/ultrasound_dicom.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

namespace {

int export_dicom(const std::string& session, const std::string& file) {
    const auto film = film_of_session(session);
    if (!film) return fail("export", film.error());
    if (const Status written = write_ultrasound_dicom(*film, file); !written)
        return fail("export", written.error());
    std::printf("%s: %zu pictures, %d x %d\n", file.c_str(), film->times_s.size(), film->width_px,
                film->height_px);
    if (!(film->mm_per_px > 0))
        std::fprintf(stderr,
                     "sonocase: the pictures do not say how large a pixel is; viewers cannot "
                     "measure in them.\n");
    return kDone;
}

}  // namespace

int verb_export(int argc, char** argv) {
    CLI::App app(
        "Unpack a bundle into files for other tools (.seg.nrrd, NRRD, PLY, PNG, TOML, JSON), or "
        "write a session's pictures as ultrasound DICOM");
    std::string path, folder, dicom;
    CommonOptions common;
    app.add_option("INPUT", path, "The bundle; with --dicom a recording or a folder of pictures")
        ->required();
    auto* to_folder = app.add_option("-o,--output", folder, "Folder to write")->type_name("DIR");
    app.add_option("--dicom", dicom,
                   "Write the pictures of the session INPUT as one multi-frame ultrasound file")
        ->type_name("FILE")
        ->excludes(to_folder);
    bool level_sets = false;
    app.add_flag("--level-sets", level_sets, "Also labels.vdb: one OpenVDB level set per label");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    if (!dicom.empty()) return export_dicom(path, dicom);
    if (folder.empty())
        return fail("export", Error{"nowhere to write to", "", "-o DIR, or --dicom FILE"});
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
    app.add_flag("--add", options.add, "Keep the cases that the site has already");
    app.add_flag("--single-file", options.single_file,
                 "One .html with one case inside, which opens from disk");
    app.add_option("--course", options.course,
                   "Course that the site shows; all its cases have to be given")
        ->type_name("FILE");
    app.add_option("--package", options.packages,
                   "Also the course as packages for learning platforms, beside the site: cmi5, "
                   "scorm12, scorm2004, with commas between")
        ->type_name("KIND,...")
        ->delimiter(',');
    app.add_option("--xapi", options.xapi,
                   "Learning record store that takes the results; the page says so")
        ->type_name("ENDPOINT");
    app.add_option("--xapi-key", options.xapi_key,
                   "Key of that store, which everyone who opens the site can read: one that may "
                   "only add statements. Default: that of the learning platform's launch")
        ->type_name("USER:SECRET");
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

}  // namespace sonocase::pipeline::inline verbs
