// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/usb_pipe.h"

#include <libusb.h>

#include <cassert>
#include <chrono>
#include <cstdio>
#include <thread>
#include <utility>

namespace sonocase::runtime::inline tracking_devices {
namespace {

std::string place_of(libusb_device* device) {
    return "bus " + std::to_string(libusb_get_bus_number(device)) + ", device " +
           std::to_string(libusb_get_device_address(device));
}

UsbOutcome outcome_of(int code) {
    switch (code) {
        case 0: return UsbOutcome::ok;
        case LIBUSB_ERROR_TIMEOUT: return UsbOutcome::timeout;
        case LIBUSB_ERROR_PIPE: return UsbOutcome::stalled;
        case LIBUSB_ERROR_NO_DEVICE: return UsbOutcome::gone;
        default: return UsbOutcome::failed;
    }
}

unsigned milliseconds(double seconds) {
    // To libusb 0 means to wait without limit.
    return seconds <= 0.001 ? 1u : static_cast<unsigned>(seconds * 1000);
}

// The first bulk endpoints of interface 0; those given stay, and zeros stay if there are none.
void find_endpoints(libusb_device* device, std::uint8_t& in, std::uint8_t& out, int& packet) {
    libusb_config_descriptor* config = nullptr;
    if (libusb_get_active_config_descriptor(device, &config) != 0 &&
        libusb_get_config_descriptor(device, 0, &config) != 0) {
        return;
    }
    if (config->bNumInterfaces > 0 && config->interface[0].num_altsetting > 0) {
        const libusb_interface_descriptor& interface = config->interface[0].altsetting[0];
        for (int i = 0; i < interface.bNumEndpoints; ++i) {
            const libusb_endpoint_descriptor& e = interface.endpoint[i];
            if ((e.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) continue;
            const bool inward = e.bEndpointAddress & LIBUSB_ENDPOINT_IN;
            if (inward && in == 0) in = e.bEndpointAddress;
            if (!inward && (out == 0 || out == e.bEndpointAddress)) {
                out = e.bEndpointAddress;
                packet = e.wMaxPacketSize & 0x7FF;
            }
        }
    }
    libusb_free_config_descriptor(config);
}

}  // namespace

void wait_s(double seconds) {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

struct UsbPipe::Impl {
    libusb_device_handle* handle = nullptr;
    UsbId id;
    std::uint8_t in = 0, out = 0;
    int packet = 64;
    std::string place;
    ~Impl() {
        if (!handle) return;
        libusb_release_interface(handle, 0);
        libusb_close(handle);
    }
};

struct UsbBus::Impl {
    libusb_context* context = nullptr;
    ~Impl() {
        if (context) libusb_exit(context);
    }
};

UsbPipe::UsbPipe(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
UsbPipe::~UsbPipe() = default;
const UsbId& UsbPipe::id() const {
    return impl_->id;
}
std::string UsbPipe::place() const {
    return impl_->place;
}

UsbOutcome UsbPipe::write(std::span<const std::uint8_t> bytes, double timeout_s) {
    int sent = 0;
    // libusb's transfers are not const-correct; it only reads from an OUT buffer.
    auto* data = const_cast<unsigned char*>(bytes.data());
    const int size = static_cast<int>(bytes.size());
    const int code =
        libusb_bulk_transfer(impl_->handle, impl_->out, data, size, &sent, milliseconds(timeout_s));
    if (code != 0) return outcome_of(code);
    if (sent != size) return UsbOutcome::failed;
    if (size > 0 && size % impl_->packet == 0) {
        return outcome_of(libusb_bulk_transfer(impl_->handle, impl_->out, data, 0, &sent,
                                               milliseconds(timeout_s)));
    }
    return UsbOutcome::ok;
}

UsbOutcome UsbPipe::read(std::span<std::uint8_t> buffer, std::size_t& got, double timeout_s) {
    assert(buffer.size() % 1024 == 0);
    int received = 0;
    const int code =
        libusb_bulk_transfer(impl_->handle, impl_->in, buffer.data(),
                             static_cast<int>(buffer.size()), &received, milliseconds(timeout_s));
    got = received > 0 ? static_cast<std::size_t>(received) : 0;
    return outcome_of(code);
}

UsbOutcome UsbPipe::clear_halt() {
    return outcome_of(libusb_clear_halt(impl_->handle, impl_->in));
}

Result<std::unique_ptr<UsbBus>> UsbBus::open() {
    auto bus = std::unique_ptr<UsbBus>(new UsbBus);
    bus->impl_ = std::make_unique<Impl>();
    const int code = libusb_init(&bus->impl_->context);
    if (code != 0) {
        bus->impl_->context = nullptr;
        return Error{
            Message("USB cannot be used: {}", {libusb_strerror(static_cast<libusb_error>(code))}),
            "", "check that /dev/bus/usb exists"};
    }
    return bus;
}

UsbBus::~UsbBus() = default;

namespace {

// The devices of one family that are plugged in.
struct Found {
    int count = 0;                    // devices whose id is in the list
    libusb_device* chosen = nullptr;  // the first that works; otherwise one that needs firmware
    UsbId id;                         // that of `chosen`
    std::string relative;  // "vendor:product" of another device of the maker; may be empty
};

Found find_devices(std::span<libusb_device*> devices, std::span<const UsbId> ids) {
    Found found;
    for (libusb_device* device : devices) {
        libusb_device_descriptor descriptor;
        if (libusb_get_device_descriptor(device, &descriptor) != 0) continue;
        bool known = false;
        for (const UsbId& id : ids) {
            if (id.vendor != descriptor.idVendor || id.product != descriptor.idProduct) continue;
            known = true;
            ++found.count;
            if (!found.chosen || (found.id.needs_firmware && !id.needs_firmware)) {
                found.chosen = device;
                found.id = id;
            }
        }
        if (!known && descriptor.idVendor == ids.front().vendor) {
            char text[16];
            std::snprintf(text, sizeof text, "%04x:%04x", descriptor.idVendor,
                          descriptor.idProduct);
            found.relative = text;
        }
    }
    return found;
}

Error not_found(const std::string& family, const std::string& relative) {
    if (relative.empty())
        return {Message("No {} is plugged in", {family}), "", "plug it in and switch it on"};
    return {Message("A device of the same maker ({}) is plugged in, but it is not a {}",
                    {relative, family}),
            "", Message("choose another tracker, or plug the {} in", {family})};
}

// Opens and claims a device.
Result<std::unique_ptr<UsbPipe::Impl>> open_device(libusb_device* device, const UsbId& id) {
    auto impl = std::make_unique<UsbPipe::Impl>();
    impl->id = id;
    impl->place = place_of(device);
    const Message which("The {} at {}", {id.name, impl->place});
    const int opened = libusb_open(device, &impl->handle);
    if (opened != 0) impl->handle = nullptr;
    if (opened == LIBUSB_ERROR_ACCESS) {
        return Error{Message("No permission for the {} at {}", {id.name, impl->place}), "",
                     "install the rule 60-sonocase-trackers.rules in /etc/udev/rules.d, run "
                     "udevadm control --reload, then replug it"};
    }
    if (opened != 0) {
        return Error{Message("{} cannot be opened: {}",
                             {which, libusb_strerror(static_cast<libusb_error>(opened))}),
                     "", "replug it"};
    }
    if (libusb_kernel_driver_active(impl->handle, 0) == 1)
        libusb_detach_kernel_driver(impl->handle, 0);
    const int claimed = libusb_claim_interface(impl->handle, 0);
    impl->in = id.endpoint_in;
    impl->out = id.endpoint_out;
    find_endpoints(device, impl->in, impl->out, impl->packet);
    if (impl->packet <= 0) impl->packet = 64;
    if (claimed != 0) {
        return Error{Message(claimed == LIBUSB_ERROR_BUSY ? "{} is in use by another program"
                                                          : "{} cannot be claimed",
                             {which}),
                     "", "close the other program, or replug it"};
    }
    if (impl->in == 0 || impl->out == 0)
        return Error{Message("{} has no bulk endpoints", {which}), "",
                     "check that it is the device it says"};
    return impl;
}

}  // namespace

Result<std::unique_ptr<UsbPipe>> UsbBus::connect(std::span<const UsbId> ids, int& found) {
    found = 0;
    libusb_device** list = nullptr;
    const ssize_t count = libusb_get_device_list(impl_->context, &list);
    if (count < 0) {
        return Error{"the USB devices cannot be listed", "", "check that /dev/bus/usb is readable"};
    }
    const Found seen = find_devices({list, static_cast<std::size_t>(count)}, ids);
    found = seen.count;
    Result<std::unique_ptr<UsbPipe>> result = not_found(ids.front().name, seen.relative);
    if (seen.chosen && seen.id.needs_firmware) {
        result = Error{
            Message("The {} at {} waits for its firmware", {seen.id.name, place_of(seen.chosen)}),
            "", "load it with the maker's program, then replug it"};
    } else if (seen.chosen) {
        auto opened = open_device(seen.chosen, seen.id);
        if (opened)
            result = std::unique_ptr<UsbPipe>(new UsbPipe(std::move(*opened)));
        else
            result = opened.error();
    }
    libusb_free_device_list(list, 1);
    return result;
}

}  // namespace sonocase::runtime::inline tracking_devices
