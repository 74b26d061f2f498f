// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/look.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "formats/files/atomic_file.h"
#include "formats/machine/machine.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/look/find_scan.h"
#include "pipeline/look/look_frames.h"

namespace sonocase::pipeline::inline look {
namespace {

struct Clip {
    std::vector<std::string> paths;  // those that are measured
    std::size_t given = 0;
    FramePile pile;
    std::vector<std::uint8_t> burnt;
};

Result<Clip> open_clip(const LookInput& input,
                       const std::vector<std::size_t>& use,
                       int max_frames,
                       const Progress& progress) {
    SONOCASE_TRY(const auto all, list_frames(input.frames));
    Clip clip;
    clip.given = all.size();
    std::vector<std::string> usable;
    for (const std::size_t i : use) {
        if (i < all.size()) usable.push_back(all[i]);
    }
    if (usable.empty()) usable = all;
    for (const std::size_t i : spread_indices(usable.size(), static_cast<std::size_t>(max_frames)))
        clip.paths.push_back(usable[i]);
    for (std::size_t i = 0; i < clip.paths.size(); ++i) {
        report_progress(progress,
                        0.3 * static_cast<double>(i) / static_cast<double>(clip.paths.size()),
                        "reading frames");
        SONOCASE_TRY(const auto frame, read_look_frame(clip.paths[i]));
        SONOCASE_TRY_DONE(clip.pile.add(frame, clip.paths[i]));
    }
    clip.burnt = burnt_in(clip.pile);
    return clip;
}

struct Placed {
    ScanPlace place;
    bool found = false;
    std::vector<std::string> warnings;
};

Result<Placed> place_of(const Clip& clip,
                        const std::optional<GivenScan>& given,
                        const LookOptions& options) {
    if (given) return Placed{given->place, false, {}};
    const auto scan = find_scan(clip.pile, clip.burnt);
    if (!scan) {
        Error error = scan.error();
        error.where = clip.paths.front();
        return error;
    }
    if (!(options.depth_mm > 0)) {
        return Error{"the pictures do not say how many millimetres a pixel is", clip.paths.front(),
                     "give the depth of the scan with --depth-mm, or its place with --geometry"};
    }
    return Placed{scan_place(*scan, options.depth_mm / scan->depth_px), true, scan->warnings};
}

// 1 where a sample lies in the picture, away from burnt-in graphics.
std::vector<std::uint8_t> usable_samples(const Clip& clip,
                                         const ScanPlace& place,
                                         const BeamImage& grid) {
    std::vector<std::uint8_t> use;
    for (int k = 0; k < grid.samples; ++k) {
        for (int l = 0; l < grid.lines; ++l) {
            const PixelPoint p = pixel_of(place, grid, k, l);
            const int x = static_cast<int>(std::lround(p.x_px)),
                      y = static_cast<int>(std::lround(p.y_px));
            use.push_back(x >= 0 && y >= 0 && x < clip.pile.width_px && y < clip.pile.height_px &&
                          !clip.burnt[clip.pile.index(x, y)]);
        }
    }
    return use;
}

std::vector<std::uint8_t> inside(const LookRectangle& r,
                                 const ScanPlace& place,
                                 const BeamImage& grid,
                                 const std::vector<std::uint8_t>& use) {
    std::vector<std::uint8_t> mask;
    for (int k = 0; k < grid.samples; ++k) {
        for (int l = 0; l < grid.lines; ++l) {
            const PixelPoint p = pixel_of(place, grid, k, l);
            mask.push_back(use[grid.index(k, l)] && p.x_px >= r.x && p.y_px >= r.y &&
                           p.x_px <= r.x + r.width - 1 && p.y_px <= r.y + r.height - 1);
        }
    }
    return mask;
}

std::string text_of(const LookRectangle& r) {
    return std::to_string(r.x) + "," + std::to_string(r.y) + "," + std::to_string(r.width) + "," +
           std::to_string(r.height);
}

struct Masks {
    std::vector<std::uint8_t> use, parenchyma;
    std::map<std::string, std::vector<std::uint8_t>> tissues;
};

// The texture is measured in rectangles of liver and in those without a name.
Result<Masks> masks_of(const Clip& clip,
                       const LookInput& input,
                       const ScanPlace& place,
                       const BeamImage& grid) {
    Masks masks;
    masks.use = usable_samples(clip, place, grid);
    if (std::count(masks.use.begin(), masks.use.end(), 1) * 10 <
        static_cast<std::ptrdiff_t>(masks.use.size())) {
        return Error{"hardly any of the scan lies in the picture", clip.paths.front(),
                     "expected a geometry of these frames"};
    }
    for (const LookRectangle& r : input.rectangles) {
        const auto mask = inside(r, place, grid, masks.use);
        if (std::count(mask.begin(), mask.end(), 1) < 64) {
            return Error{"rectangle " + text_of(r) + " holds hardly any of the scan",
                         clip.paths.front(), "expected x,y,width,height in pixels, in the scan"};
        }
        const auto join = [&](std::vector<std::uint8_t>& into) {
            into.resize(mask.size());
            for (std::size_t i = 0; i < mask.size(); ++i) into[i] |= mask[i];
        };
        if (!r.tissue.empty()) join(masks.tissues[r.tissue]);
        if (r.tissue.empty() || r.tissue == "liver") join(masks.parenchyma);
    }
    return masks;
}

Result<LookMeasures> measure_frames(const Clip& clip,
                                    const ScanPlace& place,
                                    const Masks& masks,
                                    LookPicture& shown,
                                    const Progress& progress) {
    LookGauge gauge(beam_grid(place), masks.use, masks.parenchyma, masks.tissues);
    constexpr std::size_t kTogether = 8;  // frames in memory
    const std::size_t middle = clip.paths.size() / 2;
    for (std::size_t first = 0; first < clip.paths.size(); first += kTogether) {
        report_progress(
            progress,
            0.3 + 0.4 * static_cast<double>(first) / static_cast<double>(clip.paths.size()),
            "measuring frames");
        const std::size_t count = std::min(kTogether, clip.paths.size() - first);
        std::vector<std::optional<Result<LookFrame>>> frames(count);
        std::vector<LookGauge::Part> parts(count);
        parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                frames[i].emplace(read_look_frame(clip.paths[first + i]));
                const Result<LookFrame>& frame = *frames[i];
                if (!frame || frame->width_px != clip.pile.width_px ||
                    frame->height_px != clip.pile.height_px)
                    continue;
                parts[i] = gauge.measure(
                    beam_from_picture(frame->grey, frame->width_px, frame->height_px, place));
            }
        });
        for (std::size_t i = 0; i < count; ++i) {
            const Result<LookFrame>& frame = *frames[i];
            if (!frame) return frame.error();
            if (frame->width_px != clip.pile.width_px || frame->height_px != clip.pile.height_px)
                return Error{"the file changed while it was measured", clip.paths[first + i], ""};
            if (first + i == middle)
                shown = {"Real frame", frame->width_px, frame->height_px, frame->grey};
            gauge.add(std::move(parts[i]));
        }
    }
    return gauge.result();
}

