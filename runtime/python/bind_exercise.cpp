// SPDX-License-Identifier: Apache-2.0

#include <cassert>
#include <cstdio>

#include <pybind11/stl.h>

#include "array_values.h"
#include "bindings.h"
#include "formats/exercise/exercise.h"
#include "frame_renderer.h"

namespace sonocase::python {
namespace {

ProbeShape shape_named(const std::string& name) {
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        if (name == probe_shape_name(shape)) return shape;
    }
    throw py::value_error("probe: no shape " + name + "; give linear, curvilinear or phased");
}

const ProbeNumber& number_of(double Probe::*value) {
    for (const ProbeNumber& number : probe_numbers())
        if (number.value == value) return number;
    assert(false && "a probe's number that probe_numbers() lacks");
    return probe_numbers().front();
}

double checked(double Probe::*value, double given) {
    const ProbeNumber& number = number_of(value);
    return in_range(given, number.name, number.min, number.max);
}

// As pickle needs them.
py::tuple state_of(const Probe& p) {
    return py::make_tuple(probe_shape_name(p.shape), p.radius_mm, p.field_of_view_rad, p.width_mm,
                          p.depth_mm, p.frequency_mhz, p.focus_mm, p.elevation_mm);
}
py::tuple state_of(const NeedleModel& n) {
    return py::make_tuple(n.make->name, n.gauge, n.diameter_mm, n.length_mm, n.slab_mm,
                          n.tip_visibility, n.shaft_visibility, n.bend_max_weight,
                          n.bend_alpha_per_m, n.bend_delta_m);
}

Probe make_probe(const std::string& shape,
                 double radius_mm,
                 double field_of_view_rad,
                 double width_mm,
                 double depth_mm,
                 double frequency_mhz,
                 double focus_mm,
                 double elevation_mm) {
    return {shape_named(shape),
            checked(&Probe::radius_mm, radius_mm),
            checked(&Probe::field_of_view_rad, field_of_view_rad),
            checked(&Probe::width_mm, width_mm),
            checked(&Probe::depth_mm, depth_mm),
            checked(&Probe::frequency_mhz, frequency_mhz),
            checked(&Probe::focus_mm, focus_mm),
            checked(&Probe::elevation_mm, elevation_mm)};
}

Probe probe_of_state(const py::tuple& t) {
    const auto at = [&](int i) { return py::cast<double>(t[i]); };
    return make_probe(py::cast<std::string>(t[0]), at(1), at(2), at(3), at(4), at(5), at(6), at(7));
}

void bind_probe(py::module_& module) {
    const Probe standard;
    py::class_<Probe> probe(module, "Probe", "A probe: the area that it scans, and its beam.");
    probe.def(py::init(&make_probe), py::kw_only(), "shape"_a = "curvilinear",
              "radius_mm"_a = standard.radius_mm,
              "field_of_view_rad"_a = standard.field_of_view_rad, "width_mm"_a = standard.width_mm,
              "depth_mm"_a = standard.depth_mm, "frequency_mhz"_a = standard.frequency_mhz,
              "focus_mm"_a = standard.focus_mm, "elevation_mm"_a = standard.elevation_mm);
    probe.def_property(
        "shape", [](const Probe& p) { return probe_shape_name(p.shape); },
        [](Probe& p, const std::string& name) { p.shape = shape_named(name); },
        "'linear', 'curvilinear' or 'phased'.");
    const auto number = [&](double Probe::*value, const char* about) {
        probe.def_property(
            number_of(value).name, [value](const Probe& p) { return p.*value; },
            [value](Probe& p, double given) { p.*value = checked(value, given); }, about);
    };
    number(&Probe::radius_mm, "Of the face, curvilinear.");
    number(&Probe::field_of_view_rad, "Full opening angle, curvilinear and phased.");
    number(&Probe::width_mm, "Of the face, linear.");
    number(&Probe::depth_mm, "Of the picture, along the beam.");
    number(&Probe::frequency_mhz, "Of the pulse's middle.");
    number(&Probe::focus_mm, "Depth of the focus.");
    number(&Probe::elevation_mm, "Full thickness of the beam at the focus.");
    probe.def(py::pickle([](const Probe& p) { return state_of(p); }, &probe_of_state));
    probe.def("__repr__", [](const Probe& p) {
        return "<sonocase.Probe " + std::string(probe_shape_name(p.shape)) + ", " +
               std::to_string(static_cast<int>(p.depth_mm)) + " mm deep>";
    });
    py::dict limits;
    for (const ProbeNumber& n : probe_numbers()) limits[n.name] = py::make_tuple(n.min, n.max);
    module.attr("_PROBE_LIMITS") = limits;
    module.attr("_GAUGE_LIMITS") = py::make_tuple(kMinGauge, kMaxGauge);
    module.attr("_NEEDLE_MAKES") = needle_make_names();
}

const NeedleMake* make_named(const std::string& name) {
    if (const NeedleMake* make = find_needle_make(name)) return make;
    std::string names;
    for (const NeedleMake& make : needle_makes())
        names += (names.empty() ? "" : ", ") + std::string(make.name);
    throw py::value_error("needle: no make " + name + "; give one of " + names);
}

// A gauge of somebody's choice is the diameter from then on.
void set_gauge(NeedleModel& needle, double gauge) {
    needle.gauge = in_range(gauge, "gauge", kMinGauge, kMaxGauge);
    needle.diameter_mm = 0;
}

void set_diameter(NeedleModel& needle, double diameter_mm) {
    needle.diameter_mm = in_range(diameter_mm, "diameter_mm", 0, kMaxNeedleDiameterMm);
}

void set_length(NeedleModel& needle, double length_mm) {
    needle.length_mm = in_range(length_mm, "length_mm", 1, kMaxNeedleLengthMm);
}

NeedleModel make_needle(const std::string& make,
                        double gauge,
                        double diameter_mm,
                        double length_mm) {
    NeedleModel needle;
    needle.make = make_named(make);
    set_gauge(needle, gauge);
    set_diameter(needle, diameter_mm);
    set_length(needle, length_mm);
    return needle;
}

NeedleModel needle_of_state(const py::tuple& t) {
    const auto at = [&](int i) { return py::cast<double>(t[i]); };
    NeedleModel needle = make_needle(py::cast<std::string>(t[0]), at(1), at(2), at(3));
    needle.slab_mm = at(4);
    needle.tip_visibility = at(5);
    needle.shaft_visibility = at(6);
    needle.bend_max_weight = at(7);
    needle.bend_alpha_per_m = at(8);
    needle.bend_delta_m = at(9);
    return needle;
}

void bind_needle(py::module_& module) {
    const NeedleModel standard;
    py::class_<NeedleModel>(module, "Needle", "A needle: how it shows, and how thick it is.")
        .def(py::init(&make_needle), py::kw_only(), "make"_a = standard.make->name,
             "gauge"_a = standard.gauge, "diameter_mm"_a = 0.0, "length_mm"_a = standard.length_mm,
             "diameter_mm: instead of the gauge's where it is above 0.")
        .def_property(
            "make", [](const NeedleModel& n) { return n.make->name; },
            [](NeedleModel& n, const std::string& name) { n.make = make_named(name); },
            "How it shows (docs/format.md).")
        .def_property(
            "gauge", [](const NeedleModel& n) { return n.gauge; }, set_gauge,
            "6 to 34; setting it sets the diameter.")
        .def_property("diameter_mm", needle_diameter_mm, set_diameter, "0: the gauge's.")
        .def_property(
            "length_mm", [](const NeedleModel& n) { return n.length_mm; }, set_length,
            "From hub to tip.")
        .def(py::pickle([](const NeedleModel& n) { return state_of(n); }, &needle_of_state))
        .def("__repr__", [](const NeedleModel& n) {
            char gauge[32];
            std::snprintf(gauge, sizeof gauge, "%g", n.gauge);
            return "<sonocase.Needle " + std::string(n.make->name) + ", gauge " + gauge + ">";
        });
}

void bind_target(py::module_& module) {
    py::class_<Target>(module, "Target", "What an exercise asks the needle to reach.")
        .def_readonly("name", &Target::name, "As the exercise's file has it.")
        .def_property_readonly(
            "centre_mm", [](const Target& t) { return array_of(t.centre); },
            "Frame `mannequin`, at rest; shape (3,).")
        .def_readonly("radius_mm", &Target::radius_mm, "Of the target itself.")
        .def_readonly("hit_radius_mm", &Target::hit_radius_mm,
                      "A tip as near as this to the centre is a hit.")
        .def_readonly("inside", &Target::inside, "Label that it lies in; '': any.")
        .def(py::pickle(
            [](const Target& t) {
                return py::make_tuple(t.name, t.centre.x, t.centre.y, t.centre.z, t.radius_mm,
                                      t.hit_radius_mm, t.inside);
            },
            [](const py::tuple& t) {
                const auto at = [&](int i) { return py::cast<double>(t[i]); };
                Target target;  // what Python sees of it
                target.name = py::cast<std::string>(t[0]);
                target.centre = {at(1), at(2), at(3)};
                target.radius_mm = at(4);
                target.hit_radius_mm = at(5);
                target.inside = py::cast<std::string>(t[6]);
                return target;
            }))
        .def("__repr__", [](const Target& t) { return "<sonocase.Target " + t.name + ">"; });
}

py::tuple exercise_state(const CaseExercise& e) {
    return py::make_tuple(path_text(e.case_path), e.name, state_of(e.probe), state_of(e.needle));
}

CaseExercise exercise_of_state(const py::tuple& t) {
    const auto opened = value_of(open_case(path_from(t[0], "path")));
    CaseExercise exercise{value_of(exercise_named(*opened, py::cast<std::string>(t[1]))),
                          opened->absolute};
    exercise.probe = probe_of_state(t[2]);
    exercise.needle = needle_of_state(t[3]);
    return exercise;
}

}  // namespace

