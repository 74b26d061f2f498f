// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/usb/emulated_device.h"

#include <umockdev-1.0/umockdev.h>
// ioctl.h must precede usbdevice_fs.h, whose numbers are built from it.
#include <linux/capability.h>
#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <thread>

#include "formats/base/mailbox.h"

namespace sonocase::testing {
namespace {

using Clock = std::chrono::steady_clock;

// The firmware's clock: short compared with the 4 ms between two readings of a real device.
constexpr double kTickS = 0.0002;

class EmulatedDevice final : public DevicePort {
  public:
    EmulatedDevice(UMockdevTestbed* testbed, const DeviceSpec& spec, int address)
        : testbed_(testbed), spec_(spec), address_(address) {
        char text[32];
        std::snprintf(text, sizeof text, "/dev/bus/usb/001/%03d", address);
        node_ = text;
        std::snprintf(text, sizeof text, "/sys/devices/usb1/1-%d", address);
        sys_ = text;
    }

    void plug_in(std::unique_ptr<Firmware> firmware) {
        firmware_ = std::move(firmware);
        gone_ = removed_ = false;
        start_ = Clock::now();
        ioctls_ = umockdev_ioctl_base_new();
        g_signal_connect(ioctls_, "handle-ioctl", G_CALLBACK(&EmulatedDevice::on_ioctl), this);
        GError* error = nullptr;
        if (!umockdev_testbed_attach_ioctl(testbed_, node_.c_str(), ioctls_, &error)) {
            std::fprintf(stderr, "attach: %s\n", error->message);
        }
        if (!umockdev_testbed_add_from_string(testbed_, description().c_str(), &error)) {
            std::fprintf(stderr, "add: %s\n", error->message);
        }
        if (spec_.no_permission) {
            gchar* root = umockdev_testbed_get_root_dir(testbed_);
            ::chmod((std::string(root) + node_).c_str(), 0);
            g_free(root);
        }
    }

    // Runs once; true when the device has just been unplugged.
    bool tick() {
        bool take_away = false;
        {
            const std::lock_guard lock(mutex_);
            const auto now = Clock::now();
            if (!gone_) {
                firmware_->on_tick(std::chrono::duration<double>(now - start_).count(), *this);
            }
            pump();
            answer_reap();
            if (reap_ && (gone_ || now - reap_since_ > std::chrono::milliseconds(1))) {
                UMockdevIoctlClient* client = reap_;
                reap_ = nullptr;
                umockdev_ioctl_client_complete(client, -1, gone_ ? ENODEV : EAGAIN);
                g_object_unref(client);
            }
            take_away = gone_ && !removed_;
            if (take_away) removed_ = true;
        }
        if (take_away) remove();
        return take_away;
    }

    void remove() {
        umockdev_testbed_uevent(testbed_, sys_.c_str(), "remove");
        umockdev_testbed_remove_device(testbed_, sys_.c_str());
        umockdev_testbed_detach_ioctl(testbed_, node_.c_str(), nullptr);
    }

    // DevicePort; called with the lock held.
    void send(const Bytes& transfer) override { replies_.push_back({transfer, 0}); }
    void stall() override { replies_.push_back({{}, -EPIPE}); }
    void unplug() override {
        gone_ = true;
        while (!in_.empty()) {
            finish(in_.front(), -ESHUTDOWN, 0);
            in_.pop_front();
        }
    }
    bool host_waits() const override { return !in_.empty(); }

  private:
    struct Answer {
        Bytes bytes;
        int status;
    };

    static usbdevfs_urb* urb_of(UMockdevIoctlData* data) {
        return reinterpret_cast<usbdevfs_urb*>(data->data);
    }

    std::string description() const {
        const auto byte = [](unsigned v) {
            char text[3];
            std::snprintf(text, sizeof text, "%02X", v & 255);
            return std::string(text);
        };
        const auto word = [&](unsigned v) { return byte(v) + byte(v >> 8); };
        const std::string device =
            "12010002FF000040" + word(spec_.vendor) + word(spec_.product) + "000100000001";
        const std::string configuration =
            "0902200001010080320904000002FF000000"
            "0705" +
            byte(spec_.endpoint_in) +
            "02000200"
            "0705" +
            byte(spec_.endpoint_out) + "02000200";
        char text[1024];
        std::snprintf(
            text, sizeof text,
            "P: /devices/usb1/1-%d\nN: bus/usb/001/%03d\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\n"
            "E: DRIVER=usb\nE: BUSNUM=001\nE: DEVNUM=%03d\nE: DEVNAME=/dev/bus/usb/001/%03d\n"
            "E: PRODUCT=%x/%x/100\nA: busnum=1\\n\nA: devnum=%d\\n\nA: bConfigurationValue=1\\n\n"
            "A: speed=480\\n\nA: idVendor=%04x\\n\nA: idProduct=%04x\\n\nH: descriptors=%s\n",
            address_, address_, address_, address_, spec_.vendor, spec_.product, address_,
            spec_.vendor, spec_.product, (device + configuration).c_str());
        return text;
    }

