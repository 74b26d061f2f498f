// SPDX-License-Identifier: Apache-2.0

// The machine's console. A mode is a line of kModes; the controls that it has of its own are rows
// of doppler_panel.cpp.
#include <array>
#include <cmath>
#include <cstdio>

#include "runtime/player/ui/layout/console_layout.h"
#include "runtime/player/ui/panels/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
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
        Look look;
        look.tile = true;
        look.enabled = input.enabled;
        look.icon = kPresetIcons[i];
        look.tip = preset.tip;
        look.chosen = std::abs(input.image.depth_mm - preset.depth_mm) < 0.5 &&
                      std::abs(input.image.focus_mm - preset.focus_mm) < 0.5;
        if (ui.button(preset.name, box.column(i++, 4, 8), tr(preset.name), look))
            request.preset = &preset;
    }
}

void draw_modes(Ui& ui, const Box& box, DopplerMode now, bool enabled, ConsoleRequest& request) {
    int i = 0;
    for (const Mode& mode : kModes) {
        Look look;
        look.chosen =
            now == mode.mode || (now == DopplerMode::power && mode.mode == DopplerMode::colour);
        look.enabled = enabled;
        look.tip = mode.tip;
        if (ui.button(mode.name, box.column(i++, static_cast<int>(std::size(kModes)), 4),
                      tr(mode.name), look))
            request.mode = mode.mode;
    }
}

void draw_gain(Ui& ui, Box box, ImageSettings& image, bool enabled, ConsoleRequest& request) {
    Look look;
    look.enabled = enabled;
    look.tip = "Sets gain and depth gain once";
    const Box automatic = box.take_right(ui.width(tr("Auto"), Type::body) + 22, 8);
    char value[24];
    std::snprintf(value, sizeof value, "%+.0f dB", image.gain_db);
    const int step = ui.stepper("gain", box, tr("Gain"), image.gain_db == 0 ? "0 dB" : value,
                                "Brightness of all echoes (- and =)", enabled);
    if (step != 0) image.gain_db = std::clamp(std::round(image.gain_db) + step, -30.0, 30.0);
    request.adjust_gain = ui.button("auto", automatic, tr("Auto"), look);
}

// One pad: the mouse that is held sets the slider of the row that it is on.
void draw_tgc(
    Ui& ui, const Box& box, float row_height, ImageSettings& image, double depth_mm, bool enabled) {
    Box heading = tgc_heading(box);
    Look look;
    look.link = true;
    look.enabled = enabled;
    look.tip = "All sliders to the middle (0)";
    const Box level = heading.take_right(ui.width(tr("Level"), Type::body) + 10);
    if (ui.button("level", level, tr("Level"), look)) image.tgc_db = {};
    ui.text(heading, tr("Depth gain (TGC)"), Type::body, colour::kDim);
    for (int i = 0; i < kTgcRows; ++i) {
        Box row = tgc_row(box, row_height, i);
        double& gain_db = image.tgc_db[static_cast<std::size_t>(i)];
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
    Look look;
    look.tile = true;
    look.enabled = input.enabled;
    look.icon = Icon::zoom;
    look.chosen = marks.zoom.on() || marks.tool == MarkTool::zoom;
    look.tip = "Drag a box in the picture; again: back (Y)";
    if (ui.button("zoom", box.column(0, 3, 8), tr("Zoom"), look)) toggle_zoom(marks);
    look.icon = Icon::text;
    look.chosen = marks.tool == MarkTool::label;
    look.tip = "Words on the picture: click and type (T)";
    if (ui.button("label", box.column(1, 3, 8), tr("Label"), look))
        marks.tool = look.chosen ? MarkTool::none : MarkTool::label;
    look.icon = Icon::body;
    look.chosen = marks.body;
    look.tip = "Body mark; click in it where the probe is";
    if (ui.button("body", box.column(2, 3, 8), tr("Body mark"), look)) marks.body = !marks.body;
}

void draw_tools(Ui& ui,
                const Box& box,
                ImageSettings& image,
                const ConsoleInput& input,
                ConsoleRequest& request) {
    Look look;
    look.tile = true;
    look.enabled = input.enabled;
    look.icon = Icon::measure;
    look.chosen = input.measuring;
    look.tip = "Distance: two clicks in the picture (M)";
    if (ui.button("measure", box.column(0, 3, 8), tr("Measure"), look))
        input.measuring = !input.measuring;
    look.icon = Icon::close;
    look.chosen = false;
    look.tip = "Removes the distances (C)";
    request.clear = ui.button("clear", box.column(1, 3, 8), tr("Clear"), look);
    look.icon = Icon::flip;
    look.chosen = image.flip_left_right;
    look.tip = "Left and right (F)";
    if (ui.button("flip", box.column(2, 3, 8), tr("Flip"), look))
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
    for (const ConsolePlace& place : layout.pages[static_cast<std::size_t>(input.page)]) {
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
        char words[32];
        std::snprintf(words, sizeof words, "%s  %d/%d", tr("More"), input.page + 1, pages);
        Look look;
        look.icon = Icon::next;
        look.tip = "The other controls";
        if (ui.button("more", layout.more, words, look)) input.page = (input.page + 1) % pages;
    }
    return request;
}

}  // namespace sonocase::runtime
