// SPDX-License-Identifier: Apache-2.0

// The Polhemus Viper's driver with an emulated device and an unmodified libusb, in a process of its
// own.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <iostream>

#include "formats/base/constants.h"
#include "formats/calibration/calibration.h"
#include "formats/files/load_save.h"
#include "runtime/tracking/devices/byte_stream.h"
#include "runtime/tracking/devices/viper_protocol.h"
#include "runtime/tracking/usb/usb_run.h"
#include "support/paths.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::ClientResult;
using sonocase::testing::run_with_device;

// What goes wrong, and at which position frame; -1: never.
struct Trouble {
    int not_ready = 0;     // NAKs "not ready" before the first real answer
    bool refuses = false;  // always NAKs the units command
    bool mute = false;     // answers nothing
    int bad_crc_every = -1;
    int stall_at = -1;
    int silent_at = -1;
    int unplug_at = -1;
    bool split = false;  // frames in pieces of 29 bytes
    int merge = 1;       // number of frames in one transfer
    bool already_streaming = false;
    double hz = 240;
};

class ViperFirmware final : public Firmware {
  public:
    explicit ViperFirmware(const Trouble& trouble)
        : trouble_(trouble), streaming_(trouble.already_streaming) {}

    void on_out(const Bytes& transfer, DevicePort& port) override {
        if (trouble_.mute) return;
        viper::FrameReader reader;
        reader.add(transfer);
        viper::Frame frame;
        viper::Reply command;
        if (!reader.next(frame) || !viper::parse_reply(frame.body, command)) return;
        Bytes payload;
        std::uint32_t action = viper::kAck;
        const auto nak = [&](std::uint32_t code, const char* words) {
            action = viper::kNak;
            put_u32_le(payload, code);
            const std::size_t at = payload.size();
            payload.resize(at + 128 + 48);
            std::memcpy(payload.data() + at, words, std::strlen(words));
        };
        if (command.command != viper::kContinuousPno && trouble_.not_ready > 0) {
            --trouble_.not_ready;
            nak(1, "WARMING UP");
        } else if (trouble_.refuses && command.command == viper::kUnits) {
            nak(2, "UNITS NOT UNDERSTOOD");
        } else {
            switch (command.command) {
                case viper::kWhoAmI:
                    payload.assign(64 + 4 * 32, 0);
                    std::memcpy(payload.data(), "VIPER 4 SN 1234", 15);
                    break;
                case viper::kUnits:
                    units_ok_ = command.payload.size() == 8 && u32_le(command.payload, 0) == 2 &&
                                u32_le(command.payload, 4) == 2;
                    break;
                case viper::kFrameRate:
                    rate_ok_ = command.payload.size() == 4 && u32_le(command.payload, 0) == 3;
                    break;
                case viper::kContinuousPno: streaming_ = command.action == viper::kSet; break;
                default: break;
            }
        }
        Bytes answer = viper::encode(command.command, action, 0, 0, payload);
        port.send(answer);
    }

    void on_tick(double now_s, DevicePort& port) override {
        while (clock_.due(now_s)) {
            if (!streaming_) continue;
            const int n = static_cast<int>(number_++);
            if (n == trouble_.unplug_at) {
                port.unplug();
                return;
            }
            if (trouble_.silent_at >= 0 && n >= trouble_.silent_at) continue;
            if (n == trouble_.stall_at) {
                port.stall();
                continue;
            }
            Bytes frame = position(n);
            if (trouble_.bad_crc_every > 0 && n % trouble_.bad_crc_every == 0) frame[20] ^= 1;
            pending_.insert(pending_.end(), frame.begin(), frame.end());
            if (++merged_ < trouble_.merge) continue;
            merged_ = 0;
            if (trouble_.split) {
                for (std::size_t at = 0; at < pending_.size(); at += 29) {
                    const std::size_t end = std::min(at + 29, pending_.size());
                    port.send(Bytes(pending_.begin() + static_cast<std::ptrdiff_t>(at),
                                    pending_.begin() + static_cast<std::ptrdiff_t>(end)));
                }
            } else {
                port.send(pending_);
            }
            pending_.clear();
        }
    }

