// SPDX-License-Identifier: Apache-2.0

// Polhemus Viper: start-up dialogue and stream.
#include <algorithm>
#include <array>
#include <chrono>

#include "runtime/tracking/devices/byte_stream.h"
#include "runtime/tracking/devices/usb_tracker.h"
#include "runtime/tracking/devices/viper_protocol.h"

namespace sonocase::runtime::inline tracking_devices {
namespace {

constexpr std::array<UsbId, 1> kIds = {{{0x0F44, 0xBF01, "Polhemus Viper"}}};
constexpr double kReplyTime = 0.5;

class ViperDriver final : public UsbDriver {
  public:
    std::span<const UsbId> ids() const override { return kIds; }
    Status start(UsbPipe& pipe, const UsbTrackerOptions& options, std::string& name) override;
    bool read(UsbPipe& pipe, TrackerReading& reading, UsbOutcome& outcome) override;
    void stop(UsbPipe& pipe) override {
        pipe.write(viper::encode(viper::kContinuousPno, viper::kReset), 0.1);
    }
    std::uint64_t bad_frames() const override { return frames_.bad_frames() + bad_sizes_; }

  private:
    Status ask(UsbPipe& pipe,
               std::uint32_t command,
               std::uint32_t action,
               std::uint32_t arg1,
               std::span<const std::uint8_t> payload,
               std::vector<std::uint8_t>* answer = nullptr);

    viper::FrameReader frames_;
    viper::Frame frame_;
    std::array<std::uint8_t, 4096> buffer_{};
    std::uint64_t bad_sizes_ = 0;
    double period_s_ = 1 / 240.0;
};

Status ViperDriver::ask(UsbPipe& pipe,
                        std::uint32_t command,
                        std::uint32_t action,
                        std::uint32_t arg1,
                        std::span<const std::uint8_t> payload,
                        std::vector<std::uint8_t>* answer) {
    const Error silent{"The Viper does not answer", "", "switch it off and on"};
    for (int attempt = 0; attempt < 4; ++attempt) {
        if (pipe.write(viper::encode(command, action, arg1, 0, payload), kReplyTime) !=
            UsbOutcome::ok) {
            return Error{"The Viper does not accept commands", "", "switch it off and on"};
        }
        bool not_ready = false;
        const auto until =
            std::chrono::steady_clock::now() + std::chrono::duration<double>(kReplyTime);
        while (!not_ready && std::chrono::steady_clock::now() < until) {
            std::size_t got = 0;
            const UsbOutcome outcome = pipe.read(buffer_, got, 0.1);
            frames_.add({buffer_.data(), got});
            while (frames_.next(frame_)) {
                viper::Reply reply;
                if (frame_.kind != viper::Frame::Kind::reply ||
                    !viper::parse_reply(frame_.body, reply) || reply.command != command) {
                    continue;  // sent for an earlier session
                }
                if (reply.action == viper::kNak) {
                    not_ready = reply.payload.size() >= 4 && u32_le(reply.payload, 0) == 1;
                    if (not_ready) break;
                    return Error{Message("The Viper refuses command {}: {}",
                                         {std::to_string(command), viper::nak_text(reply.payload)}),
                                 "", "switch it off and on"};
                }
                if (answer) answer->assign(reply.payload.begin(), reply.payload.end());
                return Done{};
            }
            if (outcome == UsbOutcome::stalled) pipe.clear_halt();
            if (outcome == UsbOutcome::gone || outcome == UsbOutcome::failed) return silent;
        }
        if (not_ready) wait_s(0.1);
    }
    return silent;
}

Status ViperDriver::start(UsbPipe& pipe, const UsbTrackerOptions& options, std::string& name) {
    frames_.clear();
    pipe.clear_halt();
    // A device that streams already must stop before it is asked anything; one that does not
    // stream answers with a NAK or not at all, and both are harmless.
    pipe.write(viper::encode(viper::kContinuousPno, viper::kReset), kReplyTime);
    for (int i = 0; i < 8; ++i) {
        std::size_t got = 0;
        if (pipe.read(buffer_, got, 0.05) != UsbOutcome::ok) break;
    }
    std::vector<std::uint8_t> who;
    if (Status s = ask(pipe, viper::kWhoAmI, viper::kGet, 0, {}, &who); !s) return s;
    std::string words;
    for (std::uint8_t c : who) {
        if (c == 0) break;
        if (c >= 32 && c < 127) words += static_cast<char>(c);
        if (words.size() >= 64) break;
    }
    if (!words.empty()) name += " (" + words + ")";
    std::vector<std::uint8_t> payload;
    put_u32_le(payload, 2);  // centimetres
    put_u32_le(payload, 2);  // quaternions
    if (Status s = ask(pipe, viper::kUnits, viper::kSet, 0, payload); !s) return s;
    payload.clear();
    put_u32_le(payload, 0);
    const int axis = static_cast<int>(options.hemisphere) / 2;
    const float sign = static_cast<int>(options.hemisphere) % 2 == 0 ? 1.0f : -1.0f;
    for (int a = 0; a < 3; ++a) put_f32_le(payload, a == axis ? sign : 0.0f);
    if (Status s = ask(pipe, viper::kHemisphere, viper::kSet, 0xFFFFFFFFu, payload); !s) return s;
    constexpr double kRates[] = {30, 60, 120, 240, 480, 960};
    std::uint32_t rate = 0;
    while (rate < 5 && kRates[rate] < options.rate_hz) ++rate;
    payload.clear();
    put_u32_le(payload, rate);
    if (Status s = ask(pipe, viper::kFrameRate, viper::kSet, 0, payload); !s) return s;
    period_s_ = 1 / kRates[rate];
    return ask(pipe, viper::kContinuousPno, viper::kSet, 0, {});
}

bool ViperDriver::read(UsbPipe& pipe, TrackerReading& reading, UsbOutcome& outcome) {
    const auto take_newest = [&] {
        bool any = false;
        while (frames_.next(frame_)) {
            if (frame_.kind != viper::Frame::Kind::position) continue;
            std::uint32_t number = 0;
            TrackerReading fresh = reading;
            if (!viper::parse_positions(frame_.body, fresh, number)) {
                ++bad_sizes_;
                continue;
            }
            reading = fresh;
            reading.device_time_s = number * period_s_;
            any = true;
        }
        return any;
    };
    std::size_t got = 0;
    outcome = pipe.read(buffer_, got, 0.1);
    frames_.add({buffer_.data(), got});
    return take_newest();
}

}  // namespace

std::unique_ptr<UsbDriver> make_viper_driver() {
    return std::make_unique<ViperDriver>();
}

}  // namespace sonocase::runtime::inline tracking_devices
