// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/session.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "formats/recording/poses.h"
#include "formats/recording/tool_frames.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

constexpr const char* kEventField = "Event";
constexpr const char* kSettingsField = "Settings";
constexpr const char* kPressField = "Press";
constexpr const char* kDopplerField = "Doppler";
constexpr const char* kProbeAgeField = "ProbeAge";
constexpr const char* kNeedleAgeField = "NeedleAge";
constexpr const char* kUnseenField = "Unseen";
constexpr double kHeldS = 0.02;  // a pose this old was not measured for its frame

struct HeaderField {
    const char* name;
    std::string SessionHeader::*value;
};
constexpr HeaderField kHeaderFields[] = {
    {"SonocaseCase", &SessionHeader::case_name},
    {"SonocaseCaseDigest", &SessionHeader::case_digest},
    {"SonocaseExercise", &SessionHeader::exercise},
    {"SonocaseExerciseDigest", &SessionHeader::exercise_digest},
    {"SonocaseTrainee", &SessionHeader::trainee},
    {"SonocaseStarted", &SessionHeader::started},
    {"SonocaseProgram", &SessionHeader::program},
    {"SonocaseRender", &SessionHeader::render},
    {"SonocaseAttempt", &SessionHeader::attempt}};

// An event is written as "name|detail", and several events of one frame are joined by ";". Both
// characters are replaced in the texts.
std::string without(std::string text, const char* signs) {
    for (char& c : text) {
        if (std::string(signs).find(c) != std::string::npos) c = ',';
    }
    return text;
}

void read_events(const std::string& value,
                 const SessionSample& sample,
                 std::vector<SessionEvent>& to) {
    std::size_t from = 0;
    while (from <= value.size()) {
        const std::size_t end = std::min(value.find(';', from), value.size());
        const std::string one(trimmed(std::string_view(value).substr(from, end - from)));
        from = end + 1;
        if (one.empty()) continue;
        const std::size_t bar = one.find('|');
        SessionEvent event{sample.time_s, sample.frame, one.substr(0, bar), ""};
        if (bar != std::string::npos) event.detail = one.substr(bar + 1);
        // An event that did not fall on its frame carries its own time.
        double time_s = 0;
        if (parse_number(detail_value(event.detail, "t"), time_s)) event.time_s = time_s;
        to.push_back(std::move(event));
    }
}

// Reads "force_n=3.2 pressure_kpa=8 vein_open=0.4". A word that is missing or not a number leaves
// its value as it is.
bool read_press(const std::string& text, PressSample& to) {
    const auto number = [&](const char* key, double& value) {
        double read = 0;
        if (parse_number(detail_value(text, key), read) && std::isfinite(read)) value = read;
    };
    number("force_n", to.force_n);
    number("pressure_kpa", to.pressure_kpa);
    number("vein_open", to.vein_open);
    return true;
}

std::string press_text(const PressSample& press) {
    std::string text = "force_n=" + number_text(press.force_n, 6);
    if (press.force_n > 0) text += " pressure_kpa=" + number_text(press.pressure_kpa, 6);
    if (press.vein_open >= 0) text += " vein_open=" + number_text(press.vein_open, 6);
    return text;
}

// The label as one word of such a text.
std::string word_of(std::string label) {
    for (char& c : label) {
        if (std::string(" =,;|").find(c) != std::string::npos) c = '_';
    }
    return label;
}

// Reads "coloured=NAME,NAME", or "gate=NAME fill=0.9 angle_deg=52 cursor_deg=50 psv_cm_s=78 ...".
bool read_doppler(const std::string& text, DopplerSample& to) {
    const auto number = [&](const char* key, double& value) {
        double read = 0;
        if (parse_number(detail_value(text, key), read) && std::isfinite(read)) value = read;
    };
    std::string names = detail_value(text, "coloured");
    while (!names.empty()) {
        const std::size_t end = std::min(names.find(','), names.size());
        if (end > 0) to.coloured.push_back(names.substr(0, end));
        names.erase(0, end + 1);
    }
    to.gate = detail_value(text, "gate");
    number("fill", to.gate_fill);
    number("angle_deg", to.angle_deg);
    number("cursor_deg", to.cursor_deg);
    number("psv_cm_s", to.psv_cm_s);
    number("true_psv_cm_s", to.true_psv_cm_s);
    double beats = 0;
    number("beats", beats);
    to.beats = static_cast<int>(std::clamp(beats, 0.0, 1e6));
    return true;
}

