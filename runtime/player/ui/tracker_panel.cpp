// SPDX-License-Identifier: Apache-2.0

// The tracker: which one, how it does, its sensors and their calibrations.
#include <imgui.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "runtime/player/app/case_cards.h"
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

// A list that opens, its rows as far apart as fingers need.
bool begin_list(const char* id, const char* shown) {
    ImGui::SetNextItemWidth(-1);
    const ImGuiStyle& style = ImGui::GetStyle();
    ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {style.ItemSpacing.x, style.FramePadding.y});
    if (ImGui::BeginCombo(id, shown, ImGuiComboFlags_HeightLargest)) return true;
    ImGui::PopStyleVar();
    return false;
}
void end_list() {
    ImGui::EndCombo();
    ImGui::PopStyleVar();
}

// A live camera and the file of its lens, of a specification: "camera:0,camera.json".
struct LiveCamera {
    std::string device;  // "camera:0", "camera"
    std::string lens;    // empty: not known
    std::string spec() const {
        if (lens.empty()) return device;
        return device + (device.find(':') == std::string::npos ? ":" : ",") + lens;
    }
};
std::optional<LiveCamera> live_camera(const std::string& spec) {
    const std::string kind = "camera";
    if (spec == kind) return LiveCamera{spec, ""};
    if (spec.rfind(kind + ":", 0) != 0) return {};
    const std::string argument = spec.substr(kind.size() + 1);
    const std::size_t digits = std::min(argument.find_first_not_of("0123456789"), argument.size());
    if (digits == argument.size()) return LiveCamera{spec, ""};
    if (digits > 0 && argument[digits] == ',')
        return LiveCamera{kind + ":" + argument.substr(0, digits), argument.substr(digits + 1)};
    if (argument.ends_with(".json") && argument.find(',') == std::string::npos)
        return LiveCamera{kind, argument};
    return {};  // a video
}

// A lens was measured of one camera: its file comes back with that camera and with no other.
std::map<std::string, std::string>& lens_of_camera() {
    static std::map<std::string, std::string> files;
    return files;
}

// The lens of the camera in use: one of the files beside the cases, or not known.
std::optional<std::string> draw_lens(const std::string& spec) {
    const std::optional<LiveCamera> camera = live_camera(spec);
    if (!camera) return {};
    if (!camera->lens.empty()) lens_of_camera()[camera->device] = camera->lens;
    std::optional<std::string> chosen;
    const auto choose = [&](const std::string& lens) {
        lens_of_camera()[camera->device] = lens;
        chosen = LiveCamera{camera->device, lens}.spec();
    };
    small_dim(tr("Lens and markers, as measured"));
    const char* unknown = tr("Not measured: 65 degrees across");
    if (!begin_list("##lens", camera->lens.empty() ? unknown : camera->lens.c_str())) return chosen;
    static std::vector<std::string> files;
    if (ImGui::IsWindowAppearing()) {
        files.clear();
        for (const auto& file : files_beside_cases("camera.json"))
            files.push_back(file.lexically_normal().string());
    }
    if (ImGui::Selectable(unknown, camera->lens.empty())) choose("");
    for (const std::string& file : files)
        if (ImGui::Selectable(file.c_str(), camera->lens == file)) choose(file);
    if (files.empty()) ImGui::TextDisabled("%s", tr("No camera.json lies beside the cases"));
    end_list();
    if (chosen == spec) chosen.reset();
    return chosen;
}

std::optional<std::string> draw_choice(const std::string& spec, const std::vector<Sweep>& sweeps) {
    std::optional<std::string> chosen;
    // Devices are looked for when the panel or its list opens.
    static std::vector<std::vector<TrackerChoice>> devices;
    const auto look = [&] {
        devices.clear();
        for (const TrackerKind& kind : tracker_kinds())
            devices.push_back(kind.choices ? kind.choices() : std::vector<TrackerChoice>());
    };
    if (ImGui::IsWindowAppearing() || devices.empty()) look();
    const std::optional<LiveCamera> camera = live_camera(spec);
    std::string shown = camera ? camera->device : spec;
    for (std::size_t k = 0; k < tracker_kinds().size(); ++k) {
        const TrackerKind& kind = tracker_kinds()[k];
        if (kind.name && spec == kind.panel_spec) shown = tr(kind.name);
        for (const TrackerChoice& device : devices[k])
            if (shown == device.spec) shown = device.name;
    }
    if (!begin_list("##tracker", shown.c_str())) return chosen;
    if (ImGui::IsWindowAppearing()) look();
    for (std::size_t k = 0; k < tracker_kinds().size(); ++k) {
        const TrackerKind& kind = tracker_kinds()[k];
        if (kind.name && ImGui::Selectable(tr(kind.name), spec == kind.panel_spec))
            chosen = kind.panel_spec;
        for (const TrackerChoice& device : devices[k]) {
            const std::string wanted =
                LiveCamera{device.spec, lens_of_camera()[device.spec]}.spec();
            if (ImGui::Selectable(("    " + device.name + "##" + device.spec).c_str(),
                                  camera && camera->device == device.spec))
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
    end_list();
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
    if (const auto lens = draw_lens(input.spec)) chosen = lens;
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
