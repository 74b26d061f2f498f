// SPDX-License-Identifier: Apache-2.0

#include <cmath>

#include "array_values.h"
#include "bindings.h"
#include "frame_renderer.h"

namespace sonocase::python {
namespace {

double finite(double value, const char* name) {
    if (!std::isfinite(value)) throw py::value_error(std::string(name) + ": not finite");
    return value;
}

py::object looking(py::handle point, py::handle beam, py::handle lateral) {
    return array_of(pose_along(point_from(point, "point"), vector_from(beam, "beam"),
                               vector_from(lateral, "lateral")));
}

py::object on_skin(const OpenedCase& opened,
                   py::handle near,
                   py::handle beam,
                   py::handle lateral,
                   double pressed_mm) {
    check(usable(opened));
    const runtime::Skin skin(*opened.bundle);
    Vector3 direction = beam.is_none() ? value_of(exercise_named(opened, "")).start_beam
                                       : vector_from(beam, "beam");
    direction = normalized(direction);
    const auto point = skin.project(point_from(near, "near"), direction, kSkinReachMm);
    if (!point) return py::none();
    if (beam.is_none()) {
        const Vector3 normal = skin.normal(*point, kSkinRadiusMm);
        if (!(norm(normal) > 0)) return py::none();
        direction = normalized(-1.0 * normal);
    }
    return array_of(pose_along(*point + finite(pressed_mm, "pressed_mm") * direction, direction,
                               vector_from(lateral, "lateral")));
}

py::object turned(py::handle pose, double tilt_rad, double rock_rad, double rotate_rad) {
    Rigid result = rigid_from(pose, "pose");
    result.rotation = result.rotation *
                      rotation_about({0, 0, 1}, finite(rotate_rad, "rotate_rad")) *
                      rotation_about({0, 1, 0}, finite(rock_rad, "rock_rad")) *
                      rotation_about({1, 0, 0}, finite(tilt_rad, "tilt_rad"));
    return array_of(result);
}

py::object moved(py::handle pose, py::handle offset_mm) {
    Rigid result = rigid_from(pose, "pose");
    result.translation =
        result.translation + result.rotation * (point_from(offset_mm, "offset_mm") - Point3{});
    return array_of(result);
}

}  // namespace

void bind_pose(py::module_& module) {
    py::module_ poses = module.def_submodule("pose");
    const py::tuple along_x = py::make_tuple(1.0, 0.0, 0.0);
    poses.def("looking", looking, "point"_a, "beam"_a, "lateral"_a = along_x,
              "The pose at `point` whose z is along `beam`, and whose x is as near to `lateral` as "
              "it can be.");
    poses.def(
        "on_skin", on_skin, "case"_a, "near"_a, "beam"_a = py::none(), "lateral"_a = along_x,
        "pressed_mm"_a = 0.0,
        "A probe set down on the skin, or None where there is none.\n\n"
        "near        a point above or below the skin\n"
        "beam        direction in which the skin is looked for and the probe looks; None: the "
        "skin's\n"
        "            inward normal, looked for along the exercise's first beam\n"
        "pressed_mm  how far the face is pushed in along the beam");
    poses.def("turned", turned, "pose"_a, "tilt_rad"_a = 0.0, "rock_rad"_a = 0.0,
              "rotate_rad"_a = 0.0,
              "The pose turned about its own axes: rotate about z (the beam), then rock about y "
              "(within the plane), then tilt about x (sweeps the plane), each about where the one "
              "before left the axis.");
    poses.def("moved", moved, "pose"_a, "offset_mm"_a,
              "The pose moved by `offset_mm` (3,) along its own axes.");
    poses.def(
        "inverse", [](py::handle pose) { return array_of(inverse(rigid_from(pose, "pose"))); },
        "pose"_a, "probe_from_mannequin of mannequin_from_probe.");
}

}  // namespace sonocase::python
