// SPDX-License-Identifier: Apache-2.0

// The console's rows of the Doppler modes. They change the same settings that `sonoplay --headless
// --mode` takes from its command line.
#include <algorithm>
#include <cmath>
#include <vector>

#include "runtime/player/ui/panels/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

enum class Option { scale, gain, filter, baseline, steer, angle, gate, switches };

std::vector<Option> options_of(DopplerMode mode, const Probe& probe) {
    std::vector<Option> all;
    switch (mode) {
        case DopplerMode::off:
        case DopplerMode::m_mode: return all;
        case DopplerMode::colour:
            all = {Option::switches, Option::scale, Option::gain, Option::filter, Option::baseline};
            break;
        case DopplerMode::power: all = {Option::switches, Option::gain, Option::filter}; break;
        case DopplerMode::spectral:
            all = {Option::switches, Option::scale,  Option::angle,   Option::gate,
                   Option::gain,     Option::filter, Option::baseline};
            break;
    }
    if (probe.shape == ProbeShape::linear) all.insert(all.begin() + 1, Option::steer);
    return all;
}

void draw_switches(Ui& ui,
                   const Box& box,
                   DopplerSettings& d,
                   const ConsoleInput& input,
                   ConsoleRequest& request) {
    const bool spectral = d.mode == DopplerMode::spectral;
    Look look;
    look.enabled = input.enabled;
    look.icon = Icon::target;
    look.tip = "Box and gate to the widest vessel of the plane";
    request.aim = ui.button("aim", box.column(0, 3, 4), "", look);
    look.icon = Icon::flip;
    look.chosen = d.invert;
    look.tip = "Towards and away exchanged";
    if (ui.button("invert", box.column(1, 3, 4), "", look)) d.invert = !d.invert;
    look.icon = Icon::none;
    if (spectral) {
        look.icon = Icon::sound;
        look.chosen = input.sound;
        look.tip = "Sound of the flow (F4)";
        request.toggle_sound = ui.button("sound", box.column(2, 3, 4), "", look);
        return;
    }
    look.chosen = d.mode == DopplerMode::power;
    look.tip = "Power Doppler: how much moves, not how fast";
    if (ui.button("power", box.column(2, 3, 4), tr("Power"), look))
        request.mode = look.chosen ? DopplerMode::colour : DopplerMode::power;
}

}  // namespace

int doppler_options(DopplerMode mode, const Probe& probe) {
    return static_cast<int>(options_of(mode, probe).size());
}

void draw_doppler_option(Ui& ui,
                         const Box& box,
                         int option,
                         DopplerSettings& d,
                         const ConsoleInput& input,
                         ConsoleRequest& request) {
    const std::vector<Option> all = options_of(d.mode, input.probe);
    const DopplerSettings normal;
    const bool on = input.enabled;
    const auto at = static_cast<std::size_t>(option);
    if (at >= all.size()) return;
    const auto slider = [&](const char* id, const char* name, double& value, double low,
                            double high, double middle, double step, const std::string& shown,
                            const char* tip) {
        if (ui.slider(id, box, tr(name), value, low, high, middle, shown, tip, on))
            value = std::clamp(std::round(value / step) * step, low, high);
    };
    switch (all[at]) {
        case Option::switches: draw_switches(ui, box, d, input, request); break;
        case Option::scale: {
            const bool spectral = d.mode == DopplerMode::spectral;
            double& scale = spectral ? d.spectral_scale_cm_s : d.scale_cm_s;
            slider("scale", "Scale", scale, 5, spectral ? 300 : 150,
                   spectral ? normal.spectral_scale_cm_s : normal.scale_cm_s, 5,
                   text("%.0f", scale), "Fastest flow before it wraps around (PRF), cm/s");
            break;
        }
        case Option::gain:
            slider("dgain", "Flow gain", d.gain_db, -30, 30, 0, 1, text("%+.0f dB", d.gain_db),
                   "Of the Doppler signal alone");
            break;
        case Option::filter:
            slider("filter", "Filter", d.wall_filter, 0, 0.5, normal.wall_filter, 0.01,
                   text("%.0f %%", 100 * d.wall_filter),
                   "Wall filter: what is slower, part of the scale, is not shown");
            break;
        case Option::baseline:
            slider("baseline", "Zero", d.baseline, -0.9, 0.9, 0, 0.1, text("%+.1f", d.baseline),
                   "Baseline: room for flow towards or away");
            break;
        case Option::steer:
            slider("steer", "Steer", d.steer_deg, -30, 30, 0, 5, text("%+.0f°", d.steer_deg),
                   "Slants the lines, for vessels along the skin");
            break;
        case Option::angle:
            slider("angle", "Angle", d.angle_deg, -80, 80, normal.angle_deg, 1,
                   text("%.0f°", d.angle_deg),
                   "Of the cursor along the vessel; at most 60 for measuring");
            break;
        case Option::gate:
            slider("gate", "Gate", d.gate_mm, 0.5, 20, normal.gate_mm, 0.5,
                   text("%.1f mm", d.gate_mm), "Length of the gate");
            break;
    }
}

}  // namespace sonocase::runtime
