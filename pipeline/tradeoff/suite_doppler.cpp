// SPDX-License-Identifier: Apache-2.0

#include <nlohmann/json.hpp>
#include <string>

#include "pipeline/tradeoff/program_beside.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

// Runs as a program of its own: pipeline and runtime do not link each other.
Result<Measured> measure(const std::string& arguments) {
    const auto text = output_of_program_beside("doppler_trial", arguments, "colour and spectrum");
    if (!text) return text.error();
    const auto json = nlohmann::json::parse(*text, nullptr, false);
    if (json.is_discarded() || !json.contains("error") || !json.contains("seconds"))
        return Error{"is not the error of a trial", "doppler_trial " + arguments,
                     "a JSON object with error and seconds"};
    return Measured{json["error"].get<double>(), json["seconds"].get<double>(),
                    json.value("note", "")};
}

std::string value_of(const Settings& settings, const std::string& key, const char* standard) {
    for (const Setting& s : settings)
        if (s.key == key) return s.value;
    return standard;
}

}  // namespace

Suite colour_suite() {
    Suite suite;
    suite.name = "colour";
    suite.title = "Colour Doppler";
    suite.body = "tube";
    suite.error_name = "noise of the velocity";
    suite.error_unit = "of the Nyquist velocity";
    suite.truth =
        "A tube of 8 mm with 480 mL/min at 55 degrees, in a box of a third of a sector; the "
        "standard deviation of its cells over forty frames. Seconds are the fastest of them. What "
        "pulses cost a machine "
        "is its frame rate, in the notes.";
    suite.knobs = {{"colour.ensemble",
                    {"4", "6", "8", "10", "12", "16"},
                    "10",
                    "",
                    "pulses for each line",
                    "noise of the velocity",
                    "no pulse is simulated: more of them cost the machine time, and us none"},
                   {"colour.persistence",
                    {"1", "2", "3", "4"},
                    "2",
                    "",
                    "frames whose noise is blended",
                    "nothing: its noise lasts longer and is as large",
                    "draws are kept from frame to frame"}};
    suite.measure = [](const Settings& settings) {
        return measure("colour " + value_of(settings, "colour.ensemble", "10") + " " +
                       value_of(settings, "colour.persistence", "2"));
    };
    return suite;
}

Suite spectrum_suite() {
    Suite suite;
    suite.name = "spectrum";
    suite.title = "Spectral Doppler";
    suite.body = "tube";
    suite.error_name = "rms error of the peak velocity";
    suite.error_unit = "of the true one";
    suite.truth =
        "The same tube with an artery's pulse, a gate of 4 mm in its middle: 24 times 5 s of "
        "spectrum. Seconds are those "
        "of one line, of which there are 200 a second; the bias is in the notes.";
    suite.knobs = {{"spectrum.gate_points",
                    {"8", "16", "32", "64", "128", "256"},
                    "64",
                    "",
                    "points of the gate",
                    "how finely the gate's velocities are told apart",
                    "what is left beyond 16 is the bins' and the envelope's"}};
    suite.measure = [](const Settings& settings) {
        return measure("spectrum " + value_of(settings, "spectrum.gate_points", "64"));
    };
    return suite;
}

}  // namespace sonocase::pipeline
