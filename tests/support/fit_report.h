// SPDX-License-Identifier: Apache-2.0

// What tests read in the report of a fit.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "pipeline/registration/register_surfaces.h"

namespace sonocase::testing {

// A measure of a fit's report.
inline double measure(const pipeline::RegisterResult& r, const std::string& name) {
    for (const Measure& m : r.report.measures) {
        if (m.name == name) return m.value;
    }
    ADD_FAILURE() << name;
    return -1;
}

// A note of it.
inline std::string note(const pipeline::RegisterResult& r, const std::string& name) {
    for (const Note& n : r.report.notes) {
        if (n.name == name) return n.text;
    }
    ADD_FAILURE() << name;
    return "";
}

}  // namespace sonocase::testing