    void finish(UMockdevIoctlData* urb, int status, std::size_t length) {
        urb_of(urb)->status = status;
        urb_of(urb)->actual_length = static_cast<int>(length);
        ready_.push_back(urb);
    }

    // An answer longer than the host's buffer continues in the next transfer, as packets would.
    void pump() {
        while (!in_.empty() && !replies_.empty()) {
            UMockdevIoctlData* urb = in_.front();
            in_.pop_front();
            Answer& answer = replies_.front();
            const std::size_t n = std::min<std::size_t>(
                answer.bytes.size(), static_cast<std::size_t>(urb_of(urb)->buffer_length));
            if (n > 0) std::memcpy(urb_of(urb)->buffer, answer.bytes.data(), n);
            finish(urb, answer.status, n);
            answer.bytes.erase(answer.bytes.begin(),
                               answer.bytes.begin() + static_cast<std::ptrdiff_t>(n));
            if (answer.bytes.empty()) replies_.pop_front();
        }
        while (replies_.size() > 64)
            replies_.pop_front();  // a host that does not read loses the oldest
    }

    bool give(UMockdevIoctlClient* client) {
        if (ready_.empty()) return false;
        UMockdevIoctlData* urb = ready_.front();
        ready_.pop_front();
        UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
        UMockdevIoctlData* pointer =
            umockdev_ioctl_data_resolve(argument, 0, sizeof(void*), nullptr);
        umockdev_ioctl_data_set_ptr(pointer, 0, urb);
        umockdev_ioctl_data_unref(pointer);
        umockdev_ioctl_client_complete(client, 0, 0);
        return true;  // the reference to the urb is kept by the pointer
    }

    void answer_reap() {
        if (!reap_) return;
        UMockdevIoctlClient* client = reap_;
        if (give(client)) {
            reap_ = nullptr;
            g_object_unref(client);
        }
    }

    void submit(UMockdevIoctlClient* client, UMockdevIoctlData* argument) {
        UMockdevIoctlData* data =
            umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
        usbdevfs_urb* urb = urb_of(data);
        UMockdevIoctlData* buffer =
            urb->buffer_length > 0
                ? umockdev_ioctl_data_resolve(data, offsetof(usbdevfs_urb, buffer),
                                              static_cast<gsize>(urb->buffer_length), nullptr)
                : nullptr;
        if (urb->type != USBDEVFS_URB_TYPE_BULK) {
            finish(data, -EPIPE, 0);
        } else if (urb->endpoint & 0x80) {
            in_.push_back(data);
        } else {
            const auto* bytes = static_cast<const std::uint8_t*>(urb->buffer);
            if (urb->buffer_length > 0) {
                firmware_->on_out(Bytes(bytes, bytes + urb->buffer_length), *this);
            }
            finish(data, 0, static_cast<std::size_t>(urb->buffer_length));
        }
        pump();
        if (buffer) umockdev_ioctl_data_unref(buffer);
        umockdev_ioctl_client_complete(client, 0, 0);
        answer_reap();
    }

    static gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
        return static_cast<EmulatedDevice*>(self)->handle(client);
    }

