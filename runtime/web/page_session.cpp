// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/page_session.h"

#include <optional>
#include <span>

#include "runtime/engine/tool_sample.h"
#include "runtime/recording/doppler_sample.h"
#include "runtime/recording/event_words.h"
#include "runtime/recording/session_header.h"
#include "runtime/recording/settings_text.h"

namespace sonocase::runtime {
namespace {

constexpr std::size_t kWords = 6;

bool same(const ImageSettings& a, const ImageSettings& b) {
    return a.gain_db == b.gain_db && a.dynamic_range_db == b.dynamic_range_db &&
           a.tgc_db == b.tgc_db && a.press_mm == b.press_mm &&
           a.flip_left_right == b.flip_left_right && a.doppler == b.doppler;
}

}  // namespace

PageSession::PageSession(const CaseBundle& bundle,
                         const ScanEngine& engine,
                         const std::string& trainee,
                         const std::string& started,
                         std::uint64_t seed)
    : bundle_(bundle),
      exercise_(engine.exercise()),
      first_anatomy_(engine.anatomy()),
      anatomy_(first_anatomy_),
      monitor_(exercise_, first_anatomy_.get(), bundle.labels) {
    session_.header = session_header(bundle, exercise_, engine.render_options(), trainee, started);
    if (seed != 0) session_.header.attempt = "seed=" + std::to_string(seed);
}

void PageSession::observe(const FrameRecord& record) {
    const FrameInput& input = record.input;
    SessionSample sample;
    fill_sample(record, sample);
    sample.has_doppler = record.doppler.on;
    sample.doppler = doppler_sample(record.doppler, bundle_.labels);
    if (session_.samples.empty() || !same(settings_, input.settings))
        sample.settings = settings_text(input.settings);
    settings_ = input.settings;
    monitor_.update(sample.time_s, sample.frame, sample.probe_ok, sample.mannequin_from_probe,
                    sample.needle_ok, sample.mannequin_from_drawn);
    report_punctures(record.puncture, monitor_);
    const std::span<const LiveEvent> events = monitor_.events();
    for (const LiveEvent& event : events) {
        session_.events.push_back(session_event(event, exercise_, bundle_.labels));
        std::string words = event_words(event, exercise_, bundle_.labels);
        if (words.empty()) continue;
        words_.push_back(std::move(words));
        if (words_.size() > kWords) words_.erase(words_.begin());
    }
    session_.samples.push_back(std::move(sample));
}

double PageSession::seconds() const {
    return session_.samples.empty() ? 0 : session_.samples.back().time_s;
}

Result<FinishedSession> PageSession::finish() const {
    FinishedSession out;
    out.recording = write_sequence(sequence_from_session(session_), SequenceForm::mha);
    const auto sequence = read_sequence(out.recording, "recording");
    if (!sequence) return sequence.error();
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), "recording");
    if (!session) return session.error();
    out.score = score_session(*session, exercise_, anatomy_.get(), bundle_.labels);
    out.score_json = score_json(out.score, exercise_);
    return out;
}

}  // namespace sonocase::runtime
