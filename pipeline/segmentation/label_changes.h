// SPDX-License-Identifier: Apache-2.0

// What a stage did to the volume of each label. Names every structure that was lost or has shrunk.
#pragma once

#include <string>
#include <vector>

#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline segmentation {

struct LabelChange {
    int label = 0;  // palette index
    std::string name;
    double volume_before_ml = 0;  // of the input, after the map's deformation where there is one
    double volume_after_ml = 0;
    double change() const {  // relative; -1 when lost
        return volume_before_ml > 0 ? volume_after_ml / volume_before_ml - 1 : 0;
    }
    bool lost() const { return volume_before_ml > 0 && volume_after_ml == 0; }
    std::string note;  // the reason, if known, why the volume has changed
};

// Volume of each label in ml, # labels.
std::vector<double> label_volumes_ml(const LabelVolume& volume);

// One entry per label with volume in the input, without outside (0). before, after: # labels.
std::vector<LabelChange> compare_volumes(const std::vector<Label>& labels,
                                         const std::vector<double>& before_ml,
                                         const std::vector<double>& after_ml);

// Relative change of volume above which a label is named in a warning. Of a structure below
// kSmallMl it may be half as much again: some hundred voxels of a usual CT, whose own count tells
// the volume no better.
inline constexpr double kMaxExpectedChange = 0.2;
inline constexpr double kSmallMl = 1;

// Adds the measures labels, lost_labels, mean_abs_volume_change and max_abs_volume_change, and a
// warning per label that is lost or has changed by more than `warn_above`.
void report_changes(const std::vector<LabelChange>& changes,
                    double warn_above,
                    StageReport* report);

}  // namespace sonocase::pipeline::inline segmentation
