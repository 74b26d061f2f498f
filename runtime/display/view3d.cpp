// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/view3d.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <future>

#include "runtime/display/models/skin_mesh.h"
#include "runtime/display/models/tool_models.h"
#include "runtime/display/scene_gl.h"

namespace sonocase::runtime::inline display {
namespace {

constexpr double kTanHalf = 0.36;          // tangent of half the vertical field of view
constexpr double kNear = 10, kFar = 5000;  // mm from the eye

}  // namespace

struct View3d::Impl {
    SceneProgram program;
    OffscreenPicture picture, other;
    GlMesh skin, probe, mark, plane, needle, hub, ball;
    Exercise exercise;
    Box3 box;         // around the skin
    Point3 interest;  // the point that the view from outside turns about
    Matrix3 home;     // columns: right, up, towards the eye
    BodyAxes axes;    // of the case
    Renderer::Layout plane_layout;
    bool plane_flipped = false;
    Rigid view_from_mannequin;
    double tan_half = kTanHalf;  // in this drawing: wider where the view is higher than wide
    struct Organ {
        std::unique_ptr<GlMesh> mesh;
        unsigned rgb;
    };
    std::vector<Organ> organs;
    std::atomic<bool> stop{false};
    std::future<std::vector<OrganMesh>> coming;

