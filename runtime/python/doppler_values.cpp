// SPDX-License-Identifier: Apache-2.0

#include "doppler_values.h"

#include <cstdio>

namespace sonocase::python {
namespace {

using runtime::DopplerMode;
using runtime::DopplerSettings;

struct Number {
    const char* name;
    double DopplerSettings::*value;
    runtime::Limits<double> limits;
};
constexpr Number kNumbers[] = {
    {"box_left", &DopplerSettings::box_left, runtime::kFacePartLimits},
    {"box_right", &DopplerSettings::box_right, runtime::kFacePartLimits},
    {"box_top_mm", &DopplerSettings::box_top_mm, runtime::kDepthMmLimits},
    {"box_bottom_mm", &DopplerSettings::box_bottom_mm, runtime::kDepthMmLimits},
    {"gate_line", &DopplerSettings::gate_line, runtime::kFacePartLimits},
    {"gate_depth_mm", &DopplerSettings::gate_depth_mm, runtime::kDepthMmLimits},
    {"gate_mm", &DopplerSettings::gate_mm, runtime::kGateMmLimits},
    {"angle_deg", &DopplerSettings::angle_deg, runtime::kAngleDegLimits},
    {"steer_deg", &DopplerSettings::steer_deg, runtime::kSteerDegLimits},
    {"scale_cm_s", &DopplerSettings::scale_cm_s, runtime::kScaleCmSLimits},
    {"spectral_scale_cm_s", &DopplerSettings::spectral_scale_cm_s,
     runtime::kSpectralScaleCmSLimits},
    {"baseline", &DopplerSettings::baseline, runtime::kBaselineLimits},
    {"wall_filter", &DopplerSettings::wall_filter, runtime::kWallFilterLimits},
    {"doppler_gain_db", &DopplerSettings::gain_db, runtime::kDopplerGainDbLimits},
    {"priority", &DopplerSettings::priority, runtime::kPriorityLimits},
    {"diameter_mm", &DopplerSettings::diameter_mm, runtime::kDiameterMmLimits},
};
constexpr std::size_t kBoxNumbers = 4, kGateNumbers = 7, kAimNumbers = 9;  // the first of the table

struct Count {
    const char* name;
    int DopplerSettings::*value;
    runtime::Limits<int> limits;
};
constexpr Count kCounts[] = {
    {"ensemble", &DopplerSettings::ensemble, runtime::kEnsembleLimits},
    {"persistence", &DopplerSettings::persistence, runtime::kPersistenceLimits},
    {"gate_points", &DopplerSettings::gate_points, runtime::kGatePointLimits}};

bool gives(const py::dict& given, std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i)
        if (given.contains(kNumbers[i].name)) return true;
    return false;
}

bool set_one(const std::string& name, py::handle value, DopplerSettings& settings) {
    const std::string place = "doppler: " + name;
    for (const Number& number : kNumbers) {
        if (name != number.name) continue;
        settings.*number.value = number_within(value, place, number.limits);
        return true;
    }
    for (const Count& count : kCounts) {
        if (name != count.name) continue;
        settings.*count.value =
            static_cast<int>(whole_within(value, place, count.limits.min, count.limits.max));
        return true;
    }
    if (name != "invert") return false;
    settings.invert = number_from(value, place) != 0;
    return true;
}

// "doppler: box_left 0.8 is not below box_right 0.75; give both".
void refuse_reversed(const Number& low, const Number& high, const DopplerSettings& settings) {
    if (settings.*low.value < settings.*high.value) return;
    char text[128];
    std::snprintf(text, sizeof text, "doppler: %s %.6g is not below %s %.6g; give both", low.name,
                  settings.*low.value, high.name, settings.*high.value);
    throw py::value_error(text);
}

std::string label_of(const std::vector<Label>& labels, int label) {
    return label >= 0 && label < static_cast<int>(labels.size()) ? labels[label].name
                                                                 : std::string();
}

}  // namespace

DopplerMode doppler_mode(const std::string& name) {
    if (name == "b") return DopplerMode::off;
    if (name == "colour") return DopplerMode::colour;
    if (name == "power") return DopplerMode::power;
    if (name == "pw") return DopplerMode::spectral;
    if (name == "m") return DopplerMode::m_mode;
    throw py::value_error("mode: no mode " + name + "; give b, colour, power, pw or m");
}

void apply_doppler(const py::dict& given, DopplerSettings& settings) {
    for (const auto& [key, value] : given) {
        const std::string name = text_from(key, "doppler");
        if (!set_one(name, value, settings))
            throw py::value_error("doppler: no setting " + name +
                                  "; docs/python.md lists those that there are");
    }
    refuse_reversed(kNumbers[0], kNumbers[1], settings);
    refuse_reversed(kNumbers[2], kNumbers[3], settings);
}

void take_aim(const py::dict& given, const DopplerSettings& aim, DopplerSettings& settings) {
    const auto take = [&](std::size_t first, std::size_t end) {
        if (gives(given, first, end)) return;
        for (std::size_t i = first; i < end; ++i)
            settings.*kNumbers[i].value = aim.*kNumbers[i].value;
    };
    take(0, kBoxNumbers);
    if (!gives(given, kBoxNumbers, kGateNumbers)) {
        take(kBoxNumbers, kGateNumbers);
        take(kGateNumbers, kGateNumbers + 1);  // the cursor lies along the gate's vessel
    }
    take(kAimNumbers - 1, kAimNumbers);
}

py::dict doppler_limits() {
    py::dict limits;
    for (const Number& n : kNumbers) limits[n.name] = py::make_tuple(n.limits.min, n.limits.max);
    for (const Count& n : kCounts) limits[n.name] = py::make_tuple(n.limits.min, n.limits.max);
    return limits;
}

py::dict aim_of(const DopplerSettings& settings) {
    py::dict out;
    for (std::size_t i = 0; i < kAimNumbers; ++i)
        out[kNumbers[i].name] = settings.*kNumbers[i].value;
    return out;
}

py::dict measures_of(const runtime::DopplerView& view,
                     DopplerMode mode,
                     const std::vector<Label>& labels) {
    py::dict out;
    const runtime::DopplerReport report = view.report();
    if (mode == DopplerMode::spectral) {
        const auto m = view.spectrum().measures();
        out["vessel"] = label_of(labels, report.gate_label);
        out["gate_fill"] = report.gate_fill;
        out["true_angle_deg"] = report.angle_deg;
        out["beats"] = m.beats;
        out["psv_cm_s"] = m.psv_cm_s;
        out["psv_raw_cm_s"] = m.psv_raw_cm_s;
        out["true_psv_cm_s"] = m.vessel_psv_cm_s;
        out["edv_cm_s"] = m.edv_cm_s;
        out["mean_cm_s"] = m.mean_cm_s;
        out["resistive_index"] = m.resistive_index;
        out["flow_ml_min"] = m.flow_ml_min;
        out["diameter_mm"] = m.diameter_mm;
    } else if (mode == DopplerMode::colour || mode == DopplerMode::power) {
        py::list vessels;
        for (const int label : report.coloured)
            if (label >= 0) vessels.append(label_of(labels, label));
        out["vessels"] = vessels;
        out["cells"] = view.colour().cells;
        out["blood_cells"] = view.colour().blood_cells;
        out["shown_cells"] = view.colour().shown_cells;
        out["flash"] = view.colour().flash;
        out["machine_frames_per_s"] = view.colour().frame_hz;
    }
    return out;
}

}  // namespace sonocase::python
