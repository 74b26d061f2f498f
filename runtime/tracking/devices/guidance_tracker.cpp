// SPDX-License-Identifier: Apache-2.0

// Ascension / NDI 3D Guidance: start-up dialogue and polling.
#include <algorithm>
#include <array>
#include <chrono>

#include "runtime/tracking/devices/guidance_protocol.h"
#include "runtime/tracking/devices/usb_tracker.h"

namespace sonocase::runtime::inline tracking_devices {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::array<UsbId, 3> kIds = {{
    {0x21E2, 0x1008, "NDI 3D Guidance driveBAY", false, 0x86, 0x02},
    {0x04B4, 0x1005, "NDI 3D Guidance trakSTAR", false, 0x86, 0x02},
    {0x04B4, 0x1003, "NDI 3D Guidance medSAFE", false, 0x86, 0x02},
}};
constexpr double kTimeout = 0.5;
constexpr int kSockets = 4;
constexpr int kErrorEvery = 60;  // readings between two requests of the error byte

class GuidanceDriver final : public UsbDriver {
  public:
    std::span<const UsbId> ids() const override { return kIds; }
    Status start(UsbPipe& pipe, const UsbTrackerOptions& options, std::string& name) override;
    bool read(UsbPipe& pipe, TrackerReading& reading, UsbOutcome& outcome) override;
    void stop(UsbPipe& pipe) override {
        const std::uint8_t sleep[] = {0x47};
        pipe.write(sleep, 0.1);
    }
    std::uint64_t bad_frames() const override { return bad_; }
    Message warning() const override { return warning_; }

  private:
    // Writes, then reads `want` bytes; ok only if all came.
    UsbOutcome ask(UsbPipe& pipe, std::span<const std::uint8_t> request, std::size_t want);
    void drain(UsbPipe& pipe);

    std::array<std::uint8_t, 1024> buffer_{};
    std::array<std::uint8_t, 64> answer_{};
    std::vector<int> sensors_;
    double range_in_ = 36;
    std::uint64_t bad_ = 0;
    int until_error_ = 0;
    Message warning_;
    Clock::time_point due_;
    Clock::duration period_{};
};

void GuidanceDriver::drain(UsbPipe& pipe) {
    std::size_t got = 0;
    for (int i = 0; i < 4 && pipe.read(buffer_, got, 0.02) == UsbOutcome::ok && got > 0; ++i) {
    }
}

UsbOutcome GuidanceDriver::ask(UsbPipe& pipe,
                               std::span<const std::uint8_t> request,
                               std::size_t want) {
    UsbOutcome outcome = pipe.write(request, kTimeout);
    std::size_t have = 0;
    while (outcome == UsbOutcome::ok && have < want) {
        std::size_t got = 0;
        outcome = pipe.read(buffer_, got, kTimeout);
        const std::size_t take = std::min(got, want - have);  // an answer may come in two transfers
        std::copy_n(buffer_.begin(), take, answer_.begin() + static_cast<std::ptrdiff_t>(have));
        have += take;
        if (got > take) ++bad_;
    }
    return have == want                ? UsbOutcome::ok
           : outcome == UsbOutcome::ok ? UsbOutcome::timeout
                                       : outcome;
}

Status GuidanceDriver::start(UsbPipe& pipe, const UsbTrackerOptions& options, std::string&) {
    const Error silent{"The tracker does not answer", "", "switch it off and on"};
    pipe.clear_halt();
    std::size_t got = 0;
    pipe.read(buffer_, got, 0.05);  // sent for an earlier session
    const std::uint8_t configure[] = {0x50, 0x32, 0x01};
    if (pipe.write(configure, kTimeout) != UsbOutcome::ok) return silent;
    wait_s(0.6);
    const std::uint8_t range[] = {0x4F, 0x03};
    if (ask(pipe, range, 2) != UsbOutcome::ok) return silent;
    range_in_ = (answer_[0] | answer_[1] << 8) == 1 ? 72 : 36;
    const std::uint8_t error[] = {0x4F, 0x0A};
    if (ask(pipe, error, 1) != UsbOutcome::ok) return silent;
    bool fatal = false;
    guidance::error_text(answer_[0], fatal);
    if (fatal)
        return Error{
            Message("The tracker reports a fault (error {})", {std::to_string(answer_[0])}), "",
            "switch it off and on, and have it serviced if that does not help"};
    const std::uint8_t transmitter[] = {0xF1, 0x4F, 0x1B};
    if (ask(pipe, transmitter, 2) != UsbOutcome::ok) return silent;
    if ((answer_[0] | answer_[1]) == 0) {
        return Error{"No transmitter is connected to the tracker", "", "plug the transmitter in"};
    }
    sensors_.clear();
    for (int i = 0; i < kSockets; ++i) {
        const auto address = static_cast<std::uint8_t>(0xF1 + i);
        const std::uint8_t serial[] = {address, 0x4F, 0x1A};
        if (ask(pipe, serial, 2) != UsbOutcome::ok || (answer_[0] | answer_[1]) == 0) continue;
        const std::uint8_t angles[] = {address, 0x59};
        if (pipe.write(angles, kTimeout) != UsbOutcome::ok) return silent;
        const auto half = static_cast<int>(options.hemisphere);
        const std::uint8_t hemisphere[] = {address, 0x4C, static_cast<std::uint8_t>(6 * (half / 2)),
                                           static_cast<std::uint8_t>(half % 2)};
        if (pipe.write(hemisphere, kTimeout) != UsbOutcome::ok) return silent;
        sensors_.push_back(i);
    }
    if (sensors_.empty()) {
        return Error{"No sensor is connected to the tracker", "",
                     "plug the probe's and the needle's sensors in"};
    }
    // The device measures at up to 255 Hz.
    const double rate = std::clamp(options.rate_hz, 20.0, 240.0);
    const auto word = static_cast<unsigned>(rate * 256);
    const std::uint8_t set_rate[] = {0x50, 0x07, static_cast<std::uint8_t>(word & 0xFF),
                                     static_cast<std::uint8_t>(word >> 8)};
    if (pipe.write(set_rate, kTimeout) != UsbOutcome::ok) return silent;
    period_ = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / rate));
    due_ = Clock::now();
    until_error_ = kErrorEvery;
    warning_ = {};
    return Done{};
}

