// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/pages/pages.h"

#include <imgui.h>

#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/educator/new_target.h"
#include "runtime/player/ui/panels/panels.h"

namespace sonocase::runtime {
namespace {

void show_setup(App& app, const TrackerHealth& tracker, float s) {
    CaseState& loaded = app.loaded;
    follow_setup(loaded, app.scan.controls.assignment, app.player.now_s);
    const bool save =
        draw_setup_window(*loaded.guide, tracker, loaded.frame().reading, loaded.calibrations,
                          app.scan.controls.assignment, app.view.show_setup, s);
    if (save && save_calibrations(loaded.calibrations, app.player.settings, app.view.notices))
        app.view.show_setup = false;
}

}  // namespace

void clear_marks(ViewState& view) {
    view.measurements.clear();
    view.marks_on_picture.labels.clear();
}

bool show_notice(App& app, Ui& ui, const Box& bar) {
    Notices& notices = app.view.notices;
    if (notices.standing().empty()) return false;
    if (draw_notice(ui, bar.inset(0, 3), notices.standing().back()))
        notices.dismiss(notices.standing().size() - 1);
    return true;
}

bool tracker_is_live(const App& app, const TrackerHealth& tracker) {
    if (app.scan.tracker.mouse || app.scan.tracker.paced || app.scan.tracker.spec == "null")
        return true;
    return tracker.phase == TrackerPhase::streaming && !app.loaded.frame().waiting &&
           app.scan.tracker.lost_since_s < 0;
}

void begin_page() {
    ImGui::SetNextWindowPos({0, 0});
    ImGui::SetNextWindowSize(ImGui::GetIO().DisplaySize);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, 0});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
    ImGui::Begin("sonocase", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoNav |
                     ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoBringToFrontOnFocus |
                     ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoScrollWithMouse);
    ImGui::PopStyleVar(2);
}

void end_page(Ui& ui) {
    ImGui::End();
    ui.end();
}

void draw_page(App& app, Ui& ui, const TrackerHealth& tracker) {
    ViewState& view = app.view;
    begin_page();
    if (!app.loaded.open && view.page != Page::group) view.page = Page::bundles;
    if (view.page == Page::after && !app.scan.result) view.page = Page::scan;
    switch (view.page) {
        case Page::bundles: draw_start_page(app, ui); break;
        case Page::scan: draw_scan_page(app, ui, tracker); break;
        case Page::after: draw_after_page(app, ui); break;
        case Page::group: draw_class_page(app, ui); break;
    }
    ImGui::End();
    draw_dialogs(app, ui, tracker);
    if (view.show_setup && app.loaded.open && view.page == Page::scan)
        show_setup(app, tracker, ui.scale());
    ui.end();
}

}  // namespace sonocase::runtime