  private:
    Bytes position(int n) const {
        Bytes out = {'V', 'P', 'R', 'P'};
        put_u32_le(out, 16 + 64 + 4);
        for (std::uint32_t word : {0u, static_cast<std::uint32_t>(n), 0u, 2u})
            put_u32_le(out, word);
        const double half = 0.25 * kPi;  // a quarter turn about z
        for (std::uint32_t sensor : {0u, 1u}) {
            // Wrong units show as wrong numbers.
            const double unit = units_ok_ && rate_ok_ ? 1 : 100;
            put_u32_le(out, sensor | 2u << 8 | 2u << 10);
            for (double v : {unit * (10.0 + sensor), -5.0, 0.001 * n, std::cos(half), 0.0, 0.0,
                             std::sin(half)}) {
                put_f32_le(out, static_cast<float>(v));
            }
        }
        put_u32_le(out, viper::crc16(out));
        return out;
    }

    Trouble trouble_;
    bool streaming_ = false, units_ok_ = false, rate_ok_ = false;
    SendClock clock_{trouble_.hz};
    std::uint32_t number_ = 0;
    int merged_ = 0;
    Bytes pending_;
};

nlohmann::json run_viper(const Trouble& trouble,
                         double seconds,
                         int readings = 0,
                         DeviceSpec device = {}) {
    device.vendor = 0x0F44;
    device.product = 0xBF01;
    return run_client(
        "viper", device, [&] { return std::make_unique<ViperFirmware>(trouble); }, seconds,
        readings);
}

TEST(ViperOverUsb, StartsAndStreamsAt240Hz) {
    const auto seen = run_viper({}, 20, 480);
    EXPECT_GE(seen["readings"].get<int>(), 480);
    EXPECT_EQ(seen["bad_frames"], 0);
    EXPECT_EQ(seen["connects"], 1);
    EXPECT_GT(seen["rate_hz"].get<double>(), 100);  // 240 on a machine that is not busy
    EXPECT_EQ(seen["device"], "Polhemus Viper (VIPER 4 SN 1234)");
    expect_poses(seen);
}

TEST(ViperOverUsb, StartsADeviceThatIsStreamingAlready) {
    Trouble trouble;
    trouble.already_streaming = true;
    const auto seen = run_viper(trouble, 20, 50);
    EXPECT_GE(seen["readings"].get<int>(), 50);
    expect_poses(seen);
}

TEST(ViperOverUsb, WaitsForADeviceThatIsNotReady) {
    Trouble trouble;
    trouble.not_ready = 3;
    const auto seen = run_viper(trouble, 20, 20);
    EXPECT_GE(seen["readings"].get<int>(), 20);
}

TEST(ViperOverUsb, ReportsWhatADeviceRefuses) {
    Trouble trouble;
    trouble.refuses = true;
    const auto seen = run_viper(trouble, 2);
    EXPECT_EQ(seen["readings"], 0);
    EXPECT_TRUE(says(seen, "UNITS NOT UNDERSTOOD")) << seen;
}

TEST(ViperOverUsb, ReportsADeviceThatDoesNotAnswer) {
    Trouble trouble;
    trouble.mute = true;
    const auto seen = run_viper(trouble, 4);
    EXPECT_EQ(seen["readings"], 0);
    EXPECT_TRUE(says(seen, "does not answer")) << seen;
}

TEST(ViperOverUsb, CountsAndSkipsFramesWithABadChecksum) {
    Trouble trouble;
    trouble.bad_crc_every = 10;
    const auto seen = run_viper(trouble, 20, 200);
    EXPECT_GE(seen["readings"].get<int>(), 200);
    EXPECT_GE(seen["bad_frames"].get<int>(), 20);
    EXPECT_EQ(seen["lost"], 0);
    expect_poses(seen);
}

