// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/scan_engine.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "formats/base/portable_math.h"

namespace sonocase::runtime::inline engine {
namespace {

bool is_pose(const SensorReading& s) {
    return s.state == SensorState::ok || s.state == SensorState::poor;
}

// True for a place of exactly 0, 0, 0, which no sensor measures: senders give it, turned or not,
// for a tool that they do not see.
bool at_origin(const SensorReading& s) {
    return is_pose(s) && s.world_from_sensor.translation == Vector3{};
}

// True if a sensor other than `index` has another pose than in the reading before.
bool another_moved(const TrackerReading& reading, const TrackerReading& before, int index) {
    for (int i = 0; i < std::min(reading.sensor_count, kMaxSensors); ++i) {
        if (i != index && is_pose(reading.sensors[i]) &&
            !(reading.sensors[i].world_from_sensor == before.sensors[i].world_from_sensor))
            return true;
    }
    return false;
}

}  // namespace

bool probe_in_contact(const Skin& skin, const Probe& probe, const Rigid& mannequin_from_probe) {
    constexpr double kGelMm = 4;
    const Vector3 beam = mannequin_from_probe.rotation.column(2);
    for (double part : {0.0, -0.25, 0.25, -0.5, 0.5}) {
        Point3 face{part * probe.width_mm, 0, 0};
        if (probe.shape == ProbeShape::curvilinear) {
            const double angle = part * probe.field_of_view_rad;
            face = {probe.radius_mm * sine(angle), 0, probe.radius_mm * (cosine(angle) - 1)};
        }
        const Point3 p = mannequin_from_probe * face;
        for (double depth = 0; depth <= kGelMm; depth += 1) {
            if (skin.inside(p + depth * beam)) return true;
        }
    }
    return false;
}

Result<ScanEngine> ScanEngine::create(CaseView bundle,
                                      const Exercise& exercise,
                                      const EngineOptions& options) {
    Exercise adjusted = exercise;
    if (options.depth_mm > 0) adjusted.probe.depth_mm = options.depth_mm;
    if (options.focus_mm > 0) adjusted.probe.focus_mm = options.focus_mm;
    SONOCASE_TRY(Renderer renderer, Renderer::create(bundle, adjusted, options.render));
    return ScanEngine(bundle, std::move(adjusted), exercise, options, std::move(renderer));
}

void ScanEngine::observe(const TrackerReading& given, bool is_device) {
    TrackerReading reading = given;
    const SensorAssignment places = places_of(reading, assignment_);
    const auto feed = [&](SensorWatch& watch, int index) {
        const bool present = index >= 0 && index < reading.sensor_count && index < kMaxSensors;
        if (!present) return watch.observe({}, reading.time_s, is_device);
        if (is_device && at_origin(reading.sensors[index]))
            reading.sensors[index].state = SensorState::lost;
        watch.observe(reading.sensors[index], reading.time_s, is_device,
                      another_moved(reading, reading_, index));
    };
    feed(probe_watch_, places.probe);
    feed(needle_watch_, places.needle);
    // Each sensor by itself: relative to a reference that moves, a pose that is repeated changes.
    if (places.reference >= 0) feed(reference_watch_, places.reference);
    force_watch_.observe(reading.force_n, reading.time_s);
    if (reading.restarts) begin_procedure();
    for (int i = 0; i < std::min(reading.acts.count, ActList::kMaxActs); ++i)
        (void)act(reading.acts.acts[static_cast<std::size_t>(i)]);
    reading_ = reading;
    ToolPoses tools = tool_poses(reading, calibrations_, assignment_);
    // Readings in `mannequin` of no device (scripts, the mouse, sessions recorded here) were
    // checked where they were made: holding them back a second time would make a replay differ.
    const bool checked = reading.in_mannequin && !is_device;
    const bool moved_away = places.reference >= 0 && reference_watch_.hold();
    const bool hold_probe = !checked && (moved_away || probe_watch_.hold());
    const bool hold_needle = !checked && (moved_away || needle_watch_.hold());
    // A lost probe keeps its last place, so that the picture freezes rather than flickers.
    if (hold_probe) tools.has_probe = tools_.has_probe;
    if (!tools.has_probe || hold_probe) tools.mannequin_from_probe = tools_.mannequin_from_probe;
    if (hold_needle) tools.has_needle = tools_.has_needle;
    if (!tools.has_needle || hold_needle)
        tools.mannequin_from_needle = tools_.mannequin_from_needle;
    tools_ = tools;
}

void ScanEngine::begin_procedure() {
    procedure_.begin();
    procedure_shift_s_ = 0;
    waiting_act_count_ = 0;
}

void ScanEngine::pass_over(std::span<const SessionSample> samples) {
    if (!procedure_.given()) return;
    for (SessionSample sample : samples) {
        if (!sample.has_press && sample.probe_ok) {
            FrameInput input;
            input.mannequin_from_probe = sample.mannequin_from_probe;
            input.time_s = sample.time_s;
            input.settings = last_.input.settings;
            input.change = procedure_.scene();
            renderer_.press_probe(input);
            const PressReport& press = renderer_.press();
            sample.has_press = press.solved;
            sample.press = {press.force_n, press.pressure_kpa, press.vein_open};
        }
        procedure_.update(sample);
    }
    if (reading_.device_time_s >= 0)
        procedure_shift_s_ = reading_.device_time_s - (reading_.time_s - origin_s_);
}

bool ScanEngine::act(const Act& act) {
    if (!procedure_.given()) return true;
    if (waiting_act_count_ == kMaxWaitingActs) return false;
    waiting_acts_[static_cast<std::size_t>(waiting_act_count_++)] = act;
    return true;
}

void add_probe_motion(const FrameInput& before, FrameInput& input) {
    const double seconds = input.time_s - before.time_s;
    if (!(seconds > 1e-4 && seconds < 0.5) || input.frame != before.frame + 1) return;
    const Rigid &was = before.mannequin_from_probe, &is = input.mannequin_from_probe;
    input.probe_mm_s = (is.translation - was.translation) / seconds;
    // Small angles: the axis of R2 R1^T is half of its antisymmetric part.
    const Matrix3 turn = is.rotation * transpose(was.rotation);
    input.probe_rad_s =
        Vector3{turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)} /
        (2 * seconds);
}

