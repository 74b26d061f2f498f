// SPDX-License-Identifier: Apache-2.0

// The driver of NDI 3D Guidance with an emulated device that has two sensors.
#include <gtest/gtest.h>

#include "runtime/tracking/usb/usb_run.h"

namespace sonocase::runtime {
namespace {

class GuidanceFirmware final : public Firmware {
  public:
    explicit GuidanceFirmware(int unplug_at = -1,
                              bool no_transmitter = false,
                              int error = 0,
                              int slip_at = -1)
        : unplug_at_(unplug_at),
          no_transmitter_(no_transmitter),
          error_(error),
          slip_at_(slip_at) {}
    void on_out(const Bytes& request, DevicePort& port) override {
        const auto is = [&](std::initializer_list<int> bytes) {
            return request.size() == bytes.size() &&
                   std::equal(bytes.begin(), bytes.end(), request.begin(),
                              [](int a, std::uint8_t b) { return a < 0 || a == b; });
        };
        if (is({0x4F, 0x03})) return port.send({1, 0});  // 72 inches
        if (is({0x4F, 0x0A})) return port.send({static_cast<std::uint8_t>(error_)});
        if (is({0xF1, 0x4F, 0x1B})) {
            return port.send(no_transmitter_ ? Bytes{0, 0} : Bytes{0x34, 0x12});
        }
        if (is({-1, 0x4F, 0x1A})) return port.send(request[0] <= 0xF2 ? Bytes{7, 1} : Bytes{0, 0});
        if (is({-1, 0x59})) angles_ = true;
        if (is({-1, 0x42})) {
            if (polls_++ == unplug_at_) return port.unplug();
            Bytes record;
            const double inches = request[0] == 0xF1 ? 9 : -18;
            for (double part : {inches / 72, -inches / 72, 0.0, 0.5, 0.0, 0.0}) {
                const auto bits =
                    static_cast<std::uint16_t>(static_cast<std::int16_t>(part * 32768)) >> 2;
                record.push_back(bits & 0x7F);
                record.push_back(bits >> 7 & 0x7F);
            }
            record[0] |= 0x80;
            if (polls_ == slip_at_) record.insert(record.begin(), 0x11);  // out of phase
            if (angles_) port.send(record);
        }
    }
    void on_tick(double, DevicePort&) override {}

  private:
    int unplug_at_;
    bool no_transmitter_;
    int error_;
    int slip_at_;
    bool angles_ = false;
    int polls_ = 0;
};

nlohmann::json run_guidance(double seconds,
                            int readings,
                            const std::function<std::unique_ptr<Firmware>()>& make) {
    DeviceSpec device;
    device.vendor = 0x04B4;
    device.product = 0x1005;
    device.endpoint_in = 0x86;
    return run_client("3dg", device, make, seconds, readings);
}

TEST(GuidanceOverUsb, StartsAndPolls) {
    const auto seen = run_guidance(20, 100, [] { return std::make_unique<GuidanceFirmware>(); });
    EXPECT_GE(seen["readings"].get<int>(), 100);
    EXPECT_EQ(seen["bad_frames"], 0);
    ASSERT_EQ(seen["sensors"].size(), 2u);
    // 0.3 mm: half a step of 14 bits over 72 inches is 0.06 mm, and words are truncated, not
    // rounded.
    EXPECT_NEAR(seen["sensors"][0]["position"][0].get<double>(), 9 * 25.4, 0.3);
    EXPECT_NEAR(seen["sensors"][1]["position"][0].get<double>(), -18 * 25.4, 0.3);
    EXPECT_NEAR(seen["sensors"][0]["x_axis"][1].get<double>(), 1, 1e-3);
}

TEST(GuidanceOverUsb, FindsItsPhaseAgain) {
    const auto seen =
        run_guidance(20, 60, [] { return std::make_unique<GuidanceFirmware>(-1, false, 0, 21); });
    EXPECT_GE(seen["readings"].get<int>(), 60);
    EXPECT_GE(seen["bad_frames"].get<int>(), 1);
    EXPECT_NEAR(seen["sensors"][0]["position"][0].get<double>(), 9 * 25.4, 0.3);
}

TEST(GuidanceOverUsb, ReportsAMissingTransmitterAndAFault) {
    auto seen = run_guidance(2, 0, [] { return std::make_unique<GuidanceFirmware>(-1, true); });
    EXPECT_TRUE(says(seen, "transmitter")) << seen;
    seen = run_guidance(2, 0, [] { return std::make_unique<GuidanceFirmware>(-1, false, 21); });
    EXPECT_TRUE(says(seen, "error 21")) << seen;
    EXPECT_EQ(seen["readings"], 0);
}

TEST(GuidanceOverUsb, SurvivesBeingUnplugged) {
    const auto seen = run_guidance(3, 0, [] { return std::make_unique<GuidanceFirmware>(41); });
    expect_unplug_reported(seen, 15);
}

}  // namespace
}  // namespace sonocase::runtime