std::string doppler_text(const DopplerSample& doppler) {
    std::string text;
    for (const std::string& name : doppler.coloured)
        text += (text.empty() ? "coloured=" : ",") + word_of(name);
    if (doppler.gate.empty()) return text.empty() ? "coloured=" : text;
    text += (text.empty() ? "gate=" : " gate=") + word_of(doppler.gate);
    text += " fill=" + number_text(doppler.gate_fill, 4);
    text += " angle_deg=" + number_text(doppler.angle_deg, 5);
    text += " cursor_deg=" + number_text(doppler.cursor_deg, 5);
    if (doppler.beats == 0) return text;
    text += " psv_cm_s=" + number_text(doppler.psv_cm_s, 6);
    text += " true_psv_cm_s=" + number_text(doppler.true_psv_cm_s, 6);
    return text + " beats=" + std::to_string(doppler.beats);
}

void read_age(const std::string& text, double& to) {
    double read = 0;
    if (parse_number(text, read) && read >= 0 && read < 3600) to = read;
}

// The rotation of the needle's own frame that makes its axis z.
Rigid z_along(Vector3 axis) {
    const Vector3 z = normalized(axis);
    if (z == Vector3{0, 0, 1}) return {};
    const Vector3 x = any_perpendicular(z);
    return {Matrix3::from_columns(x, cross(z, x), z), {}};
}

}  // namespace

std::string detail_value(const std::string& detail, const std::string& key) {
    std::size_t from = 0;
    while (from < detail.size()) {
        const std::size_t end = std::min(detail.find(' ', from), detail.size());
        const std::size_t equal = detail.find('=', from);
        if (equal != std::string::npos && equal < end &&
            detail.compare(from, equal - from, key) == 0 && equal - from == key.size()) {
            return detail.substr(equal + 1, end - equal - 1);
        }
        from = end + 1;
    }
    return {};
}

SessionNames guess_names(const Sequence& sequence) {
    SessionNames names;
    if (sequence.transform_index(kProbeTransform) >= 0 ||
        sequence.transform_index(kNeedleTransform) >= 0) {
        if (sequence.transform_index(kProbeTransform) < 0) names.probe.clear();
        if (sequence.transform_index(kNeedleTransform) < 0) names.needle.clear();
        return names;
    }
    const auto name_of = [&](ToolRole role) {
        const int found = find_tool(sequence, role);
        if (found < 0) return std::string();
        const std::string& tool = sequence.transforms[static_cast<std::size_t>(found)];
        const int reference = find_reference(sequence, tool);
        if (reference < 0) return tool;
        const std::string& base = sequence.transforms[static_cast<std::size_t>(reference)];
        return std::string(split_transform_name(tool).from) + "To" +
               std::string(split_transform_name(base).from);
    };
    names.probe = name_of(ToolRole::probe);
    names.needle = name_of(ToolRole::needle);
    return names;
}

