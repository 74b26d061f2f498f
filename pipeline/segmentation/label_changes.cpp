// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/label_changes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace sonocase::pipeline::inline segmentation {

std::vector<double> label_volumes_ml(const LabelVolume& volume) {
    std::array<std::size_t, 256> counts{};
    for (const std::uint8_t v : volume.voxels) ++counts[v];
    std::vector<double> out(volume.labels.size());
    for (std::size_t l = 0; l < out.size(); ++l) {
        out[l] = static_cast<double>(counts[l]) * volume.grid.voxel_volume_mm3() / 1000;
    }
    return out;
}

std::vector<LabelChange> compare_volumes(const std::vector<Label>& labels,
                                         const std::vector<double>& before_ml,
                                         const std::vector<double>& after_ml) {
    std::vector<LabelChange> out;
    for (std::size_t l = 1; l < labels.size(); ++l) {
        if (before_ml[l] <= 0) continue;
        out.push_back({static_cast<int>(l), labels[l].name, before_ml[l], after_ml[l], {}});
    }
    return out;
}

void report_changes(const std::vector<LabelChange>& changes,
                    double warn_above,
                    StageReport* report) {
    int lost = 0;
    double sum = 0, worst = 0;
    for (const LabelChange& c : changes) {
        const double change = std::abs(c.change());
        sum += change;
        worst = std::max(worst, change);
        char line[256];
        const std::string why = c.note.empty() ? "" : ": " + c.note;
        if (c.lost()) {
            ++lost;
            std::snprintf(line, sizeof line,
                          "label %s (%.3g ml) has no voxel left%s; choose a smaller voxel",
                          c.name.c_str(), c.volume_before_ml, why.c_str());
            report->warnings.emplace_back(line);
        } else if (change > (c.volume_before_ml < kSmallMl ? 1.5 : 1) * warn_above) {
            std::snprintf(
                line, sizeof line,
                "label %s went from %.3g to %.3g ml (%+.0f %%)%s; choose a smaller voxel or "
                "less smoothing",
                c.name.c_str(), c.volume_before_ml, c.volume_after_ml, 100 * c.change(),
                why.c_str());
            report->warnings.emplace_back(line);
        }
    }
    const double n = static_cast<double>(changes.size());
    report->measures.push_back({"labels", n});
    report->measures.push_back({"lost_labels", static_cast<double>(lost)});
    report->measures.push_back({"mean_abs_volume_change", n > 0 ? sum / n : 0});
    report->measures.push_back({"max_abs_volume_change", worst});
}

}  // namespace sonocase::pipeline::inline segmentation
