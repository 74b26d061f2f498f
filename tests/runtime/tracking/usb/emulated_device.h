// SPDX-License-Identifier: Apache-2.0

// An emulated USB device for an unmodified libusb in another process: umockdev gives that process a
// /sys and a /dev, and its requests to the kernel are answered here. The process that emulates the
// device must run under umockdev-wrapper.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace sonocase::testing {

using Bytes = std::vector<std::uint8_t>;

// What the device's firmware may do; called with the device's lock held.
class DevicePort {
  public:
    virtual ~DevicePort() = default;
    virtual void send(
        const Bytes& transfer) = 0;  // completes the next IN transfer with these bytes
    virtual void stall() = 0;        // the next IN transfer ends in EPIPE
    virtual void unplug() = 0;
    virtual bool host_waits() const = 0;  // an IN transfer is pending
};

class Firmware {
  public:
    virtual ~Firmware() = default;
    virtual void on_out(const Bytes& transfer, DevicePort& port) = 0;
    // Called about every 0.2 ms, with the seconds since the device was made.
    virtual void on_tick(double now_s, DevicePort& port) = 0;
};

struct DeviceSpec {
    std::uint16_t vendor = 0, product = 0;
    std::uint8_t endpoint_in = 0x81, endpoint_out = 0x02;
    bool second_alike = false;   // another one of the same kind is plugged in too
    bool no_permission = false;  // its node cannot be opened
    double replug_after_s = -1;  // from unplugging to plugging in again; < 0: never
};

struct ClientResult {
    int status = -1;  // exit status, or 128 + signal
    std::string out;  // what it printed
};

// Plugs the device in, runs the program to its end, and unplugs the device. make_firmware is called
// each time that it is plugged in.
ClientResult run_with_device(const DeviceSpec& spec,
                             const std::function<std::unique_ptr<Firmware>()>& make_firmware,
                             const std::vector<std::string>& command);

}  // namespace sonocase::testing
