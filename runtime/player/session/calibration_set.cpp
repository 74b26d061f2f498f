// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/calibration_set.h"

#include <cmath>
#include <optional>
#include <utility>

#include "formats/calibration/calibration.h"
#include "formats/calibration/foreign_calibration.h"
#include "formats/files/atomic_file.h"

namespace sonocase::runtime::inline player_session {

namespace {

// Puts a calibration in its place.
Status take(Calibration calibration, const std::string& file, Calibrations& calibrations) {
    std::optional<Calibration>* place = nullptr;
    if (calibration.kind == "probe") place = &calibrations.probe;
    if (calibration.kind == "needle") place = &calibrations.needle;
    if (calibration.kind == "mannequin") place = &calibrations.mannequin;
    if (!place) {
        return Error{"kind is \"" + calibration.kind + "\"", file,
                     "expected probe, needle or mannequin; make one with sonocase calibrate"};
    }
    const Vector3& sigma = calibration.sigma_mm;
    if (!std::isfinite(sigma.x) || !std::isfinite(sigma.y) || !std::isfinite(sigma.z)) {
        return Error{"the " + calibration.kind + " is not determined by it", file,
                     "calibrate again; for a needle a pivot of the tip and a spin are enough"};
    }
    if (*place) {
        return Error{"second calibration of the " + calibration.kind, file,
                     "give one --calibration of each kind"};
    }
    *place = std::move(calibration);
    return Done{};
}

}  // namespace

Result<Calibrations> load_calibrations(const std::vector<std::string>& files) {
    Calibrations calibrations;
    for (const std::string& file : files) {
        SONOCASE_TRY(const std::string text, read_text_file(file));
        SONOCASE_TRY(const std::optional<double> lag, parse_lag_s(text, file));
        if (lag) {
            calibrations.needle_lag_s = *lag;
            continue;
        }
        std::vector<Calibration> found;
        if (looks_like_foreign_calibration(text)) {
            SONOCASE_TRY(found, parse_foreign_calibrations(text, file));
        } else {
            SONOCASE_TRY(Calibration one, parse_calibration(text, file));
            found.push_back(std::move(one));
        }
        for (Calibration& calibration : found)
            SONOCASE_TRY_DONE(take(std::move(calibration), file, calibrations));
    }
    return calibrations;
}

void merge_calibrations(const Calibrations& newer, Calibrations& in_use) {
    if (newer.probe) in_use.probe = newer.probe;
    if (newer.needle) in_use.needle = newer.needle;
    if (newer.mannequin) in_use.mannequin = newer.mannequin;
}

std::vector<Message> calibration_warnings(const Calibrations& calibrations,
                                          const std::string& device,
                                          const std::string& now) {
    std::vector<Message> sentences;
    const auto look = [&](const std::optional<Calibration>& calibration) {
        if (!calibration) return;
        for (const Message& concern : calibration_concerns(*calibration, now)) {
            sentences.push_back({"Calibration of the {}: {}", {calibration->kind, concern}});
        }
        for (const std::string& warning : calibration->warnings)
            sentences.push_back({"Calibration of the {}: {}", {calibration->kind, warning}});
    };
    look(calibrations.probe);
    look(calibrations.needle);
    look(calibrations.mannequin);
    for (Message& sentence : sensor_mismatch_warnings(calibrations, device))
        sentences.push_back(std::move(sentence));
    return sentences;
}

std::vector<Message> sensor_mismatch_warnings(const Calibrations& calibrations,
                                              const std::string& device) {
    std::vector<Message> sentences;
    for (const auto* calibration :
         {&calibrations.probe, &calibrations.needle, &calibrations.mannequin}) {
        if (!*calibration || (*calibration)->sensor.empty() || device.empty()) continue;
        // A serial number or a short name is part of what the device calls itself.
        if (device.find((*calibration)->sensor) != std::string::npos) continue;
        sentences.push_back(
            {"The calibration of the {} was made with {}, and {} is in use; calibrate again.",
             {(*calibration)->kind, (*calibration)->sensor, device}});
    }
    return sentences;
}

}  // namespace sonocase::runtime::inline player_session
