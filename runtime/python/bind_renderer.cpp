// SPDX-License-Identifier: Apache-2.0

// What Python's arguments say of a frame, checked: each error names the argument and what it takes.

#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <tuple>
#include <vector>

#include <pybind11/stl.h>

#include "array_values.h"
#include "bind_truth.h"
#include "bindings.h"
#include "doppler_values.h"
#include "formats/files/load_save.h"
#include "frame_renderer.h"

namespace sonocase::python {

void set_time(double time_s, runtime::FrameInput& input);
std::int64_t frame_from(py::handle frame, const char* name);
void set_console(py::handle gain_db, py::handle dynamic_range_db, runtime::FrameInput& input);
void set_press(double press_mm, runtime::FrameInput& input);

// One task per pose. poses: (n, 4, 4); needles, times_s: None, or one per pose.
std::vector<FrameTask> batch_tasks(py::handle poses,
                                   py::handle needles,
                                   py::handle times_s,
                                   std::int64_t first_frame);
// press_mm: one number, or one per frame.
void press_batch(const py::object& press_mm, std::vector<FrameTask>& tasks);
// None, or a pair or None per frame.
void dent_batch(py::handle dents, std::vector<FrameTask>& tasks);

void set_console(py::handle gain_db, py::handle dynamic_range_db, runtime::FrameInput& input) {
    input.settings.gain_db = number_within(gain_db, "gain_db", runtime::kGainDbLimits);
    input.settings.dynamic_range_db =
        number_within(dynamic_range_db, "dynamic_range_db", runtime::kDynamicRangeDbLimits);
}

void set_time(double time_s, runtime::FrameInput& input) {
    if (!std::isfinite(time_s)) throw py::value_error("time_s: not finite");
    input.time_s = time_s;
}

std::int64_t frame_from(py::handle frame, const char* name) {
    return whole_within(frame, name, 0, std::numeric_limits<std::uint32_t>::max());
}

void set_press(double press_mm, runtime::FrameInput& input) {
    constexpr runtime::Limits<double> kLimits = runtime::kPressMmLimits;
    input.settings.press_mm = in_range(press_mm, "press_mm", kLimits.min, kLimits.max);
}

void press_batch(const py::object& press_mm, std::vector<FrameTask>& tasks) {
    const Numbers given = numbers_from(press_mm, "press_mm");
    const bool one = given.shape.empty();
    if (!one && given.shape != Shape{static_cast<py::ssize_t>(tasks.size())})
        throw py::value_error("press_mm: give one number, or one per pose");
    for (std::size_t n = 0; n < tasks.size(); ++n)
        set_press(given.values[one ? 0 : n], tasks[n].input);
}

void dent_batch(py::handle dents, std::vector<FrameTask>& tasks) {
    if (dents.is_none()) return;
    if (!PySequence_Check(dents.ptr()) || py::len(dents) != tasks.size())
        throw py::value_error("dents: give one per pose; None for no dent");
    const auto dent_of = py::reinterpret_borrow<py::sequence>(dents);
    for (std::size_t n = 0; n < tasks.size(); ++n) {
        const std::string name = "dents[" + std::to_string(n) + "]";
        set_dent(py::object(dent_of[n]), tasks[n].input, name.c_str());
    }
}

std::vector<FrameTask> batch_tasks(py::handle poses,
                                   py::handle needles,
                                   py::handle times_s,
                                   std::int64_t first_frame) {
    const Numbers rows = numbers_from(poses, "poses");
    if (rows.shape.size() != 3 || rows.shape[1] != 4 || rows.shape[2] != 4)
        throw py::value_error("poses: give an array of shape (n, 4, 4), rigid motions in mm");
    std::vector<FrameTask> tasks(rows.shape[0]);
    std::optional<Numbers> times;
    if (!times_s.is_none()) {
        times = numbers_from(times_s, "times_s");
        if (times->shape != Shape{rows.shape[0]})
            throw py::value_error("times_s: give one number per pose");
    }
    py::sequence needle_of;
    if (!needles.is_none()) {
        needle_of = py::reinterpret_borrow<py::sequence>(needles);
        if (!PySequence_Check(needles.ptr()) || py::len(needle_of) != tasks.size())
            throw py::value_error("needles: give one per pose; None for no needle");
    }
    for (std::size_t n = 0; n < tasks.size(); ++n) {
        runtime::FrameInput& input = tasks[n].input;
        input.mannequin_from_probe =
            rigid_from(rows.values.data() + 16 * n, "poses[" + std::to_string(n) + "]");
        if (!needles.is_none()) set_needle(py::object(needle_of[n]), input);
        set_time(times ? times->values[n] : 0, input);
        const std::int64_t frame = first_frame + static_cast<std::int64_t>(n);
        (void)in_range(static_cast<double>(frame), "first_frame and what follows", 0,
                       std::numeric_limits<std::uint32_t>::max());
        input.frame = static_cast<std::uint32_t>(frame);
    }
    return tasks;
}

namespace {

// One at a time: raises where another thread is inside.
class Turn {
  public:
    explicit Turn(std::atomic<bool>& busy) : busy_(busy) {
        if (busy_.exchange(true))
            throw std::runtime_error(
                "renderer: in use by another thread; give each thread a Renderer of its own, or "
                "use render_batch(threads=...)");
    }
    ~Turn() { busy_ = false; }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

