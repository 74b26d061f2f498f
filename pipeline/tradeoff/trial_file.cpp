// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/trial_file.h"

#include <nlohmann/json.hpp>
#include <sstream>

#include "formats/text/number_text.h"

namespace sonocase::pipeline {
namespace {

constexpr const char* kColumns =
    "suite,body,role,name,settings,error,seconds,seconds_low,seconds_high,repeats,front,note";

// Commas and line ends within a field would break the row; they carry no meaning in ours.
std::string field(std::string text) {
    for (char& c : text) {
        if (c == ',' || c == '\n' || c == '\r') c = ';';
    }
    return text;
}

}  // namespace

std::string format_trials_csv(const std::vector<Trial>& trials) {
    const std::vector<bool> front = pareto_front(trials);
    std::string csv = std::string(kColumns) + "\n";
    for (std::size_t i = 0; i < trials.size(); ++i) {
        const Trial& t = trials[i];
        csv += field(t.suite) + "," + field(t.body) + "," + role_name(t.role) + "," +
               field(t.name) + "," + field(settings_text(t.settings)) + "," + number_text(t.error) +
               "," + number_text(t.seconds) + "," + number_text(t.seconds_low) + "," +
               number_text(t.seconds_high) + "," + std::to_string(t.repeats) + "," +
               (front[i] ? "1" : "0") + "," + field(t.note) + "\n";
    }
    return csv;
}

std::string format_trials_json(const std::vector<Trial>& trials) {
    const std::vector<bool> front = pareto_front(trials);
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < trials.size(); ++i) {
        const Trial& t = trials[i];
        nlohmann::ordered_json settings = nlohmann::ordered_json::object();
        for (const Setting& s : t.settings) settings[s.key] = s.value;
        rows.push_back({{"suite", t.suite},
                        {"body", t.body},
                        {"role", role_name(t.role)},
                        {"name", t.name},
                        {"settings", settings},
                        {"error", t.error},
                        {"seconds", t.seconds},
                        {"seconds_low", t.seconds_low},
                        {"seconds_high", t.seconds_high},
                        {"repeats", t.repeats},
                        {"on_front", static_cast<bool>(front[i])},
                        {"note", t.note}});
    }
    return nlohmann::ordered_json{{"version", 1}, {"trials", rows}}.dump(1) + "\n";
}

Result<std::vector<Trial>> parse_trials_csv(const std::string& text, const std::string& where) {
    std::vector<Trial> trials;
    std::istringstream lines(text);
    std::string line;
    int number_of_line = 0;
    while (std::getline(lines, line)) {
        ++number_of_line;
        const std::string place = where + ":" + std::to_string(number_of_line);
        if (number_of_line == 1) {
            if (line != kColumns)
                return Error{"not a table of trials", place, "remove the file to sweep again"};
            continue;
        }
        std::vector<std::string> cells;
        std::istringstream row(line);
        for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
        if (cells.size() == 11) cells.emplace_back();  // an empty note at the end of the row
        Trial t;
        double repeats = 0;
        const bool good = cells.size() == 12 && parse_number(cells[5], t.error) &&
                          parse_number(cells[6], t.seconds) &&
                          parse_number(cells[7], t.seconds_low) &&
                          parse_number(cells[8], t.seconds_high) && parse_number(cells[9], repeats);
        bool known_role = false;
        if (good) {
            for (TrialRole role : {TrialRole::standard, TrialRole::knob, TrialRole::pair,
                                   TrialRole::preset, TrialRole::paper, TrialRole::peer}) {
                if (cells[2] == role_name(role)) {
                    t.role = role;
                    known_role = true;
                }
            }
        }
        if (!known_role)
            return Error{"a row that is not a trial", place, "remove the file to sweep again"};
        t.suite = cells[0];
        t.body = cells[1];
        t.name = cells[3];
        t.settings = parse_settings(cells[4]);
        t.repeats = static_cast<int>(repeats);
        t.note = cells[11];
        trials.push_back(t);
    }
    return trials;
}

}  // namespace sonocase::pipeline
