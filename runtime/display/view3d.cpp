// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/view3d.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>

#include "runtime/display/scene_gl.h"
#include "runtime/display/skin_mesh.h"
#include "runtime/display/tool_models.h"

namespace sonocase::runtime {
namespace {

constexpr double kTanHalf = 0.36;          // of half the vertical field of view
constexpr double kNear = 10, kFar = 5000;  // mm from the eye

}  // namespace

struct View3d::Impl {
    SceneProgram program;
    OffscreenPicture picture;
    GlMesh skin, probe, mark, plane, needle, hub, ball;
    Exercise exercise;
    Box3 box;         // of the skin
    Point3 interest;  // that the view from outside turns about
    Matrix3 home;     // columns: right, up, towards the eye
    Renderer::Layout plane_layout;
    bool plane_flipped = false;
    Rigid view_from_mannequin;

    void update_plane(const View3dInput& input);
    void draw_tools(const View3dInput& input, bool from_needle) const;
    void draw_targets(const View3dInput& input) const;
    void draw_skin() const;
};

View3d::View3d() : impl_(std::make_unique<Impl>()) {
    Model ball;
    sphere(ball.vertices, ball.indices);
    impl_->ball.upload(ball);
}

View3d::~View3d() = default;

void View3d::set_case(const CaseBundle& bundle) {
    Impl& d = *impl_;
    // 10 mm: some ten thousand triangles for a torso, and shoulders and breasts keep their shape.
    const Surface mesh = skin_mesh(bundle, 10);
    Model skin;
    d.box = {};
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        const Point3 p = mesh.points[i];
        const Vector3 n = mesh.normals[i];
        skin.vertices.push_back(
            {{float(p.x), float(p.y), float(p.z)}, {float(n.x), float(n.y), float(n.z)}, {0, 0}});
        d.box.include(p);
    }
    for (const auto& t : mesh.triangles)
        skin.indices.insert(skin.indices.end(), t.begin(), t.end());
    d.skin.upload(skin);
    if (d.box.empty()) d.box = bundle.grid.bounds();
}

void View3d::set_exercise(const Exercise& exercise) {
    Impl& d = *impl_;
    d.exercise = exercise;
    // The probe looks down in the picture, whatever the mannequin's axes are called; the body's
    // long axis runs across, as when a patient lies in front of an operator.
    const Vector3 up = normalized(-exercise.start_beam);
    const Vector3 extent = d.box.extent();
    Vector3 along{1, 0, 0};
    if (extent.y > extent.x && extent.y >= extent.z) along = {0, 1, 0};
    if (extent.z > extent.x && extent.z > extent.y) along = {0, 0, 1};
    Vector3 right = along - dot(along, up) * up;
    right = norm(right) > 0.3 ? normalized(right) : any_perpendicular(up);
    d.home = Matrix3::from_columns(right, up, cross(right, up));
    d.interest = d.box.centre() + 0.3 * (exercise.start_probe - d.box.centre());
    orbit_ = {};
    orbit_.distance_mm = 1.4 * std::max({extent.x, extent.y, extent.z, 100.0});
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
            program.draw(probe, place, 1, 0xD8DEE4, 1, Paint::lit);
            program.draw(mark, place, 1, 0x48BAD6, 1, Paint::lit);
        }
        program.draw(plane, place, 1, input.in_contact ? 0x6FB7CC : 0x39444E, 1,
                     input.image_texture ? Paint::textured : Paint::flat);
    }
    if (input.has_needle) {
        program.draw(needle, input.mannequin_from_needle, 1, 0xF2F4F6, 1, Paint::lit);
        program.draw(hub, input.mannequin_from_needle, 1, 0xE8904A, 1, Paint::lit);
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
        program.draw(ball, place, std::max(target.radius_mm, 3.0), reached ? 0x60C882 : 0xFFC850, 1,
                     Paint::lit);
    }
}

// Its front only, blended over what is inside; drawn last.
void View3d::Impl::draw_skin() const {
    const Rigid identity;
    glEnable(GL_CULL_FACE);
    glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    program.draw(skin, identity, 1, 0xC99A80, 0.3f, Paint::flat);  // depth alone
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glDepthFunc(GL_LEQUAL);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    program.draw(skin, identity, 1, 0xE8C0A8, 0.42f, Paint::skin);
    glDisable(GL_CULL_FACE);
    glDepthFunc(GL_LESS);
}

void* View3d::draw(int width_px, int height_px, const View3dInput& input) {
    Impl& d = *impl_;
    d.picture.resize(std::max(width_px, 16), std::max(height_px, 16));
    d.update_plane(input);
    const bool from_probe = from_ == ViewFrom::probe && input.has_probe;
    const bool from_needle = from_ == ViewFrom::needle && input.has_needle;
    d.view_from_mannequin =
        inverse(from_probe    ? mannequin_from_probe_camera(input.mannequin_from_probe)
                : from_needle ? mannequin_from_needle_camera(input.mannequin_from_needle)
                              : mannequin_from_outside_camera(d.home, d.interest, orbit_));
    const double aspect = double(d.picture.width_px()) / d.picture.height_px();
    d.picture.begin();
    d.program.use(perspective(kTanHalf, aspect, kNear, kFar), d.view_from_mannequin,
                  input.image_texture);
    d.draw_tools(input, from_needle);
    if (input.show_targets) d.draw_targets(input);
    d.draw_skin();
    d.picture.end();
    return d.picture.texture();
}

ViewRay View3d::ray(double x_px, double y_px) const {
    const Impl& d = *impl_;
    const double aspect = double(d.picture.width_px()) / std::max(d.picture.height_px(), 1);
    const Vector3 direction_view{(2 * x_px / d.picture.width_px() - 1) * kTanHalf * aspect,
                                 (1 - 2 * y_px / d.picture.height_px()) * kTanHalf, -1};
    const Rigid mannequin_from_view = inverse(d.view_from_mannequin);
    return {mannequin_from_view * Point3{0, 0, 0},
            normalized(mannequin_from_view * direction_view)};
}

}  // namespace sonocase::runtime
