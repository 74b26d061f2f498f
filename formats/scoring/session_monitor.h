// SPDX-License-Identifier: Apache-2.0

// Events of a session while it runs: entries, hits, contacts. For the frame loop of the player;
// allocates nothing after construction.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/insertion_detector.h"
#include "formats/scoring/session_score.h"
#include "formats/scoring/sight.h"

namespace sonocase {

enum class LiveEventKind : std::uint8_t {
    needle_entry,    // index: insertion, from 1; value: depth, mm
    needle_exit,     // index: insertion; value: greatest depth, mm
    target_hit,      // index: target; value: tip to centre, mm
    target_scanned,  // index: target
    no_go_contact,   // index: label
    no_go_left,      // index: label
    probe_contact,   // the probe touches the skin
    probe_lifted,
    needle_lost,  // tracking
    needle_found,
    probe_lost,
    probe_found,
    deepest,    // index: insertion; given with needle_exit, at the time of the deepest point
    key_frame,  // the player stored a picture
    session_end,
    tissue_puncture,  // index: label that the tip went into; value: force, N
    posterior_wall,   // the tip went through the far wall of a vessel; likewise
    needle_stopped,   // something rigid stopped the needle; likewise
    step_performed,   // index: step of the procedure
    complication,     // index: of complication_names()
};

struct LiveEvent {
    LiveEventKind kind = LiveEventKind::needle_entry;
    int index = -1;
    double value = 0;
    double time_s = 0;  // may be before the frame that reports it: entries are dated back
    std::int64_t frame = 0;
};

// Name and detail as in a recording: "target_hit", "target=2 name=lesion distance_mm=1.5".
SessionEvent session_event(const LiveEvent& event,
                           const Exercise& exercise,
                           const std::vector<Label>& labels);

class SessionMonitor {
  public:
    // Exercise, anatomy and labels must outlive the monitor. anatomy may be null: then only targets
    // and tracking are watched.
    SessionMonitor(const Exercise& exercise,
                   const Anatomy* anatomy,
                   const std::vector<Label>& labels,
                   const ScoreOptions& options = {});

    // The events of this sample; valid until the next call. unseen: SessionSample::unseen. Cost:
    // one walk along the inserted shaft and the targets that are still open.
    std::span<const LiveEvent> update(double time_s,
                                      std::int64_t frame,
                                      bool probe_ok,
                                      const Rigid& mannequin_from_probe,
                                      bool needle_ok,
                                      const Rigid& mannequin_from_drawn,
                                      bool unseen = false);

    // What the procedure found in the sample just given: ProcedureRun::new_steps() and its like.
    void report_procedure(std::uint32_t new_steps, std::uint32_t new_complications);
    // What the needle did to the tissue in the sample just given; index: label.
    void report(LiveEventKind kind, int label, double force_n) {
        add(kind, last_time_s_, label, force_n);
    }
    std::span<const LiveEvent> events() const { return events_; }  // of the sample just given

    // For the screen.
    double depth_mm() const { return depth_mm_; }              // inserted length; 0 outside
    double tip_to_target_mm() const { return to_target_mm_; }  // nearest; NaN: none
    int nearest_target() const { return nearest_; }
    bool tip_in_view() const { return tip_in_view_; }
    bool in_no_go() const { return no_go_now_ >= 0; }
    int insertions() const { return detector_.insertions(); }
    int targets_hit() const { return hits_; }
    double time_in_tissue_s() const { return time_in_tissue_s_; }

  private:
    void add(LiveEventKind kind, double time_s, int index = -1, double value = 0);
    void watch_needle(double time_s, const Rigid& needle);
    void watch_targets(
        double time_s, bool probe_ok, const Rigid& probe, bool needle_ok, Point3 tip);
    void watch_state(bool now, bool& state, double time_s, LiveEventKind on, LiveEventKind off);

    const Exercise* exercise_;
    const Anatomy* anatomy_;
    NeedleSight sight_;
    ScoreOptions options_;
    InsertionDetector detector_;
    std::vector<bool> is_no_go_;
    std::vector<bool> hit_, scanned_;
    std::vector<LiveEvent> events_;
    std::int64_t frame_ = 0;
    bool needle_tracked_ = false, probe_tracked_ = false, probe_on_skin_ = false,
         tip_in_view_ = false;
    bool started_ = false;
    int no_go_now_ = -1, hits_ = 0, nearest_ = -1;
    double no_go_last_s_ = 0, probe_off_s_ = 0, last_time_s_ = 0;
    double depth_mm_ = 0, to_target_mm_ = 0, time_in_tissue_s_ = 0, deepest_s_ = 0, deepest_mm_ = 0;
};

// True if any of five points across the face, pressed 2 mm in, is in the body.
bool probe_on_skin(const Anatomy& anatomy, const Probe& probe, const Rigid& mannequin_from_probe);

}  // namespace sonocase