  private:
    std::atomic<bool>& busy_;
};

// Where pictures go: the caller's array, or a new one.
struct Pixels {
    Pixels(const py::object& out, const Shape& shape) {
        if (out.is_none()) {
            const auto made = new_array<std::uint8_t>(shape);
            object = made.object;
            data = made.data;
        } else {
            view = writeable_bytes(out, shape);
            object = out;
            data = static_cast<std::uint8_t*>(view->data());
        }
    }
    std::optional<ArrayView> view;  // holds the caller's memory in place
    py::object object;
    std::uint8_t* data;
};

// How a renderer was asked for, and how it is made again from a pickle.
struct Request {
    CaseExercise exercise;
    std::string model, machine;  // "": the exercise's; the probe's
    std::vector<std::string> effects;
    int width_px = 512, height_px = 512;
    std::uint32_t seed = 1;
    std::string kind = "fast";
    int scanlines = 0, samples = 0, looks = 0;  // 0: the model's or the machine's
};

class PyRenderer {
  public:
    PyRenderer(std::unique_ptr<FrameRenderer> renderer, Request request)
        : renderer_(std::move(renderer)), request_(std::move(request)) {}

    py::ssize_t width() const { return request_.width_px; }
    py::ssize_t height() const { return request_.height_px; }
    const Request& request() const { return request_; }
    bool contact() const { return !shown_ || shown_->contact; }
    py::dict press() const { return press_of(shown_ ? shown_->press : runtime::PressReport{}); }

    // Raises once the renderer or its case is closed.
    FrameRenderer& inner() const {
        if (renderer_ == nullptr)
            throw OutsideError(Error{"the renderer is closed", "", "make another one"});
        check(usable(renderer_->opened()));
        return *renderer_;
    }
    bool closed() const { return renderer_ == nullptr; }
    void close() {
        const Turn turn(busy_);
        renderer_.reset();
    }

    py::object render(py::handle pose,
                      py::handle needle,
                      py::handle time_s,
                      py::handle frame,
                      py::handle gain_db,
                      py::handle dynamic_range_db,
                      py::handle press_mm,
                      py::handle dent,
                      const py::object& out,
                      py::handle mode,
                      py::handle doppler) {
        FrameTask task;
        task.input.mannequin_from_probe = rigid_from(pose, "pose");
        set_needle(needle, task.input);
        set_time(number_from(time_s, "time_s"), task.input);
        task.input.frame = static_cast<std::uint32_t>(frame_from(frame, "frame"));
        set_console(gain_db, dynamic_range_db, task.input);
        set_press(number_from(press_mm, "press_mm"), task.input);
        set_dent(dent, task.input, "dent");
        if (!py::isinstance<py::dict>(doppler))
            throw py::type_error("doppler: give a dict of settings by name");
        const auto given = py::reinterpret_borrow<py::dict>(doppler);
        runtime::DopplerSettings asked;
        asked.mode = doppler_mode(text_from(mode, "mode"));
        apply_doppler(given, asked);
        if (asked.mode != runtime::DopplerMode::off) {
            task.input.settings.doppler = asked;
            return render_doppler(task, given, out);
        }
        const Pixels picture(out, {height(), width()});
        task.pixels = {picture.data, static_cast<std::size_t>(width() * height())};
        const Turn turn(busy_);
        FrameRenderer& renderer = inner();
        refuse_metres(task.input, "pose", "needle");
        {
            const py::gil_scoped_release free_to_run;
            renderer.render(task);
        }
        check(usable(renderer.opened()));
        keep(task);
        return picture.object;
    }

