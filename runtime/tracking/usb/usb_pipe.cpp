// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/usb/usb_pipe.h"

#include <libusb.h>

#include <cassert>
#include <cstdio>
#include <utility>

namespace sonocase::runtime {
namespace {

std::string place_of(libusb_device* device) {
    return "bus " + std::to_string(libusb_get_bus_number(device)) + ", device " +
           std::to_string(libusb_get_device_address(device));
}

UsbOutcome outcome_of(int code) {
    switch (code) {
        case 0:
            return UsbOutcome::ok;
        case LIBUSB_ERROR_TIMEOUT:
            return UsbOutcome::timeout;
        case LIBUSB_ERROR_PIPE:
            return UsbOutcome::stalled;
        case LIBUSB_ERROR_NO_DEVICE:
            return UsbOutcome::gone;
        default:
            return UsbOutcome::failed;
    }
}

unsigned milliseconds(double seconds) {
    // libusb takes 0 for "for ever".
    return seconds <= 0.001 ? 1u : static_cast<unsigned>(seconds * 1000);
}

// First bulk endpoints of interface 0; zeros where there are none.
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
            std::string("USB cannot be used: ") + libusb_strerror(static_cast<libusb_error>(code)),
            "", "check that /dev/bus/usb exists"};
    }
    return bus;
}

UsbBus::~UsbBus() = default;

Result<std::unique_ptr<UsbPipe>> UsbBus::connect(std::span<const UsbId> ids, int& found) {
    found = 0;
    libusb_device** list = nullptr;
    const ssize_t count = libusb_get_device_list(impl_->context, &list);
    if (count < 0) {
        return Error{"the USB devices cannot be listed", "", "check that /dev/bus/usb is readable"};
    }
    const std::string family = ids.front().name;
    std::string relative;
    libusb_device* chosen = nullptr;
    UsbId chosen_id;
    for (ssize_t i = 0; i < count; ++i) {
        libusb_device_descriptor descriptor;
        if (libusb_get_device_descriptor(list[i], &descriptor) != 0) continue;
        bool known = false;
        for (const UsbId& id : ids) {
            if (id.vendor != descriptor.idVendor || id.product != descriptor.idProduct) continue;
            known = true;
            ++found;
            if (!chosen || (chosen_id.needs_firmware && !id.needs_firmware)) {
                chosen = list[i];
                chosen_id = id;
            }
        }
        if (!known && descriptor.idVendor == ids.front().vendor) {
            char text[16];
            std::snprintf(text, sizeof text, "%04x:%04x", descriptor.idVendor,
                          descriptor.idProduct);
            relative = text;
        }
    }
    Result<std::unique_ptr<UsbPipe>> result =
        Error{"No " + family + " is plugged in", "", "plug it in and switch it on"};
    if (!chosen) {
        if (!relative.empty()) {
            result = Error{
                "A device of the same maker (" + relative + ") is plugged in, and is no " + family,
                "", "choose another tracker, or plug the " + family + " in"};
        }
    } else if (chosen_id.needs_firmware) {
        result = Error{std::string("The ") + chosen_id.name + " at " + place_of(chosen) +
                           " waits for its firmware",
                       "", "load it with the maker's program, then replug it"};
    } else {
        auto impl = std::make_unique<UsbPipe::Impl>();
        impl->id = chosen_id;
        impl->place = place_of(chosen);
        const int opened = libusb_open(chosen, &impl->handle);
        int claimed = 0;
        if (opened == 0) {
            if (libusb_kernel_driver_active(impl->handle, 0) == 1) {
                libusb_detach_kernel_driver(impl->handle, 0);
            }
            claimed = libusb_claim_interface(impl->handle, 0);
        }
        impl->in = chosen_id.endpoint_in;
        impl->out = chosen_id.endpoint_out;
        find_endpoints(chosen, impl->in, impl->out, impl->packet);
        if (impl->packet <= 0) impl->packet = 64;
        const std::string which = std::string("The ") + chosen_id.name + " at " + impl->place;
        if (opened == LIBUSB_ERROR_ACCESS) {
            impl->handle = nullptr;
            result = Error{
                "No permission for the " + std::string(chosen_id.name) + " at " + impl->place, "",
                "install the rule 60-sonocase-trackers.rules in /etc/udev/rules.d, run "
                "udevadm control --reload, then replug it"};
        } else if (opened != 0) {
            impl->handle = nullptr;
            result = Error{
                which + " cannot be opened: " + libusb_strerror(static_cast<libusb_error>(opened)),
                "", "replug it"};
        } else if (claimed != 0) {
            result = Error{which + (claimed == LIBUSB_ERROR_BUSY ? " is in use by another program"
                                                                 : " cannot be claimed"),
                           "", "close the other program, or replug it"};
        } else if (impl->in == 0 || impl->out == 0) {
            result =
                Error{which + " has no bulk endpoints", "", "check that it is the device it says"};
        } else {
            result = std::unique_ptr<UsbPipe>(new UsbPipe(std::move(impl)));
        }
    }
    libusb_free_device_list(list, 1);
    return result;
}

}  // namespace sonocase::runtime
