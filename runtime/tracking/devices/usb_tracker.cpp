// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/usb_tracker.h"

#include <algorithm>
#include <utility>

namespace sonocase::runtime::inline tracking_devices {
namespace {

constexpr const char* kUnplugged = "The tracker was unplugged; plug it in again.";
constexpr const char* kSilent = "No reading comes; the device is being started again.";

}  // namespace

UsbTracker::UsbTracker(std::unique_ptr<UsbDriver> driver,
                       SessionClock clock,
                       UsbTrackerOptions options)
    : driver_(std::move(driver)), clock_(std::move(clock)), options_(options) {
    health_.device = driver_->ids().front().name;
}

UsbTracker::~UsbTracker() {
    stop();
    if (thread_.joinable()) thread_.join();
}

void UsbTracker::start() {
    thread_ = std::thread([this] { run(); });
}

bool UsbTracker::poll(double, TrackerReading& reading) {
    if (!box_.refresh()) return false;
    reading = box_.value();
    return true;
}

TrackerHealth UsbTracker::health() const {
    const std::lock_guard lock(mutex_);
    return health_;
}

void UsbTracker::set_wake(std::function<void()> wake) {
    const std::lock_guard lock(mutex_);
    wake_ = std::move(wake);
}

void UsbTracker::set_health(TrackerPhase phase, const Message& message) {
    const std::lock_guard lock(mutex_);
    health_.phase = phase;
    health_.message = message;
}

void UsbTracker::pause(double seconds) {
    // In short sleeps, so that the destructor does not wait long.
    constexpr double kShort = 0.02;
    for (double slept = 0; slept < seconds && !stop_; slept += kShort) wait_s(kShort);
}

void UsbTracker::run() {
    Result<std::unique_ptr<UsbBus>> bus = UsbBus::open();
    if (!bus) {
        set_health(TrackerPhase::failed, Message("{}.", {bus.error().message()}));
        return;
    }
    while (!stop_) {
        int found = 0;
        Result<std::unique_ptr<UsbPipe>> pipe = (*bus)->connect(driver_->ids(), found);
        if (!pipe) {
            const Error& error = pipe.error();
            if (found == 0 && unplugged_) {
                // Reported again: a search between the unplugging and its announcement may have
                // reported something else.
                set_health(TrackerPhase::searching, kUnplugged);
                pause(options_.retry_s);
                continue;
            }
            // A device that is found but not usable is a failure; the user can mend that.
            set_health(found > 0 ? TrackerPhase::failed : TrackerPhase::searching,
                       Message("{}; {}.", {error.what, error.expected}));
            pause(options_.retry_s);
            continue;
        }
        unplugged_ = false;
        mean_period_s_ = 0;
        note_ =
            found > 1
                ? Message("Two are plugged in; the one at {} is used. Unplug the other to be sure.",
                          {(*pipe)->place()})
                : Message();
        // The message about a device that fell silent stays until a reading comes.
        set_health(TrackerPhase::starting, silent_ ? Message(kSilent) : note_);
        std::string name = (*pipe)->id().name;
        const Status started = driver_->start(**pipe, options_, name);
        if (!started) {
            set_health(TrackerPhase::starting,
                       Message("{}; {}.", {started.error().what, started.error().expected}));
            pause(options_.retry_s);
            continue;
        }
        {
            const std::lock_guard lock(mutex_);
            health_.phase = TrackerPhase::streaming;
            health_.device = name;
            health_.message = silent_ ? Message(kSilent) : note_;
            ++health_.connects;
        }
        stream(**pipe);
        // A device that is gone is listed for a moment longer, and cannot be claimed then: the user
        // would be told to close another program.
        constexpr double kListedS = 0.1;
        if (unplugged_) pause(kListedS);
    }
}

void UsbTracker::stream(UsbPipe& pipe) {
    double last_s = clock_();
    TrackerReading reading;
    {
        const std::lock_guard lock(mutex_);
        reading.sequence = health_.readings;
    }
    while (!stop_) {
        UsbOutcome outcome = UsbOutcome::ok;
        const std::uint64_t sequence = reading.sequence;
        const bool got = driver_->read(pipe, reading, outcome);
        const double now_s = clock_();
        if (got) {
            reading.sequence = sequence + 1;
            reading.time_s = now_s;
            box_.publish(reading);
            silent_ = false;
            const Message warning = driver_->warning();
            const std::lock_guard lock(mutex_);
            ++health_.readings;
            health_.bad_frames = driver_->bad_frames();
            if (warning != health_.message) health_.message = warning.empty() ? note_ : warning;
            const double period = now_s - last_s;
            if (period > 0) {
                // Averaged over about a hundred readings, because transfers come with jitter.
                mean_period_s_ += (mean_period_s_ > 0 ? 0.02 : 1) * (period - mean_period_s_);
                health_.rate_hz = 1 / mean_period_s_;
            }
            last_s = now_s;
            if (wake_) wake_();
        }
        if (outcome == UsbOutcome::ok || outcome == UsbOutcome::timeout) {
            if (now_s - last_s > options_.silence_s) {
                silent_ = true;
                set_health(TrackerPhase::starting, kSilent);
                return;
            }
            continue;
        }
        if (outcome == UsbOutcome::stalled && pipe.clear_halt() == UsbOutcome::ok) {
            const std::lock_guard lock(mutex_);
            ++health_.bad_frames;
            continue;
        }
        unplugged_ = outcome == UsbOutcome::gone;
        set_health(TrackerPhase::searching,
                   outcome == UsbOutcome::gone
                       ? kUnplugged
                       : "The connection to the tracker broke; it is being opened again.");
        return;
    }
    driver_->stop(pipe);
}

}  // namespace sonocase::runtime::inline tracking_devices
