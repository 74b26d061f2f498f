// SPDX-License-Identifier: Apache-2.0

// Exercises that a case's anatomy supports: those of scenarios/ with places found in this patient.
//
// Those of a right-sided organ are tried on the left as well. Each template says in which structure
// its target lies and how high. A target is tried in up to five places of that structure, far from
// one another and as deep inside it as the target is large; the first place is kept whose windows
// (aim.h) let a scripted expert earn all pass marks. Titles, texts, pass marks and steps stay the
// template's; labels that the case lacks are left out of what is to be spared; the sweeps are those
// of the windows.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline check {

struct Proposal {
    std::string name;
    std::string toml;    // empty: the anatomy does not support it, and `why` says why
    std::string why;     // "target in 'liver', 62 mm deep, 3 windows, a scripted expert passes"
    std::string target;  // of the exercise
    Point3 centre;
    double radius_mm = 0;
};

// Why no template fits these labels, by their names alone: "there is no 'liver', there is no ...".
// Empty: one may fit.
std::string why_none_fits(const std::vector<Label>& labels);

// bundle   a case whose frame `mannequin` is `ct`: its places are then the patient's, z to the head
// told     called after each template with the share that is done, by one thread at a time
// Cost: 0.3 to 4 s for each of fourteen templates.
std::vector<Proposal> propose_exercises(const CaseBundle& bundle,
                                        const std::function<void(double share)>& told = {});

}  // namespace sonocase::pipeline::inline check
