// SPDX-License-Identifier: Apache-2.0

#include "pipeline/review/review_page.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "formats/exercise/metric_table.h"
#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/review/review_plots.h"

namespace sonocase::pipeline {
namespace {

constexpr const char* kStyle = R"(
:root{--ink:#1c2430;--soft:#5c6775;--line:#d9dfe6;--paper:#fff;--band:#f4f6f9;--blue:#2a78d9;--good:#1e8a4c;--bad:#c3372b;--gold:#b98900}
@media(prefers-color-scheme:dark){:root{--ink:#e6ebf2;--soft:#9aa6b5;--line:#313b48;--paper:#12171e;--band:#1a212b;--blue:#6aa9f4;--good:#4cc27f;--bad:#f0736a;--gold:#e0b84a}}
*{box-sizing:border-box}body{margin:0;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,sans-serif}
main{max-width:1120px;margin:0 auto;padding:28px 24px 64px}h1{font-size:26px;margin:0 0 2px}h2{font-size:18px;margin:36px 0 10px}
.sub{color:var(--soft);margin:0 0 16px}.verdict{display:inline-block;padding:3px 12px;border-radius:14px;font-weight:600;color:#fff}
.verdict.good{background:#1e8a4c;color:#fff}.verdict.bad{background:#c3372b;color:#fff}.warn{border-left:3px solid var(--gold);padding:2px 12px;color:var(--soft);margin:6px 0}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(170px,1fr));gap:12px}.card{background:var(--band);border-radius:10px;padding:12px 14px}
.card b{display:block;font-size:24px;font-variant-numeric:tabular-nums}.card span{color:var(--soft);font-size:13px}
.views{display:grid;grid-template-columns:repeat(auto-fit,minmax(440px,1fr));gap:14px}figure{margin:0;background:var(--band);border-radius:10px;overflow:hidden}
figure img{display:block;width:100%;height:auto}figcaption{padding:8px 12px;font-size:13px;color:var(--soft)}.frames{display:grid;grid-template-columns:repeat(auto-fill,minmax(240px,1fr));gap:14px}
.frames img{background:#000}table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}td,th{padding:5px 10px;border-bottom:1px solid var(--line);text-align:left}
td.num,th.num{text-align:right;white-space:nowrap}tr.group th{padding-top:18px;color:var(--soft);font-weight:600}.good{color:var(--good)}.bad{color:var(--bad)}
.scroll{overflow-x:auto}svg.timeline{width:100%;min-width:760px;height:auto;display:block}svg text{fill:var(--ink);font:12px system-ui,sans-serif}svg .tick,svg .unit,svg .mark{fill:var(--soft);font-size:11px}
svg .end{text-anchor:end}svg .middle{text-anchor:middle}svg .lane{fill:var(--band)}svg .grid{stroke:var(--line);stroke-width:1}svg .curve{fill:none;stroke:var(--blue);stroke-width:1.6;stroke-linejoin:round}
svg .limit{stroke:var(--good);stroke-dasharray:5 4;stroke-width:1.5}svg .bar.probe{fill:var(--blue)}svg .bar.needle{fill:var(--gold)}svg .event line{stroke:var(--soft);stroke-width:1.5}
svg .event.good line{stroke:var(--good);stroke-width:2.5}svg .event.bad line{stroke:var(--bad);stroke-width:2.5}svg .event.good text{fill:var(--good)}svg .event.bad text{fill:var(--bad)}
svg.progress{width:220px;height:70px}svg .now{fill:var(--blue)}svg .then{fill:var(--soft)}.key span{display:inline-block;margin-right:18px;font-size:13px;color:var(--soft)}
.key i{display:inline-block;width:12px;height:12px;border-radius:3px;margin-right:6px;vertical-align:-1px}footer{margin-top:40px;color:var(--soft);font-size:13px}
)";

std::string base64(const std::vector<std::uint8_t>& bytes) {
    static constexpr char kDigits[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve(bytes.size() * 4 / 3 + 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const std::size_t left = bytes.size() - i;
        const std::uint32_t v = static_cast<std::uint32_t>(bytes[i] << 16) |
                                (left > 1 ? static_cast<std::uint32_t>(bytes[i + 1] << 8) : 0) |
                                (left > 2 ? bytes[i + 2] : 0u);
        out += kDigits[v >> 18];
        out += kDigits[(v >> 12) & 63];
        out += left > 1 ? kDigits[(v >> 6) & 63] : '=';
        out += left > 2 ? kDigits[v & 63] : '=';
    }
    return out;
}

std::string figure(const std::vector<std::uint8_t>& png, const std::string& caption) {
    return "<figure><img alt=\"" + escaped_html(caption) + "\" src=\"data:image/png;base64," +
           base64(png) + "\"><figcaption>" + escaped_html(caption) + "</figcaption></figure>\n";
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
    std::string out = "<div class=\"cards\">";
    for (const char* name : {"elapsed_time_s", "final_tip_to_target_mm", "targets_hit",
                             "insertions", "time_in_tissue_s", "needle_in_beam_fraction",
                             "tip_in_view_at_advance_fraction", "no_go_contacts"}) {
        out += "<div class=\"card\"><b>" + shown(input.score.value(name), name) + "</b><span>" +
               escaped_html(find_metric(name)->title) + "</span></div>";
    }
    return out + "</div>\n";
}

std::string pass_marks(const ReviewInput& input) {
    if (input.score.pass_marks.empty()) return "";
    std::string out =
        "<h2>Pass marks</h2><table><tr><th>Score</th><th class=num>Reached</th><th>Called "
        "for</th><th></th></tr>";
    for (const PassResult& mark : input.score.pass_marks) {
        const MetricInfo* info = find_metric(mark.metric);
        out += "<tr><td>" + escaped_html(info ? info->title : mark.metric) + "</td><td class=num>" +
               shown(mark.value, mark.metric) + "</td><td>" + limits(mark) + "</td><td class=\"" +
               (mark.passed ? "good\">passed" : "bad\">not passed") + "</td></tr>";
    }
    return out + "</table>\n";
}

std::string score_table(const ReviewInput& input) {
    static constexpr struct {
        const char* group;
        const char* title;
    } kGroups[] = {{"session", "Session"},
                   {"targets", "Targets"},
                   {"guidance", "Guidance"},
                   {"needle", "Needle"},
                   {"probe", "Probe"}};
    const bool compare = !input.earlier.empty();
    std::string out = "<h2>All scores</h2><div class=scroll><table>";
    for (const auto& group : kGroups) {
        out += std::string("<tr class=group><th>") + group.title +
               "</th><th class=num>This session</th>" +
               (compare ? "<th class=num>Last time</th><th>All sessions</th>" : "") + "</tr>";
        for (const MetricInfo& info : metric_table()) {
            if (std::string(info.group) != group.group) continue;
            const double value = input.score.value(info.name);
            out += "<tr><td title=\"" + std::string(info.name) + "\">" + escaped_html(info.title) +
                   "</td><td class=num>" + shown(value, info.name) + "</td>";
            if (compare) {
                double before = NAN;
                for (const Metric& m : input.earlier.back().metrics) {
                    if (m.name == info.name) before = m.value;
                }
                const double change = value - before;
                const bool better = (info.sense == MetricSense::less_is_better && change < 0) ||
                                    (info.sense == MetricSense::more_is_better && change > 0);
                const bool worse = info.sense != MetricSense::neutral && !better && change != 0 &&
                                   std::isfinite(change);
                out += std::string("<td class=\"num ") +
                       (better  ? "good"
                        : worse ? "bad"
                                : "") +
                       "\">" + shown(before, info.name) + "</td><td>" +
                       progress_svg(input, info.name) + "</td>";
            }
            out += "</tr>";
        }
    }
    return out + "</table></div>\n";
}

std::string insertions(const ReviewInput& input) {
    if (input.score.insertions.empty()) return "";
    std::string out =
        "<h2>Insertions</h2><div class=scroll><table><tr><th>#</th><th class=num>Entry</th><th "
        "class=num>Out</th><th "
        "class=num>Deepest</th><th>Nearest target</th><th class=num>Tip to target</th></tr>";
    const double start_s = input.session.samples.front().time_s;
    int number = 0;
    for (const InsertionScore& s : input.score.insertions) {
        out +=
            "<tr><td>" + std::to_string(++number) + "</td><td class=num>" +
            shown(s.entry_s - start_s, "t_s") + "</td><td class=num>" +
            (s.still_in ? "stays in" : shown(s.exit_s - start_s, "t_s")) + "</td><td class=num>" +
            shown(s.deepest_mm, "d_mm") + "</td><td>" +
            (s.target < 0
                 ? "\u2013"
                 : escaped_html(input.exercise.targets[static_cast<std::size_t>(s.target)].name)) +
            "</td><td class=num>" + shown(s.tip_to_target_mm, "d_mm") + "</td></tr>";
    }
    return out + "</table></div>\n";
}

std::string frames(const ReviewInput& input) {
    const Sequence& p = input.pictures;
    if (p.frames.empty()) return "";
    std::string out = "<h2>Frames at the moments that matter</h2><div class=frames>\n";
    const double start_s = input.session.samples.front().time_s;
    for (std::size_t i = 0; i < p.frames.size(); ++i) {
        std::string what = "frame";
        for (const SequenceField& field : p.frames[i].fields) {
            if (field.name == "Event") what = field.value;
        }
        std::replace(what.begin(), what.end(), '_', ' ');
        out += figure(png_from_grey(p.pixels.data() + i * p.frame_bytes(), p.width, p.height),
                      what + ", " + shown(p.frames[i].timestamp_s - start_s, "t_s"));
    }
    return out + "</div>\n";
}

}  // namespace

std::string review_page(const ReviewInput& input, const std::vector<SessionView>& views) {
    const SessionHeader& header = input.session.header;
    std::string who = header.trainee.empty() ? "" : escaped_html(header.trainee) + " \u00b7 ";
    std::string page =
        "<!doctype html>\n<html lang=en><head><meta charset=utf-8><meta name=viewport "
        "content=\"width=device-width,initial-scale=1\"><link rel=icon href=\"data:,\"><title>" +
        escaped_html(input.exercise.title) + ": review</title><style>" + kStyle +
        "</style></head><body><main>\n";
    page += "<h1>" + escaped_html(input.exercise.title) + "</h1><p class=sub>" + who +
            escaped_html(input.bundle.manifest.case_name) +
            (header.started.empty() ? "" : " \u00b7 " + escaped_html(header.started)) + "</p>\n";
    if (!input.score.pass_marks.empty()) {
        page += std::string("<p><span class=\"verdict ") +
                (input.score.passed ? "good\">Passed" : "bad\">Not passed yet") + "</span></p>\n";
    }
    for (const auto* list : {&input.warnings, &input.score.warnings}) {
        for (const std::string& warning : *list)
            page += "<p class=warn>" + escaped_html(warning) + "</p>\n";
    }
    page += cards(input) + pass_marks(input);
    page += "<h2>Time line</h2><div class=scroll>" + timeline_svg(input) + "</div>\n";
    page += insertions(input) + frames(input);
    if (!views.empty()) {
        page +=
            "<h2>In space</h2><p class=key><span><i "
            "style=\"background:#fac71a\"></i>target</span><span><i "
            "style=\"background:#33b852\"></i>target hit</span><span><i "
            "style=\"background:#db382e\"></i>to be "
            "spared</span><span><i style=\"background:#2978d9\"></i>probe's way and scan "
            "plane</span><span><i "
            "style=\"background:linear-gradient(90deg,#451a8c,#bd2985,#f5734d,#fdd933)\"></i>tip's "
            "way, early to "
            "late</span><span><i style=\"background:#4d596b\"></i>needle at its end</span></p><div "
            "class=views>\n";
        for (const SessionView& view : views) page += figure(view.png, view.title);
        page += "</div>\n";
    }
    page += score_table(input);
    page += "<footer>" + escaped_html(header.program.empty() ? "sonocase" : header.program) +
            " \u00b7 scores are defined in docs/metrics.md</footer></main></body></html>\n";
    return page;
}

Result<StageReport> make_review(const std::string& session_path,
                                const std::string& bundle_path,
                                const std::string& folder,
                                const ReviewOptions& options) {
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
    return report;
}

}  // namespace sonocase::pipeline