TEST(ViperOverUsb, ReadsSplitAndMergedTransfers) {
    for (int merge : {1, 3}) {
        Trouble trouble;
        trouble.split = true;
        trouble.hz = 60;  // of four transfers each: the emulation manages a thousand per second
        trouble.merge = merge;
        const auto seen = run_viper(trouble, 20, 40);
        EXPECT_GE(seen["readings"].get<int>(), 40);
        EXPECT_EQ(seen["bad_frames"], 0);
        expect_poses(seen);
    }
    Trouble trouble;
    trouble.merge = 4;
    const auto seen = run_viper(trouble, 20, 30);
    EXPECT_EQ(seen["bad_frames"], 0);
    expect_poses(seen);
}

TEST(ViperOverUsb, GoesOnAfterAStall) {
    Trouble trouble;
    trouble.stall_at = 40;
    const auto seen = run_viper(trouble, 20, 120);
    EXPECT_GE(seen["readings"].get<int>(), 120);
    EXPECT_EQ(seen["connects"], 1);
}

TEST(ViperOverUsb, StartsADeviceAgainThatFallsSilent) {
    Trouble trouble;
    trouble.silent_at = 40;
    const auto seen = run_viper(trouble, 3);
    EXPECT_GE(seen["connects"].get<int>(), 2) << seen;
    EXPECT_TRUE(says(seen, "No reading comes")) << seen;
}

TEST(ViperOverUsb, SurvivesBeingUnplugged) {
    Trouble trouble;
    trouble.unplug_at = 40;
    const auto seen = run_viper(trouble, 2.2);
    expect_unplug_reported(seen, 10);  // merged where the machine is busy
    EXPECT_LE(seen["readings"].get<int>(), 40);
    EXPECT_EQ(seen["phases"].back(), "searching");
}

TEST(ViperOverUsb, ComesBackWhenPluggedInAgain) {
    Trouble trouble;
    trouble.unplug_at = 40;
    DeviceSpec device;
    device.vendor = 0x0F44;
    device.product = 0xBF01;
    device.replug_after_s = 0.3;
    // It is pulled out once, and then stays: on a busy machine fewer than its 40 readings count,
    // and the rest comes afterwards, however long that takes.
    const auto make = [&, plugged = 0]() mutable {
        return std::make_unique<ViperFirmware>(plugged++ == 0 ? trouble : Trouble{});
    };
    constexpr double kHangsS = 300;
    const auto seen = run_client("viper", device, make, kHangsS, 70);
    EXPECT_GE(seen["readings"].get<int>(), 70);
    EXPECT_GE(seen["connects"].get<int>(), 2);  // more where the emulation was halted for long
    EXPECT_TRUE(says(seen, "unplugged")) << seen;
    expect_poses(seen);
}

// From device to file through driver, calibration and renderer. The times are printed for the
// accuracy pages and not tested.
TEST(ViperOverUsb, DrivesThePlayer) {
    const sonocase::testing::TemporaryFolder folder;
    ASSERT_TRUE(save_bundle(sonocase::testing::small_case(), folder / "cylinder.sonocase"));
    // The probe stands still at (100, -50, 0) with a quarter turn: the mannequin is put under it.
    const Rigid world_from_probe{rotation_about({0, 0, 1}, 0.5 * kPi), {100, -50, 0}};
    const Rigid mannequin_from_probe{rotation_about({1, 0, 0}, kPi), {0, 0, 59}};
    Calibration mannequin;
    mannequin.kind = "mannequin";
    mannequin.sensor_from_tool = world_from_probe * inverse(mannequin_from_probe);
    ASSERT_TRUE(save_calibration(mannequin, folder / "mannequin.json"));
    DeviceSpec device;
    device.vendor = 0x0F44;
    device.product = 0xBF01;
    const ClientResult result = run_with_device(
        device, [] { return std::make_unique<ViperFirmware>(Trouble{.hz = 120}); },
        {SONOCASE_BIN "/sonoplay", folder / "cylinder.sonocase", "--headless", "--tracker", "viper",
         "--model", "paper", "--frames", "240", "--calibration", folder / "mannequin.json",
         "--stats", "-", "--out", folder / "frames"});
    ASSERT_EQ(result.status, 0) << result.out;
    const auto stats = nlohmann::json::parse(result.out, nullptr, false);
    ASSERT_TRUE(stats.is_object()) << result.out;
    EXPECT_EQ(stats["frames"], 240);
    std::cout << "pose to pixels, ms: " << stats["pose_to_pixel_ms"] << "\n";
    // A picture of tissue, not of air.
    EXPECT_GT(sonocase::testing::read_text(folder / "frames/frame_00239.png").size(), 20000u);
}

