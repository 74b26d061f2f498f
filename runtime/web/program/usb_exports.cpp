// SPDX-License-Identifier: Apache-2.0

// The page's third program, which is fetched when a USB tracker is chosen: the desktop's drivers,
// whose bytes the page carries by WebUSB. Where a thread of the desktop waits, a call of module
// "usb" suspends run() and lets the page go on (JavaScript Promise Integration). The other side is
// runtime/web/page/usb.js.

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "formats/calibration/calibration.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/tracking/devices/usb_tracker.h"

#define SONOCASE_EXPORT(name) extern "C" __attribute__((export_name(#name)))
#define SONOCASE_USB(name) __attribute__((import_module("usb"), import_name(#name)))

using namespace sonocase;
using namespace sonocase::runtime;

extern "C" {
// Opens and claims the device that was chosen. endpoint_in, endpoint_out: 0: the first bulk ones.
// Returns the size of its packets, or one of Opened.
SONOCASE_USB(open) int usb_open(int endpoint_in, int endpoint_out);
SONOCASE_USB(close) void usb_close();
SONOCASE_USB(is_there) int usb_is_there();
// Both return a UsbOutcome, usb_read() beside 16 times the number of bytes that it left at `to`.
SONOCASE_USB(write) int usb_write(const std::uint8_t* from, int size, double timeout_s);
SONOCASE_USB(read) int usb_read(std::uint8_t* to, int size, double timeout_s);
SONOCASE_USB(clear_halt) int usb_clear_halt();
SONOCASE_USB(wait) void usb_wait(double seconds);
SONOCASE_USB(now) double usb_now();  // seconds
}

namespace {

enum Opened { kNotAllowed = -1, kInUse = -2, kNoEndpoints = -3, kFailed = -4 };

// Order of what poll() leaves for each tool; usb.js reads it in the same order. After the state, a
// SensorState, come 16 numbers: rows of world_from_probe or world_from_needle.
enum ToolValue { kState, kRows, kToolValueCount = kRows + 16 };

struct Usb {
    std::string text;
    UsbId chosen;
    std::unique_ptr<UsbTracker> tracker;
    Calibrations calibrations;
    std::array<double, 2 * kToolValueCount> values{};
};
Usb usb;

std::unique_ptr<UsbDriver> (*const kDrivers[])() = {make_viper_driver, make_guidance_driver,
                                                    make_liberty_driver};

// A sentence as a page translates it: its format and its arguments, each of the same form.
nlohmann::json json_of(const Message& message) {
    nlohmann::json list = {std::string(message.format())};
    for (const Message& argument : message.arguments()) list.push_back(json_of(argument));
    return list;
}
int answer(const Error& error) {
    usb.text = json_of(error.where.empty() && error.expected.empty() ? error.what
                                                                     : Message(error.message()))
                   .dump();
    return 0;
}

}  // namespace

