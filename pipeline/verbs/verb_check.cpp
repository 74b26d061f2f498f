// SPDX-License-Identifier: Apache-2.0

// sonocase check: tells whether a case is fit to teach with. sonocase aim: finds windows on the
// skin from which a probe sees a target.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "pipeline/check/aim.h"
#include "pipeline/check/check_case.h"
#include "pipeline/check/scripted_expert.h"
#include "pipeline/tradeoff/choose_settings.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

int verb_check(int argc, char** argv) {
    CLI::App app(
        "Look a case over: organs, sides, vessels, fit, exercises. Exit status 1: a fault");
    std::string path, page;
    bool json = false;
    CommonOptions common;
    app.add_option("BUNDLE", path, "The bundle")->required();
    app.add_option("-o,--output", page, "Where to write the page")->type_name("PAGE.html");
    app.add_flag("--json", json, "As JSON: {case, faults, remarks, organs, targets}");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    auto bundle = load_bundle(path);
    if (!bundle) return fail("check", bundle.error());
    const CheckResult result = check_case(*bundle);
    if (!page.empty()) {
        const Vector3 extent = bundle->grid.bounds().extent();
        const auto points =
            case_points(measured_front(), bundle->manifest.stages, extent.x * extent.y * extent.z);
        if (auto status = write_file(page, check_page(*bundle, result, points)); !status)
            return fail("check", status.error());
    }
    const std::string as_json = check_json(*bundle, result) + "\n";
    if (!common.report_path.empty())
        if (auto status = write_file(common.report_path, as_json); !status)
            return fail("check", status.error());
    if (json) {
        std::fputs(as_json.c_str(), stdout);
    } else {
        for (const Fault& fault : result.faults)
            std::printf("%s: %s; %s\n", fault.name.c_str(), fault.what.c_str(),
                        fault.remedy.c_str());
        std::printf("%s: %zu faults, %zu remarks\n", path.c_str(), result.faults.size(),
                    result.remarks.size());
    }
    return result.faults.empty() ? kDone : kFailed;
}

namespace {

// Prints one row per target of every exercise: its first window, and whether an expert passes
// through it.
int aim_at_all(const CaseBundle& bundle, const CaseLabels& labels) {
    bool all = true;
    std::printf("%-42s %9s %9s %7s  %s\n", "exercise/target", "depth mm", "blocked", "seen",
                "expert");
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        if (!exercise) return fail("aim", exercise.error());
        const AimOptions options = aim_options(*exercise);
        std::vector<AimWindow> first;
        for (const Target& target : exercise->targets) {
            const AimResult found =
                aim(labels, {target.name, target.centre, target.radius_mm}, options);
            first.push_back(found.windows.empty() ? AimWindow{} : found.windows[0]);
        }
        const bool reached = std::all_of(first.begin(), first.end(),
                                         [](const AimWindow& window) { return window.needle; });
        std::string outcome = "no window";
        if (reached) {
            const ExpertAttempt attempt = play_as_expert(bundle, *exercise, first);
            outcome = attempt.missed.empty() ? "passes" : "misses";
            for (const std::string& mark : attempt.missed) outcome += " " + mark;
        }
        all = all && outcome == "passes";
        for (std::size_t t = 0; t < first.size(); ++t)
            std::printf("%-42s %9.0f %7.0f %% %5.0f %%  %s\n",
                        (embedded.name + "/" + exercise->targets[t].name).c_str(),
                        first[t].depth_mm, 100 * first[t].blocked, 100 * first[t].visible,
                        outcome.c_str());
    }
    return all ? kDone : kFailed;
}

}  // namespace

int verb_aim(int argc, char** argv) {
    CLI::App app("Find windows on the skin for a target: no bone or gas in the way, best first");
    std::string path, name, out, picture;
    AimOptions options;
    CommonOptions common;
    app.add_option("BUNDLE", path, "The bundle")->required();
    app.add_option("--target", name,
                   "Target of an exercise, lesion or label; without it, every target of every "
                   "exercise is listed with its first window")
        ->type_name("NAME");
    app.add_option("-o,--output", out, "Where to write an exercise")->type_name("EXERCISE.toml");
    app.add_option("--picture", picture, "Where to draw the best three")->type_name("PICTURE.png");
    app.add_option("--windows", options.windows, "How many to find")
        ->check(CLI::Range(1, 20))
        ->capture_default_str();
    app.add_option("--keep-clear", options.keep_clear, "Labels that no needle may pass");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    auto bundle = load_bundle(path);
    if (!bundle) return fail("aim", bundle.error());
    const CaseLabels labels(*bundle);
    if (name.empty()) return aim_at_all(*bundle, labels);
    auto target = find_aim_target(*bundle, name);
    if (!target) return fail("aim", target.error());
    for (const EmbeddedExercise& embedded : bundle->exercises)
        if (embedded.name == target->exercise)
            if (const auto exercise = parse_exercise(embedded.toml, embedded.name)) {
                AimOptions given = aim_options(*exercise);
                given.windows = options.windows;
                given.keep_clear.insert(given.keep_clear.end(), options.keep_clear.begin(),
                                        options.keep_clear.end());
                options = given;
            }
    const AimResult result = aim(labels, *target, options);
    if (result.windows.empty())
        return fail("aim", {"no window on the skin sees '" + name + "': of " +
                                std::to_string(options.directions) + " directions " +
                                std::to_string(result.blocked_by_bone) + " meet bone, " +
                                std::to_string(result.blocked_by_gas) + " gas, " +
                                std::to_string(result.too_deep) + " are too deep, " +
                                std::to_string(result.through_cut) + " leave through a cut face",
                            path, "choose a shallower target, or one beside the ribs"});
    std::printf("%-3s %9s %9s %9s  %-6s %6s  %-28s %s\n", "no", "depth mm", "blocked", "oblique",
                "needle", "seen", "probe", "crosses");
    int number = 0;
    for (const AimWindow& w : result.windows) {
        std::string crossed;
        for (const std::string& structure : w.crossed)
            crossed += (crossed.empty() ? "" : ", ") + structure;
        char probe[64];
        std::snprintf(probe, sizeof probe, "[%.1f, %.1f, %.1f]", w.skin.x, w.skin.y, w.skin.z);
        std::printf("%-3d %9.0f %7.0f %% %5.0f deg  %-6s %4.0f %%  %-28s %s\n", ++number,
                    w.depth_mm, 100 * w.blocked, w.obliquity_deg, w.needle ? "passes" : "no",
                    100 * w.visible, probe, crossed.c_str());
    }
    if (!out.empty())
        if (auto s = write_file(out, aim_exercise(*target, result, options)); !s)
            return fail("aim", s.error());
    if (!picture.empty())
        if (auto s = write_file(picture, aim_picture(labels, *target, result)); !s)
            return fail("aim", s.error());
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