double score_of(const LookMeasures& m, std::string_view name, bool fan) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const PatchScores& t = m.texture;
    const bool texture = m.patches > 0;
    if (name == "liver_mean") return texture ? t.mean : kNone;
    if (name == "local_sd") return texture ? t.local_sd : kNone;
    if (name == "local_sd_over_mean") return texture ? t.local_sd / (t.mean - m.black) : kNone;
    if (name == "local_skew") return texture ? t.local_skew : kNone;
    if (name == "local_kurtosis") return texture ? t.local_kurtosis : kNone;
    if (name == "gradient_kurtosis") return texture ? t.gradient_kurtosis : kNone;
    if (name == "grain_along_mm") return texture ? t.grain_along_mm : kNone;
    if (name == "grain_across_mm") return texture ? t.grain_across_mm : kNone;
    if (name == "grain_ratio") return texture ? t.grain_across_mm / t.grain_along_mm : kNone;
    if (name == "streaks_per_cm2") return texture ? m.streaks_per_cm2 : kNone;
    if (name == "wall_layers") return fan ? m.wall.layers : kNone;
    if (name == "wall_across") return fan ? m.wall.across[1] : kNone;
    if (name == "near_grey") return m.first_4_mm;
    if (!m.diaphragm) return kNone;
    if (name == "diaphragm_peak") return m.diaphragm->peak_grey;
    if (name == "diaphragm_width_mm") return m.diaphragm->width_mm;
    if (name == "black_grey") return m.diaphragm->black_grey;
    return kNone;
}

