// SPDX-License-Identifier: Apache-2.0

// An educator's own target: placed in the picture, saved as an exercise in a TOML file in the
// folder BUNDLE.exercises beside the case, without cooking. Whoever opens the case finds it among
// the exercises.
#pragma once

#include <string>
#include <vector>

#include "runtime/player/app/states.h"

namespace sonocase::runtime::inline player_app {

// The next click in the picture places the target. Not while an attempt runs.
void begin_new_target(Notices& notices,
                      const Training& training,
                      Educator& educator,
                      Screen& screen);
// Places it, in the scan plane of the frame shown; mm in the frame `probe`. A place outside the
// body becomes a notice.
void set_new_target(
    Notices& notices, const CaseState& loaded, NewTarget& target, double x_mm, double z_mm);
// Saves it and adds it to the exercises of the case. Returns its index, to be chosen next; none if
// the file cannot be written, which becomes a notice.
std::optional<int> save_new_target(Notices& notices, CaseState& loaded, NewTarget& target);

// The file's text: probe, needle and start as of `base`, one target with marks for distance,
// punctures and critical structures. A title may hold anything; the name is made of it.
std::string exercise_toml(const Exercise& base,
                          const std::string& title,
                          Point3 centre,
                          double radius_mm,
                          const Rigid& mannequin_from_probe);
// Letters and digits of ASCII and hyphens; never empty.
std::string exercise_name(const std::string& title);

// Pass marks that an educator changes in the window. The exercise with its new marks is a TOML file
// in the folder BUNDLE.exercises beside the case, in the place of the one that the case brings.

void begin_marks(const CaseState& loaded, Educator& educator, Screen& screen);
// Moves a limit by one step of its unit: 5 % for shares, 10 s for times, 1 for everything else.
void step_mark(Exercise::PassMark& mark, int steps);
// Saves the exercise. Returns its index, to be chosen next; none while an attempt runs, or if the
// file cannot be written, which becomes a notice.
std::optional<int> save_marks(Notices& notices,
                              CaseState& loaded,
                              const Training& training,
                              const std::vector<Exercise::PassMark>& marks);

// The text of an exercise with other marks: everything else stays as it is written.
std::string toml_with_marks(const std::string& toml, const std::vector<Exercise::PassMark>& marks);

}  // namespace sonocase::runtime::inline player_app
