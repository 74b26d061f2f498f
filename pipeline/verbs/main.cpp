// SPDX-License-Identifier: Apache-2.0

// sonocase: turns a segmented CT and a digitised mannequin into a case bundle.
#include <csignal>
#include <cstdio>
#include <functional>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/build_facts.h"
#include "formats/base/stage_report.h"
#include "formats/text/nearest_name.h"
#include "pipeline/base/memory_limit.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/verbs/stage_verb.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {
namespace {

constexpr const char* kCase = "Make and look at a case";
constexpr const char* kStage = "One stage, files in and files out";
constexpr const char* kFarm = "Many cases at once";
constexpr const char* kSession = "Trackers and sessions";

struct Verb {
    std::string group;
    std::string name;
    std::string summary;
    std::function<int(int argc, char** argv)> run;
    std::string after;  // of a verb of kStage: the stage that it follows in the list
};

const std::vector<Verb>& hand_written_verbs() {
    static const std::vector<Verb> table{
        {kCase, "make", "turn a scan and its labels into a case to try", verb_make, ""},
        {kCase, "build", "cook a recipe into a case bundle", verb_build, ""},
        {kCase, "inspect", "show what a bundle holds", verb_inspect, ""},
        {kCase, "validate", "check a bundle", verb_validate, ""},
        {kCase, "check", "look a case over before it teaches", verb_check, ""},
        {kCase, "aim", "find windows on the skin for a target", verb_aim, ""},
        {kCase, "export", "unpack a bundle for other tools", verb_export, ""},
        {kCase, "key", "make an author's key, to sign cases with", verb_key, ""},
        {kCase, "sign", "put the author's signature into a case", verb_sign, ""},
        {kCase, "publish", "write a site that plays cases in browsers", verb_publish, ""},
        {kCase, "look", "measure how a real machine draws", verb_look, ""},
        {kCase, "tradeoff", "sweep accuracy against time", verb_tradeoff, ""},
        {kStage, "align", "lay the skin on the mannequin rigidly", verb_align,
         stage_names::kSurface},
        {kStage, "warp", "fit the quadratic and residual warps", verb_warp, stage_names::kWarp},
        {kStage, "register", "surface, align and warp in one call", verb_register,
         stage_names::kWarp},
        {kStage, "landmarks", "list places for a landmark file", verb_landmarks,
         stage_names::kSurface},
        {kStage, "map", "carry points through a fitted map", verb_map, stage_names::kWarp},
        {kStage, "texture", "learn solid textures from example images", verb_texture,
         stage_names::kTexture},
        {kStage, "pack", "put the stages' files into a bundle", verb_pack, stage_names::kPack},
        {kFarm, "plan", "find what a build farm has to run", verb_plan, ""},
        {kFarm, "cache", "tidy a folder of stage results", verb_cache, ""},
        {kSession, "markers", "print sheets that one camera follows", verb_markers, ""},
        {kSession, "calibrate", "find tips, axes and frames of tracked tools", verb_calibrate, ""},
        {kSession, "review", "make a page of a recorded session", verb_review, ""},
        {kSession, "score", "score a recording of this or another trainer", verb_score, ""},
        {kSession, "progress", "list, export or remove trainees' results", verb_progress, ""},
    };
    return table;
}

// All verbs in the order in which help shows them: those of the stages in the order of the stages.
std::vector<Verb> verbs(const StageTable& stages) {
    std::vector<Verb> all;
    const auto add = [&](const char* group, const std::string& after) {
        for (const Verb& verb : hand_written_verbs())
            if (verb.group == group && verb.after == after) all.push_back(verb);
    };
    add(kCase, "");
    for (const StageDescriptor& stage : stages.stages) {
        if (stage.verb)
            all.push_back({kStage, stage.name, stage.summary,
                           [&stages, &stage](int argc, char** argv) {
                               return run_stage_verb(stages, stage, argc, argv);
                           },
                           ""});
        add(kStage, stage.name);
    }
    add(kFarm, "");
    add(kSession, "");
    return all;
}

void print_help(std::FILE* out) {
    std::fputs(
        "sonocase: case bundles for ultrasound-guided needle placement\n\n"
        "Usage: sonocase VERB [options]\n",
        out);
    std::string group;
    for (const Verb& verb : verbs(built_in_stages())) {
        if (group != verb.group) {
            group = verb.group;
            std::fprintf(out, "\n%s:\n", group.c_str());
        }
        std::fprintf(out, "  %-11s %s\n", verb.name.c_str(), verb.summary.c_str());
    }
    std::fputs(
        "\nsonocase VERB --help    options of a verb, with defaults and ranges\n"
        "sonocase --version      version and build facts\n"
        "\nExit status: 0 done, 1 failed with one line on standard error, 2 wrong usage.\n",
        out);
}

int run(int argc, char** argv) {
    if (argc < 2) {
        print_help(stderr);
        return kWrongUsage;
    }
    const std::string_view name = argv[1];
    if (name == "--help" || name == "-h" || name == "help") {
        print_help(stdout);
        return kDone;
    }
    if (name == "--version") {
        std::fputs(build_facts().c_str(), stdout);
        return kDone;
    }
    std::vector<std::string> names;
    for (const Verb& verb : verbs(built_in_stages())) {
        if (name == verb.name) return verb.run(argc - 1, argv + 1);
        names.push_back(verb.name);
    }
    std::fprintf(stderr, "sonocase: no verb '%s'; %s (sonocase --help lists all)\n", argv[1],
                 suggest_name(name, names).c_str());
    return kWrongUsage;
}

}  // namespace
}  // namespace sonocase::pipeline::inline verbs

int main(int argc, char** argv) {
    // A file that may not grow further is an error of its write, as a full disk is.
    std::signal(SIGXFSZ, SIG_IGN);
    try {
        return sonocase::pipeline::run(argc, argv);
    } catch (const std::bad_alloc&) {
        char text[80];
        std::snprintf(text, sizeof text, "out of memory: %.0f MB are allowed",
                      sonocase::pipeline::memory_limit_mb());
        return sonocase::pipeline::fail(
            argc > 1 ? argv[1] : "",
            {text, "", "a machine or a limit with more, larger voxels or --preset draft"});
    } catch (const std::exception& exception) {
        // The stages catch what their libraries throw; what is left is exhaustion of memory or
        // disk.
        const std::string verb = argc > 1 ? argv[1] : "";
        return sonocase::pipeline::fail(verb.c_str(), {exception.what(), "", ""});
    }
}
