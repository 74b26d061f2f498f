// SPDX-License-Identifier: Apache-2.0

#include <cmath>

#include "formats/image_scores/beam_image.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/look/fit_machine.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {
namespace {

// A machine that differs from the base in everything that is fitted to the texture.
Machine known_machine() {
    Machine machine;
    machine.beam.axial_mm = 0.95;
    machine.beam.lateral_mm = 1.7;
    machine.grey.level = 55;
    machine.grey.exponent = 0.9;
    machine.near_field.ring_level = 0;
    machine.contact.edge_db = 0;
    return machine;
}

double relative(double found, double truth) {
    return (found - truth) / truth;
}

Result<Measured> measure_look(const Settings& settings) {
    int frames = 16;
    for (const Setting& s : settings) {
        if (s.key == "look.frames") frames = std::stoi(s.value);
    }
    const Machine truth = known_machine();
    const ScanPlace place = stand_in_fan();
    const BeamImage grid = beam_grid(place);
    std::vector<std::vector<std::uint8_t>> clip;
    for (int i = 0; i < frames; ++i) {
        const auto seed = static_cast<std::uint64_t>(100 + i);
        clip.push_back(picture_from_beam(stand_in(truth, place, Parenchyma{}, seed), place,
                                         kStandInWidth, kStandInHeight));
    }
    const Stopwatch watch;
    LookGauge gauge(
        grid, std::vector<std::uint8_t>(static_cast<std::size_t>(grid.samples) * grid.lines, 1), {},
        {});
    for (const auto& frame : clip)
        gauge.add(gauge.measure(beam_from_picture(frame, kStandInWidth, kStandInHeight, place)));
    LookMeasures measures = gauge.result();
    measures.black = truth.grey.floor;  // the clip shows none, and it is not what is judged here
    measures.black_seen = true;
    const Machine found = fit_machine(measures, place, kStandInWidth, kStandInHeight, {}).machine;
    const double seconds = watch.seconds();
    const double errors[] = {
        relative(found.beam.axial_mm, truth.beam.axial_mm),
        relative(lateral_width_mm(found, grid, 50), lateral_width_mm(truth, grid, 50)),
        relative(grey_of(found.grey, 1), grey_of(truth.grey, 1))};
    double squares = 0;
    for (const double e : errors) squares += e * e;
    return Measured{100 * std::sqrt(squares / 3), seconds, ""};
}

}  // namespace

Suite look_suite() {
    Suite suite;
    suite.name = "look";
    suite.title = "A machine measured from a clip";
    suite.body = "synthetic-clip";
    suite.error_name = "rms error of point spread along and across the beam, and of grey";
    suite.error_unit = "%";
    suite.truth =
        "A known machine draws a clip of plain parenchyma, which is measured as a real clip would "
        "be. The error combines those of the width along the beam, the width across it at 50 mm "
        "and the grey of the tissue's mean amplitude.";
    suite.knobs = {{"look.frames",
                    {"1", "2", "4", "16", "48"},
                    "16",
                    "",
                    "frames measured",
                    "random variation of the speckle in the clip",
                    "the stand-in's own chance remains: from some frames on, more do not help",
                    "the lower error of few frames is chance in this one clip, and larger numbers "
                    "of frames differ by chance as well"}};
    suite.measure = measure_look;
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
