// SPDX-License-Identifier: Apache-2.0

// replay_and_score BUNDLE SESSION: renders the frames of a recorded session again and prints its
// scores.
#include <cstdint>
#include <cstdio>
#include <vector>

#include "formats/files/load_save.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_score.h"
#include "runtime/imaging/renderer.h"

using namespace sonocase;

int fail(const Error& error) {
    std::fprintf(stderr, "replay_and_score: %s\n", error.message().c_str());
    return 1;
}

// The exercise that the session names, or the bundle's first.
Result<Exercise> exercise_of(const CaseBundle& bundle, const SessionHeader& header) {
    if (bundle.exercises.empty()) return Error{"the bundle holds no exercise", "", ""};
    const EmbeddedExercise* found = &bundle.exercises[0];
    for (const EmbeddedExercise& exercise : bundle.exercises) {
        if (exercise.name == header.exercise) found = &exercise;
    }
    return parse_exercise(found->toml, found->name);
}

int main(int argc, char** argv) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: replay_and_score BUNDLE SESSION\n");
        return 2;
    }
    const Result<CaseBundle> bundle = load_bundle(argv[1]);
    if (!bundle) return fail(bundle.error());
    const Result<Sequence> sequence = load_sequence(argv[2]);
    if (!sequence) return fail(sequence.error());
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), argv[2]);
    if (!session) return fail(session.error());
    const Result<Exercise> exercise = exercise_of(*bundle, session->header);
    if (!exercise) return fail(exercise.error());

    runtime::RenderOptions options;
    options.width_px = options.height_px = 256;
    if (exercise->model == "paper") options.model = runtime::ImageModel::paper;
    auto renderer = runtime::Renderer::create(*bundle, *exercise, options);
    if (!renderer) return fail(renderer.error());
    std::vector<std::uint8_t> pixels(256 * 256);
    int frames = 0;
    for (const SessionSample& sample : session->samples) {
        if (!sample.probe_ok) continue;
        runtime::FrameInput input;
        input.mannequin_from_probe = sample.mannequin_from_probe;
        input.has_needle = sample.needle_ok;
        input.needle.tip = Point3{} + sample.mannequin_from_drawn.translation;
        input.needle.direction = sample.mannequin_from_drawn.rotation.column(2);
        input.time_s = sample.time_s;
        input.frame = static_cast<std::uint32_t>(sample.frame);
        if (renderer->render(input, pixels) != runtime::FrameStatus::held_bad_pose) ++frames;
    }
    std::printf("%d frames rendered\n", frames);

    const CaseAnatomy anatomy(*bundle, breathing_shown(*exercise, session->header));
    const SessionScore score = score_session(*session, *exercise, &anatomy, bundle->labels);
    for (const Metric& metric : score.metrics) {
        if (metric.value == metric.value)  // a metric without a value is not a number
            std::printf("%-32s %10.3f\n", metric.name.c_str(), metric.value);
    }
    return 0;
}
