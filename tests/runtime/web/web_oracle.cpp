// SPDX-License-Identifier: Apache-2.0

// What the tests of the page compare with: the desktop's engine, with its best instruction set.
//   web_oracle frames CASE SESSION paper|physical SIDE   the session's poses, and XXH3-128 of each
//                                                        picture, as JSON
//   web_oracle times CASE SESSION paper|physical SIDE [SIMD]   the same with the milliseconds of
//                                                        each frame, by one thread
//   web_oracle doppler CASE SESSION colour|power|spectral|m_mode SIDE   the same with the probe
//                                                        turned by a right angle, box and gate
//                                                        aimed at the first pose, and with
//                                                        XXH3-128 of overlay and strip
//   web_oracle score CASE RECORDING                      the scores of a recording, as JSON
//   web_oracle change CASE CHANGED                       the case with a blank more in its
//                                                        manifest, and everything else, its
//                                                        signature too, as it was
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "formats/base/digest.h"
#include "formats/bundle/codec/chunk_file.h"
#include "formats/exercise/case_exercises.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_score.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/imaging/doppler/doppler_view.h"

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
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(side) * side);
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

DopplerMode mode_of(const std::string& name) {
    return name == "colour"     ? DopplerMode::colour
           : name == "power"    ? DopplerMode::power
           : name == "spectral" ? DopplerMode::spectral
                                : DopplerMode::m_mode;
}

int doppler_frames(const CaseBundle& bundle,
                   const Exercise& exercise,
                   const Session& session,
                   const std::string& mode,
                   int side) {
    constexpr int kStripWidth = 768, kStripHeight = 192;
    EngineOptions options;
    options.render.width_px = options.render.height_px = side;
    options.render.model = ImageModel::physical;
    options.render.effects = exercise.effects;
    Result<ScanEngine> engine = ScanEngine::create(bundle, exercise, options);
    if (!engine) return fail(engine.error());
    auto view = DopplerView::create(bundle, engine->exercise(), engine->render_options());
    if (!view) return fail(view.error());
    const auto count = static_cast<std::size_t>(side) * side;
    std::vector<std::uint8_t> pixels(count),
        strip(static_cast<std::size_t>(kStripWidth) * kStripHeight);
    const Matrix3 turn = Matrix3::from_columns({0, 1, 0}, {-1, 0, 0}, {0, 0, 1});
    ImageSettings settings;
    settings.doppler.mode = mode_of(mode);
    const char* between = "[";
    for (const SessionSample& sample : session.samples) {
        Rigid pose = sample.mannequin_from_probe;
        pose.rotation = pose.rotation * turn;
        FrameInput there;
        there.mannequin_from_probe = pose;
        if (*between == '[') settings.doppler = view->aimed(there, settings.doppler);
        TrackerReading reading;
        reading.time_s = sample.time_s;
        reading.in_mannequin = true;
        reading.sensor_count = 2;
        reading.sensors[kProbeSensor] = {SensorState::ok, pose, 1.0f, 0};
        engine->observe(reading, true);
        engine->frame(sample.time_s, settings, pixels);
        view->frame(engine->last().input, engine->renderer(), pixels);
        std::fill(strip.begin(), strip.end(), std::uint8_t{0});
        if (settings.doppler.mode == DopplerMode::spectral)
            doppler::draw_spectrum(view->spectrum(), 4, kStripWidth, kStripHeight, strip);
        if (settings.doppler.mode == DopplerMode::m_mode)
            doppler::draw_m_mode(view->m_mode(), kStripWidth, kStripHeight, strip);
        const auto overlay = view->overlay();
        std::printf("%s{\"time_s\": %.17g, ", between, sample.time_s);
        print_matrix("probe", pose);
        std::printf(
            ", \"digest\": \"%s\", \"overlay\": \"%s\", \"strip\": \"%s\", "
            "\"coloured\": %d, \"psv\": %.17g}",
            digest_of(pixels).c_str(), digest_of(overlay).c_str(), digest_of(strip).c_str(),
            static_cast<int>(std::count_if(overlay.begin(), overlay.end(),
                                           [](std::uint8_t index) { return index != 0; })),
            view->spectrum().measures().psv_cm_s);
        between = ",\n";
    }
    std::printf("]\n");
    return 0;
}

int change(const std::string& from, const std::string& to) {
    const auto bytes = read_file(from);
    if (!bytes) return fail(bytes.error());
    const std::vector<std::string> types = chunk_types(*bytes);
    const std::vector<std::string_view> known(types.begin(), types.end());
    const auto reader = ChunkReader::open(*bytes, "CASE", known, from);
    if (!reader) return fail(reader.error());
    ChunkWriter writer("CASE");
    for (const std::string& type : types) {
        auto raw = reader->read(type, reader->raw_bytes(type));
        if (!raw) return fail(raw.error());
        if (type == "manifest") raw->push_back(' ');
        if (reader->is_compressed(type))
            writer.add(type, reader->is_required(type), std::move(*raw));
        else
            writer.add_packed(type, reader->is_required(type), std::move(*raw));
    }
    const Status written = write_file(to, std::span<const std::uint8_t>(writer.write()));
    return written ? 0 : fail(written.error());
}

}  // namespace

int main(int argc, char** argv) {
    const std::string verb = argc > 1 ? argv[1] : "";
    const bool timed = verb == "times";
    const bool frames_asked = verb == "frames" || verb == "doppler";
    if (argc < 4 || (frames_asked && argc != 6) || (timed && argc != 6 && argc != 7)) return 2;
    if (verb == "change") return change(argv[2], argv[3]);
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
    if (verb == "doppler")
        return doppler_frames(*bundle, *exercise, *session, argv[4], std::stoi(argv[5]));
    if (timed || verb == "frames")
        return frames(*bundle, *exercise, *session, argv[4], std::stoi(argv[5]),
                      argc > 6 ? argv[6] : "", timed);
    const CaseAnatomy anatomy(*bundle, breathing_shown(*exercise, session->header));
    const SessionScore score = score_session(*session, *exercise, &anatomy, bundle->labels);
    std::fputs(score_json(score, *exercise).c_str(), stdout);
    return 0;
}
