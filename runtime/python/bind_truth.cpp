// SPDX-License-Identifier: Apache-2.0

#include <cmath>
#include <string>

#include "bind_truth.h"
#include "bindings.h"

namespace sonocase::python {
namespace {

template <class T>
std::span<T> plane_of(const NewArray<T>& array, std::size_t n, std::size_t area) {
    if (array.data == nullptr) return {};
    return {array.data + n * area, area};
}

py::list organs_of(const runtime::FrameTruth& truth, const std::vector<Label>& labels) {
    py::list organs;
    for (std::size_t i = 1; i < labels.size(); ++i) {
        if (truth.pixels_of_label[i] == 0) continue;
        organs.append(
            py::dict("index"_a = i, "name"_a = labels[i].name,
                     "area_mm2"_a = truth.pixels_of_label[i] * truth.mm2_per_px,
                     "shadowed_mm2"_a = truth.shadowed_pixels_of_label[i] * truth.mm2_per_px));
    }
    return organs;
}

py::list lesions_of(const runtime::FrameTruth& truth, const Exercise& exercise) {
    py::list lesions;
    const std::vector<Target> shown = shown_lesions(exercise);
    for (std::size_t i = 0; i < shown.size(); ++i) {
        if (truth.pixels_of_lesion[i] == 0) continue;
        lesions.append(py::dict("index"_a = i + 1, "name"_a = shown[i].name,
                                "kind"_a = lesion_kind_name(shown[i]),
                                "area_mm2"_a = truth.pixels_of_lesion[i] * truth.mm2_per_px));
    }
    return lesions;
}

py::list targets_of(const runtime::FrameTruth& truth, const Exercise& exercise) {
    py::list targets;
    for (std::size_t i = 0; i < truth.targets.size(); ++i) {
        const runtime::TargetTruth& target = truth.targets[i];
        targets.append(
            py::dict("name"_a = exercise.targets[i].name, "centre_mm"_a = array_of(target.centre),
                     "radius_mm"_a = exercise.targets[i].radius_mm, "plane_mm"_a = target.plane_mm,
                     "in_image"_a = target.in_image, "tip_mm"_a = target.tip_mm));
    }
    return targets;
}

}  // namespace

TruthArrays TruthArrays::make(const std::vector<std::string>& names,
                              py::ssize_t count,
                              py::ssize_t height,
                              py::ssize_t width) {
    TruthArrays arrays;
    Shape shape{height, width};
    if (count >= 0) shape.insert(shape.begin(), count);
    for (const std::string& name : names) {
        if (name == "labels") {
            arrays.labels = new_array<std::uint8_t>(shape);
        } else if (name == "needle") {
            arrays.needle = new_array<std::uint8_t>(shape);
        } else if (name == "shadowed") {
            arrays.shadowed = new_array<std::uint8_t>(shape);
        } else if (name == "skin_depth_mm") {
            arrays.skin_depth_mm = new_array<float>(shape);
        } else if (name == "lesions") {
            arrays.lesions = new_array<std::uint8_t>(shape);
        } else if (name == "rest_mm") {
            Shape places = shape;
            places.push_back(3);
            arrays.rest_mm = new_array<float>(places);
        } else {
            throw py::value_error(
                "truth: no plane " + name +
                "; give labels, needle, shadowed, skin_depth_mm, lesions or rest_mm");
        }
    }
    if (arrays.shadowed.data != nullptr && arrays.labels.data == nullptr)
        throw py::value_error("truth: shadowed is found from the labels; ask for both");
    return arrays;
}

runtime::TruthPlanes TruthArrays::planes(std::size_t n, std::size_t area) const {
    const std::span<float> rest = plane_of<float>(rest_mm, n, 3 * area);
    return {.labels = plane_of<std::uint8_t>(labels, n, area),
            .needle = plane_of<std::uint8_t>(needle, n, area),
            .shadowed = plane_of<std::uint8_t>(shadowed, n, area),
            .skin_depth_mm = plane_of<float>(skin_depth_mm, n, area),
            .lesions = plane_of<std::uint8_t>(lesions, n, area),
            .rest_mm = {reinterpret_cast<std::array<float, 3>*>(rest.data()), rest.size() / 3}};
}

py::dict press_of(const runtime::PressReport& press) {
    return py::dict("pressed"_a = press.pressed, "force_n"_a = press.force_n,
                    "pressure_kpa"_a = press.pressure_kpa, "deepest_mm"_a = press.deepest_mm,
                    "excess_mm"_a = press.excess_mm,
                    "vein_open"_a = press.vein_open >= 0 ? py::object(py::float_(press.vein_open))
                                                         : py::object(py::none()));
}

py::dict facts_of(const runtime::FrameTruth& truth,
                  const std::vector<Label>& labels,
                  const Exercise& exercise) {
    py::dict facts(
        "time_s"_a = truth.time_s, "mannequin_from_probe"_a = array_of(truth.mannequin_from_probe),
        "contact"_a = truth.beams > 0 ? static_cast<double>(truth.beams_touching) / truth.beams : 0,
        "visible"_a = organs_of(truth, labels), "lesions"_a = lesions_of(truth, exercise),
        "targets"_a = targets_of(truth, exercise), "press"_a = press_of(truth.press),
        "tip"_a = py::none());
    if (truth.has_needle) {
        facts["tip"] =
            py::dict("probe_mm"_a = array_of(truth.tip_probe), "in_plane"_a = truth.tip_in_plane,
                     "visible"_a = truth.tip_visible, "label"_a = truth.tip_label,
                     "name"_a = labels[truth.tip_label].name,
                     "shaft_in_image_mm"_a = truth.needle_in_image_mm,
                     "shaft_visible_mm"_a = truth.needle_visible_mm,
                     "dent_mm"_a = py::make_tuple(truth.needle.tent_mm, truth.needle.drag_mm));
    }
    return facts;
}

// The arrays and facts of one frame, or of a batch.
void bind_truth(py::module_& module) {
    py::class_<TruthArrays>(module, "TruthPlanes",
                            "What each pixel shows: arrays (height, width), or (n, height, width) "
                            "of a batch; None where not asked for.")
        .def_property_readonly(
            "labels", [](const TruthArrays& t) { return t.labels.object; },
            "uint8, index into Case.labels; 0: outside the body or the scanned area.")
        .def_property_readonly(
            "needle", [](const TruthArrays& t) { return t.needle.object; },
            "uint8; 0: none, 1: shaft, 2: tip.")
        .def_property_readonly(
            "shadowed", [](const TruthArrays& t) { return t.shadowed.object; },
            "uint8; 1: the beam met bone or gas before it came here.")
        .def_property_readonly(
            "skin_depth_mm", [](const TruthArrays& t) { return t.skin_depth_mm.object; },
            "float32, along the beam from the skin; NaN outside the scanned area.")
        .def_property_readonly(
            "lesions", [](const TruthArrays& t) { return t.lesions.object; },
            "uint8; `index` of the lesion in facts[\"lesions\"] that the pixel shows; 0: none.")
        .def_property_readonly(
            "rest_mm", [](const TruthArrays& t) { return t.rest_mm.object; },
            "float32 (height, width, 3): where the tissue that the pixel shows lies in the bundle, "
            "before contact, press, needle and breath moved it; NaN outside the scanned area and "
            "where a beam is in air.")
        .def(py::pickle(
            [](const TruthArrays& t) {
                return py::make_tuple(t.labels.object, t.needle.object, t.shadowed.object,
                                      t.skin_depth_mm.object, t.lesions.object, t.rest_mm.object);
            },
            [](const py::tuple& t) {
                TruthArrays arrays;
                arrays.labels.object = t[0];
                arrays.needle.object = t[1];
                arrays.shadowed.object = t[2];
                arrays.skin_depth_mm.object = t[3];
                arrays.lesions.object = t[4];
                arrays.rest_mm.object = t[5];
                return arrays;
            }));
}

}  // namespace sonocase::python
