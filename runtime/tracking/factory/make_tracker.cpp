// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/factory/make_tracker.h"

#include <utility>

#include "runtime/tracking/igtl/igtl_tracker.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/tracking/null_tracker.h"
#include "runtime/tracking/replay_tracker.h"
#include "runtime/tracking/scripted_sweep.h"
#include "runtime/tracking/usb/usb_tracker.h"

namespace sonocase::runtime {
namespace {

using Made = Result<std::unique_ptr<Tracker>>;

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
    return Error{"no sweep named " + name, where, "it has: " + names};
}

}  // namespace

Made make_tracker(const std::string& spec, const TrackerContext& context) {
    const std::size_t colon = spec.find(':');
    const std::string kind = spec.substr(0, colon);
    const std::string rest = colon == std::string::npos ? "" : spec.substr(colon + 1);
    if (kind == "sweep") return make_sweep(rest, context);
    if (kind == "replay" && !rest.empty()) {
        Result<Recording> recording = load_recording(rest);
        if (!recording) return recording.error();
        // What was recorded here was seen together.
        if (!recording->in_mannequin) {
            for (Pose& pose : recording->needle) pose.timestamp_s -= context.needle_lag_s;
        }
        return Made(std::make_unique<ReplayTracker>(std::move(*recording), context.loop));
    }
    if (spec == "mouse") {
        return Made(std::make_unique<MouseTracker>(*context.skin, *context.exercise));
    }
    if (spec == "null") {
        const MouseTracker start(*context.skin, *context.exercise);
        return Made(std::make_unique<NullTracker>(start.mannequin_from_probe()));
    }
    if (kind == "igtl") {
        IgtlTrackerOptions options;
        std::string address = rest;
        if (address.rfind("listen:", 0) == 0) {
            options.listening = true;
            address = address.substr(7);
        }
        if (!split_address(address, options.host, options.port)) {
            return Error{
                "not an address: " + spec, "--tracker",
                "use igtl:HOST:PORT or igtl:listen:[ADDRESS:]PORT, e.g. igtl:127.0.0.1:18944"};
        }
        return IgtlTracker::start(options, context.clock);
    }
    using MakeDriver = std::unique_ptr<UsbDriver> (*)();
    constexpr std::pair<const char*, MakeDriver> kDevices[] = {{"viper", make_viper_driver},
                                                               {"3dg", make_guidance_driver},
                                                               {"liberty", make_liberty_driver}};
    for (const auto& [name, make] : kDevices) {
        if (spec == name) return Made(std::make_unique<UsbTracker>(make(), context.clock));
    }
    return Error{"unknown tracker " + spec, "--tracker",
                 "use mouse, sweep:NAME, replay:FILE, igtl:HOST:PORT, viper, 3dg, liberty or null"};
}

}  // namespace sonocase::runtime
