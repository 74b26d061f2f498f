// SPDX-License-Identifier: Apache-2.0

// What the page calls for the 3-D view.
#include "runtime/web/page_scene.h"
#include "runtime/web/program/page_state.h"

using namespace sonocase;
using namespace sonocase::runtime;

namespace {

// Of the open case; page.player says which.
struct Scene {
    const PagePlayer* of = nullptr;
    PageScene scene;
    Model model;
} shown;

PageScene& scene() {
    if (shown.of != page.player.get() || !shown.scene.begun()) {
        shown.scene.begin(*page.player->bundle());
        shown.of = page.player.get();
    }
    return shown.scene;
}

PlanePicture picture_of(const PagePlayer& player) {
    const PageImage& image = player.image();
    return {player.engine().renderer().layout(), image.depth_mm,
            player.engine().last().input.settings.flip_left_right, image.side_px, image.side_px};
}

}  // namespace

// Number of parts without organs; makes the skin of a case when it is first asked.
SONOCASE_EXPORT(scene_parts) int scene_parts() {
    return scene().parts();
}
// The same with organs, which are made now.
SONOCASE_EXPORT(scene_organs) int scene_organs() {
    scene().add_organs(*page.player->bundle());
    return scene().parts();
}
// Memory of the meshes is given back.
SONOCASE_EXPORT(scene_end) void scene_end() {
    shown = {};
}
// Number of vertices, of eight floats each, at scene_vertices(); indices at scene_indices().
SONOCASE_EXPORT(scene_part) std::size_t scene_part(int part) {
    shown.model = scene().part(part, page.player->engine(), picture_of(*page.player));
    return shown.model.vertices.size();
}
SONOCASE_EXPORT(scene_vertices) const float* scene_vertices() {
    return reinterpret_cast<const float*>(shown.model.vertices.data());
}
SONOCASE_EXPORT(scene_indices) const std::uint32_t* scene_indices() {
    return shown.model.indices.data();
}
SONOCASE_EXPORT(scene_index_count) std::size_t scene_index_count() {
    return shown.model.indices.size();
}
SONOCASE_EXPORT(scene_rgb) unsigned scene_rgb(int part) {
    return scene().rgb(part);
}
// At numbers(): yaw, pitch, distance of the first view.
SONOCASE_EXPORT(scene_first) void scene_first() {
    const Orbit orbit = scene().first(page.player->engine());
    page.numbers = {orbit.yaw_rad, orbit.pitch_rad, orbit.distance_mm};
}
// At numbers(): three matrices of 16, row by row: camera_from_mannequin, mannequin_from_probe,
// mannequin_from_needle as it is drawn. from: as ViewFrom.
SONOCASE_EXPORT(scene_places)
void scene_places(int from, double yaw_rad, double pitch_rad, double distance_mm) {
    const ScanEngine& engine = page.player->engine();
    const FrameRecord& record = engine.last();
    page.numbers.clear();
    for (const Rigid& place :
         {inverse(scene().camera(static_cast<ViewFrom>(from), {yaw_rad, pitch_rad, distance_mm},
                                 engine)),
          record.tools.mannequin_from_probe, record.needle.mannequin_from_drawn}) {
        const std::array<double, 16> rows = matrix_from_rigid(place);
        page.numbers.insert(page.numbers.end(), rows.begin(), rows.end());
    }
}
