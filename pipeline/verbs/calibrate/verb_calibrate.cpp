// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate point|direction|needle|mannequin|image|lag
#include <cstdio>
#include <string>

#include "pipeline/command_line/verbs.h"
#include "pipeline/verbs/calibrate/calibrate_common.h"

namespace sonocase::pipeline {
namespace {

struct SubVerb {
    const char* name;
    const char* summary;
    int (*run)(int argc, char** argv);
};
constexpr SubVerb kSubVerbs[] = {
    {"point", "tip of the probe or of a pointer, resting on a fixed point (pivot)",
     calibrate_point},
    {"direction", "the probe's axes, from a sweep along each", calibrate_direction},
    {"needle", "axis and tip of the needle, through a pinhole at several depths", calibrate_needle},
    {"mannequin", "where the mannequin is, from landmarks or a sweep of its skin",
     calibrate_mannequin},
    {"image", "the image in the probe, from touches of both ends of the face", calibrate_image},
    {"lag", "how much later one recording shows a motion than another", calibrate_lag},
};

}  // namespace

int verb_calibrate(int argc, char** argv) {
    const std::string name = argc > 1 ? argv[1] : "";
    for (const SubVerb& sub : kSubVerbs) {
        if (name != sub.name) continue;
        std::string full = "calibrate " + name;  // as messages and help name it
        argv[1] = full.data();
        return sub.run(argc - 1, argv + 1);
    }
    const bool help = name == "--help" || name == "-h" || name == "help";
    if (!help && !name.empty())
        std::fprintf(stderr, "sonocase calibrate: unknown kind \"%s\"\n", name.c_str());
    std::FILE* out = help ? stdout : stderr;
    std::fputs(
        "Usage: sonocase calibrate KIND --poses FILE.csv ... [-o CAL.json] [--json] [--pictures "
        "DIR]\n\n",
        out);
    for (const SubVerb& sub : kSubVerbs) std::fprintf(out, "  %-11s %s\n", sub.name, sub.summary);
    std::fputs("\nsonocase calibrate KIND --help    its options\n", out);
    return help ? kDone : kWrongUsage;
}

}  // namespace sonocase::pipeline
