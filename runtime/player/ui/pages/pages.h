// SPDX-License-Identifier: Apache-2.0

// The pages of the window: where the panels are, and the steps that they ask for.
#pragma once

#include "runtime/player/app/states.h"
#include "runtime/player/ui/parts/ui.h"

namespace sonocase::runtime {

// Everything of this picture, once per picture. tracker: its health now.
void draw_page(App& app, Ui& ui, const TrackerHealth& tracker);

// The window's background, on which a page is drawn between the two.
void begin_page();
void end_page(Ui& ui);

// Of the second window.
void draw_instructor_page(App& app, Ui& ui, const TrackerHealth& tracker);

void draw_scan_page(App& app, Ui& ui, const TrackerHealth& tracker);
void draw_start_page(App& app, Ui& ui);
void draw_after_page(App& app, Ui& ui);
void draw_class_page(App& app, Ui& ui);
// What is open over the page.
void draw_dialogs(App& app, Ui& ui, const TrackerHealth& tracker);

// A dialog in the middle: its room without heading; closes by its button. end_layer() ends it.
Box begin_page_dialog(Ui& ui, App& app, const char* title, float width, float height);
void draw_exercises(App& app, Ui& ui);
void draw_marks(App& app, Ui& ui);
void draw_new_target(App& app, Ui& ui);
void draw_label(App& app, Ui& ui);

// Keys, once per picture; seconds: since the picture before. Enter presses the control that has
// the focus of Tab, where one has it.
void handle_keys(App& app, Ui& ui, double seconds);

// The newest notice in a bar at the top of a page; true if there is one.
bool show_notice(App& app, Ui& ui, const Box& bar);

// Takes distances and words off the picture.
void clear_marks(ViewState& view);

// What Enter does on the page: starts practice, or the next attempt.
void press_primary(App& app);

// Whether readings of the tracker arrive, so that what is shown is what is.
bool tracker_is_live(const App& app, const TrackerHealth& tracker);

}  // namespace sonocase::runtime
