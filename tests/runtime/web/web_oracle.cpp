// SPDX-License-Identifier: Apache-2.0

// What the tests of the page compare with: the desktop's engine, with its best instruction set.
//   web_oracle frames CASE SESSION paper|physical SIDE   the session's poses, and XXH3-128 of each
//                                                        picture, as JSON
//   web_oracle times CASE SESSION paper|physical SIDE [SIMD]   the same with the milliseconds of
//                                                        each frame, by one thread
//   web_oracle score CASE RECORDING                      the scores of a recording, as JSON
#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "formats/base/digest.h"
#include "formats/exercise/case_exercises.h"
#include "formats/files/bundle_file.h"
#include "formats/files/recording_file.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_score.h"
#include "runtime/engine/scan_engine.h"

namespace {

using namespace sonocase;
using namespace sonocase::runtime;

int fail(const Error& error) {
    std::fprintf(stderr, "web_oracle: %s\n", error.message().c_str());
    return 1;
}

void print_matrix(const char* name, const Rigid& pose) {
    std::printf("\"%s\": [", name);
    const std::array<double, 16> rows = matrix_from_rigid(pose);
    for (std::size_t n = 0; n < rows.size(); ++n) std::printf(n ? ", %.17g" : "%.17g", rows[n]);
    std::printf("]");
}

int frames(const CaseBundle& bundle,
           const Exercise& exercise,
           const Session& session,
           const std::string& model,
           int side,
           const std::string& simd,
           bool timed) {
    EngineOptions options;
    options.render.model = model == "paper" ? ImageModel::paper : ImageModel::physical;
    options.render.width_px = options.render.height_px = side;
    options.render.effects = exercise.effects;
    options.render.simd = simd;
    Result<ScanEngine> engine = ScanEngine::create(bundle, exercise, options);
    if (!engine) return fail(engine.error());
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(side) *
                                     static_cast<std::size_t>(side));
    std::printf("[");
    const char* between = "";
    for (const SessionSample& sample : session.samples) {
        TrackerReading reading;
        reading.time_s = sample.time_s;
        reading.in_mannequin = true;
        reading.sensor_count = 2;
        reading.sensors[kProbeSensor] = {SensorState::ok, sample.mannequin_from_probe, 1.0f, 0};
        if (sample.needle_ok)
            reading.sensors[kNeedleSensor] = {SensorState::ok, sample.mannequin_from_needle, 1.0f,
                                              0};
        engine->observe(reading, true);
        const auto start = std::chrono::steady_clock::now();
        engine->frame(sample.time_s, {}, pixels);
        const std::chrono::duration<double, std::milli> ms =
            std::chrono::steady_clock::now() - start;
        std::printf("%s{\"time_s\": %.17g, ", between, sample.time_s);
        if (timed) std::printf("\"ms\": %.4f, ", ms.count());
        print_matrix("probe", sample.mannequin_from_probe);
        std::printf(", ");
        print_matrix("needle", sample.mannequin_from_needle);
        std::printf(", \"has_needle\": %s, \"digest\": \"%s\"}",
                    sample.needle_ok ? "true" : "false", digest_of(pixels).c_str());
        between = ",\n";
    }
    std::printf("]\n");
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    const std::string verb = argc > 1 ? argv[1] : "";
    const bool timed = verb == "times";
    if (argc < 4 || (verb == "frames" && argc != 6) || (timed && argc != 6 && argc != 7)) return 2;
    const auto bundle = load_bundle(argv[2]);
    if (!bundle) return fail(bundle.error());
    const auto sequence = load_sequence(argv[3]);
    if (!sequence) return fail(sequence.error());
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), argv[3]);
    if (!session) return fail(session.error());
    const std::vector<Exercise> exercises = exercises_of(*bundle, argv[2]).exercises;
    const Exercise* exercise = &exercises[0];
    for (const Exercise& one : exercises) {
        if (one.name == session->header.exercise) exercise = &one;
    }
    if (timed || verb == "frames")
        return frames(*bundle, *exercise, *session, argv[4], std::stoi(argv[5]),
                      argc > 6 ? argv[6] : "", timed);
    const CaseAnatomy anatomy(*bundle, breathing_shown(*exercise, session->header));
    const SessionScore score = score_session(*session, *exercise, &anatomy, bundle->labels);
    std::fputs(score_json(score, *exercise).c_str(), stdout);
    return 0;
}
