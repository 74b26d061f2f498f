// SPDX-License-Identifier: Apache-2.0

#include <array>

#include <pybind11/stl.h>

#include "array_values.h"
#include "bindings.h"
#include "formats/files/load_save.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_score.h"
#include "frame_renderer.h"

namespace sonocase::python {
namespace {

using Shared = std::shared_ptr<OpenedCase>;

const CaseBundle& bundle_of(const OpenedCase& opened) {
    check(usable(opened));
    return *opened.bundle;
}

py::object label_volume(const OpenedCase& opened) {
    const CaseBundle& bundle = bundle_of(opened);
    const Int3 size = bundle.grid.size;
    const auto volume = new_array<std::uint8_t>({size.z, size.y, size.x});
    {
        const py::gil_scoped_release free_to_run;
        const std::vector<std::uint8_t> dense = dense_from_bricks(bundle.label_bricks);
        std::copy(dense.begin(), dense.end(), volume.data);
    }
    return volume.object;
}

// Where the skin is on the line through `near` along `direction`.
py::object skin_point(const OpenedCase& opened,
                      py::handle near,
                      py::handle direction,
                      double reach_mm) {
    const runtime::Skin skin(bundle_of(opened));
    if (!(reach_mm > 0 && reach_mm <= 1000)) throw py::value_error("reach_mm: give 0 to 1000 mm");
    const auto found = skin.project(point_from(near, "near"),
                                    normalized(vector_from(direction, "direction")), reach_mm);
    return found ? py::object(array_of(*found)) : py::none();
}

py::object skin_normal(const OpenedCase& opened, py::handle point, double radius_mm) {
    const runtime::Skin skin(bundle_of(opened));
    if (!(radius_mm > 0 && radius_mm <= 100)) throw py::value_error("radius_mm: give 0 to 100 mm");
    const Vector3 normal = skin.normal(point_from(point, "point"), radius_mm);
    return norm(normal) > 0 ? py::object(array_of(normal)) : py::none();
}

std::vector<int> labels_at(const OpenedCase& opened, py::handle points) {
    (void)bundle_of(opened);
    const Numbers a = numbers_from(points, "points");
    if (a.shape.size() != 2 || a.shape[1] != 3)
        throw py::value_error("points: give an array of shape (n, 3), mm, frame `mannequin`");
    const CaseAnatomy anatomy(opened.bundle);
    std::vector<int> labels;
    for (const double* p = a.values.data(); p != a.values.data() + a.values.size(); p += 3)
        labels.push_back(anatomy.label({p[0], p[1], p[2]}));
    return labels;
}

std::string score_text(const OpenedCase& opened, py::handle session, const CaseExercise* given) {
    const CaseBundle& bundle = bundle_of(opened);
    const std::string session_path = path_from(session, "session");
    if (given != nullptr) check_of(*given, opened);
    const py::gil_scoped_release free_to_run;
    const Sequence sequence = value_of(load_recording_file(session_path));
    const Session recorded =
        value_of(session_from_sequence(sequence, guess_names(sequence), session_path));
    (void)value_of(check_session(recorded, session_path));
    const Exercise* chosen = given;  // null: that of the recording
    const Exercise exercise =
        chosen != nullptr ? *chosen : value_of(exercise_named(opened, recorded.header.exercise));
    const CaseAnatomy anatomy(opened.bundle, breathing_shown(exercise, recorded.header));
    return score_json(score_session(recorded, exercise, &anatomy, bundle.labels), exercise);
}

// Poses and times of a recorded session.
py::dict read_session(py::handle file) {
    const std::string path = path_from(file, "path");
    const Sequence sequence = value_of(load_recording_file(path));
    const Session session = value_of(session_from_sequence(sequence, guess_names(sequence), path));
    const auto count = static_cast<py::ssize_t>(session.samples.size());
    const auto time_s = new_array<double>({count});
    const auto probe = new_array<double>({count, 4, 4}), needle = new_array<double>({count, 4, 4});
    const auto probe_ok = new_array<bool>({count}), needle_ok = new_array<bool>({count});
    const auto frame = new_array<std::int64_t>({count});
    for (py::ssize_t n = 0; n < count; ++n) {
        const SessionSample& sample = session.samples[n];
        time_s.data[n] = sample.time_s;
        frame.data[n] = sample.frame;
        probe_ok.data[n] = sample.probe_ok;
        needle_ok.data[n] = sample.needle_ok;
        copy_rows(sample.mannequin_from_probe, probe.data + 16 * n);
        copy_rows(sample.mannequin_from_drawn, needle.data + 16 * n);
    }
    return py::dict("exercise"_a = path_text(session.header.exercise),
                    "case"_a = path_text(session.header.case_name),
                    "render"_a = path_text(session.header.render), "time_s"_a = time_s.object,
                    "frame"_a = frame.object, "probe_ok"_a = probe_ok.object,
                    "mannequin_from_probe"_a = probe.object, "needle_ok"_a = needle_ok.object,
                    "mannequin_from_drawn_needle"_a = needle.object);
}

void bind_label(py::module_& module) {
    py::class_<Label>(module, "Label", "One entry of a case's palette.")
        .def_readonly("name", &Label::name, "Unique within the palette, as 'liver'.")
        .def_readonly("tissue", &Label::tissue, "What it is made of, as 'blood'.")
        .def_property_readonly(
            "colour",
            [](const Label& l) { return py::make_tuple(l.colour[0], l.colour[1], l.colour[2]); },
            "sRGB, 0 to 255.")
        .def(py::pickle(
            [](const Label& l) {
                return py::make_tuple(l.name, l.tissue, l.source_value, l.colour);
            },
            [](const py::tuple& t) {
                return Label{py::cast<std::string>(t[0]), py::cast<std::string>(t[1]),
                             py::cast<int>(t[2]), py::cast<std::array<std::uint8_t, 3>>(t[3])};
            }))
        .def("__repr__",
             [](const Label& l) { return "<sonocase.Label " + l.name + " (" + l.tissue + ")>"; });
}

}  // namespace

void bind_case(py::module_& module) {
    bind_label(module);
    py::class_<OpenedCase, Shared>(module, "Case", "A case bundle, opened with Case.open(path).")
        .def_static(
            "open",
            [](py::handle path) {
                const std::string name = path_from(path, "path");
                const py::gil_scoped_release free_to_run;
                return value_of(open_case(name));
            },
            "path"_a, "Opens a bundle; raises sonocase.Error where it is none.")
        .def(
            "close", [](OpenedCase& c) { c.closed = true; },
            "Ends the use of the case: it, and renderers made from it, raise from then on.")
        .def_property_readonly(
            "closed", [](const OpenedCase& c) { return c.closed.load(); },
            "Whether close() has been called.")
        .def("__enter__", [](const py::object& self) { return self; })
        .def("__exit__", [](OpenedCase& c, const py::args&) { c.closed = true; })
        .def_property_readonly(
            "path", [](const OpenedCase& c) { return path_text(c.path); },
            "As it was given to open(), as os.fsdecode has it.")
        .def_property_readonly(
            "warnings",
            [](const OpenedCase& c) {
                py::list warnings;
                for (const std::string& warning : c.warnings) warnings.append(path_text(warning));
                return warnings;
            },
            "Whole sentences, about exercises that could not be read.")
        .def_property_readonly(
            "name", [](const OpenedCase& c) { return bundle_of(c).manifest.case_name; },
            "Of the patient, as the recipe has it.")
        .def_property_readonly(
            "labels", [](const OpenedCase& c) { return bundle_of(c).labels; },
            "List of Label; an index in truth arrays is an index into it, 0 is outside the body.")
        .def_property_readonly(
            "exercises",
            [](const OpenedCase& c) {
                std::vector<CaseExercise> exercises;
                for (const Exercise& e : c.exercises) exercises.push_back({e, c.absolute});
                return exercises;
            },
            "List of Exercise, those of the bundle that could be read.")
        .def(
            "exercise",
            [](const OpenedCase& c, const std::string& name) {
                return CaseExercise{value_of(exercise_named(c, name)), c.absolute};
            },
            "name"_a = "", "By name; the first by default.")
        .def_property_readonly(
            "size",
            [](const OpenedCase& c) {
                const Int3 s = bundle_of(c).grid.size;
                return py::make_tuple(s.x, s.y, s.z);
            },
            "Voxels along x, y, z.")
        .def_property_readonly(
            "voxel_mm", [](const OpenedCase& c) { return bundle_of(c).grid.spacing_mm.x; },
            "Side of a voxel.")
        .def_property_readonly(
            "origin_mm", [](const OpenedCase& c) { return array_of(bundle_of(c).grid.origin_mm); },
            "Centre of voxel (0, 0, 0), frame `mannequin`; shape (3,).")
        .def("label_volume", label_volume,
             "Every voxel's own label: uint8 array of shape (z, y, x), a copy.")
        .def("labels_at", labels_at, "points"_a,
             "Label indices at points (n, 3), mm, frame `mannequin`, at rest, with the surfaces "
             "inside voxels as pictures show them.")
        .def("skin_point", skin_point, "near"_a, "direction"_a, "reach_mm"_a = kSkinReachMm,
             "Skin point (3,) on the line through `near` along `direction`, or None.")
        .def("skin_normal", skin_normal, "point"_a, "radius_mm"_a = kSkinRadiusMm,
             "Outward unit normal (3,) of the skin, averaged over a ball, or None.")
        .def("_score", score_text, "session"_a, "exercise"_a = py::none())
        .def(py::pickle(
            [](const OpenedCase& c) {
                check(usable(c));
                return py::make_tuple(path_text(c.absolute));
            },
            [](const py::tuple& t) { return value_of(open_case(path_from(t[0], "path"))); }))
        .def("__repr__", [](const OpenedCase& c) {
            return path_text("<sonocase.Case " + c.path + (c.closed ? ", closed>" : ">"));
        });
    module.def("read_session", read_session, "path"_a,
               "Poses, times and frame numbers of a recorded session, as a dict of arrays.");
}

}  // namespace sonocase::python
