// SPDX-License-Identifier: Apache-2.0

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "pipeline/tradeoff/program_beside.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

// Errors and time of the press field on a folder of finite element blocks. It runs as a program of
// its own: pipeline and runtime do not link each other.
Result<Measured> measure(const std::string& blocks, const Settings& settings) {
    if (!std::filesystem::exists(blocks))
        return Error{"no finite element blocks", blocks,
                     "give their folder or its parent as --data"};
    std::string increments = "3", iterations = "12";
    for (const Setting& s : settings) {
        if (s.key == "press.increments") increments = s.value;
        if (s.key == "press.iterations") iterations = s.value;
    }
    const std::string arguments = "'" + blocks + "' '" + increments + "' '" + iterations + "'";
    const auto text = output_of_program_beside("press_block", arguments, "press");
    if (!text) return text.error();
    const auto json = nlohmann::json::parse(*text, nullptr, false);
    if (json.is_discarded() || !json.contains("blocks"))
        return Error{"is not the errors of blocks", "press_block " + arguments,
                     "a JSON object with blocks{}"};
    double error = 0, seconds = 0;
    int count = 0;
    for (const auto& block : json["blocks"]) {
        for (const auto& state : block["states"]) {
            if (state.value("pressed_mm", 0.0) > 8.5) continue;
            error += state.value("mean_mm", 0.0);
            ++count;
        }
        seconds += block.value("solve_ms", 0.0) * 1e-3 / static_cast<double>(json["blocks"].size());
    }
    if (count == 0) return Error{"no states", "press_block " + arguments, "states[] of the blocks"};
    return Measured{error / count, seconds, ""};
}

}  // namespace

Suite press_suite(const std::string& data) {
    Suite suite;
    suite.name = "press";
    suite.title = "Tissue under a pressing probe";
    suite.body = "blocks";
    suite.error_name = "mean displacement error";
    suite.error_unit = "mm";
    suite.truth =
        "Displacements of a nonlinear finite element model at up to 8 mm of pressing, mean over "
        "the blocks of the data folder; seconds are the fastest of twenty solutions, look-ups in "
        "the finite elements included.";
    suite.knobs = {{"press.increments",
                    {"1", "2", "3", "4", "8"},
                    "3",
                    "",
                    "steps in which the face is pressed in",
                    "moduli are taken at the stress reached",
                    "from three on the model's own error is larger"},
                   {"press.iterations",
                    {"3", "6", "12", "24", "48"},
                    "12",
                    "",
                    "conjugate gradients in each step, a third more in the first",
                    "what is left of the linear system's error",
                    "the model's own error is reached at twelve"}};
    suite.pairs = {{"press.increments", "press.iterations"}};
    // The blocks' folder itself or the one that holds it.
    std::error_code failed;
    const std::string within = data + "/deformation";
    const std::string blocks = std::filesystem::exists(within, failed) ? within : data;
    suite.measure = [blocks](const Settings& settings) { return measure(blocks, settings); };
    return suite;
}

}  // namespace sonocase::pipeline