    // Box, gate and cursor on the widest vessel of a plane.
    py::dict aimed(py::handle pose) {
        const Turn turn(busy_);
        FrameRenderer& renderer = inner();
        check(renderer.prepare_doppler());
        return aim_of(renderer.aimed(rigid_from(pose, "pose"), {}, true));
    }

    py::dict doppler() {
        const Turn turn(busy_);
        const FrameRenderer& renderer = inner();
        const runtime::DopplerMode mode =
            shown_ ? shown_->input.settings.doppler.mode : runtime::DopplerMode::off;
        if (mode == runtime::DopplerMode::off)
            throw std::runtime_error("renderer: the last frame was of no Doppler mode");
        return measures_of(renderer.doppler(), mode, renderer.opened().bundle->labels);
    }

    // The last frame's: (planes, facts).
    py::tuple truth(py::handle names) {
        FrameTask task;
        task.input = last();
        const TruthArrays arrays =
            TruthArrays::make(names_from(names, "planes"), -1, height(), width());
        task.planes = arrays.planes(0, width() * height());
        const Turn turn(busy_);
        FrameRenderer& renderer = inner();
        check(renderer.prepare_truth());
        {
            const py::gil_scoped_release free_to_run;
            renderer.describe(task);
        }
        check(usable(renderer.opened()));
        return py::make_tuple(
            arrays, facts_of(task.truth, renderer.opened().bundle->labels, renderer.exercise()));
    }

    py::object render_batch(py::handle poses,
                            py::handle needles,
                            py::handle times_s,
                            py::handle first_frame,
                            py::handle gain_db,
                            py::handle dynamic_range_db,
                            const py::object& press_mm,
                            py::handle dents,
                            const py::object& out,
                            py::handle thread_count,
                            py::handle truth_planes) {
        const int threads = static_cast<int>(whole_within(
            thread_count, "threads", runtime::kThreadLimits.min, runtime::kThreadLimits.max));
        std::optional<std::vector<std::string>> truth;
        if (!truth_planes.is_none()) truth = names_from(truth_planes, "truth");
        std::vector<FrameTask> tasks =
            batch_tasks(poses, needles, times_s, frame_from(first_frame, "first_frame"));
        for (FrameTask& task : tasks) {
            set_console(gain_db, dynamic_range_db, task.input);
        }
        press_batch(press_mm, tasks);
        dent_batch(dents, tasks);
        const auto count = static_cast<py::ssize_t>(tasks.size());
        const Pixels pictures(out, {count, height(), width()});
        const std::size_t area = width() * height();
        TruthArrays arrays;
        if (truth) arrays = TruthArrays::make(*truth, count, height(), width());
        for (std::size_t n = 0; n < tasks.size(); ++n) {
            tasks[n].pixels = {pictures.data + n * area, area};
            tasks[n].wants_truth = truth.has_value();
            tasks[n].planes = arrays.planes(n, area);
        }
        const Turn turn(busy_);
        FrameRenderer& renderer = inner();
        for (std::size_t n = 0; n < tasks.size(); ++n)
            refuse_metres(tasks[n].input, "poses[" + std::to_string(n) + "]",
                          "needles[" + std::to_string(n) + "]");
        std::optional<Result<bool>> whole;
        {
            const py::gil_scoped_release free_to_run;
            whole = renderer.render_all(tasks, threads, [] {
                const py::gil_scoped_acquire hold;
                return PyErr_CheckSignals() != 0;
            });
        }
        if (!value_of(*whole)) throw py::error_already_set();  // Ctrl-C, as Python's own exception
        check(usable(renderer.opened()));
        if (!tasks.empty()) keep(tasks.back());
        if (!truth) return pictures.object;
        py::list facts;
        for (const FrameTask& task : tasks)
            facts.append(
                facts_of(task.truth, renderer.opened().bundle->labels, renderer.exercise()));
        return py::make_tuple(pictures.object, arrays, facts);
    }

