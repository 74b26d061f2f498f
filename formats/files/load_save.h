// SPDX-License-Identifier: Apache-2.0

// Loads and saves the files whose bytes the other rooms of formats read and write.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/bundle/stage_files.h"
#include "formats/calibration/calibration.h"
#include "formats/machine/machine.h"
#include "formats/recording/poses.h"
#include "formats/recording/sequence.h"

namespace sonocase {

// Case bundles (formats/bundle/case_bundle.h).
Result<CaseBundle> load_bundle(const std::string& path);  // unpacks the whole bundle
// For players, which unpack blocks on demand.
Result<StreamedBundle> open_bundle(const std::string& path);
Status save_bundle(const CaseBundle& bundle, const std::string& path);

// The files between stages (formats/bundle/stage_files.h).
Status save_label_file(const LabelFile& file, const std::string& path);
Result<LabelFile> load_label_file(const std::string& path);
Status save_texture_file(const TextureFile& file, const std::string& path);
Result<TextureFile> load_texture_file(const std::string& path);
Status save_surface_file(const SurfaceFile& file, const std::string& path);
Result<SurfaceFile> load_surface_file(const std::string& path);

// Recordings: tracked poses, IGSIO sequences and the logs of other trainers. A sequence may keep
// its pixels in another file of the same folder (.mhd with .raw).
Result<std::vector<Pose>> load_poses(const std::string& path);
Result<Sequence> load_sequence(const std::string& path);
// NRRD if `path` ends in .nrrd, MetaImage otherwise.
Status save_sequence(const Sequence& sequence, const std::string& path, bool compress = false);

// The one reader of everything that is a list of readings: IGSIO sequences, PerkTutor's transform
// logs (XML) and tables of poses (formats/recording/pose_table.h), recognised by what they hold.
// The transforms of a table bear its tools' names, NeedleToTracker or the like; of a table of one
// tool without a name NeedleToTracker if its file's name says needle or stylus, else
// ProbeToTracker. Poses that are none though nobody says so are marked as lost, and noted
// (mark_lost(), tool_frames.h), except in sessions of this program. "PROBE_FILE,NEEDLE_FILE" joins
// the probe of one with the needle of the other, each its file's only transform or the one with the
// tool's name; frames of equal times become one. Errors: those of the readers, and what a file is
// that holds no readings.
Result<Sequence> load_recording_file(const std::string& files);

// Calibrations (formats/calibration/calibration.h), and those of other programs; written as these
// where the path ends in .xml, .tfm or .txt (formats/calibration/foreign_calibration.h).
Result<Calibration> load_calibration(const std::string& path);
Status save_calibration(const Calibration& calibration, const std::string& path);

// A machine (formats/machine/machine.h). name_or_path: a built-in machine's name, or the path of a
// TOML file, which has a '/' or ends in ".toml". Errors: no such name (with the nearest) or file,
// and those of parse_machine().
Result<Machine> load_machine(const std::string& name_or_path);

}  // namespace sonocase