void draw_and_score(const Masks& masks, const LookOptions& options, LookResult& result) {
    const int width = result.frame.width_px, height = result.frame.height_px;
    const BeamImage drawn =
        stand_in(result.fit.machine, result.place, Parenchyma{}, options.seed + 1);
    result.drawn = {"Stand-in: plain parenchyma, drawn with what was fitted", width, height,
                    picture_from_beam(drawn, result.place, width, height)};
    LookGauge gauge(beam_grid(result.place), masks.use, {}, {});
    gauge.add(gauge.measure(beam_from_picture(result.drawn.grey, width, height, result.place)));
    result.stand_in = gauge.result();
    result.stand_in.black = result.fit.machine.grey.floor;  // parenchyma everywhere shows none
    for (const ScoreLimits& limits : score_limits()) {
        const double real = score_of(result.real, limits.name, result.place.fan()),
                     own = score_of(result.stand_in, limits.name, result.place.fan());
        // Correlations over motion need poses.
        if (limits.name.find("correlation") != limits.name.npos ||
            limits.name == "elevation_half_mm")
            continue;
        const bool anatomy = limits.name.starts_with("wall") ||
                             limits.name.starts_with("diaphragm") || limits.name == "black_grey";
        result.scores.push_back({limits, result.place.fan(), real,
                                 anatomy ? std::numeric_limits<double>::quiet_NaN() : own});
    }
}

void add_report(LookResult& result, double seconds) {
    StageReport& report = result.report;
    report.stage = "look";
    report.version = kLookVersion;
    report.seconds = seconds;
    report.measures = {{"frames", static_cast<double>(result.real.frames)},
                       {"patches", static_cast<double>(result.real.patches)}};
    for (const LookScore& score : result.scores) {
        if (std::isfinite(score.real))
            report.measures.push_back({std::string(score.limits.name), score.real});
    }
    for (const auto& list : {result.real.warnings, result.fit.warnings})
        report.warnings.insert(report.warnings.end(), list.begin(), list.end());
}

}  // namespace

Result<LookResult> measure_look_of(const LookInput& input,
                                   const LookOptions& options,
                                   const Progress& progress) {
    const Stopwatch watch;
    std::optional<GivenScan> given;
    if (!input.geometry_path.empty()) {
        SONOCASE_TRY(const auto text, read_text_file(input.geometry_path));
        SONOCASE_TRY(auto scan, parse_scan(text, input.geometry_path));
        given = std::move(scan);
    }
    SONOCASE_TRY(const auto clip, open_clip(input, given ? given->use : std::vector<std::size_t>{},
                                            options.frames, progress));
    SONOCASE_TRY(const auto placed, place_of(clip, given, options));

    LookResult result;
    result.place = placed.place;
    result.place_found = placed.found;
    result.frames_given = clip.given;
    result.report.warnings = placed.warnings;
    SONOCASE_TRY(const auto base, built_in_machine(!options.base.empty() ? options.base
                                                   : result.place.fan()  ? "modern"
                                                                         : "modern-linear"));
    const BeamImage grid = beam_grid(result.place);
    if (grid.samples < kPatch) {
        return Error{"a scan of " + std::to_string(result.place.depth_mm) + " mm is too shallow",
                     clip.paths.front(), "expected more than 17 mm of a fan, 5 of a linear scan"};
    }
    SONOCASE_TRY(const auto masks, masks_of(clip, input, result.place, grid));
    SONOCASE_TRY(auto real, measure_frames(clip, result.place, masks, result.frame, progress));
    result.real = std::move(real);
    report_progress(progress, 0.7, "fitting the machine");
    FitOptions fit;
    fit.base = base;
    fit.seed = options.seed;
    result.fit =
        fit_machine(result.real, result.place, clip.pile.width_px, clip.pile.height_px, fit);
    result.fit.machine.name = options.name;
    result.fit.machine.title = options.title.empty() ? "Measured: " + options.name : options.title;
    draw_and_score(masks, options, result);
    add_report(result, watch.seconds());
    return result;
}

}  // namespace sonocase::pipeline::inline look
