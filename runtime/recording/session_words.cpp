// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/session_words.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "formats/base/clinical_names.h"
#include "formats/base/digest.h"
#include "formats/recording/session.h"
#include "formats/text/number_text.h"

namespace sonocase::runtime::inline recording {
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
        std::to_string(render.height_px) + " seed=" + std::to_string(render.seed) +
        " needle=" + exercise.needle.make->name;
    return header;
}

namespace {

constexpr std::array<const char*, 5> kModes{"off", "colour", "power", "spectral", "m_mode"};

// Every number of the settings by its key, for writing and reading.
template <class Settings, class Visit>
void each_number(Settings& d, Visit visit) {
    visit("box_left", d.box_left);
    visit("box_right", d.box_right);
    visit("box_top_mm", d.box_top_mm);
    visit("box_bottom_mm", d.box_bottom_mm);
    visit("steer_deg", d.steer_deg);
    visit("scale_cm_s", d.scale_cm_s);
    visit("spectral_scale_cm_s", d.spectral_scale_cm_s);
    visit("diameter_mm", d.diameter_mm);
    visit("baseline", d.baseline);
    visit("wall_filter", d.wall_filter);
    visit("doppler_gain_db", d.gain_db);
    visit("priority", d.priority);
    visit("gate_line", d.gate_line);
    visit("gate_depth_mm", d.gate_depth_mm);
    visit("gate_mm", d.gate_mm);
    visit("angle_deg", d.angle_deg);
}
template <class Settings, class Visit>
void each_count(Settings& d, Visit visit) {
    visit("ensemble", d.ensemble);
    visit("persistence", d.persistence);
    visit("gate_points", d.gate_points);
}

// Only what differs from the settings that the player begins with.
std::string doppler_text(const DopplerSettings& d) {
    std::string out = std::string(" doppler=") + kModes[static_cast<std::size_t>(d.mode)];
    std::vector<double> usual;
    const DopplerSettings begin;
    each_number(begin, [&](const char*, const double& value) { usual.push_back(value); });
    std::size_t i = 0;
    each_number(d, [&](const char* key, const double& value) {
        if (value != usual[i++]) out += std::string(" ") + key + "=" + number_text(value);
    });
    each_count(d, [&](const char* key, const int& value) {
        out += std::string(" ") + key + "=" + std::to_string(value);
    });
    return d.invert ? out + " invert=1" : out;
}

void apply_doppler(const std::string& text, DopplerSettings& settings) {
    DopplerSettings d;
    const std::string mode = detail_value(text, "doppler");
    for (std::size_t m = 0; m < kModes.size(); ++m) {
        if (mode == kModes[m]) d.mode = static_cast<DopplerMode>(m);
    }
    each_number(d, [&](const char* key, double& to) {
        double value = 0;
        if (parse_number(detail_value(text, key), value) && std::isfinite(value)) to = value;
    });
    each_count(d, [&](const char* key, int& to) {
        double value = 0;
        if (parse_number(detail_value(text, key), value) && std::abs(value) < 1e6)
            to = static_cast<int>(value);
    });
    d.invert = detail_value(text, "invert") == "1";
    settings = d;
}

}  // namespace

std::string settings_text(const ImageSettings& settings) {
    std::string out = "gain_db=" + number_text(settings.gain_db);
    out += " dynamic_range_db=" + number_text(settings.dynamic_range_db);
    out += " tgc_db=";
    for (std::size_t i = 0; i < settings.tgc_db.size(); ++i) {
        out += (i ? "," : "") + number_text(settings.tgc_db[i]);
    }
    out += std::string(" flip=") + (settings.flip_left_right ? "1" : "0");
    // Older recordings have no such key. It is written only where it is used.
    if (settings.press_mm > 0) out += " press_mm=" + number_text(settings.press_mm);
    return settings.doppler.mode == DopplerMode::off ? out : out + doppler_text(settings.doppler);
}

void apply_settings_text(const std::string& text, ImageSettings& settings) {
    if (text.empty()) return;  // unchanged
    const auto number = [](std::string_view word, double& to) {
        double value = 0;
        if (parse_number(word, value) && std::isfinite(value)) to = value;
    };
    number(detail_value(text, "gain_db"), settings.gain_db);
    number(detail_value(text, "dynamic_range_db"), settings.dynamic_range_db);
    std::string tgc = detail_value(text, "tgc_db");
    for (std::size_t i = 0, from = 0; i < settings.tgc_db.size() && from < tgc.size(); ++i) {
        const std::size_t end = std::min(tgc.find(',', from), tgc.size());
        number(std::string_view(tgc).substr(from, end - from), settings.tgc_db[i]);
        from = end + 1;
    }
    const std::string flip = detail_value(text, "flip");
    if (!flip.empty()) settings.flip_left_right = flip == "1";
    // A text without this key says that nobody presses.
    settings.press_mm = 0;
    number(detail_value(text, "press_mm"), settings.press_mm);
    apply_doppler(text, settings.doppler);
}

DopplerSample doppler_sample(const DopplerReport& report, const std::vector<Label>& labels) {
    const auto name = [&](int label) {
        return label >= 0 && label < static_cast<int>(labels.size()) ? labels[label].name
                                                                     : std::string();
    };
    DopplerSample sample;
    for (const int label : report.coloured)
        if (!name(label).empty()) sample.coloured.push_back(name(label));
    sample.gate = name(report.gate_label);
    sample.gate_fill = report.gate_fill;
    sample.angle_deg = report.angle_deg;
    sample.cursor_deg = report.cursor_deg;
    sample.psv_cm_s = report.psv_cm_s;
    sample.true_psv_cm_s = report.true_psv_cm_s;
    sample.beats = report.beats;
    return sample;
}

Message event_words(const LiveEvent& event,
                    const Exercise& exercise,
                    const std::vector<Label>& labels) {
    const auto target = [&]() -> Message {
        const auto i = static_cast<std::size_t>(event.index);
        return event.index >= 0 && i < exercise.targets.size() && !exercise.targets[i].name.empty()
                   ? Message(exercise.targets[i].name)
                   : Message("target {}", {std::to_string(event.index + 1)});
    };
    const auto label = [&]() -> Message {
        const auto i = static_cast<std::size_t>(event.index);
        return event.index >= 0 && i < labels.size() ? clinical_name(labels[i].name)
                                                     : "a structure";
    };
    char number[32];
    std::snprintf(number, sizeof number, "%.0f", event.value);
    switch (event.kind) {
        case LiveEventKind::needle_entry: return {"Insertion {}", {std::to_string(event.index)}};
        case LiveEventKind::needle_exit: return {"Needle out, was {} mm deep", {number}};
        case LiveEventKind::target_hit: return {"Reached: {}", {target()}};
        case LiveEventKind::target_scanned: return {"Seen: {}", {target()}};
        case LiveEventKind::no_go_contact: return {"Touched: {}", {label()}};
        case LiveEventKind::no_go_left: return {"Left: {}", {label()}};
        case LiveEventKind::needle_lost: return "Needle lost";
        case LiveEventKind::probe_lost: return "Probe lost";
        case LiveEventKind::step_performed: {
            const auto& steps = exercise.procedure.steps;
            const auto i = static_cast<std::size_t>(std::max(event.index, 0));
            return i < steps.size() ? Message("Done: {}", {steps[i].title}) : Message();
        }
        case LiveEventKind::complication: {
            const auto titles = complication_titles();
            const auto i = static_cast<std::size_t>(std::max(event.index, 0));
            return i < titles.size() ? Message(titles[i]) : "Complication";
        }
        default: return {};
    }
}

}  // namespace sonocase::runtime::inline recording