    void take_organs();
    void draw_lines(const View3dInput& input) const;
    void draw_through(const View3dInput& input) const;
    void update_plane(const View3dInput& input);
    void draw_tools(const View3dInput& input, bool from_needle) const;
    void draw_targets(const View3dInput& input) const;
    void draw_skin(bool exam) const;
    // Draws the scene into `to`, as the camera sees it.
    void render(OffscreenPicture& to, const View3dInput& input, bool from_needle, bool organs);
};

View3d::View3d() : impl_(std::make_unique<Impl>()) {
    Model ball;
    sphere(ball.vertices, ball.indices);
    impl_->ball.upload(ball);
}

View3d::~View3d() {
    leave_case();
}

void View3d::leave_case() {
    Impl& d = *impl_;
    if (d.coming.valid()) {
        d.stop = true;
        d.coming.wait();
        d.coming = {};
    }
    d.stop = false;
    d.organs.clear();
}

bool View3d::busy() const {
    const auto& coming = impl_->coming;
    return coming.valid() && coming.wait_for(std::chrono::seconds(0)) != std::future_status::ready;
}

// Uploads the organs when they are ready.
void View3d::Impl::take_organs() {
    if (!coming.valid() || coming.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
        return;
    for (const OrganMesh& made : coming.get()) {
        organs.push_back({std::make_unique<GlMesh>(), made.rgb});
        organs.back().mesh->upload(model_of(made.surface));
    }
}

void View3d::set_case(const CaseBundle& bundle) {
    leave_case();
    Impl& d = *impl_;
    d.coming = std::async(std::launch::async,
                          [&bundle, stop = &d.stop] { return organ_meshes(bundle, 4, *stop); });
    // 10 mm: some ten thousand triangles for a torso, and shoulders and breasts keep their shape.
    const Surface mesh = skin_mesh(bundle, 10);
    const Model skin = model_of(mesh);
    d.box = {};
    for (const Point3 p : mesh.points) d.box.include(p);
    d.axes = body_axes(bundle);
    d.skin.upload(skin);
    if (d.box.empty()) d.box = bundle.grid.bounds();
}

void View3d::set_exercise(const Exercise& exercise) {
    Impl& d = *impl_;
    d.exercise = exercise;
    const HomeView view = home_view(d.box, exercise, d.axes);
    d.home = view.home;
    d.interest = view.interest;
    first_ = view.orbit;
    orbit_ = first_;
    d.probe.upload(probe_model(exercise.probe));
    d.mark.upload(mark_model(exercise.probe));
    d.plane_layout = {};
    const double length_mm = std::max(exercise.needle.length_mm, 20.0);
    d.needle.upload(needle_model(length_mm));
    d.hub.upload(hub_model(length_mm));
}

// Makes a new mesh of the plane when the picture is placed on it in another way.
void View3d::Impl::update_plane(const View3dInput& input) {
    if (plane_flipped == input.flipped && plane_layout.mm_per_px == input.layout.mm_per_px &&
        plane_layout.origin_y_px == input.layout.origin_y_px && !plane.empty()) {
        return;
    }
    plane_layout = input.layout;
    plane_flipped = input.flipped;
    plane.upload(plane_model(exercise.probe, {input.layout, input.depth_mm, input.flipped,
                                              input.image_width_px, input.image_height_px}));
}

void View3d::Impl::draw_tools(const View3dInput& input, bool from_needle) const {
    if (input.has_probe) {
        const Rigid& place = input.mannequin_from_probe;
        if (!from_needle) {  // it would stand in the way
            program.draw(probe, place, 1, 0xB9BEC4, 1, Paint::lit);
            program.draw(mark, place, 1, 0x4A4F55, 1, Paint::lit);
        }
        program.draw(plane, place, 1, input.in_contact ? 0x9AA3AB : 0x39444E, 1,
                     input.image_texture ? Paint::textured : Paint::flat);
    }
    if (input.has_needle) {
        program.draw(needle, input.mannequin_from_needle, 1, 0xF2F4F6, 1, Paint::lit);
        program.draw(hub, input.mannequin_from_needle, 1, 0xB9BEC4, 1, Paint::lit);
    }
}

void View3d::Impl::draw_targets(const View3dInput& input) const {
    for (std::size_t i = 0; i < exercise.targets.size(); ++i) {
        const Target& target = exercise.targets[i];
        Rigid place;
        const Point3 centre =
            i < input.target_centres.size() ? input.target_centres[i] : target.centre;
        place.translation = centre - Point3{};
        const bool reached = i < input.targets_reached.size() && input.targets_reached[i];
        program.draw(ball, place, std::max(target.radius_mm, 3.0), reached ? 0x86C995 : 0xFFFFFF, 1,
                     Paint::lit);
    }
}

// The tip's path in a replay, and the straight path to compare it with.
void View3d::Impl::draw_lines(const View3dInput& input) const {
    const auto balls = [&](const std::vector<Point3>& points, std::size_t every, unsigned rgb) {
        for (std::size_t i = 0; i < points.size(); i += every) {
            Rigid place;
            place.translation = points[i] - Point3{};
            program.draw(ball, place, 1.2, rgb, 1, Paint::flat);
        }
    };
    balls(input.path, 1 + input.path.size() / 400, 0xF2F4F5);
    balls(input.best, 3, 0x82C8E0);
}

// Needle and targets shine faintly through what is in front of them.
void View3d::Impl::draw_through(const View3dInput& input) const {
    glDepthFunc(GL_GREATER);
    glDepthMask(GL_FALSE);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    if (input.has_needle)
        program.draw(needle, input.mannequin_from_needle, 1, 0xF2F4F5, 0.5f, Paint::flat);
    for (std::size_t i = 0; input.show_targets && i < exercise.targets.size(); ++i) {
        Rigid place;
        place.translation = (i < input.target_centres.size() ? input.target_centres[i]
                                                             : exercise.targets[i].centre) -
                            Point3{};
        program.draw(ball, place, std::max(exercise.targets[i].radius_mm, 3.0), 0xFFFFFF, 0.4f,
                     Paint::flat);
    }
    glDisable(GL_BLEND);
    glDepthMask(GL_TRUE);
    glDepthFunc(GL_LESS);
}

// Draws the front of the skin, blended over what is inside; comes last. In an exam the skin hides
// what is inside and is darker, so that the view does not outshine the picture beside it.
void View3d::Impl::draw_skin(bool exam) const {
    const Rigid identity;
    glEnable(GL_CULL_FACE);
    if (exam) {
        program.draw(skin, identity, 1, 0x9A8779, 1, Paint::lit);
        glDisable(GL_CULL_FACE);
        return;
    }
    glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    program.draw(skin, identity, 1, 0xDBB8A1, 0.3f, Paint::flat);  // depth alone
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glDepthFunc(GL_LEQUAL);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    program.draw(skin, identity, 1, 0xDBB8A1, organs.empty() ? 0.42f : 0.2f, Paint::skin);
    glDisable(GL_CULL_FACE);
    glDepthFunc(GL_LESS);
}

void View3d::Impl::render(OffscreenPicture& to,
                          const View3dInput& input,
                          bool from_needle,
                          bool shows_organs) {
    update_plane(input);
    const double aspect = double(to.width_px()) / to.height_px();
    tan_half = kTanHalf * std::max(1.0, 1 / std::max(aspect, 0.25));
    to.begin();
    program.use(perspective(tan_half, aspect, kNear, kFar), view_from_mannequin,
                input.image_texture);
    take_organs();
    if (shows_organs && !input.exam) {
        const Rigid identity;
        for (const Organ& organ : organs)
            program.draw(*organ.mesh, identity, 1, organ.rgb, 1, Paint::lit);
    }
    draw_tools(input, from_needle);
    draw_lines(input);
    if (input.show_targets && !input.exam) draw_targets(input);
    if (!input.exam) draw_through(input);
    draw_skin(input.exam);
    to.end();
}

void* View3d::draw(int width_px, int height_px, const View3dInput& input) {
    Impl& d = *impl_;
    d.picture.resize(std::max(width_px, 16), std::max(height_px, 16));
    const bool from_probe = from_ == ViewFrom::probe && input.has_probe;
    const bool from_needle = from_ == ViewFrom::needle && input.has_needle;
    d.view_from_mannequin =
        inverse(from_probe    ? mannequin_from_probe_camera(input.mannequin_from_probe)
                : from_needle ? mannequin_from_needle_camera(input.mannequin_from_needle)
                              : mannequin_from_outside_camera(d.home, d.interest, orbit_));
    d.render(d.picture, input, from_needle, shows_organs_);
    return d.picture.texture();
}

void* View3d::draw_for_other(int width_px, int height_px, const View3dInput& input) {
    Impl& d = *impl_;
    const Rigid view = d.view_from_mannequin;
    const double tan_half = d.tan_half;
    d.other.resize(std::max(width_px, 16), std::max(height_px, 16));
    d.view_from_mannequin = inverse(mannequin_from_outside_camera(d.home, d.interest, first_));
    d.render(d.other, input, false, true);
    d.view_from_mannequin = view;
    d.tan_half = tan_half;
    return d.other.texture();
}

std::vector<CubeFace> View3d::cube() const {
    const Impl& d = *impl_;
    return d.axes.known ? cube_faces(d.view_from_mannequin.rotation, d.axes)
                        : std::vector<CubeFace>{};
}

void View3d::look_at(Vector3 outward) {
    from_ = ViewFrom::outside;
    orbit_ = orbit_towards(impl_->home, outward, orbit_.distance_mm);
}

ViewRay View3d::ray(double x_px, double y_px) const {
    const Impl& d = *impl_;
    const double aspect = double(d.picture.width_px()) / std::max(d.picture.height_px(), 1);
    const Vector3 direction_view{(2 * x_px / d.picture.width_px() - 1) * d.tan_half * aspect,
                                 (1 - 2 * y_px / d.picture.height_px()) * d.tan_half, -1};
    const Rigid mannequin_from_view = inverse(d.view_from_mannequin);
    return {mannequin_from_view * Point3{0, 0, 0},
            normalized(mannequin_from_view * direction_view)};
}

}  // namespace sonocase::runtime::inline display
