// SPDX-License-Identifier: Apache-2.0

// Exercises written in the patient's frame.
//
// An author sees targets and paths in the CT, in Slicer's RAS millimetres, long before a mannequin
// is fitted. `frame = "ct"` at the head of an exercise says that all its positions and directions
// are those; cooking carries them through the fit. Without it they are in `mannequin`.
#pragma once

#include <string>
#include <string_view>

#include "formats/base/result.h"
#include "formats/registration/registration.h"

namespace sonocase::pipeline {

// The exercise as parse_exercise reads it, with the line of `frame` blanked so that the lines of
// errors stay right. in_ct tells what it said. Error: no TOML, or a frame that is neither.
struct FramedExercise {
    std::string toml;
    bool in_ct = false;
};
Result<FramedExercise> strip_frame(std::string_view toml, const std::string& where);

// The same exercise in `mannequin`, as new TOML. A point goes through the map. A probe's beam aims
// at where the anatomy in its middle went, its lateral axis goes with the Jacobian at the skin. A
// needle that lies in the scan plane (1 mm, 1 degree) is laid into the mapped one.
Result<std::string> exercise_to_mannequin(const std::string& stripped_toml,
                                          const std::string& where,
                                          const Registration& registration);

}  // namespace sonocase::pipeline
