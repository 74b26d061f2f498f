// SPDX-License-Identifier: Apache-2.0

// sonocase landmarks: candidates for the rows of a landmark file, on the skin of a label map and on
// a mannequin.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "formats/files/atomic_file.h"
#include "pipeline/base/parallel.h"
#include "pipeline/command_line/verbs.h"
#include "pipeline/landmarks/landmark_candidates.h"
#include "pipeline/verbs/register_inputs.h"

namespace sonocase::pipeline {
namespace {

void print_candidates(const char* whose, const std::vector<LandmarkCandidate>& candidates) {
    std::printf("%s\n", whose);
    for (const LandmarkCandidate& c : candidates)
        std::printf("  %-11s %-7s [%.1f, %.1f, %.1f]  %s\n", c.name.c_str(),
                    candidate_colour(c.name).name, c.place.x, c.place.y, c.place.z, c.how.c_str());
    if (candidates.empty()) std::printf("  none: expected at least 100 points\n");
}

}  // namespace

int verb_landmarks(int argc, char** argv) {
    CLI::App app("List places on skin and mannequin for a landmark file: navel, crotch, extremes");
    RegisterArguments arguments;
    std::string front, picture;
    if (const Status s = take_recipe(argc, argv, arguments); !s)
        return fail("landmarks", s.error());
    add_register_options(app, arguments, false);
    app.add_option("--front", front, "The patient's front in the surface's frame")
        ->type_name("X,Y,Z")
        ->required();
    app.add_option("--picture", picture, "Where to draw both, from the front and the right")
        ->type_name("PICTURE.png");
    app.add_option("-o,--output", arguments.out, "Where to write rows for --landmarks of register")
        ->type_name("LANDMARKS.csv");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(arguments.common.threads);
    const auto forwards = parse_direction(front, "--front");
    if (!forwards) return fail("landmarks", forwards.error());
    const auto inputs = read_register_inputs(arguments, {});
    if (!inputs) return fail("landmarks", inputs.error());
    if (!inputs->options.up || norm(cross(*inputs->options.up, *forwards)) < 1e-6)
        return fail("landmarks",
                    {!inputs->options.up ? "--up is missing" : "--up and --front are parallel",
                     "--up", "the patient's head direction in the surface's frame, e.g. 0,1,0"});
    // The ct frame is RAS+.
    CandidateView patient{&inputs->skin.skin, {0, 0, 1}, {0, 1, 0}, {}},
        mannequin{&inputs->mannequin, *inputs->options.up, *forwards, {}};
    for (CandidateView* view : {&patient, &mannequin})
        view->candidates = landmark_candidates(*view->skin, view->up, view->front);
    print_candidates("patient, ct frame", patient.candidates);
    print_candidates("mannequin", mannequin.candidates);
    if (!arguments.out.empty())
        if (auto s =
                write_file(arguments.out, landmark_rows(patient.candidates, mannequin.candidates));
            !s)
            return fail("landmarks", s.error());
    if (!picture.empty())
        if (auto s = write_file(picture, landmark_picture({patient, mannequin})); !s)
            return fail("landmarks", s.error());
    std::printf("Candidates, not pairs: strike out rows that are not the same place on both.\n");
    return kDone;
}

}  // namespace sonocase::pipeline
