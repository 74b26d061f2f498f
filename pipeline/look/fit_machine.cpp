// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/fit_machine.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "formats/image_scores/smooth.h"
#include "formats/text/number_text.h"
#include "pipeline/look/fit_gain.h"
#include "pipeline/look/fit_texture.h"
#include "pipeline/look/look_simulation.h"

namespace sonocase::pipeline {
namespace {

double db(double amplitude) {
    return 20 * std::log10(std::max(amplitude, 1e-6));
}

// Peaks of the profile under the face that stand still and lie at equal distances.
bool fit_face_lines(const std::vector<double>& e,
                    double sample_mm,
                    double reach_mm,
                    MachineNearField& near) {
    std::vector<double> at, height;
    for (std::size_t i = 1; i + 1 < e.size() && static_cast<double>(i) * sample_mm < reach_mm;
         ++i) {
        if (!(e[i] > e[i - 1] && e[i] >= e[i + 1])) continue;
        double around = 0, n = 0;
        const auto wide =
            static_cast<std::ptrdiff_t>(std::lround(near.spacing_mm / sample_mm / 2)) + 1;
        for (std::ptrdiff_t j = -wide; j <= wide; ++j) {
            const std::ptrdiff_t k = static_cast<std::ptrdiff_t>(i) + j;
            if (k < 0 || k >= static_cast<std::ptrdiff_t>(e.size())) continue;
            around += e[static_cast<std::size_t>(k)];
            ++n;
        }
        if (e[i] < 1.05 * around / n) continue;
        at.push_back((static_cast<double>(i) + 0.5) * sample_mm);
        height.push_back(db(e[i] / (around / n)));
    }
    if (at.size() < 3) return false;
    std::vector<double> gaps;
    for (std::size_t i = 1; i < at.size(); ++i) gaps.push_back(at[i] - at[i - 1]);
    const double gap = median_of(gaps);
    std::size_t regular = 0;
    while (regular < gaps.size() && std::abs(gaps[regular] - gap) < 0.3 * gap) ++regular;
    if (regular < 2) return false;
    near.lines = static_cast<int>(regular) + 1;
    near.first_mm = std::clamp(at[0], 0.0, 50.0);
    near.spacing_mm = std::clamp(gap, 0.1, 50.0);
    near.line_db = std::clamp(height[0] + 6, 0.0, 20.0);  // over the ringing, which is half of it
    near.line_step_db =
        std::clamp((height[0] - height[regular]) / static_cast<double>(regular), 0.0, 6.0);
    return true;
}

// Darkness at the face and the level of the ringing, whose decay is the base's, together: either
// would be taken for the other. The ringing gives the profile its mean, the darkness its shape.
void fit_ring(const std::vector<double>& e,
              double sample_mm,
              double reach_mm,
              MachineNearField& near) {
    const auto count =
        std::min(e.size(), static_cast<std::size_t>(std::max(reach_mm / sample_mm - 0.5, 0.0)) + 1);
    std::vector<double> ring;
    for (std::size_t i = 0; i < count; ++i) {
        const double r = (static_cast<double>(i) + 0.5) * sample_mm;
        double lines = 1;
        for (int k = 0; k < near.lines; ++k) {
            const double z = (r - near.first_mm - k * near.spacing_mm) / (near.line_mm / 2.3548);
            lines += std::pow(10.0, (near.line_db - k * near.line_step_db) / 20) *
                     std::exp(-0.5 * z * z);
        }
        ring.push_back(std::exp(-r / near.ring_decay_mm) * lines);
    }
    double best = std::numeric_limits<double>::infinity();
    MachineNearField found = near;
    for (int step = 0; step <= 100; ++step) {
        const double start = 0.01 * step;
        const auto ramp = [&](std::size_t i) {
            return std::min(1.0,
                            start + (static_cast<double>(i) + 0.5) * sample_mm / near.start_mm);
        };
        double missing = 0, of_one = 0, rest = 0;
        for (std::size_t i = 0; i < count; ++i) {
            missing += e[i] - ramp(i);
            of_one += ramp(i) * ring[i];
        }
        const double level = of_one > 0 ? std::clamp(missing / of_one, 0.0, 100.0) : 0;
        for (std::size_t i = 0; i < count; ++i)
            rest += std::pow(e[i] - ramp(i) * (1 + level * ring[i]), 2);
        if (rest >= best) continue;
        best = rest;
        found.start = start;
        found.ring_level = level;
    }
    near = found;
    near.tail_level = 0;
}

// `parenchyma`: the amplitude that the grey map gives parenchyma's mean grey.
void fit_near_field(const LookMeasures& m,
                    const BeamImage& grid,
                    double parenchyma,
                    FittedMachine& fit) {
    MachineNearField& near = fit.machine.near_field;
    std::vector<double> e;
    for (const double grey : m.near) e.push_back(amplitude_of(fit.machine.grey, grey) / parenchyma);
    const double scale = grid.fan ? 1 : 0.3;  // a linear probe rings over a third of the depth
    const auto mean_of = [&](double from_mm, double to_mm) {
        double sum = 0, n = 0;
        for (std::size_t i = 0; i < e.size(); ++i) {
            const double r = (static_cast<double>(i) + 0.5) * grid.sample_mm;
            if (r < from_mm || r > to_mm) continue;
            sum += e[i];
            ++n;
        }
        return n > 0 ? sum / n : 0;
    };
    if (!(mean_of(0.8 * scale, 4.5 * scale) > 0)) {
        fit.kept.push_back("near_field: the first millimetres are black");
        return;
    }
    if (!m.moves || m.near_still < 0.5 || !fit_face_lines(e, grid.sample_mm, 14 * scale, near))
        fit.kept.push_back(
            m.moves ? "near_field.lines: no regular still lines under the face"
                    : "near_field.lines: frames of a moving probe are needed to tell lines of the "
                      "probe from tissue");
    fit_ring(e, grid.sample_mm, 4 * scale, near);
}

void fit_contact(const LookMeasures& m, FittedMachine& fit) {
    std::vector<double> level;
    for (const double grey : m.by_line) level.push_back(db(amplitude_of(fit.machine.grey, grey)));
    const std::size_t n = level.size();
    if (n < 32) return;
    std::vector<double> middle(level.begin() + static_cast<std::ptrdiff_t>(n / 4),
                               level.end() - static_cast<std::ptrdiff_t>(n / 4));
    const double ground = median_of(middle);
    double edge = 0;
    const std::size_t outer = n / 40 + 1;
    for (std::size_t i = 0; i < outer; ++i)
        edge += (level[i] + level[n - 1 - i]) / 2 / static_cast<double>(outer);
    MachineContact& contact = fit.machine.contact;
    contact.edge_db = std::clamp(ground - edge, 0.0, 40.0);
    if (contact.edge_db < 3) {
        contact.edge_db = 0;
        return;
    }
    // Where half of the loss is made good; it falls linearly from the edge.
    std::size_t half = 0;
    while (half < n / 4 && (level[half] + level[n - 1 - half]) / 2 < ground - contact.edge_db / 2)
        ++half;
    contact.edge_fraction =
        std::clamp(2 * static_cast<double>(half) / static_cast<double>(n), 0.02, 0.25);
}

// Three significant digits: more would pretend a precision that no clip gives, and would differ
// between processors.
void round_values(Machine& m) {
    const auto tidy = [](double& v) { (void)parse_number(number_text(v, 3), v); };
    for (double* v : {&m.beam.axial_mm,
                      &m.beam.lateral_mm,
                      &m.beam.lateral_focus_mm,
                      &m.beam.lateral_range_mm,
                      &m.grey.floor,
                      &m.grey.level,
                      &m.grey.exponent,
                      &m.grey.knee,
                      &m.grey.dynamic_range_db,
                      &m.gain.far_from_mm,
                      &m.gain.far_db_per_cm,
                      &m.gain.far_limit_db,
                      &m.near_field.ring_level,
                      &m.near_field.first_mm,
                      &m.near_field.spacing_mm,
                      &m.near_field.line_db,
                      &m.near_field.line_step_db,
                      &m.near_field.start,
                      &m.contact.edge_db,
                      &m.contact.edge_fraction})
        tidy(*v);
    for (auto& [tissue, level_db] : m.tissue_db) tidy(level_db);
}

}  // namespace

FittedMachine fit_machine(const LookMeasures& measures,
                          const ScanPlace& place,
                          int width_px,
                          int height_px,
                          const FitOptions& options) {
    FittedMachine fit;
    const BeamImage grid = beam_grid(place);
    double parenchyma_db = 0;
    Machine& machine = fit.machine = options.base;
    machine.grey.floor = measures.black;
    machine.noise.reject = measures.black_seen;
    if (!measures.black_seen) {
        fit.warnings.push_back(
            "No black region was seen: the grey floor is what the contrast of the speckle tells, "
            "and levels are uncertain by a sixth. Add frames that show fluid, a shadow or air.");
    }
    constexpr int kFewPatches = 4;
    if (measures.patches < kFewPatches) {
        fit.warnings.push_back(
            "Hardly any even parenchyma was found: point spread, looks and grey map are those of "
            "'" +
            options.base.name + "'. Name a place with --rectangle.");
        fit.kept.push_back("beam, looks, grey map: no even parenchyma");
    } else {
        fit_texture(measures, place, width_px, height_px, options, fit);
        machine.looks.near_count = near_looks(machine.looks.count);
        // The mean grey of parenchyma is not the grey of its mean amplitude.
        parenchyma_db = db(amplitude_of(machine.grey, measures.texture.mean));
        fit_far_gain(measures, grid, fit);
    }
    fit_near_field(measures, grid, std::pow(10.0, parenchyma_db / 20), fit);
    fit_contact(measures, fit);
    for (const auto& [tissue, grey] : measures.tissue_grey) {
        const double level = db(amplitude_of(machine.grey, grey)) - parenchyma_db +
                             far_fall_db(machine.gain, measures.tissue_depth_mm.at(tissue));
        machine.tissue_db[tissue] = std::clamp(level, -60.0, 60.0);
    }
    fit.kept.push_back("haze, persistence, elevation, frequency: stills do not show them");
    round_values(machine);
    return fit;
}

}  // namespace sonocase::pipeline
