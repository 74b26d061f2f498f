// SPDX-License-Identifier: Apache-2.0

// Steps of scanning: freezing and the cine loop, attempts at the exercise, the frames that go to
// the OpenIGTLink server.
#pragma once

#include <span>
#include <string>

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

void set_frozen(ScanState& scan, bool frozen);
// Freezes the picture and goes `frames` of the kept frames back, < 0 forward. kept: how many are.
void step_cine(ScanState& scan, int frames, int kept);
// Once per picture: the next frame of a cine loop that plays.
void advance_cine(ScanState& scan, int kept, double now_s);

// path: of the recording; empty: a new file in the user's sessions folder. exam: gives no help even
// where the exercise would. Does nothing while an attempt runs or no case is open.
void start_attempt(App& app, const std::string& path, bool exam = false);
// Ends the recording, scores it and shows the page after the attempt. Does nothing unless an
// attempt runs.
void finish_attempt(App& app);
void toggle_attempt(App& app);
// True if nothing would be lost by leaving: no attempt runs, or the user was asked in the last 4 s
// and insists by the same key. Else asks, in a notice. key: that was pressed, as in "F5".
bool may_leave_attempt(App& app, const std::string& key);
// Plays the last attempt again in the window, at any speed; end_replay() goes back to the tracker
// that was in use. Both do nothing where there is nothing to play or to end.
void start_replay(App& app);
void end_replay(App& app);
inline bool replays(const ScanState& scan) {
    return !scan.replayed_over.empty();
}
// Makes the review page of the last attempt and opens it. Needs the program sonocase.
void open_review(App& app);
// Practice: the exercise's next hint; after the last of them the targets are shown.
void show_next_hint(App& app);
// False while an attempt runs that does not show where the targets are: an exam, or practice
// before all hints were asked for.
bool shows_targets(const ScanState& scan, const Exercise& exercise);
// Sends each live frame to the attempt and to the server, as far as they exist. When it returns,
// the scan thread no longer uses an attempt that ended.
void observe_frames(const ScanState& scan, ScanThread& thread);

// Marks the targets that the drawn needle's tip has reached.
// record          the frame shown
// centres         # targets, `mannequin` frame, in that frame
// reached         # targets; marks stay
void mark_targets_reached(const Exercise& exercise,
                          const FrameRecord& record,
                          std::span<const Point3> centres,
                          std::vector<bool>& reached);

}  // namespace sonocase::runtime
