// SPDX-License-Identifier: Apache-2.0

// The tracker: which one, how it does, its sensors and their calibrations.
#include <imgui.h>

#include <cstdio>
#include <map>

#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"
#include "runtime/tracking/devices/make_tracker.h"

namespace sonocase::runtime::inline player_ui {
namespace {

void sensor_row(const char* tool, const SensorReading* reading, SensorVerdict verdict) {
    unsigned packed = colour::kGood;
    const char* word = "ok";
    switch (verdict) {
        case SensorVerdict::fine: break;
        case SensorVerdict::absent: packed = colour::kFaint, word = "none"; break;
        case SensorVerdict::lost: packed = colour::kBad, word = "out of view"; break;
        case SensorVerdict::stale: packed = colour::kBad, word = "silent"; break;
        case SensorVerdict::frozen: packed = colour::kBad, word = "frozen"; break;
        case SensorVerdict::jumped: packed = colour::kWarn, word = "jumped"; break;
        case SensorVerdict::poor: packed = colour::kWarn, word = "distorted"; break;
    }
    row(tool, tr(word), packed);
    if (reading && verdict != SensorVerdict::absent) {
        const Vector3 t = reading->world_from_sensor.translation;
        ImGui::PushFont(fonts().small);
        ImGui::TextDisabled("  %.1f  %.1f  %.1f mm", t.x, t.y, t.z);
        if (reading->quality >= 0) {
            const std::string words = filled(tr("quality %.0f %%"), 100.0 * reading->quality);
            ImGui::SameLine(ImGui::GetWindowContentRegionMax().x -
                            ImGui::CalcTextSize(words.c_str()).x);
            ImGui::TextDisabled("%s", words.c_str());
        }
        ImGui::PopFont();
    }
    const char* sentence = verdict_sentence(verdict);
    if (*sentence) coloured(packed, tr(sentence));
}

void calibration_row(const char* tool, const std::optional<Calibration>& calibration) {
    if (!calibration) {
        row(tool, tr("none"), colour::kFaint);
        return;
    }
    // 1.5 and 3 mm: what an 18-gauge needle and a target of 5 mm tolerate.
    const double rms = calibration->rms_mm;
    const unsigned packed = rms < 0      ? colour::kText
                            : rms <= 1.5 ? colour::kGood
                            : rms <= 3   ? colour::kWarn
                                         : colour::kBad;
    if (rms < 0) {
        row(tool, tr("not measured"), packed);
    } else {
        row(tool, tr("rms %.2f mm"), rms, packed);
    }
    for (const std::string& warning : calibration->warnings) coloured(colour::kWarn, warning);
}

// Where a recording or script is, and how fast it runs.
void draw_pace(PacedTracker& paced) {
    const double at = paced.at_s(), whole = paced.duration_s();
    const std::string text =
        filled(tr(paced.speed() == 0 ? "%.1f of %.1f s, still" : "%.1f of %.1f s"), at, whole);
    float place = static_cast<float>(at);
    small_dim(tr("Place in the recording, and its speed"));
    ImGui::SetNextItemWidth(-1);
    if (ImGui::SliderFloat("##place", &place, 0, static_cast<float>(whole), text.c_str())) {
        paced.jump(place - at);
    }
    float speed = static_cast<float>(paced.speed());
    ImGui::SetNextItemWidth(-1);
    if (ImGui::SliderFloat("##speed", &speed, 0, 8, tr("%.2fx speed"),
                           ImGuiSliderFlags_Logarithmic)) {
        paced.set_speed(speed);
    }
    if (ImGui::IsItemClicked(1)) paced.set_speed(1);
}

std::optional<std::string> draw_choice(const std::string& spec, const std::vector<Sweep>& sweeps) {
    std::optional<std::string> chosen;
    std::string shown = spec;
    for (const TrackerKind& kind : tracker_kinds()) {
        if (kind.name && spec == kind.panel_spec) shown = tr(kind.name);
    }
    ImGui::SetNextItemWidth(-1);
    if (!ImGui::BeginCombo("##tracker", shown.c_str())) return chosen;
    // Devices are looked for when the list opens.
    static std::vector<std::vector<TrackerChoice>> devices;
    // A lens was measured of one camera: its file comes back with that camera and with no other.
    static std::map<std::string, std::string> with_file;
    if (const std::size_t comma = spec.find(','); comma != std::string::npos)
        with_file[spec.substr(0, comma)] = spec;
    if (ImGui::IsWindowAppearing() || devices.size() != tracker_kinds().size()) {
        devices.clear();
        for (const TrackerKind& kind : tracker_kinds())
            devices.push_back(kind.choices ? kind.choices() : std::vector<TrackerChoice>());
    }
    for (std::size_t k = 0; k < tracker_kinds().size(); ++k) {
        const TrackerKind& kind = tracker_kinds()[k];
        if (kind.name && ImGui::Selectable(tr(kind.name), spec == kind.panel_spec))
            chosen = kind.panel_spec;
        for (const TrackerChoice& device : devices[k]) {
            const auto known = with_file.find(device.spec);
            const std::string& wanted = known == with_file.end() ? device.spec : known->second;
            if (ImGui::Selectable(("    " + device.name + "##" + device.spec).c_str(),
                                  spec == wanted))
                chosen = wanted;
        }
        if (kind.choices && devices[k].empty())
            ImGui::TextDisabled("    %s", tr("No camera is connected"));
    }
    for (const Sweep& sweep : sweeps) {
        const std::string sweep_spec = "sweep:" + sweep.name;
        if (ImGui::Selectable((tr("Script: ") + sweep.name).c_str(), spec == sweep_spec))
            chosen = sweep_spec;
    }
    ImGui::EndCombo();
    return chosen;
}

// Where an OpenIGTLink sender is; the address stays while the program runs.
std::optional<std::string> draw_address(const std::string& spec) {
    static char address[128] = "localhost:18944";
    const std::string prefix = "igtl:";
    small_dim(tr("OpenIGTLink, HOST:PORT"));
    ImGui::SetNextItemWidth(-1);
    const bool entered = ImGui::InputText("##address", address, sizeof address,
                                          ImGuiInputTextFlags_EnterReturnsTrue);
    const float half = 0.5f * (ImGui::GetContentRegionAvail().x - ImGui::GetStyle().ItemSpacing.x);
    const bool pressed = ImGui::Button(tr("Connect"), {half, 0});
    ImGui::SameLine();
    // Waits for the sender instead, at the port alone.
    const bool listens = ImGui::Button(tr("Listen"), {-1, 0});
    if (ImGui::IsItemHovered())
        ImGui::SetTooltip("%s", tr("Waits at this port for a sender that connects"));
    if ((!entered && !pressed && !listens) || !address[0]) return {};
    const std::string given = address;
    const std::string wanted =
        listens ? prefix + "listen:" + given.substr(given.rfind(':') + 1) : prefix + given;
    if (spec == wanted) return {};
    return wanted;
}

void draw_health(const TrackerHealth& health) {
    const bool failed = health.phase == TrackerPhase::failed;
    if (health.phase == TrackerPhase::streaming) {
        if (health.rate_hz > 0) row("Rate", "%.0f Hz", health.rate_hz);
        if (health.late_s >= 0) row("Predicted over", "%.0f ms", 1e3 * health.late_s);
    } else {
        row("State", tr(phase_name(health.phase)), failed ? colour::kBad : colour::kWarn);
    }
    if (!health.message.empty())
        coloured(failed ? colour::kBad : colour::kDim, tr_message(health.message));
    if (health.bad_frames > 0)
        row("Discarded", "%.0f", static_cast<double>(health.bad_frames), colour::kWarn);
}

void draw_calibrations(const Calibrations& calibrations, bool in_mannequin) {
    heading("Calibration");
    if (in_mannequin) {
        row("Probe, needle, mannequin", tr("exact"), colour::kGood);
        return;
    }
    calibration_row("Probe", calibrations.probe);
    calibration_row("Needle", calibrations.needle);
    calibration_row("Mannequin", calibrations.mannequin);
    if (!calibrations.mannequin || !calibrations.probe)
        coloured(colour::kDim, tr("Press F3 to set up."));
}

}  // namespace

std::optional<std::string> draw_tracker_panel(const TrackerPanelInput& input) {
    std::optional<std::string> chosen = draw_choice(input.spec, input.sweeps);
    if (const auto address = draw_address(input.spec)) chosen = address;
    if (input.paced) draw_pace(*input.paced);
    draw_health(input.health);
    const ScanFrame& frame = input.frame;
    const TrackerReading& reading = frame.reading;
    const SensorAssignment assignment = places_of(reading, input.assignment);
    const auto sensor = [&](int index) -> const SensorReading* {
        if (index < 0 || index >= reading.sensor_count) return nullptr;
        return &reading.sensors[index];
    };
    sensor_row("Probe", sensor(assignment.probe), frame.probe_verdict);
    sensor_row("Needle", sensor(assignment.needle), frame.needle_verdict);
    if (assignment.reference >= 0)
        sensor_row("Reference", sensor(assignment.reference), frame.reference_verdict);
    ImGui::Separator();
    draw_calibrations(input.calibrations, reading.in_mannequin);
    return chosen;
}

}  // namespace sonocase::runtime::inline player_ui
