// SPDX-License-Identifier: Apache-2.0

#include "pipeline/review/review.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "formats/base/base64.h"
#include "formats/exercise/metric_table.h"
#include "formats/files/atomic_file.h"
#include "formats/scoring/session_monitor.h"
#include "formats/text/number_text.h"
#include "pipeline/pictures/axis.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/pictures/png.h"
#include "pipeline/pictures/svg.h"

namespace sonocase::pipeline::inline review {

extern const std::string_view kReviewPageHtml;  // review_page.html, embedded by CMake

namespace {

constexpr double kLeft = 150, kRight = 20, kWidth = 1000, kLaneHeight = 84;

struct TimeAxis {
    double from_s = 0, to_s = 1;
    double x(double t) const {
        return kLeft +
               (std::clamp(t, from_s, to_s) - from_s) / (to_s - from_s) * (kWidth - kLeft - kRight);
    }
};

// A bar for each period in which flag(i) holds.
template <class Flag>
void add_bars(const TimeAxis& axis,
              const std::vector<double>& t,
              Flag flag,
              double y,
              const char* style,
              Svg& svg) {
    for (std::size_t i = 0; i < t.size();) {
        if (!flag(i)) {
            ++i;
            continue;
        }
        std::size_t j = i;
        while (j + 1 < t.size() && flag(j + 1)) ++j;
        const double x0 = axis.x(t[i]), x1 = axis.x(t[j]);
        svg.rectangle(x0, y, std::max(x1 - x0, 1.0), 10, style);
        i = j + 1;
    }
}

struct Lane {
    std::string title, unit;
    const std::vector<double>* values;
    double limit = NAN;     // drawn as a dashed line
    double min_top = 1;     // the top of the lane's axis is at least this
    bool absolute = false;  // values are shown without their sign
};

// Each pixel column keeps its minimum and maximum, so that no peak is lost in a long session.
SvgPath curve(
    const TimeAxis& axis, const SessionCurves& c, const Lane& lane, double top_value, double y) {
    SvgPath path;
    double column = -1, low = 0, high = 0;
    bool open = false;
    const auto place = [&](double v) {
        return y + kLaneHeight - std::clamp(v / top_value, 0.0, 1.0) * kLaneHeight;
    };
    const auto flush = [&] {
        if (column < 0) return;
        if (open)
            path.line_to(column, place(low));
        else
            path.move_to(column, place(low));
        if (high != low) path.line_to(column, place(high));
        open = true;
        column = -1;
    };
    for (std::size_t i = 0; i < c.time_s.size(); ++i) {
        double v = (*lane.values)[i];
        if (lane.absolute) v = std::abs(v);
        if (!std::isfinite(v)) {
            flush();
            open = false;
            continue;
        }
        const double x = std::round(axis.x(c.time_s[i]) * 2) / 2;
        if (x == column) {
            low = std::min(low, v);
            high = std::max(high, v);
            continue;
        }
        flush();
        column = x;
        low = high = v;
    }
    flush();
    return path;
}

// y: the top of the lane.
void add_lane(const TimeAxis& axis, const SessionCurves& c, const Lane& lane, double y, Svg& svg) {
    double top = lane.min_top;
    for (double v : *lane.values) {
        if (lane.absolute) v = std::abs(v);
        if (std::isfinite(v)) top = std::max(top, v);
    }
    const double step = round_step(top, 3);
    top = std::ceil(top / step - 1e-9) * step;
    svg.rectangle(kLeft, y, kWidth - kLeft - kRight, kLaneHeight, "class=\"lane\"");
    svg.text(8, y + 16, lane.title, "class=\"name\"");
    svg.text(8, y + 32, lane.unit, "class=\"unit\"");
    const auto level = [&](double v) { return y + kLaneHeight - v / top * kLaneHeight; };
    for (const double v : multiples_between(0, top, step)) {
        svg.line(kLeft, level(v), kWidth - kRight, level(v), "class=\"grid\"");
        svg.text(kLeft - 8, level(v) + 4, svg_number(v), "class=\"tick end\"");
    }
    svg.path(curve(axis, c, lane, top, y), "class=\"curve\"");
    if (std::isfinite(lane.limit) && lane.limit <= top)
        svg.line(kLeft, level(lane.limit), kWidth - kRight, level(lane.limit), "class=\"limit\"");
}

// From the first to the last sample.
TimeAxis time_axis(const std::vector<SessionSample>& samples) {
    TimeAxis axis{INFINITY, -INFINITY};
    for (const SessionSample& s : samples) {
        if (!std::isfinite(s.time_s)) continue;
        axis.from_s = std::min(axis.from_s, s.time_s);
        axis.to_s = std::max(axis.to_s, s.time_s);
    }
    if (!(axis.to_s > axis.from_s)) axis.to_s = axis.from_s + 1;
    return axis;
}

// The bar of the times at which the probe was on the skin.
void add_probe_bar(const ReviewInput& input, const TimeAxis& axis, double y, Svg& svg) {
    const auto& samples = input.session.samples;
    std::vector<double> times;
    std::vector<bool> on_skin;
    const CaseAnatomy anatomy(input.bundle);
    // A bar a thousand pixels wide needs at most a few thousand tests against the body.
    const std::size_t stride = std::max<std::size_t>(1, samples.size() / 4000);
    for (std::size_t i = 0; i < samples.size(); i += stride) {
        times.push_back(samples[i].time_s);
        on_skin.push_back(
            samples[i].probe_ok && is_finite(samples[i].mannequin_from_probe) &&
            probe_on_skin(anatomy, input.exercise.probe, samples[i].mannequin_from_probe));
    }
    add_bars(
        axis, times, [&](std::size_t i) { return on_skin[i]; }, y, "class=\"bar probe\"", svg);
}

// "needle entry"
std::string event_words(std::string name) {
    std::replace(name.begin(), name.end(), '_', ' ');
    return name;
}

// One mark per event, described where the pointer rests on it; names below the marks, in the first
// of two rows that has room.
void add_events(const ReviewInput& input, const TimeAxis& axis, double y, Svg& svg) {
    constexpr double kLetter = 6.2, kRow = 14, kGap = 8;
    double free_from[] = {-1, -1};
    for (const SessionEvent& event : input.session.events) {
        const double x = axis.x(event.time_s);
        const std::string kind = event.name.substr(0, 5) == "no_go" ? "bad"
                                 : event.name == "target_hit"       ? "good"
                                                                    : "plain";
        svg.open_group(
            "class=\"event " + kind + "\"",
            svg_number(event.time_s - axis.from_s) + " s: " + event.name + " " + event.detail);
        svg.line(x, y, x, y + 10, "");
        const std::string name = input.words(event_words(event.name));
        const double width = kLetter * static_cast<double>(name.size());
        const double from = std::min(x - 1, kWidth - width);
        for (int row = 0; row < 2; ++row) {
            if (from < free_from[row]) continue;
            svg.text(from, y + 22 + kRow * row, name, "class=\"mark\"");
            free_from[row] = from + width + kGap;
            break;
        }
        svg.close_group();
    }
}

// The distance from the tip to the target that the exercise asks for; NaN if it asks for none.
double pass_distance_mm(const Exercise& exercise) {
    double distance = NAN;
    for (const Exercise::PassMark& mark : exercise.pass_marks) {
        if (mark.metric == "final_tip_to_target_mm") distance = mark.at_most;
    }
    if (!std::isfinite(distance) && !exercise.targets.empty())
        distance = exercise.targets.front().hit_radius_mm;
    return distance;
}

}  // namespace

std::string timeline_svg(const ReviewInput& input) {
    const TimeAxis axis = time_axis(input.session.samples);
    const SessionCurves& c = input.score.curves;
    Svg svg;
    double y = 8;
    svg.text(8, y + 10, input.words("probe on skin"), "class=\"name\"");
    add_probe_bar(input, axis, y, svg);
    y += 22;
    svg.text(8, y + 10, input.words("needle in tissue"), "class=\"name\"");
    add_bars(
        axis, c.time_s, [&](std::size_t i) { return c.depth_mm[i] > 0; }, y, "class=\"bar needle\"",
        svg);
    y += 26;
    svg.text(8, y + 12, input.words("events"), "class=\"name\"");
    add_events(input, axis, y, svg);
    y += 48;
    const Lane lanes[] = {
        {input.words("inserted length"), "mm", &c.depth_mm, NAN, 10, false},
        {input.words("tip to target"), input.words("mm, nearest"), &c.tip_to_target_mm,
         pass_distance_mm(input.exercise), 10, false},
        {input.words("tip to scan plane"), "mm", &c.plane_distance_mm, NAN, 5, true},
        {input.words("needle visible"), input.words("part inside the sector"), &c.in_beam_fraction,
         NAN, 1, false}};
    const double lanes_from = y;
    if (!c.time_s.empty()) {
        for (const Lane& lane : lanes) {
            add_lane(axis, c, lane, y, svg);
            y += kLaneHeight + 14;
        }
    }
    const double span = axis.to_s - axis.from_s;
    for (const double t : multiples_between(0, span, round_step(span, 10))) {
        const double x = axis.x(axis.from_s + t);
        svg.line(x, lanes_from - 6, x, y - 8, "class=\"grid\"");
        svg.text(x, y + 6, svg_number(t) + " s", "class=\"tick middle\"");
    }
    y += 16;
    return svg.picture(kWidth, y,
                       "class=\"timeline\" role=\"img\" aria-label=\"" +
                           escaped_html(input.words("Time line")) + "\"");
}

std::string progress_svg(const ReviewInput& input, const std::string& metric) {
    std::vector<double> values;
    for (const ProgressEntry& entry : input.earlier) {
        double value = NAN;
        for (const Metric& m : entry.metrics) {
            if (m.name == metric) value = m.value;
        }
        values.push_back(value);
    }
    values.push_back(input.score.value(metric));
    double top = 0;
    int known = 0;
    for (const double v : values) {
        if (std::isfinite(v)) top = std::max(top, v), ++known;
    }
    if (known < 2 || !(top > 0)) return "";
    constexpr double kProgressWidth = 220, kProgressHeight = 70;
    const double dx =
        values.size() > 1 ? (kProgressWidth - 20) / static_cast<double>(values.size() - 1) : 0;
    const auto x = [&](std::size_t i) { return 10 + dx * static_cast<double>(i); };
    const auto y = [&](std::size_t i) {
        return kProgressHeight - 8 - values[i] / top * (kProgressHeight - 16);
    };
    Svg svg;
    SvgPath path;
    bool open = false;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (!std::isfinite(values[i])) continue;
        if (open)
            path.line_to(x(i), y(i));
        else
            path.move_to(x(i), y(i));
        open = true;
    }
    svg.path(path, "class=\"curve\"");
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (!std::isfinite(values[i])) continue;
        const bool last = i + 1 == values.size();
        svg.circle(x(i), y(i), last ? 5 : 3, last ? "class=\"now\"" : "class=\"then\"",
                   svg_number(values[i]) + " " + metric_unit(metric));
    }
    return svg.picture(kProgressWidth, kProgressHeight, "class=\"progress\"");
}