    gboolean handle(UMockdevIoctlClient* client) {
        const std::lock_guard lock(mutex_);
        const gulong request = umockdev_ioctl_client_get_request(client);
        UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
        const auto complete = [&](int result, int error) {
            umockdev_ioctl_client_complete(client, result, error);
            return TRUE;
        };
        switch (request) {
            case USBDEVFS_GET_CAPABILITIES: {
                UMockdevIoctlData* data = umockdev_ioctl_data_resolve(argument, 0, 4, nullptr);
                const std::uint32_t flags =
                    USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                    USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
                std::memcpy(data->data, &flags, 4);
                umockdev_ioctl_data_unref(data);
                return complete(0, 0);
            }
            case USBDEVFS_GETDRIVER: return complete(-1, ENODATA);
            case USBDEVFS_CLAIMINTERFACE:
            case USBDEVFS_RELEASEINTERFACE:
            case USBDEVFS_SETCONFIGURATION:
            case USBDEVFS_SETINTERFACE:
            case USBDEVFS_CLEAR_HALT:
            case USBDEVFS_RESET: return gone_ ? complete(-1, ENODEV) : complete(0, 0);
            case USBDEVFS_SUBMITURB:
                if (gone_) return complete(-1, ENODEV);
                submit(client, argument);
                return TRUE;
            case USBDEVFS_DISCARDURB: {
                const gulong address = *reinterpret_cast<gulong*>(argument->data);
                for (auto it = in_.begin(); it != in_.end(); ++it) {
                    if ((*it)->client_addr != address) continue;
                    UMockdevIoctlData* urb = *it;
                    in_.erase(it);
                    finish(urb, -ENOENT, 0);
                    complete(0, 0);
                    answer_reap();
                    return TRUE;
                }
                return complete(-1, EINVAL);
            }
            case USBDEVFS_REAPURB:
            case USBDEVFS_REAPURBNDELAY:
                if (give(client)) return TRUE;
                if (gone_) return complete(-1, ENODEV);
                if (reap_) return complete(-1, EAGAIN);
                // Held and answered within a millisecond: poll() on the node is always ready, and
                // the host would spin if the answer came at once.
                reap_ = static_cast<UMockdevIoctlClient*>(g_object_ref(client));
                reap_since_ = Clock::now();
                return TRUE;
            default: return complete(-1, ENOTTY);
        }
    }

    UMockdevTestbed* testbed_;
    DeviceSpec spec_;
    int address_;
    std::string node_, sys_;
    UMockdevIoctlBase* ioctls_ = nullptr;
    std::unique_ptr<Firmware> firmware_;
    std::mutex mutex_;
    std::deque<UMockdevIoctlData*> in_, ready_;
    std::deque<Answer> replies_;
    UMockdevIoctlClient* reap_ = nullptr;
    Clock::time_point reap_since_, start_;
    bool gone_ = false, removed_ = false;
};

}  // namespace

ClientResult run_with_device(const DeviceSpec& spec,
                             const std::function<std::unique_ptr<Firmware>()>& make_firmware,
                             const std::vector<std::string>& command) {
    UMockdevTestbed* testbed = umockdev_testbed_new();
    std::vector<std::unique_ptr<EmulatedDevice>> devices;
    int address = 2;
    devices.push_back(std::make_unique<EmulatedDevice>(testbed, spec, address++));
    devices.back()->plug_in(make_firmware());
    if (spec.second_alike) {
        devices.push_back(std::make_unique<EmulatedDevice>(testbed, spec, address++));
        devices.back()->plug_in(make_firmware());
    }
    int pipe_ends[2];
    if (::pipe(pipe_ends) != 0) std::abort();
    const pid_t child = ::fork();
    if (child == 0) {
        // Root may open any file: the program gives up that right.
        if (spec.no_permission) {
            ::prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE);
            ::prctl(PR_CAPBSET_DROP, CAP_DAC_READ_SEARCH);
        }
        ::dup2(pipe_ends[1], STDOUT_FILENO);
        ::close(pipe_ends[0]);
        const char* first = std::getenv("SONOCASE_PRELOAD_FIRST");  // tests/CMakeLists.txt
        const std::string preload = std::string(first ? first : "") + "libumockdev-preload.so.0";
        ::setenv("LD_PRELOAD", preload.c_str(), 1);
        std::vector<char*> arguments;
        for (const std::string& word : command)
            arguments.push_back(const_cast<char*>(word.c_str()));
        arguments.push_back(nullptr);
        ::execv(arguments[0], arguments.data());
        ::_exit(127);
    }
    ::close(pipe_ends[1]);
    std::atomic<bool> stop{false};
    Event event;
    std::thread player([&] {
        Clock::time_point replug_at = Clock::time_point::max();
        while (!stop) {
            event.wait(kTickS);
            for (std::size_t i = 0; i < devices.size(); ++i) {
                if (devices[i]->tick() && spec.replug_after_s >= 0) {
                    replug_at = Clock::now() + std::chrono::microseconds(
                                                   static_cast<long>(spec.replug_after_s * 1e6));
                }
            }
            if (Clock::now() >= replug_at) {
                replug_at = Clock::time_point::max();
                devices.push_back(std::make_unique<EmulatedDevice>(testbed, spec, address++));
                devices.back()->plug_in(make_firmware());
            }
        }
    });
    ClientResult result;
    char buffer[4096];
    for (ssize_t n; (n = ::read(pipe_ends[0], buffer, sizeof buffer)) > 0;) {
        result.out.append(buffer, static_cast<std::size_t>(n));
    }
    ::close(pipe_ends[0]);
    int status = 0;
    ::waitpid(child, &status, 0);
    result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    stop = true;
    event.notify();
    player.join();
    g_object_unref(testbed);
    return result;
}

}  // namespace sonocase::testing
