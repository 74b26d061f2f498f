// SPDX-License-Identifier: Apache-2.0

// The machine's console. A mode is a line of kModes; the rows of controls that a Doppler mode has
// of its own change the same settings that `sonoplay --headless --mode` takes from its command
// line.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {

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
    ButtonStyle style;
    style.enabled = input.enabled;
    style.icon = Icon::target;
    style.tip = "Box and gate to the widest vessel of the plane";
    request.aim = ui.button("aim", box.column(0, 3, 4), "", style);
    style.icon = Icon::flip;
    style.chosen = d.invert;
    style.tip = "Towards and away exchanged";
    if (ui.button("invert", box.column(1, 3, 4), "", style)) d.invert = !d.invert;
    style.icon = Icon::none;
    if (spectral) {
        style.icon = Icon::sound;
        style.chosen = input.sound;
        style.tip = "Sound of the flow (F4)";
        request.toggle_sound = ui.button("sound", box.column(2, 3, 4), "", style);
        return;
    }
    style.chosen = d.mode == DopplerMode::power;
    style.tip = "Power Doppler: how much moves, not how fast";
    if (ui.button("power", box.column(2, 3, 4), tr("Power"), style))
        request.mode = style.chosen ? DopplerMode::colour : DopplerMode::power;
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

namespace {

struct Mode {
    const char *name, *tip;
    DopplerMode mode;
};
constexpr Mode kModes[] = {
    {"B", "Grey picture (Shift + 1)", DopplerMode::off},
    {"Colour", "Flow towards and away (Shift + 2)", DopplerMode::colour},
    {"PW", "Speed of flow at one place (Shift + 3)", DopplerMode::spectral},
    {"M", "Movement along one line (Shift + 4)", DopplerMode::m_mode},
};

constexpr Icon kPresetIcons[] = {Icon::liver, Icon::kidney, Icon::vessel, Icon::deep};

void draw_presets(Ui& ui, const Box& box, const ConsoleInput& input, ConsoleRequest& request) {
    int i = 0;
    for (const ImagePreset& preset : kPresets) {
        ButtonStyle style;
        style.tile = true;
        style.enabled = input.enabled;
        style.icon = kPresetIcons[i];
        style.tip = preset.tip;
        style.chosen = std::abs(input.image.depth_mm - preset.depth_mm) < 0.5 &&
                       std::abs(input.image.focus_mm - preset.focus_mm) < 0.5;
        if (ui.button(preset.name, box.column(i++, 4, 8), tr(preset.name), style))
            request.preset = &preset;
    }
}

void draw_modes(Ui& ui, const Box& box, DopplerMode now, bool enabled, ConsoleRequest& request) {
    int i = 0;
    for (const Mode& mode : kModes) {
        ButtonStyle style;
        style.chosen =
            now == mode.mode || (now == DopplerMode::power && mode.mode == DopplerMode::colour);
        style.enabled = enabled;
        style.tip = mode.tip;
        if (ui.button(mode.name, box.column(i++, static_cast<int>(std::size(kModes)), 4),
                      tr(mode.name), style))
            request.mode = mode.mode;
    }
}

void draw_gain(Ui& ui, Box box, ImageSettings& image, bool enabled, ConsoleRequest& request) {
    ButtonStyle style;
    style.enabled = enabled;
    style.tip = "Sets gain and depth gain once";
    const Box automatic = box.take_right(ui.width(tr("Auto"), Type::body) + 22, 8);
    char value[24];
    std::snprintf(value, sizeof value, "%+.0f dB", image.gain_db);
    const int step = ui.stepper("gain", box, tr("Gain"), image.gain_db == 0 ? "0 dB" : value,
                                "Brightness of all echoes (- and =)", enabled);
    if (step != 0) image.gain_db = std::clamp(std::round(image.gain_db) + step, -30.0, 30.0);
    request.adjust_gain = ui.button("auto", automatic, tr("Auto"), style);
}

// One pad: the mouse that is held sets the slider of the row that it is on.
void draw_tgc(
    Ui& ui, const Box& box, float row_height, ImageSettings& image, double depth_mm, bool enabled) {
    Box heading = tgc_heading(box);
    ButtonStyle style;
    style.link = true;
    style.enabled = enabled;
    style.tip = "All sliders to the middle (0)";
    const Box level = heading.take_right(ui.width(tr("Level"), Type::body) + 10);
    if (ui.button("level", level, tr("Level"), style)) image.tgc_db = {};
    ui.text(heading, tr("Depth gain (TGC)"), Type::body, colour::kDim);
    for (int i = 0; i < kTgcRows; ++i) {
        Box row = tgc_row(box, row_height, i);
        double& gain_db = image.tgc_db[i];
        char words[24];
        std::snprintf(words, sizeof words, "%.1f cm", depth_mm / 80 * (i + 0.5));
        ui.text(row.take_left(64), words, Type::small, colour::kDim);
        std::snprintf(words, sizeof words, "%+.0f", gain_db);
        ui.text(row.take_right(34), std::abs(gain_db) < 0.5 ? "0" : words, Type::small,
                colour::kDim, Align::right);
        char id[16];
        std::snprintf(id, sizeof id, "tgc%d", i);
        ui.groove(id, row, gain_db, -20, 20, 0, "Brightness at this depth; double click: 0",
                  enabled);
    }
}

void draw_marks(Ui& ui, const Box& box, const ConsoleInput& input) {
    PictureMarks& marks = input.marks;
    ButtonStyle style;
    style.tile = true;
    style.enabled = input.enabled;
    style.icon = Icon::zoom;
    style.chosen = marks.zoom.on() || marks.tool == MarkTool::zoom;
    style.tip = "Drag a box in the picture; again: back (Y)";
    if (ui.button("zoom", box.column(0, 3, 8), tr("Zoom"), style)) toggle_zoom(marks);
    style.icon = Icon::text;
    style.chosen = marks.tool == MarkTool::label;
    style.tip = "Words on the picture: click and type (T)";
    if (ui.button("label", box.column(1, 3, 8), tr("Label"), style))
        marks.tool = style.chosen ? MarkTool::none : MarkTool::label;
    style.icon = Icon::body;
    style.chosen = marks.body;
    style.tip = "Body mark; click in it where the probe is";
    if (ui.button("body", box.column(2, 3, 8), tr("Body mark"), style)) marks.body = !marks.body;
}

void draw_tools(Ui& ui,
                const Box& box,
                ImageSettings& image,
                const ConsoleInput& input,
                ConsoleRequest& request) {
    ButtonStyle style;
    style.tile = true;
    style.enabled = input.enabled;
    style.icon = Icon::measure;
    style.chosen = input.measuring;
    style.tip = "Distance: two clicks in the picture (M)";
    if (ui.button("measure", box.column(0, 3, 8), tr("Measure"), style))
        input.measuring = !input.measuring;
    style.icon = Icon::close;
    style.chosen = false;
    style.tip = "Removes the distances (C)";
    request.clear = ui.button("clear", box.column(1, 3, 8), tr("Clear"), style);
    style.icon = Icon::flip;
    style.chosen = image.flip_left_right;
    style.tip = "Left and right (F)";
    if (ui.button("flip", box.column(2, 3, 8), tr("Flip"), style))
        image.flip_left_right = !image.flip_left_right;
}

}  // namespace

