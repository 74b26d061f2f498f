// SPDX-License-Identifier: Apache-2.0

// Steps that choose and drive the tracker.
#pragma once

#include <string>

#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

enum class ToolOf { probe, needle, reference };
// "probe", as --tool takes it.
const char* role_name(ToolOf role);

// spec: as --tracker takes it. One that cannot be made becomes a notice, and the mouse is used.
void choose_tracker(PlayerState& player,
                    CaseState& loaded,
                    TrackerInUse& tracker,
                    const std::string& spec);
// Puts the mouse at the start of the exercise, without a needle. Does nothing unless it is in use.
// now_s: session clock.
void put_mouse_at_start(TrackerInUse& tracker, const CaseState& loaded, double now_s);
// What was said on the command line, else in the set-up: "needle=StylusTipToTracker".
const std::vector<std::string>& tools_in_use(const PlayerState& player);
// Which sensor of the tracker is on which tool, by the names and numbers that were said for it.
SensorAssignment sensors_in_use(const PlayerState& player, const TrackerInUse& tracker);
// Gives the tracker's sensor a role, in which it takes the place of another; or takes the role away
// where it has it. Kept in the settings, by the sensor's name or, of a device without names, by its
// number. sensors: the names that the tracker heard (TrackerHealth::sensors).
void give_role(PlayerState& player,
               CaseState& loaded,
               const TrackerInUse& tracker,
               const std::vector<std::string>& sensors,
               int sensor,
               ToolOf role);

// The next tracker of those that F7 steps through, or the one before.
void step_tracker(PlayerState& player, CaseState& loaded, TrackerInUse& tracker, bool back);
// Lets go of what the window's thread holds of the tracker.
void forget_tracker(TrackerInUse& tracker);

// steps: how many speeds faster, < 0 slower. Does nothing unless a recording or script is in use.
void change_pace(const TrackerInUse& tracker, int steps);
// Takes the mouse's needle, in the scan plane or across it, or withdraws it. Does nothing unless
// the mouse is in use.
void toggle_needle(TrackerInUse& tracker, const Probe& probe, bool in_plane, Notices& notices);

// Once per picture: hands the mouse's poses to the scan thread. now_s: session clock.
void feed_mouse(TrackerInUse& tracker, double now_s);
// Once per picture: prints the device's messages, each once, and warns of calibrations that were
// made with another device. health: of the tracker now.
void check_device(TrackerInUse& tracker,
                  const TrackerHealth& health,
                  const CaseState& loaded,
                  Notices& notices);

// Once per picture: since when no reading has arrived. frozen: the frame shown is an older one and
// says nothing about that.
void note_readings(TrackerInUse& tracker, const CaseState& loaded, bool frozen, double now_s);

}  // namespace sonocase::runtime::inline player_app
