// SPDX-License-Identifier: Apache-2.0

// From what a hospital delivers to a case that can be tried, in one call: what is in the given
// paths is recognised, a recipe is written, the case is cooked on the patient's own skin or fitted
// to a mannequin, exercises are proposed for it, and it is checked, drawn and published.
//
// Beside the bundle OUT/NAME.sonocase lies the folder OUT/NAME:
//
//     case.toml         the recipe           } written once, and again while nobody has changed
//     EXERCISE.toml     proposed exercises   } them: a changed file is the author's and stays
//     check.html, pictures.png
//     input/            links to what was given, so that no folder's name gets into the bundle
//     cache/, made.json what a second run goes by: it does what has changed, and no more
//
// Exercises are proposed on the patient's own skin and written in the frame `ct`, whatever the case
// is fitted to: another mannequin carries them along and cooks neither import nor textures again.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/export/publish.h"

namespace sonocase::pipeline::inline make {

struct MakeOptions {
    std::vector<std::string> inputs;   // files and folders as they came
    std::string scan, table, surface;  // by hand; empty: found in the inputs, or none
    std::string names = "auto";        // names_options()
    std::string up;                    // "X,Y,Z": the patient's head in the surface's frame
    std::string out;                   // OUT/NAME.sonocase
    std::string preset;                // empty: that of the recipe
    std::vector<std::string> sets;     // SECTION.KEY=VALUE
    bool resample_shear = false;  // slanted axes too; slices of a tilted gantry are in any case
    bool accept_faults = false;   // publish a case in which the check finds faults
    std::string site;             // to publish into; empty: none
    PublishOptions publish;
    std::string producer;  // program and version, for the manifest
};

// One thing that was decided, and what decides otherwise.
struct Decision {
    std::string what;       // "labels: DICOM segmentation seg.dcm"
    std::string otherwise;  // "give another by its own path"
};

struct MadeCase {
    std::string bundle, folder, site;   // paths
    std::vector<std::string> cooked;    // stages that ran and were not in the cache
    std::vector<std::string> warnings;  // of the stages, whole sentences
    std::vector<std::string> faults;    // of the check
    std::size_t exercises = 0;
    bool checked_anew = false;  // check and pictures were made in this run
};

// decided: called for each decision as it is taken.
// Errors besides those of the stages: no labels, or several maps; labels of organs alone without a
// scan; an anatomy that supports no exercise where the author has written none; faults that the
// check finds, unless they are accepted: the bundle and its check are written then, and not
// published. warnings: gets those of the stages where no case is made.
Result<MadeCase> make_case(const MakeOptions& options,
                           const std::function<void(const Decision&)>& decided,
                           const Progress& progress = {},
                           std::vector<std::string>* warnings = nullptr);

}  // namespace sonocase::pipeline::inline make
