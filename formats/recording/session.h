// SPDX-License-Identifier: Apache-2.0

// A training session: poses of probe and needle over time, console settings, and events. On disk it
// is an IGSIO sequence (docs/format.md, part 7), which 3D Slicer and PLUS can open.
//
// Everything is in the `mannequin` frame. Times are seconds on the session's clock, first sample
// first.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "formats/recording/acts.h"
#include "formats/recording/sequence.h"

namespace sonocase {

struct SessionHeader {
    std::string case_name;
    std::string case_digest;      // of the bundle's bytes; empty: not known
    std::string exercise;         // name
    std::string exercise_digest;  // of its TOML
    std::string trainee;          // a chosen name; empty: none
    std::string started;          // ISO 8601, UTC
    std::string program;          // "sonoplay 0.1.0"
    // What replay needs besides poses, as "key=value" words: model, effects, seed, size. Written by
    // the player.
    std::string render;
    // How the attempt was set, as "key=value" words: seed of its target positions, mode. Empty: the
    // exercise as written.
    std::string attempt;
};

// What the probe did to the tissue in a frame (effect deformation).
struct PressSample {
    double force_n = 0, pressure_kpa = 0;
    // Area of the draining lumens under the face in the scan plane, relative to that at rest.
    // Negative: there is none, or nothing is pressed.
    double vein_open = -1;
    friend bool operator==(const PressSample&, const PressSample&) = default;
};

// What a Doppler mode showed in a frame, and the true values. Vessels are named by their labels.
struct DopplerSample {
    std::vector<std::string> coloured;       // vessels with colour in the box
    std::string gate;                        // vessel with most of the spectral gate; empty: none
    double gate_fill = 0;                    // share of the gate in that vessel's blood
    double angle_deg = 0, cursor_deg = 0;    // of beam and flow, [0, 90]: true, and by the cursor
    double psv_cm_s = 0, true_psv_cm_s = 0;  // peak velocity: measured over `beats`, and true
    int beats = 0;
    friend bool operator==(const DopplerSample&, const DopplerSample&) = default;
};

struct SessionSample {
    double time_s = 0;
    std::int64_t frame = 0;  // the renderer's frame number, which seeds its noise
    bool probe_ok = false;
    Rigid mannequin_from_probe;
    bool needle_ok = false;
    Rigid mannequin_from_needle;  // as measured: origin at the tip, z from hub to tip
    Rigid mannequin_from_drawn;   // as shown, after the bend constraint
    // How long before time_s the tracker measured the pose that was shown.
    double probe_age_s = 0, needle_age_s = 0;
    // Console settings that changed at this frame, as "key=value" words; empty: unchanged.
    std::string settings;
    bool has_press = false;  // false in older recordings and in those of other programs
    PressSample press;
    bool has_doppler = false;  // a Doppler mode was on
    DopplerSample doppler;
    ActList acts;         // of a procedure; none in older recordings
    bool unseen = false;  // the picture on the screen was frozen: nobody saw this one
};

// Events have fixed names; `detail` holds "key=value" words. docs/metrics.md lists them.
struct SessionEvent {
    double time_s = 0;
    std::int64_t frame = 0;
    std::string name;    // "needle_entry", letters, digits and _
    std::string detail;  // "insertion=1 depth_mm=2.1"
    friend bool operator==(const SessionEvent&, const SessionEvent&) = default;
};

struct Session {
    SessionHeader header;
    std::vector<SessionSample> samples;
    std::vector<SessionEvent> events;  // in order of time
    std::vector<Message> notes;        // what readers put together or took for lost; not kept
    std::string no_pose;               // why not one pose counts; empty: one does
};

inline constexpr const char* kActField = "Act";  // acts_text() of a frame
inline constexpr const char* kProbeTransform = "ProbeToMannequin";
inline constexpr const char* kNeedleTransform = "NeedleToMannequin";
inline constexpr const char* kDrawnTransform = "DrawnNeedleToMannequin";

// Which transforms of a recording are the probe and the needle; other programs name them
// differently. Empty: none. `drawn` falls back to `needle`.
struct SessionNames {
    std::string probe = kProbeTransform;
    std::string needle = kNeedleTransform;
    std::string drawn = kDrawnTransform;
    // Axis of the needle's own frame that points from hub to tip.
    Vector3 needle_axis{0, 0, 1};
};

// The most likely names in a recording: ours if it has them, otherwise those that find_tool() takes
// (formats/recording/tool_frames.h), relative to the reference where find_reference() finds one:
// ProbeToReference then need not be in the recording.
SessionNames guess_names(const Sequence& sequence);

// Poses that are not rigid count as not tracked. A transform that the sequence lacks is composed of
// others, and so is one of the two where probe and needle end in different frames; the notes say
// so. An Error when a named transform is missing and follows from no others, or nothing connects
// the two frames.
Result<Session> session_from_sequence(const Sequence& sequence,
                                      const SessionNames& names,
                                      const std::string& where);
// An Error for a session whose scores would be zeros that look like a trainee's: no usable pose,
// times that fall or tell nothing (check_times()), or places in metres.
Status check_session(const Session& session, const std::string& where);
Sequence sequence_from_session(const Session& session);

// One frame and the fields of its events, as the recorder writes it.
SequenceFrame frame_from_sample(const SessionSample& sample,
                                const std::vector<SessionEvent>& events);
std::vector<SequenceField> fields_from_header(const SessionHeader& header);
// The trainee of a session's file or of its pictures, of which `start` is the beginning (8 KiB hold
// the header); empty: it names none, or is no session.
std::string trainee_in_header(std::string_view start);

// Seed of the attempt (formats/scoring/draw_attempt.h); 0: the exercise as written.
std::uint64_t attempt_seed(const SessionHeader& header);

// Value of a key in "key=value key=value"; empty if the key is missing.
std::string detail_value(const std::string& detail, const std::string& key);

}  // namespace sonocase
