// SPDX-License-Identifier: Apache-2.0

// Steps of scanning: freezing and the cine loop, attempts at the exercise, their replay and review,
// signing in, and the frames that go to the servers.
#pragma once

#include <span>
#include <string>

#include "formats/base/result.h"
#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

void set_frozen(Console& console, bool frozen);
// Freezes the picture and goes `frames` of the kept frames back, < 0 forward. kept: how many are.
void step_cine(Console& console, int frames, int kept);
// Once per picture: the next frame of a cine loop that plays.
void advance_cine(Console& console, int kept, double now_s);

// path: of the recording; empty: a new file in the user's sessions folder or, where there is none,
// one that is not kept, which a notice says. exam: gives no help even
// where the exercise would. Does nothing while an attempt runs or no case is open.
void start_attempt(PlayerState& player,
                   CaseState& loaded,
                   ScanState& scan,
                   const std::string& path,
                   bool exam = false);
// Ends the recording and scores it. Does nothing unless an attempt runs.
void finish_attempt(PlayerState& player, CaseState& loaded, ScanState& scan);
// Starts or finishes an attempt; asks, in a notice, before it ends an exam. Returns whether there
// is a result to show.
bool toggle_attempt(PlayerState& player, CaseState& loaded, ScanState& scan);
// True if nothing would be lost by leaving: no attempt runs, or the user was asked in the last 4 s
// and insists by the same key. Else asks, in a notice. key: that was pressed, as in "F5".
bool may_leave_attempt(PlayerState& player, Training& training, const std::string& key);
// Plays the last attempt again in the window, at any speed; end_replay() goes back to the tracker
// that was in use. Both do nothing where there is nothing to play or to end. start_replay() returns
// whether one begins.
bool start_replay(PlayerState& player, CaseState& loaded, ScanState& scan);
void end_replay(PlayerState& player, CaseState& loaded, ScanState& scan);
// Plays a script of the exercise as a replay. False: an attempt or a replay runs, or there is no
// such script; a notice says so.
bool watch_expert(PlayerState& player,
                  CaseState& loaded,
                  ScanState& scan,
                  const std::string& sweep);
// Makes the review page of the last attempt and opens it. Needs the program sonocase.
void open_review(Notices& notices, const CaseState& loaded, const Training& training);
// Practice: the exercise's next hint; after the last of them the targets are shown.
void show_next_hint(Notices& notices, const CaseState& loaded, Training& training);
// False while an attempt runs that does not show where the targets are: an exam, or practice
// before all hints were asked for.
bool shows_targets(const ScanState& scan, const Exercise& exercise);
// Sends each live frame to the attempt and to the server, as far as they exist. When it returns,
// the scan thread no longer uses an attempt that ended.
void observe_frames(const std::shared_ptr<Attempt>& attempt,
                    const Servers& servers,
                    ScanThread& thread);

// Notes which steps of an attempt this frame shows done.
// anatomy         as the picture breathes; null: whatever lies in the sector shows
// record, centres as for mark_targets_reached()
void note_steps(const Exercise& exercise,
                const Anatomy* anatomy,
                const FrameRecord& record,
                std::span<const Point3> centres,
                StepsDone& done);

// Marks the targets that the drawn needle's tip has reached.
// record          the frame shown
// centres         # targets, `mannequin` frame, in that frame
// reached         # targets; marks stay
void mark_targets_reached(const Exercise& exercise,
                          const FrameRecord& record,
                          std::span<const Point3> centres,
                          std::vector<bool>& reached);

// Steps about who is trained: signing in, and what the progress book knows.

// Signs in under a chosen name; empty: nobody, and scores are not kept. Reads that trainee's
// history. A book that cannot be read becomes a notice.
void sign_in(PlayerState& player, const std::string& name);
// Keeps what was chosen before a module of the course in use; for a trainee with a name in the
// book.
void answer_course(PlayerState& player, const std::string& module, int option);
// Works out the page after the attempt that was just scored, and adds the attempt to the history.
// started: ISO 8601, UTC.
void note_attempt(Progress& progress,
                  const CaseState& loaded,
                  Training& training,
                  const std::string& started);

// What a replay is shown beside: the way that the tip took so far, and the straight way from where
// the needle entered to the target.

// Once per picture.
void follow_replay(Notices& notices, CaseState& loaded, ScanState& scan);

// Points 2 mm apart from a to b, both included.
std::vector<Point3> straight_way(Point3 a, Point3 b);

// The review page of a session, made by the program sonocase, which the player does not contain.

// Starts `sonocase review` and, when it is done, the user's browser; returns at once. Errors: the
// program sonocase is neither beside this one nor in the PATH.
// exercise: a TOML file; empty: the session's own.
Status show_review(const std::string& session,
                   const std::string& bundle,
                   const std::string& exercise);

}  // namespace sonocase::runtime::inline player_app
