// SPDX-License-Identifier: Apache-2.0

// What the tests of USB drivers share: running tracker_client with an emulated device, and reading
// what it saw.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "runtime/tracking/usb/emulated_device.h"
#include "support/paths.h"

namespace sonocase::testing {

inline nlohmann::json run_client(const char* spec,
                                 const DeviceSpec& device,
                                 const std::function<std::unique_ptr<Firmware>()>& make,
                                 double seconds,
                                 int readings = 0) {
    std::vector<std::string> command = {SONOCASE_BIN "/tracker_client", spec,
                                        std::to_string(seconds)};
    if (readings > 0) command.push_back(std::to_string(readings));
    const ClientResult result = run_with_device(device, make, command);
    EXPECT_EQ(result.status, 0) << result.out;
    auto json = nlohmann::json::parse(result.out, nullptr, false);
    EXPECT_TRUE(json.is_object()) << result.out;
    return json;
}

inline bool says(const nlohmann::json& seen, const char* words) {
    return seen["messages"].dump().find(words) != std::string::npos;
}

// For a run in which the device was unplugged: readings came before, and the user was told.
inline void expect_unplug_reported(const nlohmann::json& seen, int min_readings) {
    EXPECT_GE(seen["readings"].get<int>(), min_readings);
    EXPECT_TRUE(says(seen, "unplugged")) << seen;
}

inline void expect_poses(const nlohmann::json& seen) {
    ASSERT_EQ(seen["sensors"].size(), 2u) << seen;
    EXPECT_NEAR(seen["sensors"][0]["position"][0].get<double>(), 100, 1e-3);
    EXPECT_NEAR(seen["sensors"][1]["position"][0].get<double>(), 110, 1e-3);
    EXPECT_NEAR(seen["sensors"][0]["position"][1].get<double>(), -50, 1e-3);
    EXPECT_NEAR(seen["sensors"][0]["x_axis"][1].get<double>(), 1, 1e-6);
}

// When an emulated device sends: every 1/hz from its first tick on.
class SendClock {
  public:
    explicit SendClock(double hz) : period_s_(1 / hz) {}
    // True once per period that has passed; to be called until it is false.
    bool due(double now_s) {
        if (next_s_ < 0) next_s_ = now_s;
        if (now_s < next_s_) return false;
        next_s_ += period_s_;
        return true;
    }

  private:
    double period_s_, next_s_ = -1;
};

}  // namespace sonocase::testing

// What every test of a driver uses.
namespace sonocase::runtime {
using testing::Bytes;
using testing::DevicePort;
using testing::DeviceSpec;
using testing::expect_poses;
using testing::expect_unplug_reported;
using testing::Firmware;
using testing::run_client;
using testing::says;
using testing::SendClock;
}  // namespace sonocase::runtime
