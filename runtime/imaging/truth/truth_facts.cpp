// SPDX-License-Identifier: Apache-2.0

// What a frame as a whole shows: needle and targets.
#include <algorithm>
#include <cmath>
#include <limits>

#include "formats/scoring/image_region.h"
#include "runtime/imaging/truth/truth_state.h"

namespace sonocase::runtime {

bool TruthRenderer::Impl::needle_shape_of(const FrameInput& input, NeedleShape& shape) const {
    const Vector3 d = input.needle.direction;
    const Point3 tip = input.needle.tip;
    const bool finite = std::isfinite(tip.x) && std::isfinite(tip.y) && std::isfinite(tip.z) &&
                        std::isfinite(d.x) && std::isfinite(d.y) && std::isfinite(d.z);
    if (!input.has_needle || !finite || !(norm(d) > 0.5)) return false;
    const Rigid probe_from_mannequin = inverse(input.mannequin_from_probe);
    shape = needle_shape(needle, probe_from_mannequin * tip, normalized(probe_from_mannequin * d));
    return shape.radius_mm > 0 && std::isfinite(shape.slab_mm);
}

void TruthRenderer::Impl::needle_facts(const FrameInput& input) {
    NeedleShape shape;
    truth.has_needle = needle_shape_of(input, shape);
    truth.tip_in_plane = false;
    truth.needle_in_image_mm = 0;
    truth.tip_label = 0;
    if (!truth.has_needle) return;
    truth.needle = {input.needle.tip, normalized(input.needle.direction)};
    if (probe) {
        const NeedlePose& in = input.needle;
        const NeedleDent dent = bounded_dent(shape.tip, shape.axis, in.tent_mm, in.drag_mm);
        truth.needle.tent_mm = dent.tent_mm;
        truth.needle.drag_mm = dent.drag_mm;
    }
    truth.tip_probe = shape.tip;
    const double half_slab = 0.5 * shape.slab_mm;
    truth.tip_in_plane =
        std::abs(shape.tip.y) <= half_slab && in_image(exercise.probe, shape.tip.x, shape.tip.z);
    truth.needle_in_image_mm = length_in_image(
        exercise.probe, shape.tip - shape.length_mm * shape.axis, shape.tip, half_slab);
    const Point3 tip = probe ? probe->at_rest(input.needle.tip) : input.needle.tip;
    truth.tip_label = anatomy.label(anatomy.at_rest(tip, truth.time_s));
}

void TruthRenderer::Impl::target_facts() {
    const Rigid probe_from_mannequin = inverse(truth.mannequin_from_probe);
    truth.nearest_target = -1;
    double nearest = INFINITY;
    for (std::size_t i = 0; i < truth.targets.size(); ++i) {
        const Target& target = exercise.targets[i];
        TargetTruth& out = truth.targets[i];
        out.centre = anatomy.moved(target.centre, truth.time_s);
        if (probe) out.centre = probe->now_at(out.centre);
        const Point3 p = probe_from_mannequin * out.centre;
        out.plane_mm = p.y;
        const double cut = target.radius_mm * target.radius_mm - p.y * p.y;
        out.in_image =
            cut > 0 && distance_to_image(exercise.probe, p.x, p.z) < std::sqrt(std::max(cut, 0.0));
        out.tip_mm = truth.has_needle ? distance(truth.needle.tip, out.centre)
                                      : std::numeric_limits<double>::quiet_NaN();
        if (out.tip_mm < nearest) {
            nearest = out.tip_mm;
            truth.nearest_target = static_cast<int>(i);
        }
    }
}

void TruthRenderer::Impl::facts(const FrameInput& input) {
    truth.posed = true;
    truth.mannequin_from_probe = input.mannequin_from_probe;
    truth.time_s = std::isfinite(input.time_s) ? input.time_s : 0;
    truth.mm2_per_px = geometry.mm_per_px * geometry.mm_per_px;
    truth.beams = geometry.scanlines;
    truth.beams_touching = look_up.contact().touching;
    needle_facts(input);
    target_facts();
}

}  // namespace sonocase::runtime