namespace {

// The page in the language of its reader.
struct Page {
    explicit Page(const ReviewInput& of)
        : input(of),
          html(kReviewPageHtml, [&of](std::string_view english) { return of.words(english); }) {}

    std::string filled(std::string_view block, const HtmlValues& values) const {
        return html.filled(block, values);
    }
    std::string figure(const std::vector<std::uint8_t>& png, const std::string& caption) const {
        return filled("figure", {{"caption", escaped_html(caption)}, {"png", base64(png)}});
    }
    std::string words(const Message& english) const { return input.language->words(english); }

    const ReviewInput& input;
    HtmlTemplate html;
};

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

std::string limits(const Page& page, const PassResult& mark) {
    std::string out;
    if (std::isfinite(mark.at_least))
        out += page.words({"at least {}", {shown(mark.at_least, mark.metric)}});
    if (std::isfinite(mark.at_most))
        out += (out.empty() ? "" : ", ") +
               page.words({"at most {}", {shown(mark.at_most, mark.metric)}});
    return out;
}

std::string cards(const Page& page) {
    const ReviewInput& input = page.input;
    std::string out;
    for (const char* name : {"elapsed_time_s", "final_tip_to_target_mm", "targets_hit",
                             "insertions", "time_in_tissue_s", "needle_in_beam_fraction",
                             "tip_in_view_at_advance_fraction", "no_go_contacts"}) {
        out += page.filled("card", {{"value", shown(input.score.value(name), name)},
                                    {"title", escaped_html(page.words(find_metric(name)->title))}});
    }
    return out;
}

std::string pass_marks(const Page& page) {
    const ReviewInput& input = page.input;
    if (input.score.pass_marks.empty()) return "";
    std::string rows;
    for (const PassResult& mark : input.score.pass_marks) {
        const MetricInfo* info = find_metric(mark.metric);
        rows += page.filled("pass_mark",
                            {{"title", escaped_html(info ? page.words(info->title) : mark.metric)},
                             {"value", shown(mark.value, mark.metric)},
                             {"limits", limits(page, mark)},
                             {"class", mark.passed ? "good" : "bad"},
                             {"verdict", page.words(mark.passed ? "passed" : "not passed")}});
    }
    return page.filled("pass_marks", {{"rows", rows}});
}

std::string seconds_words(double time_s) {
    return time_s < 0 ? "\u2013" : number_text(time_s, 3) + " s";
}

std::string title_of(const ReviewInput& input, const ProcedureResult::Item& item) {
    for (const ExerciseTexts::Item& text : input.texts.items)
        if (text.name == item.name) return text.title;
    return item.title;
}

// The list of a procedure, and below it what went wrong.
std::string checklist(const Page& page) {
    const ReviewInput& input = page.input;
    if (!input.score.procedure) return "";
    const ProcedureResult& list = *input.score.procedure;
    std::string rows;
    for (const ProcedureResult::Item& item : list.items) {
        rows +=
            page.filled("checklist_item",
                        {{"title", escaped_html(title_of(input, item)) +
                                       (item.critical ? " (" + page.words("critical") + ")" : "")},
                         {"when", seconds_words(item.time_s)},
                         {"class", item.ticked ? "good" : "bad"},
                         {"verdict", page.words(item.ticked ? "Done" : missed_words(item.why))},
                         {"source", escaped_html(item.source)}});
    }
    const auto& names = complication_names();
    for (const ProcedureResult::Happened& one : list.complications) {
        const auto at = std::find(names.begin(), names.end(), one.name) - names.begin();
        rows +=
            page.filled("checklist_item",
                        {{"title", page.words(complication_titles()[static_cast<std::size_t>(at)])},
                         {"when", seconds_words(one.time_s)},
                         {"class", "bad"},
                         {"verdict", page.words("complication")},
                         {"source", ""}});
    }
    std::string points = page.words(
        {"{} points of {}, {} needed.",
         {number_text(list.points, 4), number_text(list.max_points, 4), number_text(list.cut, 4)}});
    if (list.stray_acts > list.stray_acts_at_most)
        points += " " + page.words({"{} acts where no step asks for them; at most {} pass.",
                                    {std::to_string(list.stray_acts),
                                     std::to_string(list.stray_acts_at_most)}});
    return page.filled("checklist", {{"points", points}, {"rows", rows}});
}

// The score of the last session, marked as better or worse, and the course over all sessions.
std::string comparison(const Page& page, const MetricInfo& info, double value) {
    const ReviewInput& input = page.input;
    double before = NAN;
    for (const Metric& m : input.earlier.back().metrics) {
        if (m.name == info.name) before = m.value;
    }
    const double change = value - before;
    const bool better = (info.sense == MetricSense::less_is_better && change < 0) ||
                        (info.sense == MetricSense::more_is_better && change > 0);
    const bool worse =
        info.sense != MetricSense::neutral && !better && change != 0 && std::isfinite(change);
    return page.filled("comparison", {{"class", better  ? "good"
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

// The groups of the metrics that have evidence, or of the others.
std::string score_groups(const Page& page, bool evidence) {
    const ReviewInput& input = page.input;
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
            rows += page.filled("score",
                                {{"name", escaped_html(meaning(info))},
                                 {"title", escaped_html(page.words(info.title))},
                                 {"value", shown(value, info.name)},
                                 {"comparison", compare ? comparison(page, info, value) : ""}});
        }
        if (rows.empty()) continue;
        groups += page.filled("score_group",
                              {{"title", page.words(group.title)},
                               {"comparison", compare ? page.filled("comparison_head", {}) : ""},
                               {"rows", rows}});
    }
    return groups;
}

std::string score_table(const Page& page) {
    return page.filled(
        "scores", {{"groups", score_groups(page, true)}, {"others", score_groups(page, false)}});
}

std::string insertions(const Page& page) {
    const ReviewInput& input = page.input;
    if (input.score.insertions.empty()) return "";
    std::string rows;
    const double start_s = input.session.samples.front().time_s;
    int number = 0;
    for (const InsertionScore& s : input.score.insertions) {
        const auto target = static_cast<std::size_t>(s.target);
        rows += page.filled(
            "insertion",
            {{"number", std::to_string(++number)},
             {"entry", shown(s.entry_s - start_s, "t_s")},
             {"exit", s.still_in ? page.words("stays in") : shown(s.exit_s - start_s, "t_s")},
             {"deepest", shown(s.deepest_mm, "d_mm")},
             {"target", s.target < 0 ? "\u2013"
                                     : escaped_html(input.language->tissue_words(
                                           input.exercise.targets[target].name))},
             {"tip_to_target", shown(s.tip_to_target_mm, "d_mm")}});
    }
    return page.filled("insertions", {{"rows", rows}});
}

std::string frames(const Page& page) {
    const ReviewInput& input = page.input;
    const Sequence& p = input.pictures;
    if (p.frames.empty()) return "";
    std::string figures;
    const double start_s = input.session.samples.front().time_s;
    for (std::size_t i = 0; i < p.frames.size(); ++i) {
        std::string what = "picture";
        for (const SequenceField& field : p.frames[i].fields) {
            if (field.name == "Event") what = field.value;
        }
        figures += page.figure(
            png_from_grey(p.pixels.data() + i * p.frame_bytes(), p.width, p.height),
            page.words(event_words(what)) + ", " + shown(p.frames[i].timestamp_s - start_s, "t_s"));
    }
    return page.filled("frames", {{"figures", figures}});
}

}  // namespace

std::string review_page(const ReviewInput& input, const std::vector<SessionView>& views) {
    const Page page(input);
    const SessionHeader& header = input.session.header;
    const std::string dot = " \u00b7 ";
    std::string verdict, warnings, figures;
    if (!input.score.pass_marks.empty() || input.score.procedure)
        verdict = page.filled(input.score.passed ? "verdict_passed" : "verdict_not_passed", {});
    for (const auto* list : {&input.warnings, &input.score.warnings}) {
        for (const Message& warning : *list)
            warnings += page.filled("warning", {{"text", escaped_html(page.words(warning))}});
    }
    for (const SessionView& view : views) figures += page.figure(view.png, page.words(view.title));
    return page.filled(
        "page", {{"language", input.language->code},
                 {"title", escaped_html(input.texts.title)},
                 {"trainee", header.trainee.empty() ? "" : escaped_html(header.trainee) + dot},
                 {"case", escaped_html(input.bundle.manifest.case_name)},
                 {"started", header.started.empty() ? "" : dot + escaped_html(header.started)},
                 {"verdict", verdict},
                 {"warnings", warnings},
                 {"cards", cards(page)},
                 {"checklist", checklist(page)},
                 {"pass_marks", pass_marks(page)},
                 {"time_line", timeline_svg(input)},
                 {"insertions", insertions(page)},
                 {"frames", frames(page)},
                 {"views", views.empty() ? "" : page.filled("views", {{"figures", figures}})},
                 {"scores", score_table(page)},
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
    SONOCASE_TRY(auto input, load_review(session_path, bundle_path, options));
    StageReport report;
    report.stage = "review";
    report.measures.push_back({"load_and_score_s", seconds()});
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed)
        return Error{"cannot make the folder: " + failed.message(), folder, "check the path"};
    const auto views = render_session_views(input, options);
    if (!views) {
        input.warnings.push_back(
            {"No 3-D views could be rendered: {}.", {views.error().message()}});
    }
    report.measures.push_back({"views", views ? static_cast<double>(views->size()) : 0});
    const std::string page = review_page(input, views ? *views : std::vector<SessionView>{});
    SONOCASE_TRY_DONE(write_file(folder + "/review.html", page));
    SONOCASE_TRY_DONE(write_file(folder + "/scores.json", score_json(input.score, input.exercise)));
    report.measures.push_back({"readings", static_cast<double>(input.session.samples.size())});
    report.warnings.assign(input.warnings.begin(), input.warnings.end());
    report.seconds = seconds();
    if (seen != nullptr) *seen = std::move(input);
    return report;
}

}  // namespace sonocase::pipeline::inline review
