// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/session_header.h"

#include <vector>

#include "formats/base/digest.h"

namespace sonocase::runtime {
namespace {

std::string joined(const std::vector<std::string>& words) {
    std::string out;
    for (const std::string& word : words) out += (out.empty() ? "" : ",") + word;
    return out;
}

}  // namespace

SessionHeader session_header(const CaseBundle& bundle,
                             const Exercise& exercise,
                             const RenderOptions& render,
                             const std::string& trainee,
                             const std::string& started) {
    SessionHeader header;
    header.case_name = bundle.manifest.case_name;
    header.exercise = exercise.name;
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        if (embedded.name == header.exercise) header.exercise_digest = digest_of(embedded.toml);
    }
    header.trainee = trainee;
    header.started = started;
    header.program = "sonoplay";
    header.render =
        std::string("model=") + (render.model == ImageModel::paper ? "paper" : "physical") +
        (render.machine ? " machine=" + render.machine->name : "") +
        " effects=" + joined(render.effects) + " size=" + std::to_string(render.width_px) + "x" +
        std::to_string(render.height_px) + " seed=" + std::to_string(render.seed);
    return header;
}

}  // namespace sonocase::runtime
