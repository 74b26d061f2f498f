// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/make_tracker.h"

#include <utility>

#include "runtime/tracking/devices/igtl_tracker.h"
#include "runtime/tracking/devices/usb_tracker.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/tracking/replay_tracker.h"
#include "runtime/tracking/scripted_sweep.h"
#include "runtime/tracking/tracker.h"
#ifdef SONOCASE_CAMERA
#include "runtime/tracking/camera/v4l2_camera.h"
#endif

namespace sonocase::runtime::inline tracking_devices {
namespace {

// Holds one pose, to view a bundle without a tracker and for tests.
class NullTracker final : public Tracker {
  public:
    explicit NullTracker(const Rigid& mannequin_from_probe) {
        reading_.in_mannequin = true;
        reading_.sensor_count = 1;
        reading_.sensors[kProbeSensor] = {SensorState::ok, mannequin_from_probe, 1.0f, 0};
    }
    bool poll(double now_s, TrackerReading& reading) override {
        reading_.time_s = now_s;
        ++reading_.sequence;
        reading = reading_;
        return true;
    }
    TrackerHealth health() const override {
        TrackerHealth health;
        health.phase = TrackerPhase::streaming;
        health.device = "No tracker";
        health.message = "No tracker is in use; the probe stays where the exercise starts.";
        health.readings = reading_.sequence;
        return health;
    }

