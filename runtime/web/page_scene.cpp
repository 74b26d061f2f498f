// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/page_scene.h"

#include <algorithm>
#include <atomic>

namespace sonocase::runtime::inline web {
namespace {

constexpr double kSkinStepMm = 10, kOrganStepMm = 5;
constexpr double kMinNeedleMm = 20;

}  // namespace

void PageScene::begin(const CaseBundle& bundle) {
    begun_ = true;
    skin_ = skin_mesh(bundle, kSkinStepMm);
    body_ = {};
    for (const Point3 p : skin_.points) body_.include(p);
    if (body_.empty()) body_ = bundle.grid.bounds();
}

void PageScene::add_organs(const CaseBundle& bundle) {
    organs_ = organ_meshes(bundle, kOrganStepMm, std::atomic<bool>{false});
}

Model PageScene::part(int part, const ScanEngine& engine, const PlanePicture& picture) const {
    const Exercise& exercise = engine.exercise();
    const double needle_mm = std::max(exercise.needle.length_mm, kMinNeedleMm);
    switch (static_cast<ScenePart>(part)) {
        case ScenePart::skin: return model_of(skin_);
        case ScenePart::probe: return probe_model(exercise.probe);
        case ScenePart::mark: return mark_model(exercise.probe);
        case ScenePart::plane: return plane_model(exercise.probe, picture);
        case ScenePart::needle: return needle_model(needle_mm);
        case ScenePart::hub: return hub_model(needle_mm);
        case ScenePart::ball: {
            Model ball;
            sphere(ball.vertices, ball.indices);
            return ball;
        }
        case ScenePart::count: break;
    }
    const std::size_t organ = part - static_cast<int>(ScenePart::count);
    return organ < organs_.size() ? model_of(organs_[organ].surface) : Model{};
}

unsigned PageScene::rgb(int part) const {
    const std::size_t organ = part - static_cast<int>(ScenePart::count);
    return organ < organs_.size() ? organs_[organ].rgb : 0;
}

Rigid PageScene::camera(ViewFrom from, const Orbit& orbit, const ScanEngine& engine) const {
    const FrameRecord& record = engine.last();
    if (from == ViewFrom::probe && record.tools.has_probe)
        return mannequin_from_probe_camera(record.tools.mannequin_from_probe);
    if (from == ViewFrom::needle && record.tools.has_needle)
        return mannequin_from_needle_camera(record.needle.mannequin_from_drawn);
    const HomeView view = home_view(body_, engine.exercise());
    return mannequin_from_outside_camera(view.home, view.interest, orbit);
}

Orbit PageScene::first(const ScanEngine& engine) const {
    return home_view(body_, engine.exercise()).orbit;
}

}  // namespace sonocase::runtime::inline web