void check_of(const CaseExercise& exercise, const OpenedCase& opened) {
    if (!is_of(exercise, opened))
        raise_value_error("exercise: " + exercise.name + " is of the case " + exercise.case_path +
                          ", not of " + opened.absolute + "; give one of this case, or its name");
}

void bind_exercise(py::module_& module) {
    bind_probe(module);
    bind_needle(module);
    bind_target(module);
    py::class_<CaseExercise>(module, "Exercise",
                             "Probe, needle, targets and motion of one exercise. Probe and needle "
                             "may be changed before a Renderer is made.")
        .def_readonly("name", &Exercise::name, "By which Case.exercise() finds it.")
        .def_readonly("title", &Exercise::title, "As the window shows it.")
        .def_readonly("description", &Exercise::description, "What the trainee is asked to do.")
        .def_readonly("kind", &Exercise::kind, "As its file has it, as 'scan' (docs/format.md).")
        .def_readonly("difficulty", &Exercise::difficulty, "1 (easy) to 5 (hard).")
        .def_readonly("model", &Exercise::model, "Image model: 'physical' or 'paper'.")
        .def_readonly("effects", &Exercise::effects, "As on sonoplay's command line.")
        .def_property(
            "probe", [](CaseExercise& e) -> Probe& { return e.probe; },
            [](CaseExercise& e, const Probe& p) { e.probe = p; },
            "Its Probe, which may be changed.")
        .def_property(
            "needle", [](CaseExercise& e) -> NeedleModel& { return e.needle; },
            [](CaseExercise& e, const NeedleModel& n) { e.needle = n; },
            "Its Needle, which may be changed.")
        .def_readonly("targets", &Exercise::targets, "List of Target.")
        .def_readonly("no_go", &Exercise::no_go, "Labels that the needle must not touch.")
        .def_property_readonly(
            "start_pose", [](const CaseExercise& e) { return array_of(start_pose(e)); },
            "mannequin_from_probe where the exercise begins, before the probe is set down on the "
            "skin; shape (4, 4), mm.")
        .def_property_readonly(
            "breathing",
            [](const CaseExercise& e) {
                return py::dict("amplitude_mm"_a = e.breathing.amplitude_mm,
                                "period_s"_a = e.breathing.period_s);
            },
            "{'amplitude_mm', 'period_s'}; amplitude 0: none.")
        .def(
            "sweep_poses",
            [](const CaseExercise& e, const std::string& name) {
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
        .def_property_readonly(
            "sweeps",
            [](const CaseExercise& e) {
                py::list names;
                for (const Sweep& sweep : e.sweeps) names.append(sweep.name);
                return names;
            },
            "Names of its scripted sweeps; see sweep_poses().")
        .def(py::pickle(&exercise_state, &exercise_of_state))
        .def("__repr__",
             [](const CaseExercise& e) { return "<sonocase.Exercise " + e.name + ">"; });
}

}  // namespace sonocase::python