Result<Session> session_from_sequence(const Sequence& sequence,
                                      const SessionNames& names,
                                      const std::string& where) {
    Session session;
    for (const SequenceField& field : sequence.fields) {
        for (const HeaderField& known : kHeaderFields) {
            if (field.name == known.name) session.header.*known.value = field.value;
        }
    }
    const auto index_of = [&](const std::string& name) { return sequence.transform_index(name); };
    const int probe = names.probe.empty() ? -1 : index_of(names.probe);
    const int needle = names.needle.empty() ? -1 : index_of(names.needle);
    const int drawn = names.drawn.empty() ? -1 : index_of(names.drawn);
    for (const auto& [name, index] :
         {std::pair(names.probe, probe), std::pair(names.needle, needle)}) {
        if (name.empty() || index >= 0) continue;
        Sequence composed;  // without the images
        composed.transforms = sequence.transforms;
        composed.frames = sequence.frames;
        composed.fields = sequence.fields;
        composed.notes = sequence.notes;
        const TransformName wanted = split_transform_name(name);
        Message said;
        if (compose_transform(composed, wanted.from, wanted.to, &said) >= 0) {
            composed.notes.push_back(said);
            return session_from_sequence(composed, names, where);
        }
        std::string known;
        for (const std::string& t : sequence.transforms) known += (known.empty() ? "" : ", ") + t;
        return Error{"has no transform '" + name + "'", where,
                     known.empty() ? "it has none" : "it has " + known};
    }
    if (in_two_frames(names.probe, names.needle)) {
        Sequence in_one = sequence;
        SessionNames there = names;
        SONOCASE_TRY_DONE(bring_to_one_frame(in_one, there.probe, there.needle, where));
        if (there.drawn == names.needle) there.drawn = there.needle;
        return session_from_sequence(in_one, there, where);
    }
    session.notes = sequence.notes;
    const Rigid turn = z_along(names.needle_axis);
    bool any = false;
    session.samples.reserve(sequence.frames.size());
    for (const SequenceFrame& frame : sequence.frames) {
        SessionSample sample;
        sample.time_s = frame.timestamp_s;
        sample.frame = frame.number;
        const auto pose = [&](int index, Rigid& to) {
            if (index < 0) return false;
            const SequencePose& from = frame.poses[index];
            const auto rigid = rigid_from_matrix(from.to_from);
            if (!from.ok || !rigid) return false;
            to = *rigid;
            return true;
        };
        sample.probe_ok = pose(probe, sample.mannequin_from_probe);
        sample.needle_ok = pose(needle, sample.mannequin_from_needle);
        if (sample.needle_ok) sample.mannequin_from_needle = sample.mannequin_from_needle * turn;
        if (!pose(drawn, sample.mannequin_from_drawn)) {
            sample.mannequin_from_drawn = sample.mannequin_from_needle;
        }
        for (const SequenceField& field : frame.fields) {
            if (field.name == kSettingsField) sample.settings = field.value;
            if (field.name == kPressField) sample.has_press = read_press(field.value, sample.press);
            if (field.name == kDopplerField)
                sample.has_doppler = read_doppler(field.value, sample.doppler);
            if (field.name == kProbeAgeField) read_age(field.value, sample.probe_age_s);
            if (field.name == kNeedleAgeField) read_age(field.value, sample.needle_age_s);
            if (field.name == kUnseenField) sample.unseen = field.value == "1";
            if (field.name == kActField) sample.acts = acts_of(field.value);
            if (field.name == kEventField) read_events(field.value, sample, session.events);
        }
        any = any || sample.probe_ok || sample.needle_ok;
        session.samples.push_back(std::move(sample));
    }
    if (names.probe.empty() && names.needle.empty() && !sequence.transforms.empty()) {
        for (const std::string& name : sequence.transforms)
            session.no_pose += (session.no_pose.empty() ? "" : ", ") + name;
        session.no_pose += " name neither; say which is which, as with --probe and --needle";
    }
    for (const int index : {probe, needle}) {
        if (any || index < 0) continue;
        const std::string why = why_no_pose(sequence, index);
        if (!why.empty())
            session.no_pose += (session.no_pose.empty() ? "of " : "; of ") +
                               sequence.transforms[static_cast<std::size_t>(index)] + " " + why;
    }
    return session;
}

SequenceFrame frame_from_sample(const SessionSample& sample,
                                const std::vector<SessionEvent>& events) {
    SequenceFrame frame;
    frame.number = sample.frame;
    frame.timestamp_s = sample.time_s;
    frame.unfiltered_timestamp_s = sample.time_s;
    frame.poses = {{sample.probe_ok, matrix_from_rigid(sample.mannequin_from_probe)},
                   {sample.needle_ok, matrix_from_rigid(sample.mannequin_from_needle)},
                   {sample.needle_ok, matrix_from_rigid(sample.mannequin_from_drawn)}};
    if (sample.probe_ok && sample.probe_age_s > kHeldS)
        frame.fields.push_back({kProbeAgeField, number_text(sample.probe_age_s, 4)});
    if (sample.needle_ok && sample.needle_age_s > kHeldS)
        frame.fields.push_back({kNeedleAgeField, number_text(sample.needle_age_s, 4)});
    if (sample.unseen) frame.fields.push_back({kUnseenField, "1"});
    if (!sample.settings.empty()) frame.fields.push_back({kSettingsField, sample.settings});
    if (sample.has_press) frame.fields.push_back({kPressField, press_text(sample.press)});
    if (sample.has_doppler) frame.fields.push_back({kDopplerField, doppler_text(sample.doppler)});
    if (sample.acts.count > 0) frame.fields.push_back({kActField, acts_text(sample.acts)});
    std::string text;
    for (const SessionEvent& event : events) {
        if (!text.empty()) text += ";";
        text += without(event.name, ";|");
        std::string detail = without(event.detail, ";|");
        if (event.time_s != sample.time_s && detail_value(detail, "t").empty()) {
            detail += (detail.empty() ? "t=" : " t=") + number_text(event.time_s);
        }
        if (!detail.empty()) text += "|" + detail;
    }
    if (!text.empty()) frame.fields.push_back({kEventField, text});
    return frame;
}

