// SPDX-License-Identifier: Apache-2.0

// The parts of the module, in the order in which module.cpp adds them.
#pragma once

#include <pybind11/pybind11.h>

namespace sonocase::python {

void bind_exercise(pybind11::module_& module);  // Probe, Needle, Target, Exercise
void bind_case(pybind11::module_& module);      // Label, Case
void bind_pose(pybind11::module_& module);      // pose: a module of functions
void bind_truth(pybind11::module_& module);     // Truth
void bind_renderer(pybind11::module_& module);  // Renderer, simd_targets, effect_names

struct CaseExercise;
struct OpenedCase;
// Raises ValueError where the exercise is another case's.
void check_of(const CaseExercise& exercise, const OpenedCase& opened);

}  // namespace sonocase::python