namespace sonocase::runtime::inline tracking_devices {

void wait_s(double seconds) {
    usb_wait(seconds);
}

struct UsbPipe::Impl {
    UsbId id;
    int packet = 64;
    ~Impl() { usb_close(); }
};
struct UsbBus::Impl {};

UsbPipe::UsbPipe(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
UsbPipe::~UsbPipe() = default;
const UsbId& UsbPipe::id() const {
    return impl_->id;
}
std::string UsbPipe::place() const {
    return "USB";
}

UsbOutcome UsbPipe::write(std::span<const std::uint8_t> bytes, double timeout_s) {
    const int size = static_cast<int>(bytes.size());
    const auto outcome = static_cast<UsbOutcome>(usb_write(bytes.data(), size, timeout_s));
    if (outcome != UsbOutcome::ok || size == 0 || size % impl_->packet != 0) return outcome;
    return static_cast<UsbOutcome>(usb_write(bytes.data(), 0, timeout_s));
}

UsbOutcome UsbPipe::read(std::span<std::uint8_t> buffer, std::size_t& got, double timeout_s) {
    assert(buffer.size() % 1024 == 0);
    const int answer = usb_read(buffer.data(), static_cast<int>(buffer.size()), timeout_s);
    got = static_cast<std::size_t>(answer / 16);
    return static_cast<UsbOutcome>(answer % 16);
}

UsbOutcome UsbPipe::clear_halt() {
    return static_cast<UsbOutcome>(usb_clear_halt());
}

Result<std::unique_ptr<UsbBus>> UsbBus::open() {
    return std::unique_ptr<UsbBus>(new UsbBus);
}
UsbBus::~UsbBus() = default;

Result<std::unique_ptr<UsbPipe>> UsbBus::connect(std::span<const UsbId> ids, int& found) {
    found = usb_is_there();
    if (!found)
        return Error{Message("No {} is plugged in", {ids.front().name}), "",
                     "plug it in and switch it on"};
    auto impl = std::make_unique<UsbPipe::Impl>();
    const auto id = std::find_if(ids.begin(), ids.end(), [](const UsbId& one) {
        return one.vendor == usb.chosen.vendor && one.product == usb.chosen.product;
    });
    assert(id != ids.end());  // choose()
    impl->id = *id;
    if (id->needs_firmware)
        return Error{Message("The {} waits for its firmware", {id->name}), "",
                     "load it with the maker's program, then replug it"};
    const int opened = usb_open(id->endpoint_in, id->endpoint_out);
    const Message which(id->name);
    if (opened == kNotAllowed)
        return Error{Message("This computer does not let the browser use the {}", {which}), "",
                     "on Linux install the rule 60-sonocase-trackers.rules, then replug it"};
    if (opened == kInUse)
        return Error{Message("{} is in use by another program", {which}), "",
                     "close the other program, or replug it"};
    if (opened == kNoEndpoints)
        return Error{Message("{} has no bulk endpoints", {which}), "",
                     "check that it is the device it says"};
    if (opened <= 0) return Error{Message("{} cannot be claimed", {which}), "", "replug it"};
    impl->packet = opened;
    return std::unique_ptr<UsbPipe>(new UsbPipe(std::move(impl)));
}

}  // namespace sonocase::runtime::inline tracking_devices

SONOCASE_EXPORT(text) const char* text() {
    return usb.text.data();
}
SONOCASE_EXPORT(text_bytes) std::size_t text_bytes() {
    return usb.text.size();
}
SONOCASE_EXPORT(reserve_text) char* reserve_text(std::size_t bytes) {
    usb.text.resize(bytes);
    return usb.text.data();
}

// text(): the devices that are known, [[vendor, product], ...].
SONOCASE_EXPORT(devices) void devices() {
    nlohmann::json list = nlohmann::json::array();
    for (const auto make : kDrivers)
        for (const UsbId& id : make()->ids()) list.push_back({id.vendor, id.product});
    usb.text = list.dump();
}
// The device that the user chose. 0: it is none of ours.
SONOCASE_EXPORT(choose) int choose(int vendor, int product) {
    for (const auto make : kDrivers) {
        std::unique_ptr<UsbDriver> driver = make();
        for (const UsbId& id : driver->ids()) {
            if (id.vendor != vendor || id.product != product) continue;
            usb.chosen = id;
            usb.tracker = std::make_unique<UsbTracker>(std::move(driver), usb_now);
            return 1;
        }
    }
    return 0;
}
// Reads the device until stop(). The page promises it; meanwhile the other functions may be called.
SONOCASE_EXPORT(run) void run() {
    usb.tracker->run();
}
SONOCASE_EXPORT(stop) void stop() {
    usb.tracker->stop();
}

// text(): what `sonocase calibrate` wrote, line break, its name. 0: text() is why it is refused.
SONOCASE_EXPORT(use_calibration) int use_calibration() {
    const std::size_t end = usb.text.rfind('\n');
    const std::string name = end == std::string::npos ? "" : usb.text.substr(end + 1);
    Result<Calibration> read = parse_calibration(std::string_view(usb.text).substr(0, end), name);
    if (!read) return answer(read.error());
    Calibrations& c = usb.calibrations;
    (read->kind == "probe"    ? c.probe
     : read->kind == "needle" ? c.needle
                              : c.mannequin) = *std::move(read);
    return 1;
}

// 1 and the tools at values(), if a reading has come since the last call.
SONOCASE_EXPORT(poll) int poll() {
    TrackerReading reading;
    if (!usb.tracker->poll(usb_now(), reading)) return 0;
    const ToolPoses tools = tool_poses(reading, usb.calibrations, {});
    for (int tool = 0; tool < 2; ++tool) {
        const SensorReading& sensor = reading.sensors[tool == 0 ? kProbeSensor : kNeedleSensor];
        const bool has = tool == 0 ? tools.has_probe : tools.has_needle;
        const Rigid& pose = tool == 0 ? tools.mannequin_from_probe : tools.mannequin_from_needle;
        double* v = usb.values.data() + tool * kToolValueCount;
        v[kState] = static_cast<double>(
            has || sensor.state == SensorState::absent ? sensor.state : SensorState::lost);
        double* rows = v + kRows;
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) rows[4 * r + c] = pose.rotation(r, c);
        rows[3] = pose.translation.x, rows[7] = pose.translation.y, rows[11] = pose.translation.z;
        rows[12] = rows[13] = rows[14] = 0, rows[15] = 1;
    }
    return 1;
}
SONOCASE_EXPORT(values) const double* values() {
    return usb.values.data();
}
SONOCASE_EXPORT(value_count) int value_count() {
    return static_cast<int>(usb.values.size());
}
// text(): {phase, device, message, rate_hz, in_mannequin: a mannequin's calibration is used}.
SONOCASE_EXPORT(health) void health() {
    const TrackerHealth h = usb.tracker->health();
    usb.text = nlohmann::json{{"phase", phase_name(h.phase)},
                              {"device", h.device},
                              {"message", json_of(h.message)},
                              {"rate_hz", h.rate_hz},
                              {"in_mannequin", usb.calibrations.mannequin.has_value()}}
                   .dump();
}
