// SPDX-License-Identifier: Apache-2.0

// sonocase inspect and validate: what a bundle holds, and whether it is valid.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/files/thread_jobs.h"
#include "pipeline/export/accuracy_picture.h"
#include "pipeline/export/author_key.h"
#include "pipeline/export/inspect_case.h"
#include "pipeline/tradeoff/choose_settings.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

namespace {

Result<PublicKey> public_key_from(const std::string& path) {
    SONOCASE_TRY(const auto text, read_text_file(path));
    return parse_public_key(text, path);
}

}  // namespace

int verb_inspect(int argc, char** argv) {
    CLI::App app(
        "Show what a bundle holds: grid, labels, tissues, errors and seconds of each stage");
    std::string path;
    bool json = false, accuracy = false;
    std::string picture;
    std::string signed_by;
    CommonOptions common;
    app.add_option("BUNDLE", path, "The bundle")->required();
    auto* as_json = app.add_flag("--json", json, "As JSON, in the documented form");
    app.add_flag("--accuracy", accuracy,
                 "Only this case's accuracy: where its millimetres come from, which structures are "
                 "known least, what more seconds would buy")
        ->excludes(as_json);
    app.add_option("--picture", picture, "Draw that accuracy into FILE.svg or FILE.png")
        ->type_name("FILE");
    app.add_option("--signed-by", signed_by,
                   "Fail unless the case is as the holder of this key left it")
        ->type_name("KEY.pub");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    auto bytes = read_file(path);
    if (!bytes) return fail("inspect", bytes.error());
    ThreadJobs jobs(common.threads);
    auto bundle = read_bundle(*bytes, path, jobs);
    if (!bundle) return fail("inspect", bundle.error());
    Inspection inspection{path, digest_of(*bytes), bytes->size(), {}, {}, signature_of(*bytes)};
    if (!signed_by.empty()) {
        const auto key = public_key_from(signed_by);
        if (!key) return fail("inspect", key.error());
        const CaseSignature& found = inspection.signature;
        const std::string words = signature_words(found);
        if (found.fit != SignatureFit::fits || found.key != *key)
            return fail("inspect", {words.empty() ? "is not signed" : words, path,
                                    "expected the signature of the key with fingerprint " +
                                        fingerprint_of(*key)});
    }
    inspection.seconds = recorded_seconds(*bundle, path, inspection.digest);
    const Vector3 extent = bundle->grid.bounds().extent();
    const double volume_mm3 = extent.x * extent.y * extent.z;
    inspection.next = next_step(measured_front(), bundle->manifest.stages, volume_mm3);
    const CaseAccuracy own =
        case_accuracy(*bundle, case_points(measured_front(), bundle->manifest.stages, volume_mm3));
    if (!picture.empty())
        if (auto status = write_accuracy_picture(own, picture); !status)
            return fail("inspect", status.error());
    const std::string text = accuracy ? accuracy_text(own)
                             : json   ? inspection_json(*bundle, inspection)
                                      : inspection_text(*bundle, inspection);
    std::fputs(text.c_str(), stdout);
    if (!common.report_path.empty())
        if (auto status = write_file(common.report_path, inspection_json(*bundle, inspection));
            !status)
            return fail("inspect", status.error());
    return kDone;
}

int verb_validate(int argc, char** argv) {
    CLI::App app("Check bundles from the first byte to the last exercise");
    std::vector<std::string> paths;
    bool json = false;
    CommonOptions common;
    app.add_option("BUNDLE", paths, "One or more bundles")->required();
    app.add_flag("--json", json, "As JSON: [{bundle, valid, errors, remarks}]");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    nlohmann::ordered_json all = nlohmann::ordered_json::array();
    bool all_valid = true;
    for (const std::string& path : paths) {
        nlohmann::ordered_json errors = nlohmann::ordered_json::array();
        nlohmann::ordered_json remarks = nlohmann::ordered_json::array();
        auto bundle = load_bundle(path);
        if (!bundle)
            errors.push_back(bundle.error().message());
        else
            for (const Finding& finding : validate_case(*bundle))
                (finding.error ? errors : remarks).push_back(finding.text);
        const bool valid = errors.empty();
        all_valid = all_valid && valid;
        if (!json) {
            std::printf("%s: %s\n", path.c_str(), valid ? "valid" : "not valid");
            for (const auto& remark : remarks)
                std::printf("  remark: %s\n", remark.get<std::string>().c_str());
        }
        for (const auto& error : errors)
            std::fprintf(
                stderr, "sonocase validate: %s\n",
                (bundle ? path + ": " : std::string()).append(error.get<std::string>()).c_str());
        all.push_back(
            {{"bundle", path}, {"valid", valid}, {"errors", errors}, {"remarks", remarks}});
    }
    if (json)
        std::printf("%s\n",
                    all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    if (!common.report_path.empty())
        if (auto status = write_file(
                common.report_path,
                all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
            !status)
            return fail("validate", status.error());
    return all_valid ? kDone : kFailed;
}

}  // namespace sonocase::pipeline::inline verbs
