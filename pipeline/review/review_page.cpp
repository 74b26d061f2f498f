// SPDX-License-Identifier: Apache-2.0

#include "pipeline/review/review_page.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "formats/exercise/metric_table.h"
#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/html_template.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/pictures/png.h"
#include "pipeline/review/review_page_html.h"
#include "pipeline/review/review_plots.h"

namespace sonocase::pipeline {
namespace {

const HtmlTemplate& page_template() {
    static const HtmlTemplate page(kReviewPageHtml);
    return page;
}

std::string filled(std::string_view block, const HtmlValues& values) {
    return page_template().filled(block, values);
}

std::string figure(const std::vector<std::uint8_t>& png, const std::string& caption) {
    return filled("figure", {{"caption", escaped_html(caption)}, {"png", base64(png)}});
}

std::string shown(double value, const std::string& name) {
    if (!std::isfinite(value)) return "\u2013";
    std::string text;
    const double size = std::abs(value);
    const bool fraction = name.size() > 9 && name.compare(name.size() - 9, 9, "_fraction") == 0;
    if (fraction) {
        text = number_text(std::round(100 * value), 4) + " %";
    } else {
        const double scale = size >= 100 || value == std::round(value) ? 1 : size >= 10 ? 10 : 100;
        text = number_text(std::round(value * scale) / scale, 9);
        const std::string unit = metric_unit(name);
        if (!unit.empty()) text += (unit == "\u00b0" ? "" : " ") + unit;
    }
    return text;
}

std::string limits(const PassResult& mark) {
    std::string out;
    if (std::isfinite(mark.at_least)) out += "at least " + shown(mark.at_least, mark.metric);
    if (std::isfinite(mark.at_most))
        out += (out.empty() ? "" : ", ") + ("at most " + shown(mark.at_most, mark.metric));
    return out;
}

std::string cards(const ReviewInput& input) {
    std::string out;
    for (const char* name : {"elapsed_time_s", "final_tip_to_target_mm", "targets_hit",
                             "insertions", "time_in_tissue_s", "needle_in_beam_fraction",
                             "tip_in_view_at_advance_fraction", "no_go_contacts"}) {
        out += filled("card", {{"value", shown(input.score.value(name), name)},
                               {"title", escaped_html(find_metric(name)->title)}});
    }
    return out;
}

std::string pass_marks(const ReviewInput& input) {
    if (input.score.pass_marks.empty()) return "";
    std::string rows;
    for (const PassResult& mark : input.score.pass_marks) {
        const MetricInfo* info = find_metric(mark.metric);
        rows += filled("pass_mark", {{"title", escaped_html(info ? info->title : mark.metric)},
                                     {"value", shown(mark.value, mark.metric)},
                                     {"limits", limits(mark)},
                                     {"class", mark.passed ? "good" : "bad"},
                                     {"verdict", mark.passed ? "passed" : "not passed"}});
    }
    return filled("pass_marks", {{"rows", rows}});
}

// The score of the last session, better or worse than this one, and the course over all of them.
std::string comparison(const ReviewInput& input, const MetricInfo& info, double value) {
    double before = NAN;
    for (const Metric& m : input.earlier.back().metrics) {
        if (m.name == info.name) before = m.value;
    }
    const double change = value - before;
    const bool better = (info.sense == MetricSense::less_is_better && change < 0) ||
                        (info.sense == MetricSense::more_is_better && change > 0);
    const bool worse =
        info.sense != MetricSense::neutral && !better && change != 0 && std::isfinite(change);
    return filled("comparison", {{"class", better  ? "good"
                                           : worse ? "bad"
                                                   : ""},
                                 {"before", shown(before, info.name)},
                                 {"progress", progress_svg(input, info.name)}});
}

std::string meaning(const MetricInfo& info) {
    const std::string evidence = info.evidence;
    return std::string(info.name) + ": " + metric_range(info.name) +
           (evidence.empty() ? "" : "; evidence: " + evidence);
}

// The groups of those metrics that have evidence, or of the others.
std::string score_groups(const ReviewInput& input, bool evidence) {
    static constexpr struct {
        const char* group;
        const char* title;
    } kGroups[] = {{"session", "Session"}, {"targets", "Targets"}, {"guidance", "Guidance"},
                   {"needle", "Needle"},   {"doppler", "Doppler"}, {"probe", "Probe"}};
    const bool compare = !input.earlier.empty();
    std::string groups;
    for (const auto& group : kGroups) {
        std::string rows;
        for (const MetricInfo& info : metric_table()) {
            if (std::string(info.group) != group.group) continue;
            if ((info.evidence[0] != 0) != evidence) continue;
            const double value = input.score.value(info.name);
            rows +=
                filled("score", {{"name", escaped_html(meaning(info))},
                                 {"title", escaped_html(info.title)},
                                 {"value", shown(value, info.name)},
                                 {"comparison", compare ? comparison(input, info, value) : ""}});
        }
        if (rows.empty()) continue;
        groups +=
            filled("score_group", {{"title", group.title},
                                   {"comparison", compare ? filled("comparison_head", {}) : ""},
                                   {"rows", rows}});
    }
    return groups;
}

std::string score_table(const ReviewInput& input) {
    return filled("scores",
                  {{"groups", score_groups(input, true)}, {"others", score_groups(input, false)}});
}

std::string insertions(const ReviewInput& input) {
    if (input.score.insertions.empty()) return "";
    std::string rows;
    const double start_s = input.session.samples.front().time_s;
    int number = 0;
    for (const InsertionScore& s : input.score.insertions) {
        const auto target = static_cast<std::size_t>(s.target);
        rows +=
            filled("insertion",
                   {{"number", std::to_string(++number)},
                    {"entry", shown(s.entry_s - start_s, "t_s")},
                    {"exit", s.still_in ? "stays in" : shown(s.exit_s - start_s, "t_s")},
                    {"deepest", shown(s.deepest_mm, "d_mm")},
                    {"target",
                     s.target < 0 ? "\u2013" : escaped_html(input.exercise.targets[target].name)},
                    {"tip_to_target", shown(s.tip_to_target_mm, "d_mm")}});
    }
    return filled("insertions", {{"rows", rows}});
}

std::string frames(const ReviewInput& input) {
    const Sequence& p = input.pictures;
    if (p.frames.empty()) return "";
    std::string figures;
    const double start_s = input.session.samples.front().time_s;
    for (std::size_t i = 0; i < p.frames.size(); ++i) {
        std::string what = "frame";
        for (const SequenceField& field : p.frames[i].fields) {
            if (field.name == "Event") what = field.value;
        }
        std::replace(what.begin(), what.end(), '_', ' ');
        figures += figure(png_from_grey(p.pixels.data() + i * p.frame_bytes(), p.width, p.height),
                          what + ", " + shown(p.frames[i].timestamp_s - start_s, "t_s"));
    }
    return filled("frames", {{"figures", figures}});
}

}  // namespace

std::string review_page(const ReviewInput& input, const std::vector<SessionView>& views) {
    const SessionHeader& header = input.session.header;
    const std::string dot = " \u00b7 ";
    std::string verdict, warnings, figures;
    if (!input.score.pass_marks.empty())
        verdict = filled(input.score.passed ? "verdict_passed" : "verdict_not_passed", {});
    for (const auto* list : {&input.warnings, &input.score.warnings}) {
        for (const std::string& warning : *list)
            warnings += filled("warning", {{"text", escaped_html(warning)}});
    }
    for (const SessionView& view : views) figures += figure(view.png, view.title);
    return filled(
        "page", {{"title", escaped_html(input.exercise.title)},
                 {"trainee", header.trainee.empty() ? "" : escaped_html(header.trainee) + dot},
                 {"case", escaped_html(input.bundle.manifest.case_name)},
                 {"started", header.started.empty() ? "" : dot + escaped_html(header.started)},
                 {"verdict", verdict},
                 {"warnings", warnings},
                 {"cards", cards(input)},
                 {"pass_marks", pass_marks(input)},
                 {"time_line", timeline_svg(input)},
                 {"insertions", insertions(input)},
                 {"frames", frames(input)},
                 {"views", views.empty() ? "" : filled("views", {{"figures", figures}})},
                 {"scores", score_table(input)},
                 {"program", escaped_html(header.program.empty() ? "sonocase" : header.program)}});
}

Result<StageReport> make_review(const std::string& session_path,
                                const std::string& bundle_path,
                                const std::string& folder,
                                const ReviewOptions& options,
                                ReviewInput* seen) {
    const auto start = std::chrono::steady_clock::now();
    const auto seconds = [&] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    auto input = load_review(session_path, bundle_path, options);
    if (!input) return input.error();
    StageReport report;
    report.stage = "review";
    report.measures.push_back({"load_and_score_s", seconds()});
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed)
        return Error{"cannot make the folder: " + failed.message(), folder, "check the path"};
    const auto views = render_session_views(*input, options);
    if (!views) {
        input->warnings.push_back("No 3-D views could be rendered: " + views.error().message() +
                                  ".");
    }
    report.measures.push_back({"views", views ? static_cast<double>(views->size()) : 0});
    const std::string page = review_page(*input, views ? *views : std::vector<SessionView>{});
    if (Status s = write_file(folder + "/review.html", page); !s) return s.error();
    if (Status s = write_file(folder + "/scores.json", score_json(input->score, input->exercise));
        !s)
        return s.error();
    report.measures.push_back({"readings", static_cast<double>(input->session.samples.size())});
    report.warnings = input->warnings;
    report.seconds = seconds();
    if (seen != nullptr) *seen = std::move(*input);
    return report;
}

}  // namespace sonocase::pipeline
