// SPDX-License-Identifier: Apache-2.0

// Runs tracker_client against an emulated device and reads what it saw.
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

inline void expect_poses(const nlohmann::json& seen) {
    ASSERT_EQ(seen["sensors"].size(), 2u) << seen;
    EXPECT_NEAR(seen["sensors"][0]["position"][0].get<double>(), 100, 1e-3);
    EXPECT_NEAR(seen["sensors"][1]["position"][0].get<double>(), 110, 1e-3);
    EXPECT_NEAR(seen["sensors"][0]["position"][1].get<double>(), -50, 1e-3);
    EXPECT_NEAR(seen["sensors"][0]["x_axis"][1].get<double>(), 1, 1e-6);
}

}  // namespace sonocase::testing
