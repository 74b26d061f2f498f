// SPDX-License-Identifier: Apache-2.0

// An educator's own target: placed in the picture, saved as an exercise in a TOML file in the
// folder BUNDLE.exercises beside the case, without cooking. Whoever opens the case finds it among
// the exercises.
#pragma once

#include <string>

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

// The next click in the picture places the target. Not while an attempt runs.
void begin_new_target(App& app);
// Places it, in the scan plane of the frame shown; mm in the frame `probe`. A place outside the
// body becomes a notice.
void set_new_target(App& app, double x_mm, double z_mm);
// Saves and opens it. A file that cannot be written becomes a notice.
void save_new_target(App& app);

// The file's text: probe, needle and start as of `base`, one target with marks for distance,
// punctures and critical structures. A title may hold anything; the name is made of it.
std::string exercise_toml(const Exercise& base,
                          const std::string& title,
                          Point3 centre,
                          double radius_mm,
                          const Rigid& mannequin_from_probe);
// Letters and digits of ASCII and hyphens; never empty.
std::string exercise_name(const std::string& title);

}  // namespace sonocase::runtime
