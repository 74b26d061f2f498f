// SPDX-License-Identifier: Apache-2.0

// sonocase calibrate lag: finds how much later one recording shows a motion than another.
#include <CLI/CLI.hpp>

#include "formats/calibration/lag.h"
#include "formats/files/atomic_file.h"
#include "pipeline/calibration/calibration_pictures.h"
#include "pipeline/calibration/touched_points.h"
#include "pipeline/verbs/verb_calibrate.h"

namespace sonocase::pipeline::inline verbs {

int calibrate_lag(int argc, char** argv) {
    CLI::App app("Find how much later the second recording shows a motion than the first",
                 "sonocase calibrate lag");
    CalibrateOptions options;
    options.add(app, 1);
    LagOptions how;
    std::string signal = "speed", values;
    app.add_option("--max-lag", how.max_lag_s, "Largest lag looked for, s")
        ->check(CLI::Range(0.01, 10.0))
        ->capture_default_str();
    app.add_option("--signal", signal, "What of a pose is compared")
        ->check(CLI::IsMember({"speed", "position"}))
        ->capture_default_str();
    app.add_option("--values", values,
                   "Second signal as rows time_s,value, e.g. the height of a line in the image, "
                   "instead of a second recording")
        ->type_name("FILE.csv");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const Stopwatch watch;
    if (options.poses.size() != (values.empty() ? 2u : 1u)) {
        return wrong_usage("calibrate", "lag takes two recordings, or one and --values");
    }
    if (!values.empty()) signal = "position";
    std::vector<Signal> signals;
    for (const std::string& path : options.poses) {
        auto poses = options.load(path);
        if (!poses) return fail("calibrate", poses.error());
        signals.push_back(signal == "speed" ? speed_signal(*poses) : position_signal(*poses));
    }
    if (!values.empty()) {
        auto read = load_signal(values);
        if (!read) return fail("calibrate", read.error());
        signals.push_back(std::move(*read));
    }
    const LagFit fit = fit_lag(signals[0], signals[1], how);
    Json json;
    json["lag_s"] = json_number(fit.lag_s);
    json["sigma_s"] = json_number(fit.sigma_s);
    json["correlation"] = json_number(fit.correlation);
    json["overlap_s"] = json_number(fit.overlap_s);
    json["determined"] = fit.determined;
    json["problem"] = fit.problem;
    json["warnings"] = fit.warnings;
    if (!options.pictures.empty()) {
        if (auto s = draw_lag_pictures(signals[0], signals[1], fit, options.pictures, "lag"); !s)
            return fail("calibrate", s.error());
    }
    if (!options.output.empty() && fit.determined) {
        // A format of its own: a lag is not a frame.
        Json file = {{"sonocase", "lag"},
                     {"version", 1},
                     {"lag_s", json_number(fit.lag_s)},
                     {"sigma_s", json_number(fit.sigma_s)},
                     {"correlation", json_number(fit.correlation)},
                     {"date", options.today()},
                     {"sensor", options.sensor},
                     {"warnings", fit.warnings}};
        if (auto s = write_file(options.output, std::string_view(file.dump(2) + "\n")); !s)
            return fail("calibrate", s.error());
        options.output.clear();
    }
    const std::string people =
        text_line("the second is %.1f ms later than the first, one sigma %.1f ms, correlation %.3f",
                  1e3 * fit.lag_s, 1e3 * fit.sigma_s, fit.correlation);
    return finish_calibration(options, json, people, {}, fit.problem, fit.warnings,
                              watch.seconds());
}

}  // namespace sonocase::pipeline::inline verbs