    const runtime::FrameInput& last() const {
        if (!shown_) throw std::runtime_error("renderer: no frame has been rendered yet");
        return shown_->input;
    }

    // Of the last frame: name and why.
    py::dict skipped_effects() {
        const Turn turn(busy_);
        py::dict skipped;
        for (const runtime::EffectCost& cost : inner().last_engine().renderer().costs())
            if (!cost.ran) skipped[cost.name] = cost.why;
        return skipped;
    }

  private:
    // A pose in metres puts the face within 2 mm of the frame's origin, where a face in millimetres
    // lies only if the skin does. A needle's tip may well lie there: in metres it is one that a
    // thousand times as much brings nearer to the probe.
    void refuse_metres(const runtime::FrameInput& input,
                       const std::string& pose,
                       const std::string& needle) const {
        const Vector3 face = input.mannequin_from_probe.translation;
        const auto near_origin = [](Vector3 v) { return norm(v) > 0 && norm(v) < 2; };
        if (near_origin(face)) {
            const runtime::Skin skin(*inner().opened().bundle);
            if (!(norm(skin.normal(Point3{} + face, kSkinRadiusMm)) > 0))
                throw py::value_error(pose +
                                      ": a translation of less than 2 mm, far from the skin; "
                                      "give it in millimetres, not in metres");
        }
        const Vector3 tip = input.needle.tip - Point3{};
        if (input.has_needle && near_origin(tip) && norm(1000 * tip - face) < norm(tip - face))
            throw py::value_error(needle +
                                  ": a tip less than 2 mm from the frame's origin, far from the "
                                  "probe; give it in millimetres, not in metres");
    }

    // The last frame that was drawn, or the last of a batch: what is said of it belongs together.
    struct Shown {
        runtime::FrameInput input;
        bool contact;
        runtime::PressReport press;
    };
    void keep(const FrameTask& task) {
        shown_ = {task.input, task.status != runtime::FrameStatus::no_contact, task.press};
    }

    py::object render_doppler(FrameTask& task, const py::dict& given, const py::object& out) {
        runtime::DopplerSettings& settings = task.input.settings.doppler;
        const Turn turn(busy_);
        FrameRenderer& renderer = inner();
        refuse_metres(task.input, "pose", "needle");
        check(renderer.prepare_doppler());
        take_aim(
            given,
            renderer.aimed(task.input.mannequin_from_probe, settings, !given.contains("steer_deg")),
            settings);
        if (shown_) runtime::add_probe_motion(shown_->input, task.input);
        const py::ssize_t rows = runtime::doppler_rows(settings.mode, static_cast<int>(height()));
        const Pixels picture(out, {rows, width(), 3});
        std::vector<std::uint8_t> grey(width() * height());
        task.pixels = grey;
        const std::span<std::uint8_t> rgb(picture.data,
                                          static_cast<std::size_t>(3 * width() * rows));
        {
            const py::gil_scoped_release free_to_run;
            renderer.render(task);
            renderer.show_doppler(task, rgb);
        }
        check(usable(renderer.opened()));
        keep(task);
        return picture.object;
    }