std::vector<SequenceField> fields_from_header(const SessionHeader& header) {
    std::vector<SequenceField> fields{{"SonocaseSession", "1"}};
    for (const HeaderField& field : kHeaderFields) {
        if (!(header.*field.value).empty()) fields.push_back({field.name, header.*field.value});
    }
    return fields;
}

std::string trainee_in_header(std::string_view start) {
    start = start.substr(0, start.find("\nSeq_Frame"));
    if (start.find("\nSonocaseSession = 1\n") == std::string_view::npos) return {};
    constexpr std::string_view kName = "\nSonocaseTrainee = ";
    const std::size_t at = start.find(kName);
    if (at == std::string_view::npos) return {};
    start.remove_prefix(at + kName.size());
    return std::string(start.substr(0, start.find('\n')));
}

std::uint64_t attempt_seed(const SessionHeader& header) {
    const std::string text = detail_value(header.attempt, "seed");
    std::uint64_t seed = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
    return error == std::errc{} && end == text.data() + text.size() ? seed : 0;
}

Status check_session(const Session& session, const std::string& where) {
    constexpr double kMetres = 10;  // no torso is that small in mm or that large in m
    if (session.samples.empty()) return Done{};
    long poses = 0;
    double farthest = 0;
    double before = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < session.samples.size(); ++i) {
        const SessionSample& s = session.samples[i];
        if (!std::isfinite(s.time_s) || s.time_s < before)
            return Error{"time stamps do not rise at frame " + std::to_string(i + 1), where,
                         "expected frames in the order of their time stamps, in seconds"};
        before = s.time_s;
        for (const auto& [ok, pose] : {std::pair{s.probe_ok, &s.mannequin_from_probe},
                                       {s.needle_ok, &s.mannequin_from_needle}}) {
            if (!ok) continue;
            ++poses;
            farthest = std::max(farthest, norm(pose->translation));
        }
    }
    if (poses == 0)
        return Error{"none of " + std::to_string(session.samples.size()) +
                         " frames has a pose of probe or needle that counts" +
                         (session.no_pose.empty() ? "" : ": " + session.no_pose),
                     where,
                     "expected rotations without scale or mirror, places in mm, and status OK"};
    std::vector<double> probe_times, needle_times;
    for (const SessionSample& s : session.samples) {
        if (s.probe_ok) probe_times.push_back(s.time_s);
        if (s.needle_ok) needle_times.push_back(s.time_s);
    }
    SONOCASE_TRY_DONE(
        check_times(probe_times.size() >= needle_times.size() ? probe_times : needle_times, where));
    if (poses > 10 && farthest < kMetres)
        return Error{
            "no pose lies farther than " + number_text(farthest, 3) + " mm from the origin", where,
            "expected millimetres; these look like metres: multiply them by 1000"};
    return Done{};
}

Sequence sequence_from_session(const Session& session) {
    Sequence sequence;
    sequence.transforms = {kProbeTransform, kNeedleTransform, kDrawnTransform};
    sequence.fields = fields_from_header(session.header);
    std::size_t next = 0;
    for (std::size_t i = 0; i < session.samples.size(); ++i) {
        const SessionSample& sample = session.samples[i];
        const bool last = i + 1 == session.samples.size();
        std::vector<SessionEvent> events;
        while (next < session.events.size() &&
               (last || session.events[next].time_s < session.samples[i + 1].time_s)) {
            events.push_back(session.events[next++]);
        }
        sequence.frames.push_back(frame_from_sample(sample, events));
    }
    return sequence;
}

}  // namespace sonocase
