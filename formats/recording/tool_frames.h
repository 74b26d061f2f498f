// SPDX-License-Identifier: Apache-2.0

// Transforms of a recording by their names: which is a tool's, from which frame to which, how they
// connect, and which of their poses are none though nobody says so.
//
// "ProbeToTracker" maps points of the probe to the tracker. Two of them connect where the frame in
// which one ends is that in which the other begins or ends: ProbeToReference follows from
// ProbeToTracker and ReferenceToTracker.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/recording/sequence.h"

namespace sonocase {

struct TransformName {
    std::string_view from, to;  // "Probe", "Tracker"; of a name without "To" the whole, and ""
};
// Split at the last "To" that stands between two frames: a capital letter follows it.
TransformName split_transform_name(std::string_view name);

enum class ToolRole { probe, needle };
// How well a transform's name says that it is the pose of such a tool; 0: it does not. A needle
// goes before a stylus, and its tip before the sensor on it; a name that begins with the tool's
// before one that holds it; the probe before its image; a transform to the mannequin before one to
// the tracker, and that before others.
int rank_as_tool(std::string_view transform, ToolRole role);
// The transform of highest rank, the first of several; -1: none.
int find_tool(const Sequence& sequence, ToolRole role);

// Adds the transform FROM_TO_TO of `sequence` that follows from others, frame by frame, where they
// are all OK, the last of each no older than 0.25 s. Returns its index, or -1 where the names do
// not connect `from` and `to`. `said` gets the sentence that says what was composed.
int compose_transform(Sequence& sequence,
                      std::string_view from,
                      std::string_view to,
                      Message* said = nullptr);

// ReferenceToTracker, where `tool` ends in this tracker: of a sensor that is fixed to the mannequin
// or the patient. -1: none, or `tool` ends in no tracker.
int find_reference(const Sequence& sequence, std::string_view tool);

// Adds the poses of tools that a recording has only the other way round (TrackerToProbe), with a
// note. What ends in a tool and begins in no tracker, reference or patient is a calibration.
void add_inverses(Sequence& sequence);

// Probe and needle in one frame. `probe` and `needle` are names of transforms or empty; one of them
// is replaced by a composed one where they end in different frames, the mannequin before others. An
// Error where nothing connects the two frames.
Status bring_to_one_frame(Sequence& sequence,
                          std::string& probe,
                          std::string& needle,
                          const std::string& where);
// True if bring_to_one_frame() would change anything or fail.
bool in_two_frames(const std::string& probe, const std::string& needle);

// Why no pose of a transform counts: "240 have a scale, 3 have another status than OK"; empty where
// one counts, or there is none.
std::string why_no_pose(const Sequence& sequence, int transform);

// Marks poses that are none though their status is OK: exactly the identity where the tool has been
// elsewhere; and the last pose repeated to the last bit for 0.2 s and more while another tool
// moves, of a tool whose noise changed every reading before. A source that mostly goes on within 1
// mm of where it rested to the last bit has no noise (a simulation), and none of its rests is taken
// for a loss. Returns how many were marked. The rules are those of live trackers
// (runtime/engine/sensor_watch.h).
std::size_t mark_lost(Sequence& sequence);

}  // namespace sonocase