// The second sensor is on the mannequin, which moves with it: only relative to it does the probe
// stand on the skin.
TEST(ViperOverUsb, AReferenceOnTheMannequinCountsLive) {
    const sonocase::testing::TemporaryFolder folder;
    ASSERT_TRUE(save_bundle(sonocase::testing::small_case(), folder / "cylinder.sonocase"));
    const Matrix3 turn = rotation_about({0, 0, 1}, 0.5 * kPi);
    const Rigid world_from_probe{turn, {100, -50, 0}}, world_from_reference{turn, {110, -50, 0}};
    const Rigid mannequin_from_probe{rotation_about({1, 0, 0}, kPi), {0, 0, 59}};
    Calibration mannequin;
    mannequin.kind = "mannequin";
    mannequin.sensor_from_tool =
        inverse(world_from_reference) * world_from_probe * inverse(mannequin_from_probe);
    ASSERT_TRUE(save_calibration(mannequin, folder / "mannequin.json"));
    DeviceSpec device;
    device.vendor = 0x0F44;
    device.product = 0xBF01;
    const auto last_picture = [&](const std::string& role) {
        const ClientResult result = run_with_device(
            device, [] { return std::make_unique<ViperFirmware>(Trouble{.hz = 120}); },
            {SONOCASE_BIN "/sonoplay", folder / "cylinder.sonocase", "--headless", "--tracker",
             "viper", "--tool", role, "--model", "paper", "--frames", "60", "--calibration",
             folder / "mannequin.json", "--out", folder / "frames"});
        EXPECT_EQ(result.status, 0) << result.out;
        return sonocase::testing::read_text(folder / "frames/frame_00059.png").size();
    };
    const std::size_t of_air = last_picture("needle=2"), of_tissue = last_picture("reference=2");
    EXPECT_GT(of_tissue, 20000u);
    EXPECT_LT(of_air, of_tissue / 2);
}

TEST(ViperOverUsb, ReportsTwoOfAKind) {
    DeviceSpec device;
    device.second_alike = true;
    const auto seen = run_viper({}, 20, 20, device);
    EXPECT_GE(seen["readings"].get<int>(), 20);
    EXPECT_TRUE(says(seen, "Two are plugged in")) << seen;
}

TEST(ViperOverUsb, WithoutPermissionNamesTheRuleAndHowToInstallIt) {
    DeviceSpec device;
    device.no_permission = true;
    const auto seen = run_viper({}, 1, 0, device);
    EXPECT_TRUE(says(seen, "No permission for the Polhemus Viper")) << seen;
    EXPECT_TRUE(says(seen, "60-sonocase-trackers.rules in /etc/udev/rules.d")) << seen;
    EXPECT_TRUE(says(seen, "udevadm control --reload")) << seen;
    EXPECT_EQ(seen["phases"].back(), "failed");
    EXPECT_EQ(seen["readings"], 0);
}

TEST(ViperOverUsb, NamesARelativeThatItCannotUse) {
    DeviceSpec device;
    device.vendor = 0x0F44;
    device.product = 0x0001;
    const auto seen = run_client(
        "viper", device, [] { return std::make_unique<ViperFirmware>(Trouble{}); }, 0.5);
    EXPECT_TRUE(says(seen, "0f44:0001")) << seen;
    EXPECT_EQ(seen["phases"].back(), "searching");
}

}  // namespace
}  // namespace sonocase::runtime
