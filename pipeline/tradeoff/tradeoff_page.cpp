// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/tradeoff_page.h"

#include <algorithm>
#include <cmath>

#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/chart.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/stages/built_in_stages.h"

namespace sonocase::pipeline {
namespace {

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

    Series all{"settings tried", {}, {}, SeriesLook::points, {190, 190, 190}, 2.5};
    std::vector<std::pair<double, double>> line;
    for (std::size_t i = 0; i < trials.size(); ++i) {
        all.x.push_back(trials[i].seconds);
        all.y.push_back(trials[i].error);
        if (front[i] && trials[i].error > 0) line.emplace_back(trials[i].seconds, trials[i].error);
    }
    std::sort(line.begin(), line.end());
    Series best{"Pareto front", {}, {}, SeriesLook::line_and_points, {0, 114, 178}, 2};
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
        chart.series.push_back({t.name, {t.seconds}, {t.error}, SeriesLook::points, own, 4.5});
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

// A cheaper setting whose error is no worse than the standard one's, if the sweep found one.
const Trial* cheaper_than_standard(const std::vector<Trial>& trials, double noise) {
    const auto standard = std::find_if(
        trials.begin(), trials.end(), [](const Trial& t) { return t.role == TrialRole::standard; });
    if (standard == trials.end()) return nullptr;
    const Trial* best = nullptr;
    for (const Trial& t : trials) {
        if (!(t.error <= standard->error * 1.02) || !(t.seconds < standard->seconds * (1 - noise)))
            continue;
        if (best == nullptr || t.seconds < best->seconds) best = &t;
    }
    return best;
}

std::string knob_rows(const Suite& suite, const std::vector<Trial>& trials, double noise) {
    std::string html;
    for (const Knob& knob : suite.knobs) {
        const std::vector<Trial> curve = trials_of_knob(trials, knob);
        html += "<tr><td><code>" + escaped_html(knob.key) + "</code></td><td>" +
                escaped_html(knob.meaning) + "</td><td>" +
                escaped_html(knob.standard + (knob.unit.empty() ? "" : " " + knob.unit)) +
                "</td><td>" + escaped_html(knob.trades) + "</td><td>";
        for (const Trial& t : curve) {
            html += escaped_html(t.settings.empty() ? "" : t.settings.front().value) + ": " +
                    number(t.error) + " " + escaped_html(suite.error_unit) + " in " +
                    number(t.seconds) + " s<br>";
        }
        html += "</td><td>";
        const CurveVerdict verdict = judge_curve(curve, noise);
        if (verdict.monotone) {
            html += "more time, less error (within noise)";
        } else {
            html += "not monotone (" + escaped_html(verdict.worst) + "). " +
                    escaped_html(knob.why_not_monotone.empty()
                                     ? "No reason is known; look before trusting it."
                                     : knob.why_not_monotone);
        }
        html += "</td></tr>\n";
    }
    return html;
}

// Every option of every stage; an option that no suite above sweeps trades no accuracy for time.
std::string options_table() {
    return "\n## Every option of the stages\n\nSet in a recipe's section or by `--set KEY=VALUE`; "
           "`sonocase build --list-options` prints the same.\n\n" +
           options_markdown(built_in_stages());
}

constexpr const char* kStyle =
    "body{font:15px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 "
    "1rem;color:#1b1f24}"
    "table{border-collapse:collapse;width:100%;font-size:13px}td,th{border:1px solid "
    "#d0d7de;padding:.35rem .5rem;"
    "vertical-align:top;text-align:left}th{background:#f6f8fa}img{max-width:100%}code{background:#"
    "f6f8fa}"
    "h2{margin-top:2.5rem;border-bottom:1px solid #d0d7de}.front{background:#eaf4fb}";

}  // namespace

Status write_tradeoff_page(const PageInput& input, const std::string& folder) {
    std::string html =
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>What accuracy costs"
        "</title><style>" +
        std::string(kStyle) +
        "</style><body><h1>What accuracy costs in time</h1>"
        "<p>Each point is one setting of one stage: how wrong its answer is against the truth "
        "named "
        "below, and how long it took (median of its repeats). Lower and further left is better. "
        "The "
        "blue line is the Pareto front: no other setting tried is both faster and better. Measured "
        "on " +
        escaped_html(input.machine) + "; another machine moves all points sideways alike.</p>\n";
    for (const Suite& suite : input.suites) {
        const std::vector<Trial> trials = trials_of(input, suite);
        if (trials.empty()) continue;
        const std::string stem = suite.name + "-" + suite.body;
        const ChartSheet sheet{{suite_chart(suite, trials)}, 1, 900, 560};
        if (const Status s = write_chart_png(sheet, folder + "/" + stem + ".png"); !s) return s;
        if (const Status s = write_chart_svg(sheet, folder + "/" + stem + ".svg"); !s) return s;
        html += "<h2>" + escaped_html(suite.title) + " <small>(" + escaped_html(suite.body) +
                ")</small></h2><p>" + escaped_html(suite.truth) + "</p>\n<a href=\"" + stem +
                ".svg\"><img src=\"" + stem + ".png\" alt=\"error against seconds\"></a>\n";
        const Trial* cheaper = cheaper_than_standard(trials, input.noise);
        html +=
            cheaper == nullptr
                ? std::string(
                      "<p>No setting tried is cheaper than the standard one at equal error.</p>\n")
                : "<p>Cheaper than the standard setting at equal error: <code>" +
                      escaped_html(settings_text(cheaper->settings)) + "</code>, " +
                      number(cheaper->error) + " " + escaped_html(suite.error_unit) + " in " +
                      number(cheaper->seconds) + " s.</p>\n";
        html +=
            "<table><tr><th>knob</th><th>meaning</th><th>standard</th><th>error it "
            "trades</th><th>measured"
            "</th><th>curve</th></tr>\n" +
            knob_rows(suite, trials, input.noise) + "</table>\n";

        std::vector<bool> front = pareto_front(trials);
        html +=
            "<h3>The front, presets, the paper and "
            "peers</h3><table><tr><th>what</th><th>settings</th><th>" +
            escaped_html(suite.error_name + ", " + suite.error_unit) +
            "</th><th>seconds (low to high)</th><th>note"
            "</th></tr>\n";
        for (std::size_t i = 0; i < trials.size(); ++i) {
            const Trial& t = trials[i];
            const bool named = t.role != TrialRole::knob && t.role != TrialRole::pair;
            if (!front[i] && !named) continue;
            html += std::string("<tr") + (front[i] ? " class=\"front\"" : "") + "><td>" +
                    (named ? escaped_html(t.name) : std::string("on the front")) +
                    "</td><td><code>" + escaped_html(settings_text(t.settings)) +
                    "</code></td><td>" + number(t.error) + "</td><td>" + number(t.seconds) + " (" +
                    number(t.seconds_low) + " to " + number(t.seconds_high) + ")</td><td>" +
                    escaped_html(t.note) + "</td></tr>\n";
        }
        html += "</table>\n";
    }
    html += "</body></html>\n";
    return write_file(folder + "/index.html", html);
}

std::string format_accuracy_markdown(const PageInput& input) {
    std::string text =
        "# What accuracy costs\n\n"
        "Written by `scripts/accuracy` from the table of knobs and a sweep (`sonocase tradeoff`); "
        "do not edit.\n"
        "Measured on " +
        input.machine + ".\n";
    for (const Suite& suite : input.suites) {
        const std::vector<Trial> trials = trials_of(input, suite);
        text += "\n## " + suite.title + " (" + suite.body + ")\n\n" + suite.truth + "\n\n";
        text += "| knob | standard | meaning | error it trades | value: " + suite.error_unit +
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
        text += "\n| setting | " + suite.error_name + ", " + suite.error_unit +
                " | s |\n|---|---|---|\n";
        for (const Trial& t : trials) {
            if (t.role == TrialRole::knob || t.role == TrialRole::pair) continue;
            text += "| " + t.name + " | " + number(t.error) + " | " + number(t.seconds) + " |\n";
        }
    }
    return text + options_table();
}

}  // namespace sonocase::pipeline
