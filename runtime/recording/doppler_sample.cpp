// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/doppler_sample.h"

#include <string>

namespace sonocase::runtime {

DopplerSample doppler_sample(const DopplerReport& report, const std::vector<Label>& labels) {
    const auto name = [&](int label) {
        return label >= 0 && label < static_cast<int>(labels.size())
                   ? labels[static_cast<std::size_t>(label)].name
                   : std::string();
    };
    DopplerSample sample;
    for (const int label : report.coloured)
        if (!name(label).empty()) sample.coloured.push_back(name(label));
    sample.gate = name(report.gate_label);
    sample.gate_fill = report.gate_fill;
    sample.angle_deg = report.angle_deg;
    sample.cursor_deg = report.cursor_deg;
    sample.psv_cm_s = report.psv_cm_s;
    sample.true_psv_cm_s = report.true_psv_cm_s;
    sample.beats = report.beats;
    return sample;
}

}  // namespace sonocase::runtime
