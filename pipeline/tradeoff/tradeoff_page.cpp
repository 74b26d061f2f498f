// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/tradeoff_page.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>

#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "pipeline/base/text.h"
#include "pipeline/pictures/chart.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/stages/built_in_stages.h"

namespace sonocase::pipeline::inline tradeoff {

extern const std::string_view kTradeoffPageHtml;  // tradeoff_page.html, embedded by CMake

namespace {

const HtmlTemplate& html() {
    static const HtmlTemplate page(kTradeoffPageHtml);
    return page;
}

std::vector<Trial> trials_of(const PageInput& input, const Suite& suite) {
    std::vector<Trial> own;
    for (const Trial& t : input.trials) {
        if (t.suite == suite.name && t.body == suite.body) own.push_back(t);
    }
    return own;
}

std::string number(double value) {
    if (!std::isfinite(value)) return "failed";
    return number_text(value, 3);
}

Chart suite_chart(const Suite& suite, const std::vector<Trial>& trials) {
    Chart chart;
    chart.title = suite.title + " (" + suite.body + ")";
    chart.x_label = "seconds";
    chart.y_label = suite.error_name + ", " + suite.error_unit;
    chart.x_log = chart.y_log = true;
    const std::vector<bool> front = pareto_front(trials);

    Series all{"settings tried", {}, {}, SeriesStyle::points, {190, 190, 190}, 2.5};
    std::vector<std::pair<double, double>> line;
    for (std::size_t i = 0; i < trials.size(); ++i) {
        all.x.push_back(trials[i].seconds);
        all.y.push_back(trials[i].error);
        if (front[i] && trials[i].error > 0) line.emplace_back(trials[i].seconds, trials[i].error);
    }
    std::sort(line.begin(), line.end());
    Series best{"Pareto front", {}, {}, SeriesStyle::line_and_points, {0, 114, 178}, 2};
    for (const auto& [s, e] : line) {
        best.x.push_back(s);
        best.y.push_back(e);
    }
    chart.series = {all, best};

    std::size_t colour = 0;
    constexpr std::array<std::array<std::uint8_t, 3>, 6> marks{{{0, 158, 115},
                                                                {230, 159, 0},
                                                                {204, 121, 167},
                                                                {86, 180, 233},
                                                                {240, 228, 66},
                                                                {90, 60, 160}}};
    for (const Trial& t : trials) {
        const bool shown = t.role == TrialRole::standard || t.role == TrialRole::preset ||
                           t.role == TrialRole::paper || t.role == TrialRole::peer;
        if (!shown || !std::isfinite(t.error)) continue;
        const auto own = t.role == TrialRole::paper ? std::array<std::uint8_t, 3>{213, 40, 0}
                                                    : marks[colour++ % marks.size()];
        // The standard is often a preset as well: it shows as a ring round it.
        const double width = t.role == TrialRole::standard ? 7 : 4.5;
        chart.series.push_back({t.name, {t.seconds}, {t.error}, SeriesStyle::points, own, width});
    }
    return chart;
}

std::vector<Trial> trials_of_knob(const std::vector<Trial>& trials, const Knob& knob) {
    std::vector<Trial> own;
    for (const Trial& t : trials) {
        if (t.role == TrialRole::knob && t.name == knob.key && std::isfinite(t.error))
            own.push_back(t);
    }
    return own;
}

std::string curve_text(const Knob& knob, const CurveVerdict& verdict) {
    if (verdict.monotone) return "more time, less error (within noise)";
    const std::string reason = knob.why_not_monotone.empty()
                                   ? "No reason is known; look before trusting it."
                                   : knob.why_not_monotone;
    return escaped_html("not monotone (" + verdict.worst + "). " + reason);
}

std::string knob_rows(const Suite& suite, const std::vector<Trial>& trials, double noise) {
    std::string rows;
    for (const Knob& knob : suite.knobs) {
        const std::vector<Trial> curve = trials_of_knob(trials, knob);
        std::string measured;
        for (const Trial& t : curve)
            measured += html().filled(
                "measured",
                {{"value", t.settings.empty() ? "" : escaped_html(t.settings.front().value)},
                 {"error", number(t.error)},
                 {"unit", escaped_html(suite.error_unit)},
                 {"seconds", number(t.seconds)}});
        rows += html().filled(
            "knob",
            {{"key", escaped_html(knob.key)},
             {"meaning", escaped_html(knob.meaning)},
             {"standard", escaped_html(knob.standard + (knob.unit.empty() ? "" : " " + knob.unit))},
             {"trades", escaped_html(knob.trades)},
             {"measured", measured},
             {"curve", curve_text(knob, judge_curve(curve, noise))}});
    }
    return rows;
}

// Trials that have a name or lie on the front.
std::string trial_rows(const std::vector<Trial>& trials) {
    std::string rows;
    const std::vector<bool> front = pareto_front(trials);
    for (std::size_t i = 0; i < trials.size(); ++i) {
        const Trial& t = trials[i];
        const bool named = t.role != TrialRole::knob && t.role != TrialRole::pair;
        if (!front[i] && !named) continue;
        rows += html().filled("trial", {{"class", front[i] ? "front" : ""},
                                        {"name", named ? escaped_html(t.name) : "on the front"},
                                        {"settings", escaped_html(settings_text(t.settings))},
                                        {"error", number(t.error)},
                                        {"seconds", number(t.seconds)},
                                        {"low", number(t.seconds_low)},
                                        {"high", number(t.seconds_high)},
                                        {"note", escaped_html(t.note)}});
    }
    return rows;
}

std::string why_standard(const Beaten& beaten) {
    return beaten.why_standard.empty() ? "No reason is known to keep it."
                                       : "The standard stays because " + beaten.why_standard + ".";
}

std::string beaten_text(const Suite& suite, const std::vector<Beaten>& beaten) {
    std::string text;
    for (const Beaten& b : beaten)
        text += html().filled("beaten", {{"settings", escaped_html(settings_text(b.by.settings))},
                                         {"error", number(b.by.error)},
                                         {"unit", escaped_html(suite.error_unit)},
                                         {"seconds", number(b.by.seconds)},
                                         {"why", escaped_html(why_standard(b))}});
    return text.empty() ? html().filled("unbeaten", {}) : text;
}

// Every option of every stage; an option that no suite above sweeps trades no accuracy for time.
std::string options_table() {
    return "\n## Every option of the stages\n\nSet in a recipe's section or by `--set KEY=VALUE`; "
           "`sonocase build --list-options` prints the same.\n\n" +
           options_markdown(built_in_stages());
}

}  // namespace

Status write_tradeoff_page(const PageInput& input, const std::string& folder) {
    std::string suites;
    for (const Suite& suite : input.suites) {
        const std::vector<Trial> trials = trials_of(input, suite);
        if (trials.empty()) continue;
        const std::string stem = suite.name + "-" + suite.body;
        const ChartSheet sheet{{suite_chart(suite, trials)}, 1, 900, 560};
        SONOCASE_TRY_DONE(write_chart_png(sheet, folder + "/" + stem + ".png"));
        SONOCASE_TRY_DONE(write_chart_svg(sheet, folder + "/" + stem + ".svg"));
        suites += html().filled(
            "suite", {{"title", escaped_html(suite.title)},
                      {"body", escaped_html(suite.body)},
                      {"truth", escaped_html(suite.truth)},
                      {"stem", escaped_html(stem)},
                      {"beaten", beaten_text(suite, beaten_standard(suite, trials, input.noise))},
                      {"knobs", knob_rows(suite, trials, input.noise)},
                      {"error", escaped_html(suite.error_name + ", " + suite.error_unit)},
                      {"trials", trial_rows(trials)}});
    }
    return write_file(
        folder + "/index.html",
        html().filled("page", {{"machine", escaped_html(input.machine)}, {"suites", suites}}));
}

Status write_overview_picture(const PageInput& input, const std::string& path) {
    ChartSheet sheet;
    sheet.columns = 2;
    sheet.width_px = 620;
    sheet.height_px = 400;
    for (const Suite& suite : input.suites) {
        const std::vector<Trial> trials = trials_of(input, suite);
        const bool shown = std::any_of(trials.begin(), trials.end(), [](const Trial& t) {
            return t.role == TrialRole::paper || t.role == TrialRole::preset;
        });
        if (shown) sheet.charts.push_back(suite_chart(suite, trials));
    }
    if (sheet.charts.empty())
        return Error{"no suite has the paper's settings or presets", path,
                     "sweep register, elastic, smooth, texture or case"};
    return write_chart_png(sheet, path);
}

namespace {

std::string markdown_heading(const Suite& suite) {
    return "\n## " + suite.title + " (" + suite.body + ")\n";
}

std::string markdown_section(const PageInput& input, const Suite& suite) {
    const std::vector<Trial> trials = trials_of(input, suite);
    std::string text =
        markdown_heading(suite) + "\n" + suite.truth + " Measured on " + input.machine +
        ".\n\n| knob | standard | meaning | error traded for time | value: " + suite.error_unit +
        ", s |\n|---|---|---|---|---|\n";
    for (const Knob& knob : suite.knobs) {
        text += "| `" + knob.key + "` | " + knob.standard +
                (knob.unit.empty() ? "" : " " + knob.unit) + " | " + knob.meaning + " | " +
                knob.trades + " | ";
        for (const Trial& t : trials_of_knob(trials, knob)) {
            text += (t.settings.empty() ? std::string() : t.settings.front().value) + ": " +
                    number(t.error) + ", " + number(t.seconds) + "; ";
        }
        text += "|\n";
    }
    text +=
        "\n| setting | " + suite.error_name + ", " + suite.error_unit + " | s |\n|---|---|---|\n";
    for (const Trial& t : trials) {
        if (t.role == TrialRole::knob || t.role == TrialRole::pair) continue;
        text += "| " + t.name + " | " + number(t.error) + " | " + number(t.seconds) + " |\n";
    }
    for (const Beaten& b : beaten_standard(suite, trials, input.noise))
        text += "\nThe standard is beaten by `" + settings_text(b.by.settings) + "`, " +
                number(b.by.error) + " " + suite.error_unit + " in " + number(b.by.seconds) +
                " s. " + why_standard(b) + "\n";
    return text;
}

// What a part of the page says of itself.
struct PartSummary {
    std::string title, error_name;
    std::string paper, standard, least;  // "5.64 in 1.95 s"; empty: none
    double least_error = INFINITY;
};

PartSummary summary_of(const std::string& part) {
    PartSummary summary;
    const auto figures = [](std::string_view error, std::string_view seconds) {
        return std::string(trimmed(error)) + " in " + std::string(trimmed(seconds)) + " s";
    };
    const auto tried = [&](std::string_view error, std::string_view seconds) {
        const auto value = number_in(trimmed(error));
        if (!value || !(*value < summary.least_error)) return;
        summary.least_error = *value;
        summary.least = figures(error, seconds);
    };
    std::istringstream lines(part);
    for (std::string line; std::getline(lines, line);) {
        if (line.starts_with("## ")) summary.title = line.substr(3);
        if (!line.starts_with("| ")) continue;
        const std::vector<std::string> cells = split_line(line, '|');
        if (cells.size() == 7) {  // "8: 1.07, 2.46; 3: 1.01, 2.62;" of a knob
            std::istringstream values(cells[5]);
            for (std::string value; std::getline(values, value, ';');) {
                const std::size_t colon = value.find(": "), comma = value.find(", ");
                if (colon < comma && comma != std::string::npos)
                    tried(value.substr(colon + 2, comma - colon - 2), value.substr(comma + 2));
            }
        }
        if (cells.size() != 5) continue;
        if (cells[1] == "setting") {
            summary.error_name = cells[2];
        } else if (number_in(cells[3])) {
            tried(cells[2], cells[3]);
            if (cells[1] == "standard") summary.standard = figures(cells[2], cells[3]);
            if (cells[1].find("paper") != std::string::npos)
                summary.paper = figures(cells[2], cells[3]);
        }
    }
    return summary;
}

// A link to a heading of the same page, as GitHub makes them.
std::string link_to(const std::string& title) {
    std::string anchor;
    for (const char c : lower_case(title)) {
        if (c == ' ' || c == '-')
            anchor += '-';
        else if (std::isalnum(static_cast<unsigned char>(c)) || c == '_')
            anchor += c;
    }
    return "[" + title + "](#" + anchor + ")";
}

// A line for each part that has a standard with an error.
std::string overview_table(const std::string& parts) {
    std::string table =
        "\n| what | error | the paper's method | standard | least error tried |\n"
        "|---|---|---|---|---|\n";
    for (std::size_t at = parts.find("\n## "); at != std::string::npos;) {
        const std::size_t next = parts.find("\n## ", at + 1);
        const PartSummary s =
            summary_of(parts.substr(at, next == std::string::npos ? next : next - at));
        if (!s.standard.empty() && !s.standard.starts_with("0 "))
            table += "| " + link_to(s.title) + " | " + s.error_name + " | " + s.paper + " | **" +
                     s.standard + "** | " + s.least + " |\n";
        at = next;
    }
    return table;
}

}  // namespace

std::string format_accuracy_markdown(const PageInput& input, const std::string& before) {
    const std::string opening =
        "# What accuracy costs\n\n"
        "`scripts/accuracy` writes this page from the table of knobs and a sweep (`sonocase "
        "tradeoff`); do not edit it.\n"
        "Seconds are processor seconds of all threads together, unless a part states otherwise; "
        "each part names its machine.\n\n"
        "![error against seconds](pictures/accuracy.png)\n\n"
        "A point that lies lower and further left is better; both axes are logarithmic. Red is the "
        "paper's own method. Blue is the Pareto front: no other setting tried is both faster and "
        "more accurate. The table below has one line for each part, with its error and its "
        "seconds.\n";
    std::string text;
    // Parts that this sweep has, in the places of those before; the others as they were.
    const std::string options = options_table();
    std::vector<bool> written(input.suites.size(), false);
    std::size_t at = before.find("\n## ");
    while (at != std::string::npos && before.compare(at, 9, options, 0, 9) != 0) {
        const std::size_t next = before.find("\n## ", at + 1);
        const std::string part = before.substr(at, next == std::string::npos ? next : next - at);
        std::string now = part;
        for (std::size_t i = 0; i < input.suites.size(); ++i) {
            if (!part.starts_with(markdown_heading(input.suites[i]))) continue;
            now = markdown_section(input, input.suites[i]);
            written[i] = true;
        }
        text += now;
        at = next;
    }
    for (std::size_t i = 0; i < input.suites.size(); ++i)
        if (!written[i]) text += markdown_section(input, input.suites[i]);
    return opening + overview_table(text) + text + options;
}

}  // namespace sonocase::pipeline::inline tradeoff
