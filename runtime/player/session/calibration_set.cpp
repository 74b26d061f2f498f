// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/calibration_set.h"

#include <optional>
#include <utility>

#include "formats/calibration/quality.h"
#include "formats/files/atomic_file.h"

namespace sonocase::runtime {

Result<Calibrations> load_calibrations(const std::vector<std::string>& files) {
    Calibrations calibrations;
    for (const std::string& file : files) {
        const Result<std::string> text = read_text_file(file);
        if (!text) return text.error();
        const Result<std::optional<double>> lag = parse_lag_s(*text, file);
        if (!lag) return lag.error();
        if (*lag) {
            calibrations.needle_lag_s = **lag;
            continue;
        }
        Result<Calibration> calibration = parse_calibration(*text, file);
        if (!calibration) return calibration.error();
        std::optional<Calibration>* place = nullptr;
        if (calibration->kind == "probe") place = &calibrations.probe;
        if (calibration->kind == "needle") place = &calibrations.needle;
        if (calibration->kind == "mannequin") place = &calibrations.mannequin;
        if (!place) {
            return Error{"kind is \"" + calibration->kind + "\"", file,
                         "expected probe, needle or mannequin; make one with sonocase calibrate"};
        }
        if (*place) {
            return Error{"second calibration of the " + calibration->kind, file,
                         "give one --calibration of each kind"};
        }
        *place = std::move(*calibration);
    }
    return calibrations;
}

void merge_calibrations(const Calibrations& newer, Calibrations& in_use) {
    if (newer.probe) in_use.probe = newer.probe;
    if (newer.needle) in_use.needle = newer.needle;
    if (newer.mannequin) in_use.mannequin = newer.mannequin;
}

std::vector<std::string> calibration_warnings(const Calibrations& calibrations,
                                              const std::string& device,
                                              const std::string& now) {
    std::vector<std::string> sentences;
    const auto look = [&](const std::optional<Calibration>& calibration) {
        if (!calibration) return;
        for (const std::string& concern : calibration_concerns(*calibration, now)) {
            sentences.push_back("Calibration of the " + calibration->kind + ": " + concern);
        }
    };
    look(calibrations.probe);
    look(calibrations.needle);
    look(calibrations.mannequin);
    for (std::string& sentence : sensor_mismatch_warnings(calibrations, device))
        sentences.push_back(std::move(sentence));
    return sentences;
}

std::vector<std::string> sensor_mismatch_warnings(const Calibrations& calibrations,
                                                  const std::string& device) {
    std::vector<std::string> sentences;
    for (const auto* calibration :
         {&calibrations.probe, &calibrations.needle, &calibrations.mannequin}) {
        if (!*calibration || (*calibration)->sensor.empty() || device.empty()) continue;
        // A serial number or a short name is part of what the device calls itself.
        if (device.find((*calibration)->sensor) != std::string::npos) continue;
        sentences.push_back("The calibration of the " + (*calibration)->kind + " was made with " +
                            (*calibration)->sensor + ", and " + device +
                            " is in use; calibrate again.");
    }
    return sentences;
}

}  // namespace sonocase::runtime
