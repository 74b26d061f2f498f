// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/shown_scene.h"

#include <string>

#include "runtime/imaging/formation/effect_choice.h"
#include "runtime/imaging/formation/image_formation.h"
#include "runtime/imaging/paper/paper_formation.h"
#include "runtime/imaging/physical/physical_formation.h"

namespace sonocase::runtime {

Result<MovingEffects> moving_effects(const RenderOptions& options) {
    MovingEffects moves;
    const bool physical = options.model == ImageModel::physical;
    const auto own = physical ? kPhysicalModel.effects : kPaperModel.effects;
    const auto others = physical ? kPaperModel.effects : kPhysicalModel.effects;
    const Result<EffectChoice> choice = choose_effects(options.effects, own, others);
    if (!choice) return choice.error();
    for (std::size_t i = 0; i < own.size(); ++i) {
        const std::string name = own[i];
        if (name == "deformation") moves.deformation = choice->on[i];
        if (!physical) continue;
        if (name == "contact") moves.contact = choice->on[i];
        if (name == "breathing") moves.breathing = choice->on[i];
        if (name == "pulsation") moves.pulsation = choice->on[i];
    }
    return moves;
}

ScanGeometry shown_geometry(const Exercise& exercise, const RenderOptions& o) {
    const ImageModelInfo& info = o.model == ImageModel::physical ? kPhysicalModel : kPaperModel;
    return make_scan_geometry(
        exercise.probe, o.scanlines > 0 ? o.scanlines : info.scanlines(exercise, o),
        o.samples > 0 ? o.samples : info.samples(exercise, o), o.width_px, o.height_px);
}

}  // namespace sonocase::runtime
