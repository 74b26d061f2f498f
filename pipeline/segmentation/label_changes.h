// SPDX-License-Identifier: Apache-2.0

// What a stage did to each label: the guard that names every lost or shrunk structure.
#pragma once

#include <string>
#include <vector>

#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline {

struct LabelChange {
    int label = 0;  // palette index
    std::string name;
    double volume_before_ml = 0;  // expected: of the input, stretched by the map where there is one
    double volume_after_ml = 0;
    double change() const {  // relative; -1 when lost
        return volume_before_ml > 0 ? volume_after_ml / volume_before_ml - 1 : 0;
    }
    bool lost() const { return volume_before_ml > 0 && volume_after_ml == 0; }
    std::string note;  // why, where the volume is not kept
};

// Volume of each label in ml, # labels.
std::vector<double> label_volumes_ml(const LabelVolume& volume);

// One entry for each label, outside (0) left out, that the input has. # before, # after = # labels.
std::vector<LabelChange> compare_volumes(const std::vector<Label>& labels,
                                         const std::vector<double>& before_ml,
                                         const std::vector<double>& after_ml);

// Adds labels, lost_labels, mean_abs_volume_change, max_abs_volume_change, and a warning for each
// label that is lost or changed by more than `warn_above`.
void report_changes(const std::vector<LabelChange>& changes,
                    double warn_above,
                    StageReport* report);

}  // namespace sonocase::pipeline