FrameStatus ScanEngine::frame(double now_s,
                              const ImageSettings& settings,
                              std::span<std::uint8_t> pixels,
                              bool unseen) {
    FrameRecord record;
    record.unseen = unseen;
    ToolPoses& tools = record.tools;
    tools = tools_;
    const SensorAssignment places = places_of(reading_, assignment_);
    const auto lost = [&](const SensorWatch& watch, int index) {
        // Only a tool whose pose depends on the reference is lost with it.
        const SensorReading* s = sensor_with_pose(reading_, index);
        const bool depends = places.reference >= 0 && s && !s->in_mannequin && !s->in_reference;
        return watch.lost(now_s) || (depends && reference_watch_.lost(now_s));
    };
    if (lost(probe_watch_, places.probe)) tools.has_probe = false;
    if (lost(needle_watch_, places.needle)) tools.has_needle = false;
    tools.probe_age_s = probe_watch_.age_s(now_s);
    tools.needle_age_s = needle_watch_.age_s(now_s);
    record.reading_time_s = reading_.time_s;
    FrameInput& input = record.input;
    input.mannequin_from_probe = tools.mannequin_from_probe;
    input.has_needle = tools.has_needle;
    const double time_s = now_s - origin_s_;
    if (tools.has_needle) {
        record.needle = needle_.update(time_s, tools.mannequin_from_needle);
        const Rigid& needle = record.needle.mannequin_from_drawn;
        input.needle.tip = needle * Point3{0, 0, 0};
        input.needle.direction = needle.rotation.column(2);
        input.needle.bevel = needle.rotation.column(0);
    }
    input.time_s = time_s;
    input.frame = frame_++;
    input.settings = settings;
    if (settings.doppler.mode != DopplerMode::off) add_probe_motion(last_.input, input);
    if (force_watch_.present()) {
        if (force_watch_.fresh())
            sensed_press_mm_ = renderer_.press_mm_for(input.mannequin_from_probe,
                                                      force_watch_.force_n(), sensed_press_mm_);
        force_watch_.taken();
        input.settings.press_mm = sensed_press_mm_;
    }
    if (procedure_.given()) input.change = procedure_.scene();  // what the frame before left
    renderer_.press_probe(input);
    record.press = renderer_.press();
    if (tools.has_needle) {
        record.puncture = puncture_.update(time_s, input.needle.tip, input.needle.direction,
                                           record.needle.depth_mm, *anatomy_, renderer_);
        // Tissue yields to what is inserted.
        if (record.needle.depth_mm > 0) {
            input.needle.tent_mm = record.puncture.tent_mm;
            input.needle.drag_mm = record.puncture.drag_mm;
        }
    }
    if (procedure_.given()) {
        const int taken = std::min(waiting_act_count_, ActList::kMaxActs);
        for (int i = 0; i < taken; ++i) record.acts.add(waiting_acts_[static_cast<std::size_t>(i)]);
        std::copy(waiting_acts_.begin() + taken, waiting_acts_.begin() + waiting_act_count_,
                  waiting_acts_.begin());
        waiting_act_count_ -= taken;
        procedure_.update(time_s + procedure_shift_s_, tools.has_probe, tools.mannequin_from_probe,
                          tools.has_needle, record.needle.mannequin_from_drawn, record.press.solved,
                          {record.press.force_n, record.press.pressure_kpa, record.press.vein_open},
                          record.acts, unseen);
        record.new_steps = procedure_.new_steps();
        record.new_complications = procedure_.new_complications();
        input.change = procedure_.scene();
    }
    const FrameStatus drawn = renderer_.render(input, pixels);
    const FrameStatus status = finish(input, drawn, pixels);
    record.skin_not_fitted =
        status == FrameStatus::rendered &&
        skin_fit_.not_fitted(Point3{} + input.mannequin_from_probe.translation);
    last_ = record;
    return status;
}

