// SPDX-License-Identifier: Apache-2.0

// The pages of the window: where the panels are. A page shows what a SessionView gives it, changes
// what is its own, and asks for everything else.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "runtime/player/app/states.h"
#include "runtime/player/ui/parts/ui.h"
#include "runtime/player/ui/requests.h"

namespace sonocase::runtime::inline player_ui {

// Beside a picture that a script saves, in PICTURE.boxes: one line per box with kind (card,
// control, words, picture), layer, x, y, width and height in u, 1 if words are cut, and the name;
// then the words that the catalogue lacks, of kind untranslated.
Status write_boxes(const Ui& ui, const std::string& picture);

// What a page shows of the session. Nothing of it is changed through it.
struct SessionView {
    const Settings& settings;
    const std::string& serve;  // --serve; empty: does not serve
    const Progress& progress;
    const CaseState& loaded;
    const ScanState& scan;
    const TrackerHealth& tracker;  // now
    bool live;                     // tracker_is_live()
    double now_s;                  // session clock at the start of this picture

    bool case_open() const { return loaded.open != nullptr; }
};
// Whether readings of the tracker arrive, so that what is shown is what is.
bool tracker_is_live(const CaseState& loaded,
                     const TrackerInUse& tracker,
                     const TrackerHealth& health);

// The window's background, on which a page is drawn between the two.
void begin_page();
void end_page(Ui& ui);

// The start page.
void draw_start_page(const Progress& progress,
                     Notices& notices,
                     BundleChooser& chooser,
                     Screen& screen,
                     Ui& ui,
                     Requests& requests);
void draw_scan_page(const SessionView& session,
                    Notices& notices,
                    Console& console,
                    ViewState& view,
                    Ui& ui,
                    Requests& requests);
// After an attempt, whose result there is.
void draw_after_page(
    const SessionView& session, Notices& notices, Screen& screen, Ui& ui, Requests& requests);
// chooser: whose cases give exercises their titles.
void draw_class_page(PlayerState& player,
                     ClassPage& page,
                     const BundleChooser& chooser,
                     bool case_open,
                     Screen& screen,
                     Ui& ui,
                     Requests& requests);
// The page of the course in use, of which there is one.
void draw_course_page(Progress& progress,
                      Notices& notices,
                      const BundleChooser& chooser,
                      CoursePage& page,
                      Screen& screen,
                      Ui& ui,
                      Requests& requests);
// The course on the start page; false: there is none, or no room.
bool draw_course_card(const Progress& progress, Screen& screen, Ui& ui, Box& side);
// What Enter does on the page of a course: begins the module that is shown.
void press_course_primary(const Progress& progress,
                          const BundleChooser& chooser,
                          const CoursePage& page,
                          Requests& requests);
// What is open over the page.
void draw_dialogs(
    const SessionView& session, PlayerState& player, ViewState& view, Ui& ui, Requests& requests);

// Keys, once per picture; seconds: since the picture before. Enter presses the control that has
// the focus of Tab, where one has it.
void handle_keys(const SessionView& session,
                 Settings& settings,
                 Console& console,
                 ViewState& view,
                 Ui& ui,
                 double seconds,
                 Requests& requests);

// The newest notice in a bar at the top of a page; true if there is one.
bool show_notice(Notices& notices, Ui& ui, const Box& bar);

// Takes distances and words off the picture.
void clear_marks(PictureTools& tools);

// What Enter does on the start page: starts practice.
void press_primary(const Progress& progress, const BundleChooser& chooser, Requests& requests);

}  // namespace sonocase::runtime::inline player_ui
