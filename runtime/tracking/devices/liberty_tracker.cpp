// SPDX-License-Identifier: Apache-2.0

// Polhemus Liberty and Patriot: start-up and stream.
#include <algorithm>
#include <array>
#include <string_view>

#include "runtime/tracking/devices/liberty_protocol.h"
#include "runtime/tracking/devices/usb_tracker.h"

namespace sonocase::runtime::inline tracking_devices {
namespace {

constexpr std::array<UsbId, 7> kIds = {{
    {0x0F44, 0xFF20, "Polhemus Liberty", false, 0x88, 0x04},
    {0x0F44, 0xEF12, "Polhemus Patriot", false, 0x82, 0x02},
    {0x0F44, 0xEF20, "Polhemus Patriot HS", false, 0x88, 0x04},
    {0x0F44, 0xFF21, "Polhemus Liberty", true},
    {0x0F44, 0xFF11, "Polhemus Liberty", true},
    {0x0F44, 0xEF11, "Polhemus Patriot", true},
    {0x0F44, 0xEF21, "Polhemus Patriot HS", true},
}};

class LibertyDriver final : public UsbDriver {
  public:
    std::span<const UsbId> ids() const override { return kIds; }
    Status start(UsbPipe& pipe, const UsbTrackerOptions& options, std::string& name) override;
    bool read(UsbPipe& pipe, TrackerReading& reading, UsbOutcome& outcome) override;
    void stop(UsbPipe& pipe) override { send(pipe, "p"); }
    std::uint64_t bad_frames() const override { return records_.bad_frames(); }

  private:
    static bool send(UsbPipe& pipe, std::string_view text) {
        const auto* bytes = reinterpret_cast<const std::uint8_t*>(text.data());
        return pipe.write({bytes, text.size()}, 0.5) == UsbOutcome::ok;
    }

    liberty::RecordReader records_;
    std::array<std::uint8_t, 4096> buffer_{};
    TrackerReading building_;
    std::uint32_t frame_ = 0;
    int top_station_ = 0;  // highest of the last whole frame; 0: not known yet
    bool open_ = false;    // building_ holds stations of frame_
};

Status LibertyDriver::start(UsbPipe& pipe, const UsbTrackerOptions& options, std::string&) {
    records_.clear();
    open_ = false;
    top_station_ = 0;
    pipe.clear_halt();
    const Error refused{"The tracker does not accept commands", "", "switch it off and on"};
    if (!send(pipe, "p")) return refused;
    for (int i = 0; i < 8; ++i) {  // sent for an earlier session
        std::size_t got = 0;
        if (pipe.read(buffer_, got, 0.05) != UsbOutcome::ok) break;
    }
    static const char* kHemispheres[] = {"h*,1,0,0\r",  "h*,-1,0,0\r", "h*,0,1,0\r",
                                         "h*,0,-1,0\r", "h*,0,0,1\r",  "h*,0,0,-1\r"};
    for (const char* command :
         {"f1\r", "O*,8,9,11,3,7\r", kHemispheres[static_cast<std::size_t>(options.hemisphere)],
          "U1\r", "c\r"}) {
        if (!send(pipe, command)) return refused;
    }
    return Done{};
}

bool LibertyDriver::read(UsbPipe& pipe, TrackerReading& reading, UsbOutcome& outcome) {
    std::size_t got = 0;
    outcome = pipe.read(buffer_, got, 0.1);
    records_.add({buffer_.data(), got});
    bool any = false;
    const auto hand_over = [&] {
        reading.sensor_count = building_.sensor_count;
        reading.sensors = building_.sensors;
        reading.device_time_s = building_.device_time_s;
        any = true;
        open_ = false;
    };
    liberty::Record record;
    while (records_.next(record)) {
        if (open_ && record.frame != frame_) {  // a station fell silent: the frame has what came
            top_station_ = building_.sensor_count;
            hand_over();
        }
        if (!open_) {
            building_ = {};
            frame_ = record.frame;
            open_ = true;
        }
        building_.device_time_s = record.device_ms / 1000.0;
        building_.sensors[record.station - 1] = record.reading;
        building_.sensor_count = std::max(building_.sensor_count, record.station);
        // Handed over with its last station, not with the first of the next frame, which comes a
        // whole period later.
        if (building_.sensor_count >= top_station_ && top_station_ > 0) {
            top_station_ = building_.sensor_count;
            hand_over();
        }
    }
    return any;
}

}  // namespace

std::unique_ptr<UsbDriver> make_liberty_driver() {
    return std::make_unique<LibertyDriver>();
}

}  // namespace sonocase::runtime::inline tracking_devices
