// SPDX-License-Identifier: Apache-2.0

#include "doppler_values.h"

#include <cmath>

namespace sonocase::python {
namespace {

using runtime::DopplerMode;
using runtime::DopplerSettings;

struct Number {
    const char* name;
    double DopplerSettings::*value;
};
constexpr Number kNumbers[] = {
    {"box_left", &DopplerSettings::box_left},
    {"box_right", &DopplerSettings::box_right},
    {"box_top_mm", &DopplerSettings::box_top_mm},
    {"box_bottom_mm", &DopplerSettings::box_bottom_mm},
    {"gate_line", &DopplerSettings::gate_line},
    {"gate_depth_mm", &DopplerSettings::gate_depth_mm},
    {"gate_mm", &DopplerSettings::gate_mm},
    {"angle_deg", &DopplerSettings::angle_deg},
    {"steer_deg", &DopplerSettings::steer_deg},
    {"scale_cm_s", &DopplerSettings::scale_cm_s},
    {"spectral_scale_cm_s", &DopplerSettings::spectral_scale_cm_s},
    {"baseline", &DopplerSettings::baseline},
    {"wall_filter", &DopplerSettings::wall_filter},
    {"doppler_gain_db", &DopplerSettings::gain_db},
    {"priority", &DopplerSettings::priority},
    {"diameter_mm", &DopplerSettings::diameter_mm},
};
constexpr std::size_t kBoxNumbers = 4, kGateNumbers = 7, kAimNumbers = 9;  // the first of the table

struct Count {
    const char* name;
    int DopplerSettings::*value;
};
constexpr Count kCounts[] = {{"ensemble", &DopplerSettings::ensemble},
                             {"persistence", &DopplerSettings::persistence},
                             {"gate_points", &DopplerSettings::gate_points}};

bool gives(const py::dict& given, std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i)
        if (given.contains(kNumbers[i].name)) return true;
    return false;
}

bool set_one(const std::string& name, py::handle value, DopplerSettings& settings) {
    for (const Number& number : kNumbers) {
        if (name != number.name) continue;
        const auto read = py::cast<double>(value);
        if (!std::isfinite(read)) throw py::value_error("doppler: " + name + " is not finite");
        settings.*number.value = read;
        return true;
    }
    for (const Count& count : kCounts) {
        if (name != count.name) continue;
        settings.*count.value = py::cast<int>(value);
        return true;
    }
    if (name != "invert") return false;
    settings.invert = py::cast<bool>(value);
    return true;
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
        const auto name = py::cast<std::string>(key);
        if (!set_one(name, value, settings))
            throw py::value_error("doppler: no setting " + name +
                                  "; docs/python.md lists those that there are");
    }
}

bool gives_box(const py::dict& given) {
    return gives(given, 0, kBoxNumbers);
}

bool gives_gate(const py::dict& given) {
    return gives(given, kBoxNumbers, kGateNumbers);
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