    std::unique_ptr<FrameRenderer> renderer_;  // null: closed
    Request request_;
    std::atomic<bool> busy_{false};
    std::optional<Shown> shown_;
};

std::unique_ptr<PyRenderer> renderer_of(const std::shared_ptr<OpenedCase>& opened,
                                        const Request& request) {
    check(usable(*opened));
    runtime::RenderOptions options;
    const std::string model = request.model.empty() ? request.exercise.model : request.model;
    if (model != "paper" && model != "physical")
        throw py::value_error("model: no model " + model + "; give physical or paper");
    options.model = model == "paper" ? runtime::ImageModel::paper : runtime::ImageModel::physical;
    if (request.kind != "fast" && request.kind != "reference")
        throw py::value_error("renderer: no renderer " + request.kind + "; give fast or reference");
    options.kind =
        request.kind == "fast" ? runtime::RendererKind::fast : runtime::RendererKind::reference;
    options.width_px = request.width_px;
    options.height_px = request.height_px;
    options.seed = request.seed;
    options.effects = request.effects;
    options.scanlines = request.scanlines;
    options.samples = request.samples;
    options.looks = request.looks;
    const py::gil_scoped_release free_to_run;
    if (!request.machine.empty()) options.machine = value_of(load_machine(request.machine));
    return std::make_unique<PyRenderer>(
        value_of(FrameRenderer::create(opened, request.exercise, options)), request);
}

// Width and height.
std::pair<int, int> size_from(py::handle size) {
    if (!py::isinstance<py::sequence>(size) || py::isinstance<py::str>(size) || py::len(size) != 2)
        throw py::type_error("size: give (width, height), two whole numbers of pixels");
    constexpr std::int64_t kMax = std::numeric_limits<int>::max();
    const auto two = py::reinterpret_borrow<py::sequence>(size);
    return {static_cast<int>(whole_within(py::object(two[0]), "size", -kMax, kMax)),
            static_cast<int>(whole_within(py::object(two[1]), "size", -kMax, kMax))};
}

// 0: the model's own.
int count_from(py::handle value, const char* name, runtime::Limits<int> limits) {
    constexpr std::int64_t kMax = std::numeric_limits<std::int64_t>::max();
    const std::int64_t count = whole_within(value, name, -kMax, kMax);
    if (count != 0 && (count < limits.min || count > limits.max))
        throw py::value_error(std::string(name) + ": " + std::to_string(count) +
                              " is out of range: give " + std::to_string(limits.min) + " to " +
                              std::to_string(limits.max) + ", or 0 for the model's own");
    return static_cast<int>(count);
}

// None: nothing is put in place of `part`.
template <class Part>
void replace_part(const py::object& given, const char* expected, Part& part) {
    if (given.is_none()) return;
    if (!py::isinstance<Part>(given)) throw py::type_error(expected);
    part = py::cast<Part>(given);
}

// What the arguments ask for.
std::unique_ptr<PyRenderer> make_renderer(const std::shared_ptr<OpenedCase>& opened,
                                          const py::object& exercise,
                                          const py::object& probe,
                                          const py::object& needle,
                                          py::handle model,
                                          py::handle machine,
                                          const py::object& effects,
                                          py::handle size,
                                          py::handle seed,
                                          py::handle kind,
                                          py::handle scanlines,
                                          py::handle samples,
                                          py::handle looks) {
    check(usable(*opened));
    Request request;
    if (py::isinstance<CaseExercise>(exercise)) {
        request.exercise = py::cast<CaseExercise>(exercise);
        check_of(request.exercise, *opened);
    } else if (exercise.is_none() || py::isinstance<py::str>(exercise)) {
        const auto name = exercise.is_none() ? std::string() : text_from(exercise, "exercise");
        request.exercise = {value_of(exercise_named(*opened, name)), opened->absolute};
    } else {
        throw py::type_error("exercise: give a name or an Exercise");
    }
    replace_part(probe, "probe: give a sonocase.Probe", request.exercise.probe);
    replace_part(needle, "needle: give a sonocase.Needle", request.exercise.needle);
    request.model = text_from(model, "model");
    request.machine = path_from(machine, "machine");
    if (request.machine.find('/') != std::string::npos || request.machine.ends_with(".toml"))
        request.machine = absolute_path(request.machine);  // a file, as load_machine() sees it
    if (effects.is_none()) {
        request.effects = request.exercise.effects;
    } else if (py::isinstance<py::str>(effects)) {
        request.effects = {text_from(effects, "effects")};
    } else {
        request.effects = names_from(effects, "effects");
    }
    std::tie(request.width_px, request.height_px) = size_from(size);
    request.seed = static_cast<std::uint32_t>(frame_from(seed, "seed"));
    request.kind = text_from(kind, "renderer");
    request.scanlines = count_from(scanlines, "scanlines", runtime::kScanlineLimits);
    request.samples = count_from(samples, "samples", runtime::kSampleLimits);
    request.looks = count_from(looks, "looks", runtime::kLookLimits);
    return renderer_of(opened, request);
}

// As pickle keeps a renderer, for the workers of loaders: what it was asked for, no frames.
py::tuple renderer_state(const PyRenderer& renderer) {
    const Request& r = renderer.request();
    const OpenedCase& opened = renderer.inner().opened();
    return py::make_tuple(path_text(opened.absolute), r.exercise, r.model, path_text(r.machine),
                          r.effects, r.width_px, r.height_px, r.seed, r.kind, r.scanlines,
                          r.samples, r.looks);
}

std::unique_ptr<PyRenderer> renderer_of_state(const py::tuple& t) {
    const auto opened = value_of(open_case(path_from(t[0], "path")));
    Request r;
    r.exercise = py::cast<CaseExercise>(t[1]);
    r.model = py::cast<std::string>(t[2]);
    r.machine = path_from(t[3], "machine");
    r.effects = py::cast<std::vector<std::string>>(t[4]);
    r.width_px = py::cast<int>(t[5]);
    r.height_px = py::cast<int>(t[6]);
    r.seed = py::cast<std::uint32_t>(t[7]);
    r.kind = py::cast<std::string>(t[8]);
    r.scanlines = py::cast<int>(t[9]);
    r.samples = py::cast<int>(t[10]);
    r.looks = py::cast<int>(t[11]);
    return renderer_of(opened, r);
}

}  // namespace

void bind_renderer(py::module_& module) {
    // A pointer to a member without arguments takes None for its object: lambdas take none.
    py::class_<PyRenderer>(module, "Renderer", "Renders frames of a case, as sonoplay does.")
        .def(
            py::init(&make_renderer), py::arg("case").none(false), "exercise"_a = py::none(),
            "probe"_a = py::none(), "needle"_a = py::none(), py::kw_only(), "model"_a = "",
            "machine"_a = "", "effects"_a = py::none(), "size"_a = py::make_tuple(512, 512),
            "seed"_a = 1, "renderer"_a = "fast", "scanlines"_a = 0, "samples"_a = 0, "looks"_a = 0,
            "exercise: a name or an Exercise, the case's first by default; probe, needle: instead "
            "of the exercise's; model, machine, effects: as on sonoplay's command line, by default "
            "the exercise's; size: (width, height) in pixels; seed: of the noise; scanlines, "
            "samples (of each), looks (speckle fields that are averaged): 0 for the model's own, "
            "or as "
            "on sonoplay's command line.")
        .def(
            "close", [](PyRenderer& r) { return r.close(); },
            "Frees its memory: it raises from then on. Its case stays open.")
        .def_property_readonly(
            "closed", [](const PyRenderer& r) { return r.closed(); },
            "Whether close() has been called.")
        .def("__enter__", [](const py::object& self) { return self; })
        .def("__exit__", [](PyRenderer& r, const py::args&) { r.close(); })
        .def(py::pickle(&renderer_state, &renderer_of_state))
        .def("render", &PyRenderer::render, "pose"_a, "needle"_a = py::none(), "time_s"_a = 0.0,
             py::kw_only(), "frame"_a = 0, "gain_db"_a = 0.0, "dynamic_range_db"_a = 60.0,
             "press_mm"_a = 0.0, "dent"_a = py::none(), "out"_a = py::none(), "mode"_a = "b",
             "doppler"_a = py::dict(),
             "One frame: uint8 array (height, width). pose: mannequin_from_probe, 4 x 4, mm. "
             "needle: None, mannequin_from_needle (4 x 4; tip at the origin, z from hub to tip, x "
             "to "
             "the bevel's side), "
             "or (tip, direction). time_s: drives breathing and pulse. frame: seeds the noise; "
             "sonoplay counts 0, 1, 2, ... gain_db, dynamic_range_db (20 to 120, which model paper "
             "lacks): knobs of the console. press_mm: how much deeper than its pose the probe is "
             "pressed, 0 to 40. dent: (tent_mm, drag_mm), by which the needle pushes the layer "
             "before its tip and drags tissue along its shaft; a player's needle has them from its "
             "past, and its truth says them (`dent_mm`). out: written to instead of a new array. "
             "mode: b, or colour, power, pw (spectral), m (M-mode): then an array (rows, width, 3) "
             "of colours, with the strip of pw and m below the picture. doppler: settings of the "
             "console by name; where box or gate are not given, they lie on the widest vessel that "
             "the plane cuts. A frame of mode b is of its arguments alone. Of pw and m the strip "
             "goes on from the frames before, and of colour and power the probe's motion since "
             "the last frame shows: a new Renderer has none before.")
        .def("aimed", &PyRenderer::aimed, "pose"_a,
             "Box, gate and angle cursor on the widest vessel that a plane cuts, as `doppler` of "
             "render() takes them: to keep them from frame to frame.")
        .def_property_readonly(
            "doppler", [](PyRenderer& r) { return r.doppler(); },
            "Of the last frame's mode: a dict of what was measured in a "
            "spectrum and what was true there, or of a colour box's cells.")
        .def("render_batch", &PyRenderer::render_batch, "poses"_a, "needles"_a = py::none(),
             "times_s"_a = py::none(), py::kw_only(), "first_frame"_a = 0, "gain_db"_a = 0.0,
             "dynamic_range_db"_a = 60.0, "press_mm"_a = 0.0, "dents"_a = py::none(),
             "out"_a = py::none(), "threads"_a = 1, "truth"_a = py::none(),
             "Many frames: uint8 array (n, height, width). poses: (n, 4, 4). needles: a sequence "
             "of what render() takes. Frame i has number first_frame + i. press_mm: one number, or "
             "one per pose; dents: None, or one dent or None per pose. The pixels do not "
             "depend on `threads`. truth: names of planes; then (pictures, TruthPlanes, list of "
             "facts) is returned. Ctrl-C raises KeyboardInterrupt after the frames in hand.")
        .def(
            "truth", &PyRenderer::truth,
            "planes"_a = py::make_tuple("labels", "needle", "shadowed", "skin_depth_mm", "lesions"),
            "What the last frame shows: (TruthPlanes, facts). planes: those of TruthPlanes; "
            "rest_mm only where it is asked for. facts: a dict of `visible` organs and `lesions` "
            "with their areas, `targets` with their distances, the needle's `tip`, `contact`.")
        .def_property_readonly(
            "contact", [](const PyRenderer& r) { return r.contact(); },
            "Whether the probe of the last frame touched the skin.")
        .def_property_readonly(
            "press", [](const PyRenderer& r) { return r.press(); },
            "What the probe of the last frame did to the tissue: a dict of "
            "`pressed`, `force_n`, `pressure_kpa`, `deepest_mm`, `excess_mm` "
            "(by how much bone held it back) and `vein_open`.")
        .def_property_readonly(
            "size", [](const PyRenderer& r) { return py::make_tuple(r.width(), r.height()); },
            "(width, height) of a picture, pixels.")
        .def_property_readonly(
            "exercise", [](const PyRenderer& r) { return r.request().exercise; },
            "The Exercise that it shows, with the probe and the needle that it was given.")
        .def_property_readonly(
            "skipped_effects", [](PyRenderer& r) { return r.skipped_effects(); },
            "Effects that the last frame did without: by name, why.")
        .def_property_readonly(
            "mm_per_px",
            [](const PyRenderer& r) { return r.inner().engine().renderer().layout().mm_per_px; },
            "Side of a pixel.")
        .def_property_readonly(
            "origin_px",
            [](const PyRenderer& r) {
                const auto layout = r.inner().engine().renderer().layout();
                return py::make_tuple(layout.origin_x_px, layout.origin_y_px);
            },
            "Pixel (u, v) of the middle of the probe's face: x_mm = (u - u0) * mm_per_px, "
            "z_mm = (v - v0) * mm_per_px in the frame `probe`.");
    py::dict limits = doppler_limits();
    const auto add = [&](const char* name, auto of) {
        limits[name] = py::make_tuple(of.min, of.max);
    };
    add("scanlines", runtime::kScanlineLimits);
    add("samples", runtime::kSampleLimits);
    add("looks", runtime::kLookLimits);
    add("threads", runtime::kThreadLimits);
    add("gain_db", runtime::kGainDbLimits);
    add("dynamic_range_db", runtime::kDynamicRangeDbLimits);
    add("press_mm", runtime::kPressMmLimits);
    add("dent_mm", runtime::kDentMmLimits);
    module.attr("_LIMITS") = limits;
    module.def("simd_targets", &runtime::simd_targets,
               "Names of the instruction sets of this machine and build, best first.");
}

}  // namespace sonocase::python
