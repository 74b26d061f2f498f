// SPDX-License-Identifier: Apache-2.0

// A USB tracker: waits for the device, starts it, hands over readings, and begins again after it
// was unplugged; on a thread of its own, or on a page between its frames. What differs between
// makers is a UsbDriver.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>

#include "formats/base/mailbox.h"
#include "formats/base/result.h"
#include "runtime/tracking/devices/usb_pipe.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking_devices {

// Which half of the transmitter's field the sensors are in.
enum class Hemisphere : std::uint8_t { plus_x, minus_x, plus_y, minus_y, plus_z, minus_z };

struct UsbTrackerOptions {
    Hemisphere hemisphere = Hemisphere::plus_x;
    double rate_hz = 240;    // the device uses the nearest that it has
    double retry_s = 0.5;    // between two searches for the device
    double silence_s = 1.0;  // without a reading until it is started again
};

class UsbDriver {
  public:
    virtual ~UsbDriver() = default;
    virtual std::span<const UsbId> ids() const = 0;  // the first one's name is the family's
    // Brings a device from any state to streaming. `name`, as shown to the user, may be extended.
    virtual Status start(UsbPipe& pipe, const UsbTrackerOptions& options, std::string& name) = 0;
    // Waits up to 0.1 s for a reading; true, with ok, when one came. Outcomes other than ok and
    // timeout end the connection, except stalled, which the caller clears before it reads on.
    virtual bool read(UsbPipe& pipe, TrackerReading& reading, UsbOutcome& outcome) = 0;
    virtual void stop(UsbPipe& pipe) = 0;
    virtual std::uint64_t bad_frames() const = 0;
    virtual Message warning() const { return {}; }  // a sentence; empty: none
};

class UsbTracker final : public Tracker {
  public:
    UsbTracker(std::unique_ptr<UsbDriver> driver,
               SessionClock clock,
               UsbTrackerOptions options = {});
    ~UsbTracker() override;
    // run() on a thread of its own, until this is destroyed.
    void start();
    // Does all that, until stop(). A page calls it itself: its pipe's waits let others run.
    void run();
    void stop() { stop_ = true; }
    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override;
    void set_wake(std::function<void()> wake) override;
    bool is_device() const override { return true; }

  private:
    void stream(UsbPipe& pipe);
    void set_health(TrackerPhase phase, const Message& message);
    void pause(double seconds);

    std::unique_ptr<UsbDriver> driver_;
    SessionClock clock_;
    UsbTrackerOptions options_;
    std::atomic<bool> stop_{false};
    Mailbox<TrackerReading> box_;
    mutable std::mutex mutex_;
    TrackerHealth health_;
    Message note_;            // a sentence when two devices are plugged in
    bool unplugged_ = false;  // and not plugged in again yet
    bool silent_ = false;     // was started again after silence, no reading since
    double mean_period_s_ = 0;
    std::function<void()> wake_;
    std::thread thread_;
};

std::unique_ptr<UsbDriver> make_viper_driver();
std::unique_ptr<UsbDriver> make_guidance_driver();
std::unique_ptr<UsbDriver> make_liberty_driver();

}  // namespace sonocase::runtime::inline tracking_devices