void ScanEngine::begin_session(double now_s) {
    origin_s_ = now_s;
    frame_ = 0;
    needle_ = NeedleState(anatomy_.get(), exercise_.needle);
    puncture_.reset();
    procedure_.begin();
    procedure_shift_s_ = 0;
    waiting_act_count_ = 0;
}

void ScanEngine::take_over(const ScanEngine& before) {
    needle_ = before.needle_;
    needle_.set_anatomy(anatomy_.get());
    puncture_ = before.puncture_;
    procedure_ = before.procedure_;
    procedure_shift_s_ = before.procedure_shift_s_;
    waiting_acts_ = before.waiting_acts_;
    waiting_act_count_ = before.waiting_act_count_;
    force_watch_ = before.force_watch_;
    sensed_press_mm_ = before.sensed_press_mm_;
    probe_watch_ = before.probe_watch_;
    needle_watch_ = before.needle_watch_;
    reference_watch_ = before.reference_watch_;
    reading_ = before.reading_;
    tools_ = before.tools_;
    last_ = before.last_;
    frame_ = before.frame_;
    origin_s_ = before.origin_s_;
}

FrameStatus ScanEngine::frame_again(const FrameRecord& record, std::span<std::uint8_t> pixels) {
    return finish(record.input, renderer_.render(record.input, pixels), pixels);
}

FrameStatus ScanEngine::finish(const FrameInput& input,
                               FrameStatus status,
                               std::span<std::uint8_t> pixels) {
    if (status != FrameStatus::rendered ||
        probe_in_contact(skin_, exercise_.probe, input.mannequin_from_probe)) {
        return status;
    }
    // Model `physical` darkens beams in air by itself; model `paper` has no air.
    if (options_.render.model == ImageModel::paper) {
        std::fill(pixels.begin(), pixels.end(), std::uint8_t{0});
    }
    return FrameStatus::no_contact;
}

}  // namespace sonocase::runtime::inline engine