bool GuidanceDriver::read(UsbPipe& pipe, TrackerReading& reading, UsbOutcome& outcome) {
    const double early_s = std::chrono::duration<double>(due_ - Clock::now()).count();
    if (early_s > 0) wait_s(early_s);
    due_ = std::max(due_ + period_, Clock::now());
    reading.sensor_count = 0;
    reading.sensors.fill({});
    for (int i : sensors_) {
        const std::uint8_t point[] = {static_cast<std::uint8_t>(0xF1 + i), 0x42};
        outcome = ask(pipe, point, guidance::kAnglesRecord);
        if (outcome != UsbOutcome::ok) {
            if (outcome == UsbOutcome::timeout) ++bad_;
            return false;
        }
        SensorReading& out = reading.sensors[i];
        reading.sensor_count = i + 1;
        const auto pose =
            guidance::parse_angles({answer_.data(), guidance::kAnglesRecord}, range_in_);
        if (!pose) {
            ++bad_;
            drain(pipe);  // back into phase with the next request
            return false;
        }
        out.state = SensorState::ok;
        out.world_from_sensor = *pose;
    }
    if (--until_error_ <= 0) {
        until_error_ = kErrorEvery;
        const std::uint8_t error[] = {0x4F, 0x0A};
        outcome = ask(pipe, error, 1);
        if (outcome == UsbOutcome::ok) {
            bool fatal = false;
            warning_ = guidance::error_text(answer_[0], fatal);
        }
    }
    if (!warning_.empty()) {
        for (int i : sensors_) reading.sensors[i].state = SensorState::poor;
    }
    return true;
}

}  // namespace

std::unique_ptr<UsbDriver> make_guidance_driver() {
    return std::make_unique<GuidanceDriver>();
}

}  // namespace sonocase::runtime::inline tracking_devices
