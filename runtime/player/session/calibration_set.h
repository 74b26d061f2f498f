// SPDX-License-Identifier: Apache-2.0

// The calibrations of a run: read from files, and compared with the date and the device in use.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "runtime/engine/scan_engine.h"

namespace sonocase::runtime::inline player_session {

// Reads --calibration files: at most one each of probe, needle and mannequin, and lags.
// Errors: a file that cannot be read or parsed, an unknown kind, a second one of the same kind.
Result<Calibrations> load_calibrations(const std::vector<std::string>& files);

// Uses the calibrations of `newer` in place of those in use; those that it lacks stay, and so does
// the lag.
void merge_calibrations(const Calibrations& newer, Calibrations& in_use);

// Whole sentences, one per reason to question a calibration in use: its age, its accuracy, another
// device.
// device  as TrackerHealth::device; empty: not known, not compared
// now     ISO 8601, UTC
std::vector<Message> calibration_warnings(const Calibrations& calibrations,
                                          const std::string& device,
                                          const std::string& now);

// Only the warnings about calibrations that were made with another device.
std::vector<Message> sensor_mismatch_warnings(const Calibrations& calibrations,
                                              const std::string& device);

}  // namespace sonocase::runtime::inline player_session