ConsoleRequest draw_console(Ui& ui,
                            const Box& card,
                            ScanControls& controls,
                            const ConsoleInput& input) {
    ConsoleRequest request;
    ImageSettings& image = controls.settings;
    ui.card(card, "console");
    const ConsoleLayout layout = console_layout(card.inset(12), static_cast<int>(std::size(kModes)),
                                                doppler_options(image.doppler.mode, input.probe));
    const int pages = static_cast<int>(layout.pages.size());
    input.page = std::clamp(input.page, 0, pages - 1);
    const bool on = input.enabled;
    for (const ConsolePlace& place : layout.pages[input.page]) {
        const Box& box = place.box;
        switch (place.item) {
            case ConsoleItem::presets: draw_presets(ui, box, input, request); break;
            case ConsoleItem::modes: draw_modes(ui, box, image.doppler.mode, on, request); break;
            case ConsoleItem::option:
                draw_doppler_option(ui, box, place.option, image.doppler, input, request);
                break;
            case ConsoleItem::depth:
                request.depth_by_mm = 10 * ui.stepper("depth", box, tr("Depth"),
                                                      text("%.0f cm", input.image.depth_mm / 10),
                                                      "How deep the picture reaches ([ and ])", on);
                break;
            case ConsoleItem::focus:
                request.focus_by_mm = 5 * ui.stepper("focus", box, tr("Focus"),
                                                     text("%.1f cm", input.image.focus_mm / 10),
                                                     "Depth of the sharpest part (; and ')", on);
                break;
            case ConsoleItem::gain: draw_gain(ui, box, image, on, request); break;
            case ConsoleItem::range:
                ui.slider("range", box, tr("Range"), image.dynamic_range_db, 40, 90, 60,
                          text("%.0f dB", image.dynamic_range_db),
                          "Fewer or more greys (dynamic range)", on);
                break;
            case ConsoleItem::press:
                ui.slider("press", box, tr("Press"), image.press_mm, 0, 40, 0,
                          text("%.0f mm", image.press_mm),
                          "How far the probe presses in (Page Down, Page Up)", on);
                break;
            case ConsoleItem::tgc:
                draw_tgc(ui, box, layout.tgc_row, image, input.image.depth_mm, on);
                break;
            case ConsoleItem::marks: draw_marks(ui, box, input); break;
            case ConsoleItem::tools: draw_tools(ui, box, image, input, request); break;
        }
    }
    if (pages > 1) {
        const std::string words = filled("%s  %d/%d", tr("More"), input.page + 1, pages);
        ButtonStyle style;
        style.icon = Icon::next;
        style.tip = "The other controls";
        if (ui.button("more", layout.more, words, style)) input.page = (input.page + 1) % pages;
    }
    return request;
}

}  // namespace sonocase::runtime::inline player_ui
