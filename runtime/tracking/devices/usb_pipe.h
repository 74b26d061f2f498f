// SPDX-License-Identifier: Apache-2.0

// One claimed USB device with a bulk endpoint each way. libusb stays in the .cpp file; on a page
// the same functions are those of runtime/web/program/usb_exports.cpp.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::runtime::inline tracking_devices {

struct UsbId {
    std::uint16_t vendor = 0, product = 0;
    const char* name = "";
    bool needs_firmware = false;  // is listed, but does nothing until firmware is uploaded
    std::uint8_t endpoint_in = 0,
                 endpoint_out = 0;  // 0: the first bulk ones that the device describes
};

// Waits as reading and writing do: a thread sleeps, a page lets others run.
void wait_s(double seconds);

enum class UsbOutcome { ok, timeout, stalled, gone, failed };

class UsbPipe {
  public:
    ~UsbPipe();
    UsbPipe(const UsbPipe&) = delete;
    UsbPipe& operator=(const UsbPipe&) = delete;

    // Writes every byte or reports why not. A zero-length packet follows a full last packet,
    // because the device would wait otherwise.
    UsbOutcome write(std::span<const std::uint8_t> bytes, double timeout_s);
    // Reads what comes within the time; `got` may be above 0 with any outcome. The buffer's size
    // must be a multiple of 1024 bytes, so that no packet overflows it.
    UsbOutcome read(std::span<std::uint8_t> buffer, std::size_t& got, double timeout_s);
    UsbOutcome clear_halt();
    const UsbId& id() const;
    std::string place() const;  // "bus 1, device 2"

    struct Impl;

  private:
    friend class UsbBus;
    explicit UsbPipe(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// The devices that are plugged in.
class UsbBus {
  public:
    static Result<std::unique_ptr<UsbBus>> open();
    ~UsbBus();
    UsbBus(const UsbBus&) = delete;
    UsbBus& operator=(const UsbBus&) = delete;

    // Opens and claims the first device whose id is in the list. `found` counts those plugged in.
    // Errors are whole sentences: none is plugged in, firmware is missing, another device of the
    // maker that is not supported, no permission, in use.
    Result<std::unique_ptr<UsbPipe>> connect(std::span<const UsbId> ids, int& found);

    struct Impl;

  private:
    UsbBus() = default;
    std::unique_ptr<Impl> impl_;
};

}  // namespace sonocase::runtime::inline tracking_devices