  private:
    TrackerReading reading_;
};

// "3" or "Sensor 3"; 0: a name.
int sensor_number(const std::string& name) {
    const std::string digits = name.rfind("Sensor ", 0) == 0 ? name.substr(7) : name;
    if (digits.empty() || digits.size() > 2) return 0;
    int number = 0;
    for (const char c : digits) {
        if (c < '0' || c > '9') return 0;
        number = 10 * number + (c - '0');
    }
    return number <= kMaxSensors ? number : 0;
}

using Made = Result<std::unique_ptr<Tracker>>;

Made make_mouse(const std::string&, const TrackerContext& context) {
    return Made(std::make_unique<MouseTracker>(*context.skin, *context.exercise));
}

Made make_null(const std::string&, const TrackerContext& context) {
    const MouseTracker start(*context.skin, *context.exercise);
    return Made(std::make_unique<NullTracker>(start.mannequin_from_probe()));
}

Made make_sweep(const std::string& name, const TrackerContext& context) {
    const auto& sweeps = context.exercise->sweeps;
    std::string names;
    for (const Sweep& sweep : sweeps) {
        if (sweep.name == name || name.empty()) {
            return Made(std::make_unique<ScriptedSweep>(sweep, *context.skin, context.loop));
        }
        names += (names.empty() ? "" : ", ") + sweep.name;
    }
    const std::string where = "exercise " + context.exercise->name;
    if (sweeps.empty()) {
        return Error{"has no scripted sweep", where, "use --tracker mouse or replay:FILE"};
    }
    return Error{Message("no sweep named {}", {name}), where, Message("it has: {}", {names})};
}

Made make_replay(const std::string& files, const TrackerContext& context) {
    // In a recording of this player both tools were seen at the same time; recordings of sensors
    // may have a lag.
    SONOCASE_TRY(Recording recording, load_recording(files, context.needle_lag_s, context.tools));
    return Made(std::make_unique<ReplayTracker>(std::move(recording), context.loop));
}

Made make_igtl(const std::string& argument, const TrackerContext& context) {
    IgtlTrackerOptions options;
    options.tools = context.tools;
    std::string address = argument;
    if (address.rfind("listen:", 0) == 0) {
        options.listening = true;
        address = address.substr(7);
    }
    if (!split_address(address, options.host, options.port)) {
        return Error{"not an address: igtl:" + argument, "--tracker",
                     "use igtl:HOST:PORT or igtl:listen:[ADDRESS:]PORT, e.g. igtl:127.0.0.1:18944"};
    }
    return IgtlTracker::start(options, context.clock);
}

#ifdef SONOCASE_CAMERA
// A video is read to its end before the first frame: it is a function of time, as a recording is.
Made make_camera(const std::string& argument, const TrackerContext& context) {
    SONOCASE_TRY(const CameraArgument camera, parse_camera_argument(argument));
    if (camera.video.empty()) {
        const int number = camera.number;
        return Made(std::make_unique<CameraTracker>([number] { return open_v4l2_camera(number); },
                                                    context.clock, camera.options));
    }
    SONOCASE_TRY(Recording recording, load_camera_video(camera.video, camera.options));
    return Made(std::make_unique<ReplayTracker>(std::move(recording), context.loop));
}

std::vector<TrackerChoice> cameras() {
    std::vector<TrackerChoice> out;
    for (const CameraDevice& device : v4l2_cameras())
        out.push_back({device.name, "camera:" + std::to_string(device.number)});
    return out;
}
#endif

template <std::unique_ptr<UsbDriver> (*make_driver)()>
Made make_usb(const std::string&, const TrackerContext& context) {
    auto tracker = std::make_unique<UsbTracker>(make_driver(), context.clock);
    tracker->start();
    return Made(std::move(tracker));
}

constexpr auto kNone = TrackerKind::Argument::none;
constexpr auto kOptional = TrackerKind::Argument::optional;
constexpr auto kRequired = TrackerKind::Argument::required;
constexpr bool kStepped = true, kNotStepped = false;

constexpr TrackerKind kTrackers[] = {
    {"mouse", "mouse", kNone, "Mouse and keyboard", "mouse", kStepped, make_mouse},
    {"sweep", "sweep:NAME", kOptional, nullptr, nullptr, kStepped, make_sweep},
    {"replay", "replay:FILE[,NEEDLE_FILE]", kRequired, nullptr, nullptr, kNotStepped, make_replay},
    {"igtl", "igtl:HOST:PORT | igtl:listen:PORT", kRequired, "OpenIGTLink, this machine",
     "igtl:127.0.0.1:18944", kNotStepped, make_igtl, true},
#ifdef SONOCASE_CAMERA
    {"camera", "camera[:N|VIDEO][,CAMERA.json]", kOptional, "Camera and printed markers", "camera",
     kStepped, make_camera, false, cameras},
#endif
    {"viper", "viper", kNone, "Polhemus Viper", "viper", kStepped, make_usb<make_viper_driver>},
    {"3dg", "3dg", kNone, "NDI 3D Guidance", "3dg", kStepped, make_usb<make_guidance_driver>},
    {"liberty", "liberty", kNone, "Polhemus Liberty / Patriot", "liberty", kStepped,
     make_usb<make_liberty_driver>},
    {"null", "null", kNone, "None", "null", kNotStepped, make_null},
};

}  // namespace

std::span<const TrackerKind> tracker_kinds() {
    return kTrackers;
}

std::string tracker_help() {
    std::string help;
    for (const TrackerKind& kind : kTrackers)
        help += (help.empty() ? "" : " | ") + std::string(kind.help);
    return help;
}

Result<ToolNames> parse_tool_names(const std::vector<std::string>& texts) {
    ToolNames tools;
    for (const std::string& text : texts) {
        const std::size_t sign = text.find('=');
        const std::string role = text.substr(0, sign);
        if (sign == std::string::npos || sign + 1 == text.size() ||
            (role != "probe" && role != "needle" && role != "reference")) {
            return Error{"not a tool: " + text, "--tool",
                         "use ROLE=NAME with probe, needle or reference, e.g. "
                         "needle=StylusTipToTracker, or reference=3 for the third sensor"};
        }
        tools.emplace_back(role, text.substr(sign + 1));
    }
    return tools;
}

SensorAssignment assignment_of(const ToolNames& tools, const SensorAssignment& otherwise) {
    SensorAssignment places = otherwise;
    int* const of_role[] = {&places.probe, &places.needle, &places.reference};
    const char* const roles[] = {"probe", "needle", "reference"};
    for (const auto& [role, name] : tools) {
        for (int r = 0; r < 3; ++r) {
            if (role != roles[r]) continue;
            // Of several names for a role the tracker puts each in the same place.
            const int number = sensor_number(name);
            const int sensor = number > 0 ? number - 1 : r;
            for (int* other : of_role) {
                if (other != of_role[r] && *other == sensor) *other = -1;
            }
            *of_role[r] = sensor;
        }
    }
    return places;
}

Made make_tracker(const std::string& spec, const TrackerContext& context) {
    const std::size_t colon = spec.find(':');
    const std::string prefix = spec.substr(0, colon);
    const std::string argument = colon == std::string::npos ? "" : spec.substr(colon + 1);
    for (const TrackerKind& kind : kTrackers) {
        if (prefix != kind.prefix) continue;
        const bool wrong = kind.argument == kNone       ? colon != std::string::npos
                           : kind.argument == kRequired ? argument.empty()
                                                        : false;
        if (wrong)
            return Error{"not a tracker: " + spec, "--tracker", std::string("use ") + kind.help};
        return kind.make(argument, context);
    }
    return Error{Message("unknown tracker {}", {spec}), "--tracker",
                 "use one of " + tracker_help()};
}

}  // namespace sonocase::runtime::inline tracking_devices
