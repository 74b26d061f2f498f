// SPDX-License-Identifier: Apache-2.0

// The driver of Polhemus Liberty and Patriot with an emulated device that streams two stations.
#include <gtest/gtest.h>

#include "runtime/tracking/devices/byte_stream.h"
#include "runtime/tracking/usb/usb_run.h"

namespace sonocase::runtime {
namespace {

class LibertyFirmware final : public Firmware {
  public:
    explicit LibertyFirmware(int unplug_at = -1) : unplug_at_(unplug_at) {}
    void on_out(const Bytes& transfer, DevicePort&) override {
        for (std::uint8_t c : transfer) {
            if (line_.empty() && c == 'p') {
                streaming_ = false;
                continue;
            }
            if (c != '\r') {
                line_ += static_cast<char>(c);
                continue;
            }
            if (line_ == "f1") binary_ = true;
            if (line_ == "U1") centimetres_ = true;
            if (line_ == "O*,8,9,11,3,7") listed_ = true;
            if (line_ == "c") streaming_ = binary_ && centimetres_ && listed_;
            line_.clear();
        }
    }
    void on_tick(double now_s, DevicePort& port) override {
        while (clock_.due(now_s)) {
            if (!streaming_) continue;
            if (static_cast<int>(frame_) == unplug_at_) {  // once all that was sent has arrived
                if (port.host_waits()) port.unplug();
                return;
            }
            Bytes both;
            for (int station : {1, 2}) {
                Bytes record = {'L', 'Y', static_cast<std::uint8_t>(station), 'C', ' ', 0, 40, 0};
                put_u32_le(record, frame_ * 4);
                put_u32_le(record, frame_);
                put_u32_le(record, 0);
                for (double v :
                     {9.0 + station, -5.0, 0.01 * frame_, 0.70710678, 0.0, 0.0, 0.70710678}) {
                    put_f32_le(record, static_cast<float>(v));
                }
                both.insert(both.end(), record.begin(), record.end());
            }
            ++frame_;
            port.send(both);
        }
    }

  private:
    int unplug_at_;
    std::string line_;
    bool binary_ = false, centimetres_ = false, listed_ = false, streaming_ = false;
    SendClock clock_{240};
    std::uint32_t frame_ = 0;
};

nlohmann::json run_liberty(std::uint16_t product,
                           double seconds,
                           int readings,
                           int unplug_at = -1) {
    DeviceSpec device;
    device.vendor = 0x0F44;
    device.product = product;
    device.endpoint_in = product == 0xEF12 ? 0x82 : 0x88;
    device.endpoint_out = product == 0xEF12 ? 0x02 : 0x04;
    return run_client(
        "liberty", device, [&] { return std::make_unique<LibertyFirmware>(unplug_at); }, seconds,
        readings);
}

TEST(LibertyOverUsb, StartsAndStreams) {
    for (const std::uint16_t product :
         std::initializer_list<std::uint16_t>{0xFF20, 0xEF12, 0xEF20}) {
        const auto seen = run_liberty(product, 20, 100);
        EXPECT_GE(seen["readings"].get<int>(), 100) << product;
        EXPECT_EQ(seen["bad_frames"], 0);
        expect_poses(seen);
    }
}

TEST(LibertyOverUsb, ReportsADeviceThatWaitsForFirmware) {
    const auto seen = run_liberty(0xFF21, 1, 0);
    EXPECT_TRUE(says(seen, "firmware")) << seen;
    EXPECT_EQ(seen["phases"].back(), "failed");
}

TEST(LibertyOverUsb, SurvivesBeingUnplugged) {
    const auto seen = run_liberty(0xFF20, 2, 0, 50);
    expect_unplug_reported(seen, 40);
}

}  // namespace
}  // namespace sonocase::runtime
