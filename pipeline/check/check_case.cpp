// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/check_case.h"

#include <algorithm>

#include "formats/text/json_reader.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/export/inspect_case.h"

namespace sonocase::pipeline {
namespace {

using detail::Json;

void check_fit(const CaseBundle& bundle, CheckResult& result) {
    for (const StageReport& report : bundle.manifest.stages) {
        for (const Measure& m : report.measures)
            if (m.name == "min_det_jacobian" && !(m.value > 0))
                result.faults.push_back({"fold",
                                         "the fitted map may turn tissue inside out (det J "
                                         "of at least " +
                                             std::to_string(m.value) + ")",
                                         "fit again: look at the pose, give landmarks"});
        for (const std::string& warning : report.warnings)
            result.remarks.push_back(report.stage + ": " + warning);
    }
}

void check_textures(const CaseBundle& bundle, CheckResult& result) {
    for (const Tissue* tissue : tissues_without_texture(bundle)) {
        result.faults.push_back({"texture-missing",
                                 "tissue '" + tissue->name + "' asks for the texture '" +
                                     tissue->texture + "', which is not there",
                                 "cook the textures of this case again"});
    }
}

void check_validity(const CaseBundle& bundle, CheckResult& result) {
    for (const Finding& finding : validate_case(bundle)) {
        if (finding.text.find("missing texture") != std::string::npos) continue;  // named above
        if (finding.error)
            result.faults.push_back({"not-valid", finding.text, "cook the case again"});
        else
            result.remarks.push_back(finding.text);
    }
}

}  // namespace

CheckResult check_case(const CaseBundle& bundle) {
    CheckResult result;
    check_anatomy(bundle, result);
    check_fit(bundle, result);
    check_textures(bundle, result);
    check_exercises(bundle, result);
    check_validity(bundle, result);
    return result;
}

std::string check_json(const CaseBundle& bundle, const CheckResult& result) {
    Json out = Json::object();
    out["case"] = bundle.manifest.case_name;
    out["faults"] = Json::array();
    for (const Fault& fault : result.faults) {
        Json item = Json::object();
        item["name"] = fault.name;
        item["what"] = fault.what;
        item["remedy"] = fault.remedy;
        out["faults"].push_back(std::move(item));
    }
    out["remarks"] = result.remarks;
    out["organs"] = Json::array();
    for (const OrganRow& organ : result.organs) {
        Json item = Json::object();
        item["label"] = organ.label;
        item["ml"] = organ.ml;
        if (organ.high_ml > 0) item["normal_ml"] = Json::array({organ.low_ml, organ.high_ml});
        out["organs"].push_back(std::move(item));
    }
    out["targets"] = Json::array();
    for (const TargetRow& target : result.targets) {
        Json item = Json::object();
        item["exercise"] = target.exercise;
        item["target"] = target.target;
        item["windows"] = target.windows;
        item["depth_mm"] = target.depth_mm;
        item["blocked"] = target.blocked;
        item["needle"] = target.needle;
        item["visible"] = target.visible;
        out["targets"].push_back(std::move(item));
    }
    out["exercises"] = Json::array();
    for (const ExerciseRow& exercise : result.exercises) {
        Json item = Json::object();
        item["exercise"] = exercise.exercise;
        item["played"] = exercise.played;
        item["missed"] = exercise.missed;
        out["exercises"].push_back(std::move(item));
    }
    out["ribs"] = Json::object();
    out["ribs"]["right"] = result.ribs_right;
    out["ribs"]["left"] = result.ribs_left;
    return detail::json_text(out, true);
}

}  // namespace sonocase::pipeline
