// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/accuracy_picture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/text/number_text.h"
#include "pipeline/base/text.h"
#include "pipeline/pictures/chart.h"

namespace sonocase::pipeline::inline exporting {
namespace {

constexpr std::size_t kPlaces = 8;                               // structures that are shown
constexpr double kNearlyAll = 0.9, kWorthSaying = 0.01;          // shares of squares, of the error
constexpr std::array<std::uint8_t, 3> kBarColour{86, 180, 233},  // pale: marks lie on it
    kPresentColour{213, 94, 0}, kLandmarksColour{0, 158, 115};

std::string bar(double mm, double longest_mm) {
    constexpr double kWidth = 32;
    const double letters = longest_mm > 0 ? std::round(kWidth * mm / longest_mm) : 0;
    std::string text(static_cast<std::size_t>(std::clamp(letters, 0.0, kWidth)), '#');
    text.resize(static_cast<std::size_t>(kWidth), ' ');
    return text;
}

// "voxels of 2 mm, 1.5 s less".
std::string described(const CasePoint& point) {
    constexpr std::string_view kVoxel = "resample.voxel_mm=";
    const std::string what =
        point.setting.starts_with(kVoxel)
            ? text("voxels of %s mm", point.setting.substr(kVoxel.size()).c_str())
            : point.setting;
    if (point.present) return what + ", as it is";
    if (point.landmarks) return what + ", no more seconds";
    return text("%s, %.1f s %s", what.c_str(), std::abs(point.more_seconds),
                point.more_seconds < 0 ? "less" : "more");
}

std::string named(const UnknownPlace& place) {
    return place.label + (place.target ? " (has a target)" : "");
}

ChartSheet sheet_of(const CaseAccuracy& accuracy) {
    ChartSheet sheet;
    sheet.width_px = 350;
    sheet.height_px = 420;
    Chart parts;
    parts.title = "Where the millimetres come from";
    parts.y_label = "mean displacement of surfaces, mm";
    parts.rows = true;
    for (const BudgetEntry& e : accuracy.budget.entries) {
        if (!std::isfinite(e.mm)) continue;
        parts.series.push_back({text("%s (%s)", e.cause.c_str(), e.stage.c_str()),
                                {0},
                                {e.mm},
                                SeriesStyle::bars,
                                kBarColour});
    }
    sheet.charts.push_back(std::move(parts));
    if (!accuracy.places.empty()) {
        Chart places;
        places.title = "How far from its place";
        places.y_label = "mm, nine times in ten within";
        places.rows = true;
        Series held{"with two landmarks", {}, {}, SeriesStyle::diamonds, {27, 31, 36}, 6};
        for (std::size_t i = 0; i < std::min(accuracy.places.size(), kPlaces); ++i) {
            const UnknownPlace& p = accuracy.places[i];
            places.series.push_back({named(p), {0}, {p.p90_mm}, SeriesStyle::bars, kBarColour});
            if (!(p.with_landmarks_mm > 0)) continue;
            held.x.push_back(static_cast<double>(i + 1));
            held.y.push_back(p.with_landmarks_mm);
        }
        if (!held.x.empty()) places.series.push_back(std::move(held));
        sheet.charts.push_back(std::move(places));
    }
    if (accuracy.points.size() > 1) {
        Chart curve;
        curve.title = "What would lower it";
        curve.y_label = "mean displacement of surfaces, mm";
        curve.rows = true;
        for (const CasePoint& point : accuracy.points)
            curve.series.push_back({described(point),
                                    {0},
                                    {point.error_mm},
                                    SeriesStyle::bars,
                                    point.present     ? kPresentColour
                                    : point.landmarks ? kLandmarksColour
                                                      : kBarColour});
        sheet.charts.push_back(std::move(curve));
    }
    sheet.columns = 3;
    return sheet;
}

}  // namespace

CaseAccuracy case_accuracy(const CaseBundle& bundle, std::vector<CasePoint> points) {
    return {bundle.manifest.case_name, error_budget(bundle.manifest.stages),
            unknown_places_of_case(bundle), std::move(points)};
}

std::string accuracy_summary(const CaseAccuracy& accuracy) {
    const double known_mm = accuracy.budget.known_mm;
    const auto number = [](double mm) { return number_text(mm, 3); };
    std::string out = "On average a surface of this case lies " + number(known_mm) +
                      " mm from its place in the patient";
    const BudgetEntry* largest = nullptr;
    std::string uncounted;
    for (const BudgetEntry& e : accuracy.budget.entries) {
        if (!std::isfinite(e.mm))
            uncounted += " Not counted are " + e.cause + ": " + e.basis + ".";
        else if (largest == nullptr || e.mm > largest->mm)
            largest = &e;
    }
    if (largest != nullptr && known_mm > 0) {
        const double share = largest->mm * largest->mm / (known_mm * known_mm);
        out += std::string(share > kNearlyAll ? "; nearly all of that"
                           : share > 0.5      ? "; most of that"
                                              : "; the largest part") +
               " is " + largest->cause;
    }
    out += "." + uncounted;
    const CasePoint *landmarks = nullptr, *finer = nullptr;
    for (const CasePoint& point : accuracy.points) {
        if (!(point.error_mm < (1 - kWorthSaying) * known_mm)) continue;
        if (point.landmarks) landmarks = &point;
        if (point.more_seconds > 0 && finer == nullptr) finer = &point;  // the next finer one
    }
    if (landmarks != nullptr) {
        out += " Two landmarks far apart would bring that to " + number(landmarks->error_mm) +
               " mm (--landmarks FILE.csv; `sonocase landmarks` lists places).";
    }
    if (finer != nullptr)
        out += " With " + finer->setting + " it would be " + number(finer->error_mm) + " mm, for " +
               number(finer->more_seconds) + " s more.";
    else if (accuracy.points.size() > 1)
        out += " Finer voxels buy nothing.";
    return out;
}

std::string accuracy_text(const CaseAccuracy& accuracy) {
    std::string out = accuracy.case_name + "\n\n" + accuracy_summary(accuracy) +
                      "\n\nwhere its millimetres come from: mean displacement "
                      "of surfaces\n";
    double longest = 0;
    for (const BudgetEntry& e : accuracy.budget.entries)
        if (std::isfinite(e.mm)) longest = std::max(longest, e.mm);
    for (const BudgetEntry& e : accuracy.budget.entries) {
        if (std::isfinite(e.mm))
            out += text("  %-9s %s %6.2f mm  %s (%s)\n", e.stage.c_str(),
                        bar(e.mm, longest).c_str(), e.mm, e.cause.c_str(), e.basis.c_str());
        else
            out += text("  %-9s %-32s   ?   mm  %s: %s\n", e.stage.c_str(), "not known",
                        e.cause.c_str(), e.basis.c_str());
    }
    out += text("  %-9s %-32s %6.2f mm\n", "together", "", accuracy.budget.known_mm);
    out += "  tracker   not part of a bundle: the files of its calibration say theirs\n";
    if (!accuracy.places.empty()) {
        out +=
            "\nhow far from its place: nine times in ten within, if the patient lies as fitted\n";
        double worst = 0;
        for (const UnknownPlace& p : accuracy.places) worst = std::max(worst, p.p90_mm);
        for (std::size_t i = 0; i < std::min(accuracy.places.size(), kPlaces); ++i) {
            const UnknownPlace& p = accuracy.places[i];
            out += text("  %-32s %s %6.1f mm", named(p).c_str(), bar(p.p90_mm, worst).c_str(),
                        p.p90_mm);
            if (p.with_landmarks_mm > 0)
                out += text("  (%.1f with two landmarks)", p.with_landmarks_mm);
            out += "\n";
        }
    }
    if (!accuracy.points.empty()) {
        out += "\nwhat seconds buy in this case, on the machine of docs/accuracy.md\n";
        for (const CasePoint& point : accuracy.points)
            out += text("  %-32s %+7.1f s  %6.2f mm%s\n", point.setting.c_str(), point.more_seconds,
                        point.error_mm, point.present ? "  as it is" : "");
    }
    return out;
}

std::string accuracy_svg(const CaseAccuracy& accuracy) {
    return chart_svg(sheet_of(accuracy));
}

Status write_accuracy_picture(const CaseAccuracy& accuracy, const std::string& path) {
    if (path.ends_with(".svg")) return write_chart_svg(sheet_of(accuracy), path);
    if (path.ends_with(".png")) return write_chart_png(sheet_of(accuracy), path);
    return Error{"is no kind of picture that can be written", path, "end its name in .svg or .png"};
}

}  // namespace sonocase::pipeline::inline exporting
