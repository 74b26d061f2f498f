// SPDX-License-Identifier: Apache-2.0

#include <pybind11/stl.h>

#include "array_values.h"
#include "bindings.h"
#include "formats/exercise/exercise.h"

namespace sonocase::python {
namespace {

ProbeShape shape_named(const std::string& name) {
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        if (name == probe_shape_name(shape)) return shape;
    }
    throw py::value_error("probe: no shape " + name + "; give linear, curvilinear or phased");
}

void bind_probe(py::module_& module) {
    const Probe standard;
    py::class_<Probe>(module, "Probe", "A probe: the area that it scans, and its beam.")
        .def(py::init([](const std::string& shape, double radius_mm, double field_of_view_rad,
                         double width_mm, double depth_mm, double frequency_mhz, double focus_mm,
                         double elevation_mm) {
                 return Probe{shape_named(shape), radius_mm,     field_of_view_rad, width_mm,
                              depth_mm,           frequency_mhz, focus_mm,          elevation_mm};
             }),
             py::kw_only(), py::arg("shape") = "curvilinear",
             py::arg("radius_mm") = standard.radius_mm,
             py::arg("field_of_view_rad") = standard.field_of_view_rad,
             py::arg("width_mm") = standard.width_mm, py::arg("depth_mm") = standard.depth_mm,
             py::arg("frequency_mhz") = standard.frequency_mhz,
             py::arg("focus_mm") = standard.focus_mm,
             py::arg("elevation_mm") = standard.elevation_mm)
        .def_property(
            "shape", [](const Probe& p) { return probe_shape_name(p.shape); },
            [](Probe& p, const std::string& name) { p.shape = shape_named(name); },
            "'linear', 'curvilinear' or 'phased'.")
        .def_readwrite("radius_mm", &Probe::radius_mm, "Of the face, curvilinear.")
        .def_readwrite("field_of_view_rad", &Probe::field_of_view_rad,
                       "Full opening angle, curvilinear and phased.")
        .def_readwrite("width_mm", &Probe::width_mm, "Of the face, linear.")
        .def_readwrite("depth_mm", &Probe::depth_mm, "Of the picture, along the beam.")
        .def_readwrite("frequency_mhz", &Probe::frequency_mhz)
        .def_readwrite("focus_mm", &Probe::focus_mm)
        .def_readwrite("elevation_mm", &Probe::elevation_mm,
                       "Full thickness of the beam at the focus.")
        .def("__repr__", [](const Probe& p) {
            return "<sonocase.Probe " + std::string(probe_shape_name(p.shape)) + ", " +
                   std::to_string(static_cast<int>(p.depth_mm)) + " mm deep>";
        });
}

void bind_targets(py::module_& module) {
    py::class_<Target>(module, "Target", "What an exercise asks the needle to reach.")
        .def_readonly("name", &Target::name)
        .def_property_readonly(
            "centre_mm", [](const Target& t) { return array_of(t.centre); },
            "Frame `mannequin`, at rest; shape (3,).")
        .def_readonly("radius_mm", &Target::radius_mm)
        .def_readonly("hit_radius_mm", &Target::hit_radius_mm,
                      "A tip as near as this to the centre is a hit.")
        .def_readonly("inside", &Target::inside, "Label that it lies in; '': any.")
        .def("__repr__", [](const Target& t) { return "<sonocase.Target " + t.name + ">"; });
    py::class_<NeedleModel>(module, "Needle", "A needle as an exercise describes it.")
        .def_property_readonly(
            "make", [](const NeedleModel& n) { return n.make->name; },
            "How it shows (docs/format.md).")
        .def_readonly("gauge", &NeedleModel::gauge)
        .def_property_readonly("diameter_mm",
                               [](const NeedleModel& n) { return needle_diameter_mm(n); })
        .def_readonly("length_mm", &NeedleModel::length_mm);
}

}  // namespace

void bind_exercise(py::module_& module) {
    bind_probe(module);
    bind_targets(module);
    py::class_<Exercise>(module, "Exercise", "Probe, needle, targets and motion of one exercise.")
        .def_readonly("name", &Exercise::name)
        .def_readonly("title", &Exercise::title)
        .def_readonly("description", &Exercise::description)
        .def_readonly("kind", &Exercise::kind)
        .def_readonly("difficulty", &Exercise::difficulty)
        .def_readonly("model", &Exercise::model)
        .def_readonly("effects", &Exercise::effects)
        .def_readonly("probe", &Exercise::probe)
        .def_readonly("needle", &Exercise::needle)
        .def_readonly("targets", &Exercise::targets)
        .def_readonly("no_go", &Exercise::no_go, "Labels that the needle must not touch.")
        .def_property_readonly(
            "start_pose",
            [](const Exercise& e) {
                return array_of(pose_along(e.start_probe, e.start_beam, {1, 0, 0}));
            },
            "mannequin_from_probe where the exercise begins, before the probe is set down on the "
            "skin; shape (4, 4), mm.")
        .def_property_readonly(
            "breathing",
            [](const Exercise& e) {
                return py::dict("amplitude_mm"_a = e.breathing.amplitude_mm,
                                "period_s"_a = e.breathing.period_s);
            },
            "{'amplitude_mm', 'period_s'}; amplitude 0: none.")
        .def(
            "sweep_poses",
            [](const Exercise& e, const std::string& name) {
                for (const Sweep& sweep : e.sweeps) {
                    if (sweep.name != name) continue;
                    py::list poses;
                    for (const SweepKey& key : sweep.keys)
                        poses.append(array_of(pose_along(key.probe, key.beam, key.lateral)));
                    return poses;
                }
                throw py::key_error("no sweep named " + name + " in exercise " + e.name);
            },
            "name"_a, "The key poses of a scripted sweep, each (4, 4), mm.")
        .def_property_readonly("sweeps",
                               [](const Exercise& e) {
                                   py::list names;
                                   for (const Sweep& sweep : e.sweeps) names.append(sweep.name);
                                   return names;
                               })
        .def("__repr__", [](const Exercise& e) { return "<sonocase.Exercise " + e.name + ">"; });
}

}  // namespace sonocase::python
