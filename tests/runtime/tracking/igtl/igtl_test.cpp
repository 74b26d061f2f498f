// SPDX-License-Identifier: Apache-2.0

// OpenIGTLink: both directions with Debian's library in another process, and with hostile peers.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "formats/base/mailbox.h"
#include "runtime/tracking/devices/igtl_message.h"
#include "runtime/tracking/devices/igtl_server.h"
#include "runtime/tracking/devices/igtl_tracker.h"
#include "support/paths.h"
#include "support/random.h"

namespace sonocase::runtime {
namespace {

using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::uint8_t>;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

// Checks the predicate whenever the tracker notifies and every 5 ms, because changes of its health
// are not notified; false if it has not come true within `seconds`.
template <class Predicate>
bool seen_after_events(Event& event, Predicate predicate, double seconds = 15) {
    const auto start = Clock::now();
    while (!predicate()) {
        if (seconds_since(start) > seconds) return false;
        event.wait(0.005);
    }
    return true;
}

// A tracker that notifies `event`, and stops doing so before the event is destroyed.
struct NotifyingTracker {
    explicit NotifyingTracker(std::unique_ptr<Tracker> made) : tracker(std::move(made)) {
        tracker->set_wake([this] { event.notify(); });
    }
    ~NotifyingTracker() { tracker->set_wake({}); }
    NotifyingTracker(const NotifyingTracker&) = delete;
    NotifyingTracker& operator=(const NotifyingTracker&) = delete;
    Tracker* operator->() const { return tracker.get(); }
    Tracker& operator*() const { return *tracker; }
    template <class Predicate>
    bool eventually(Predicate predicate) {
        return seen_after_events(event, predicate);
    }
    Event event;
    std::unique_ptr<Tracker> tracker;
};

SessionClock clock_from_now() {
    return [start = Clock::now()] { return seconds_since(start); };
}

class Peer {
  public:
    Peer(const char* verb, int port, int n) {
        const std::string command = std::string(SONOCASE_BIN "/igtl_peer ") + verb + " " +
                                    std::to_string(port) + " " + std::to_string(n) + " 2>/dev/null";
        pipe_ = popen(command.c_str(), "r");
    }
    std::string line() {
        char text[1024] = "";
        return std::fgets(text, sizeof text, pipe_) ? text : "";
    }
    int close() {
        const int status = pclose(pipe_);
        pipe_ = nullptr;
        return WEXITSTATUS(status);
    }

  private:
    FILE* pipe_;
};

int free_port() {
    Result<Socket> socket = Socket::listen("127.0.0.1", 0);
    return socket ? socket->port() : 0;
}

NotifyingTracker start_tracker(int port, bool listening) {
    IgtlTrackerOptions options;
    options.port = port;
    options.listening = listening;
    options.retry_s = 0.05;
    Result<std::unique_ptr<Tracker>> tracker = IgtlTracker::start(options, clock_from_now());
    EXPECT_TRUE(tracker);
    return NotifyingTracker(std::move(*tracker));
}

void expect_pose(const SensorReading& sensor, double x) {
    EXPECT_EQ(sensor.state, SensorState::ok);
    EXPECT_LT(norm(sensor.world_from_sensor.translation - Vector3{x, -5, 7}), 1e-4);
    EXPECT_LT(norm(sensor.world_from_sensor.rotation * Vector3{1, 0, 0} - Vector3{0, 1, 0}), 1e-6);
}

TEST(IgtlTracker, FollowsAServerOfTheLibrary) {
    const int port = free_port();
    auto tracker = start_tracker(port, false);
    Peer peer("serve", port, 400);
    EXPECT_EQ(peer.line(), "ready\n");
    TrackerReading reading;
    ASSERT_TRUE(
        tracker.eventually([&] { return tracker->poll(0, reading) && reading.sensor_count == 4; }));
    expect_pose(reading.sensors[kProbeSensor], 100);
    expect_pose(reading.sensors[kNeedleSensor], 200);
    expect_pose(reading.sensors[2], 300);
    expect_pose(reading.sensors[3], 400);
    EXPECT_EQ(tracker->health().phase, TrackerPhase::streaming);
    EXPECT_EQ(tracker->health().bad_frames, 0u);
    EXPECT_EQ(peer.close(), 0);
    ASSERT_TRUE(
        tracker.eventually([&] { return tracker->health().phase == TrackerPhase::searching; }));
}

TEST(IgtlTracker, ConnectsAgainAfterTheServerWentAway) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    auto tracker = start_tracker(server->port(), false);
    for (int round = 0; round < 3; ++round) {
        Socket client = server->accept(15);
        ASSERT_TRUE(client.open()) << round;
        client.write(igtl::encode_transform("ProbeToTracker", 1, {}));
        const auto readings = static_cast<std::uint64_t>(round + 1);
        ASSERT_TRUE(tracker.eventually([&] { return tracker->health().readings >= readings; }));
    }
    EXPECT_EQ(tracker->health().connects, 3u);
}

TEST(IgtlTracker, ForceComesWithTheNextPose) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    auto tracker = start_tracker(server->port(), false);
    Socket client = server->accept(15);
    ASSERT_TRUE(client.open());
    client.write(igtl::encode_transform("ProbeToTracker", 1, {}));
    TrackerReading reading;
    ASSERT_TRUE(tracker.eventually([&] { return tracker->poll(0, reading); }));
    EXPECT_LT(reading.force_n, 0);
    client.write(igtl::encode_sensor("ProbeForce", 1, std::vector<double>{4.5, 2}));
    client.write(igtl::encode_transform("ProbeToTracker", 1, {}));
    ASSERT_TRUE(
        tracker.eventually([&] { return tracker->poll(0, reading) && reading.force_n == 4.5; }));
}

// A server that is there and whose messages are all passed over: health says why.
TEST(IgtlTracker, SaysWhyNoPoseComes) {
    Rigid scaled{{}, {1, 2, 300}}, mirrored = scaled, metres{{}, {0.1, 0.2, 0.9}};
    for (double& v : scaled.rotation.m) v *= 0.2;
    mirrored.rotation(0, 0) = -1;
    Bytes wrong = igtl::encode_transform("ProbeToTracker", 1, {});
    wrong[57] ^= 1;
    const std::pair<Bytes, const char*> cases[] = {
        {wrong, "wrong checksum"},
        {igtl::encode_transform("ImageToReference", 1, scaled), "ImageToReference has a scale"},
        {igtl::encode_transform("ProbeToTracker", 1, mirrored), "mirrored"},
        {igtl::encode_transform("MarkerToReference", 1, {}), "--tool probe=MarkerToReference"},
        {igtl::encode_transform("TrackerToProbe", 1, {}), "inverse of a tool's pose"},
        {igtl::encode_transform("ProbeToTracker", 1, metres), "metres"},
        {igtl::encode_transform("ProbeToTracker", 1, {}), "always at 0, 0, 0"},
        {igtl::encode_transform("ProbeToTracker", 1, {{}, {-3.7e28, 0, 0}}), "it has no pose"},
        {igtl::encode_transform("ImageToProbe", 1, {}), "a calibration and no pose"},
        {igtl::encode("POSITION", "ProbeToTracker", 1, Bytes(12, 0)), "without an orientation"},
        {igtl::encode("TRANSFORM", "ProbeToTracker", 1, Bytes(40, 0)), "wrong length"},
        {igtl::encode("STATUS", "S", 1, Bytes(31, 7)), "none with a pose"}};
    for (const auto& [message, sentence] : cases) {
        Result<Socket> server = Socket::listen("127.0.0.1", 0);
        ASSERT_TRUE(server);
        IgtlTrackerOptions options;
        options.port = server->port();
        options.explain_s = 0.1;
        auto started = IgtlTracker::start(options, clock_from_now());
        ASSERT_TRUE(started);
        NotifyingTracker tracker(std::move(*started));
        Socket client = server->accept(15);
        ASSERT_TRUE(client.open());
        EXPECT_TRUE(tracker.eventually([&, &message = message, &sentence = sentence] {
            client.write(message);
            return tracker->health().message.find(sentence) != std::string::npos;
        })) << sentence
            << ": " << tracker->health().message;
    }
}

// The TrackingDataServer of the library sends once it is asked.
TEST(IgtlTracker, AsksASilentServerForItsPoses) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    IgtlTrackerOptions options;
    options.port = server->port();
    options.ask_s = 0.05;
    auto started = IgtlTracker::start(options, clock_from_now());
    ASSERT_TRUE(started);
    Socket client = server->accept(15);
    ASSERT_TRUE(client.open());
    Bytes asked(128);
    const long n = client.read(asked, 15);
    ASSERT_EQ(n, 94);  // a header and 36 bytes
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(asked.data()) + 2), "STT_TDATA");
}

TEST(IgtlTracker, EachSensorHasItsOwnTimeFrameAndName) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    IgtlTrackerOptions options;
    options.port = server->port();
    options.tools = {{"needle", "TipToReference"}};
    auto started = IgtlTracker::start(options, clock_from_now());
    ASSERT_TRUE(started);
    NotifyingTracker tracker(std::move(*started));
    Socket client = server->accept(15);
    ASSERT_TRUE(client.open());
    client.write(igtl::encode_transform("NeedleToTracker", 1, {{}, {9, 9, 9}}));
    client.write(igtl::encode_transform("ProbeToMannequin", 1, {{}, {1, 0, 0}}));
    client.write(igtl::encode_transform("TipToReference", 1, {{}, {2, 0, 0}}));
    client.write(igtl::encode_transform("ReferenceToTracker", 1, {{}, {400, 0, 0}}));
    TrackerReading reading;
    ASSERT_TRUE(
        tracker.eventually([&] { return tracker->poll(0, reading) && reading.sensor_count == 4; }));
    EXPECT_FALSE(reading.in_mannequin);
    EXPECT_TRUE(reading.sensors[kProbeSensor].in_mannequin);
    EXPECT_FALSE(reading.sensors[kNeedleSensor].in_mannequin);
    EXPECT_EQ(reading.sensors[kNeedleSensor].world_from_sensor.translation.x, 2);
    const double needle_s = reading.sensors[kNeedleSensor].time_s;
    ASSERT_TRUE(tracker.eventually([&] {
        client.write(igtl::encode_transform("ProbeToMannequin", 1, {{}, {1, 0, 0}}));
        return tracker->poll(0, reading) && reading.sensors[kProbeSensor].time_s > needle_s;
    }));
    EXPECT_EQ(reading.sensors[kNeedleSensor].time_s, needle_s);
}

TEST(IgtlTracker, TheReferenceHasItsPlaceAndSaysWhatIsRelativeToItAlready) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    IgtlTrackerOptions options;
    options.port = server->port();
    options.tools = {{"reference", "ReferenceToTracker"}};
    auto started = IgtlTracker::start(options, clock_from_now());
    ASSERT_TRUE(started);
    NotifyingTracker tracker(std::move(*started));
    Socket client = server->accept(15);
    ASSERT_TRUE(client.open());
    TrackerReading reading;
    const auto x_with = [&](double reference, double probe) {
        EXPECT_TRUE(tracker.eventually([&] {
            client.write(igtl::encode_transform("ReferenceToTracker", 1, {{}, {reference, 0, 0}}));
            client.write(igtl::encode_transform("ProbeToTracker", 1, {{}, {probe, 0, 0}}));
            return tracker->poll(0, reading) &&
                   reading.sensors[kProbeSensor].state == SensorState::ok &&
                   reading.sensors[kReferenceSensor].world_from_sensor.translation.x == reference;
        }));
        const auto pose =
            sensor_pose(reading, {kProbeSensor, kNeedleSensor, kReferenceSensor}, kProbeSensor);
        ASSERT_TRUE(pose);
        EXPECT_EQ(pose->translation.x, probe - reference);
    };
    x_with(100, 250);
    x_with(300, 250);
    EXPECT_FALSE(reading.sensors[kProbeSensor].in_reference);
    ASSERT_TRUE(tracker.eventually([&] {
        client.write(igtl::encode_transform("NeedleToReference", 1, {{}, {7, 0, 0}}));
        return tracker->poll(0, reading) && reading.sensors[kNeedleSensor].in_reference;
    }));
    const std::vector<std::string> names = tracker->health().sensors;
    ASSERT_EQ(names.size(), static_cast<std::size_t>(kMaxSensors));
    EXPECT_EQ(names[kReferenceSensor], "ReferenceToTracker");
    EXPECT_EQ(names[kNeedleSensor], "NeedleToReference");
}

// In the set-up a person gives the names that were heard their roles.
TEST(IgtlTracker, NamesTakeTheirPlacesAnewWhenTheyAreGivenRoles) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    auto tracker = start_tracker(server->port(), false);
    Socket client = server->accept(15);
    ASSERT_TRUE(client.open());
    const auto send = [&] {
        for (const auto& [name, x] : {std::pair{"ATo1", 1.0}, {"BTo1", 2.0}, {"CTo1", 3.0}})
            client.write(igtl::encode_transform(name, 1, {{}, {x, 0, 0}}));
    };
    TrackerReading reading;
    const auto x_of = [&](int sensor) {
        return reading.sensors[static_cast<std::size_t>(sensor)].world_from_sensor.translation.x;
    };
    ASSERT_TRUE(tracker.eventually([&] {
        send();
        return tracker->poll(0, reading) && reading.sensor_count == 5;
    }));
    EXPECT_EQ(reading.sensors[kProbeSensor].state, SensorState::absent);
    const std::vector<std::string> names = tracker->health().sensors;
    EXPECT_EQ(std::vector<std::string>(names.begin() + 2, names.begin() + 5),
              (std::vector<std::string>{"ATo1", "BTo1", "CTo1"}));
    tracker->set_tools({{"probe", "BTo1"}, {"reference", "ATo1"}});
    ASSERT_TRUE(tracker.eventually([&] {
        send();
        return tracker->poll(0, reading) && x_of(kProbeSensor) == 2 &&
               x_of(kReferenceSensor) == 1 && x_of(3) == 3;
    }));
    EXPECT_EQ(reading.sensors[kNeedleSensor].state, SensorState::absent);
}

TEST(IgtlTracker, ListensToAClientOfTheLibrary) {
    auto tracker = start_tracker(0, true);
    const int port = static_cast<IgtlTracker&>(*tracker).port();
    Peer peer("send", port, 50);
    TrackerReading reading;
    ASSERT_TRUE(
        tracker.eventually([&] { return tracker->poll(0, reading) && reading.sensor_count == 2; }));
    expect_pose(reading.sensors[kProbeSensor], 100);
    EXPECT_EQ(peer.close(), 0);
}

TEST(IgtlServer, IsFollowedByAClientOfTheLibrary) {
    Result<std::unique_ptr<IgtlServer>> server = IgtlServer::start("127.0.0.1", 0);
    ASSERT_TRUE(server) << server.error().message();
    Peer peer("follow", (*server)->port(), 5);
    std::atomic<bool> stop{false};
    Event pace;
    std::thread sender([&] {
        while (!stop) {
            ServedFrame& frame = (*server)->slot();
            frame.width_px = 64;
            frame.height_px = 48;
            frame.mm_per_px = 0.5;
            frame.has_probe = frame.has_needle = true;
            frame.mannequin_from_probe.translation = {1, 2, 33.5};
            frame.pixels.assign(64 * 48, 9);
            (*server)->publish();
            pace.wait(0.002);
        }
    });
    const auto seen = nlohmann::json::parse(peer.line(), nullptr, false);
    EXPECT_EQ(peer.close(), 0);
    stop = true;
    pace.notify();
    sender.join();
    ASSERT_TRUE(seen.is_object());
    EXPECT_EQ(seen["bad"], 0);
    EXPECT_EQ(seen["width"], 64);
    EXPECT_EQ(seen["height"], 48);
    EXPECT_EQ(seen["sum"], 64 * 48 * 9);
    EXPECT_NEAR(seen["spacing"].get<double>(), 0.5, 1e-4);
    EXPECT_NEAR(seen["z"].get<double>(), 33.5, 1e-3);
    EXPECT_GE(seen["transforms"].get<int>(), 8);
}

// The probe rests and nothing is published any more: whoever connects then sees what is shown.
TEST(IgtlServer, ANewcomerGetsWhatIsShownAtOnce) {
    Result<std::unique_ptr<IgtlServer>> server = IgtlServer::start("127.0.0.1", 0);
    ASSERT_TRUE(server);
    ServedFrame& frame = (*server)->slot();
    frame.width_px = 64;
    frame.height_px = 48;
    frame.has_probe = true;
    frame.mannequin_from_probe.translation = {1, 2, 33.5};
    frame.pixels.assign(64 * 48, 9);
    (*server)->publish();
    // The second as the first, which may have been there before the frame was taken.
    for (int i = 0; i < 2; ++i) {
        Result<Socket> socket = Socket::connect("127.0.0.1", (*server)->port(), 5);
        ASSERT_TRUE(socket) << socket.error().message();
        igtl::MessageReader reader;
        Bytes buffer(4096);
        std::set<std::string> kinds;
        while (kinds.size() < 3) {  // probe, force, picture
            const long count = socket->read(buffer, 15);
            ASSERT_GT(count, 0) << "nothing came";
            reader.add({buffer.data(), static_cast<std::size_t>(count)});
            while (reader.next() == igtl::MessageReader::Event::message)
                kinds.insert(reader.header().type);
        }
        EXPECT_TRUE(kinds.count("IMAGE"));
    }
}

// A frame whose pixels are not those of its size yet is sent without its picture: the message would
// be one that no client can unpack.
TEST(IgtlServer, NoPictureIsSentThatCannotBeUnpacked) {
    Result<std::unique_ptr<IgtlServer>> server = IgtlServer::start("127.0.0.1", 0);
    ASSERT_TRUE(server);
    const auto publish = [&](int width_px, std::size_t pixels) {
        ServedFrame& frame = (*server)->slot();
        frame.width_px = width_px;
        frame.height_px = 48;
        frame.has_probe = true;
        frame.pixels.assign(pixels, 9);
        (*server)->publish();
    };
    publish(64, 0);
    Result<Socket> socket = Socket::connect("127.0.0.1", (*server)->port(), 5);
    ASSERT_TRUE(socket) << socket.error().message();
    igtl::MessageReader reader;
    Bytes buffer(4096);
    int transforms = 0, pictures = 0;
    const auto read_until = [&](const auto& enough) {
        while (!enough()) {
            const long count = socket->read(buffer, 15);
            ASSERT_GT(count, 0) << "nothing came";
            reader.add({buffer.data(), static_cast<std::size_t>(count)});
            while (reader.next() == igtl::MessageReader::Event::message) {
                transforms += reader.header().type == "TRANSFORM";
                if (reader.header().type != "IMAGE") continue;
                ++pictures;
                EXPECT_EQ(reader.header().body_size, 72u + 64 * 48);
            }
        }
    };
    read_until([&] { return transforms > 0; });
    EXPECT_EQ(pictures, 0);
    publish(64, 64 * 48);
    read_until([&] { return pictures > 0; });
}

// What a listening tracker must survive; after each of these it serves the next good client.
TEST(IgtlTracker, SurvivesHostilePeers) {
    auto tracker = start_tracker(0, true);
    const int port = static_cast<IgtlTracker&>(*tracker).port();
    const Bytes good = igtl::encode_transform("ProbeToTracker", 1, {});
    Bytes bad_crc = good, bad_version = good, huge = good, huge_unknown = good;
    bad_crc[57] ^= 1;
    bad_version[1] = 99;
    for (std::size_t i = 42; i < 50; ++i) huge[i] = huge_unknown[i] = 0xFF;
    huge_unknown[2] = 'X';
    const Bytes half(good.begin(), good.begin() + 70);
    sonocase::testing::Random random(17);
    Bytes noise(20000);
    for (auto& b : noise) b = static_cast<std::uint8_t>(random.uniform(0, 256));
    for (const Bytes& attack : {bad_crc, bad_version, huge, huge_unknown, half, noise, Bytes{}}) {
        {
            Result<Socket> socket = Socket::connect("127.0.0.1", port, 5);
            ASSERT_TRUE(socket);
            if (!attack.empty()) socket->write(attack);
        }
        const std::uint64_t before = tracker->health().readings;
        Result<Socket> honest = Socket::connect("127.0.0.1", port, 5);
        ASSERT_TRUE(honest);
        ASSERT_TRUE(tracker.eventually([&] {
            honest->write(good);
            return tracker->health().readings > before;
        }));
    }
    EXPECT_GE(tracker->health().bad_frames, 3u);
}

double resident_mb() {
    std::ifstream in("/proc/self/statm");
    double size = 0, resident = 0;
    in >> size >> resident;
    return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1048576;
}

double process_seconds() {
    timespec t{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// A program that sends without a pause for as long as it lives, and connects again when it is
// thrown out. `drips`: byte by byte.
class Flood {
  public:
    Flood(int port, const std::function<Bytes(int)>& message, bool drips) : child_(::fork()) {
        if (child_ != 0) return;
        for (int i = 0;;) {
            Result<Socket> socket = Socket::connect("127.0.0.1", port, 1);
            Bytes heard(256);
            while (socket && socket->open()) {
                const Bytes bytes = message(i++);
                for (std::size_t at = 0; at < bytes.size();) {
                    const std::size_t n = drips ? 1 : bytes.size() - at;
                    const long sent = socket->write({bytes.data() + at, n});
                    if (sent < 0) socket->close();
                    if (sent < 0) break;
                    if (sent == 0)
                        (void)socket->read(heard, 0.001);  // until it is read: no load from here
                    at += static_cast<std::size_t>(sent);
                }
            }
        }
    }
    ~Flood() {
        ::kill(child_, SIGKILL);
        ::waitpid(child_, nullptr, 0);
    }
    Flood(const Flood&) = delete;
    Flood& operator=(const Flood&) = delete;

  private:
    pid_t child_;
};

// Whatever is sent, and however fast, costs the player at most a tenth of a core: the picture,
// which is drawn on others, does not become slower by more than that. Those who wait for poses are
// woken 500 times a second at most, what they get is always of one size, and memory does not grow.
TEST(IgtlTracker, AFloodTakesATenthOfACoreAndNoMemory) {
    const Bytes good = igtl::encode_transform("ProbeToTracker", 1, {{}, {1, 2, 300}});
    Bytes wrong = good, negative = good, endless = good;
    wrong[57] ^= 1;
    for (std::size_t i = 42; i < 50; ++i) negative[i] = 0xFF;
    for (std::size_t i = 42; i < 50; ++i) endless[i] = i == 47 ? 15 : 0;  // 983 kB, never whole
    endless.resize(igtl::kHeaderSize + 500000);
    Bytes many(14000 * 70, 0);
    for (std::size_t i = 0; i < many.size(); i += 70) {
        const std::string name = "T" + std::to_string(i) + "ToX";
        std::copy(name.begin(), name.end(), many.begin() + static_cast<std::ptrdiff_t>(i));
        std::copy(good.begin() + 58, good.end(),
                  many.begin() + static_cast<std::ptrdiff_t>(i) + 22);
    }
    const Bytes tdata = igtl::encode("TDATA", "T", 1, many);
    const struct {
        const char* name;
        std::function<Bytes(int)> message;
        bool drips, comes;  // comes: poses arrive, and go on doing so
    } floods[] = {
        {"one name", [&](int) { return good; }, false, true},
        {"endless names",
         [](int i) { return igtl::encode_transform("N" + std::to_string(i) + "ToX", 1, {}); },
         false, false},
        {"fourteen thousand tools in a message", [&](int) { return tdata; }, false, true},
        {"wrong checksums", [&](int) { return wrong; }, false, false},
        {"negative sizes", [&](int) { return negative; }, false, false},
        {"half a message", [&](int) { return endless; }, false, false},
        {"byte by byte", [&](int) { return good; }, true, true},
        {"pictures", [](int) { return igtl::encode("IMAGE", "U", 1, Bytes(300000, 7)); }, false,
         false}};
    for (const auto& flood : floods) {
        SCOPED_TRACE(flood.name);
        auto tracker = start_tracker(0, true);
        const int port = static_cast<IgtlTracker&>(*tracker).port();
        std::atomic<int> woken{0};
        tracker->set_wake([&] {
            ++woken;
            tracker.event.notify();
        });
        const Flood sender(port, flood.message, flood.drips);
        // On a busy machine the sender and the tracker come to their turns late.
        constexpr double kHangsS = 300;
        ASSERT_TRUE(seen_after_events(
            tracker.event,
            [&] {
                const TrackerHealth health = tracker->health();
                return flood.comes ? health.readings > 0 : health.connects > 0;
            },
            kHangsS));
        const auto start = Clock::now();
        const double before_s = process_seconds();
        const int woken_before = woken;
        const std::uint64_t had = tracker->health().readings;
        const double memory_before_mb = resident_mb();
        // For half a second, and until poses have gone on: however long that takes, the share of a
        // core and the number of wakes are those of the time that has passed.
        Event pause;  // not woken by poses: this thread counts as well
        EXPECT_TRUE(seen_after_events(
            pause,
            [&] {
                return seconds_since(start) >= 0.5 &&
                       (!flood.comes || tracker->health().readings > had);
            },
            kHangsS));
        const double wall_s = seconds_since(start), spent_s = process_seconds() - before_s;
        // A tenth of a core, what was saved up for it, and as much again for an unlucky measure.
        EXPECT_LT(spent_s, 0.1 * wall_s + 0.02 + 0.1);
        EXPECT_LT(woken - woken_before, 520 * wall_s);
        EXPECT_LT(resident_mb() - memory_before_mb, 30);
        tracker->set_wake({});
    }
}

// One program is heard. A second one is refused and told of while the first sends, and heard once
// it does not: also where the first only drips bytes of a message that never ends.
TEST(IgtlTracker, ASecondProgramIsRefusedWithAWordOrTakesOver) {
    auto tracker = start_tracker(0, true);
    const int port = static_cast<IgtlTracker&>(*tracker).port();
    Result<Socket> first = Socket::connect("127.0.0.1", port, 5);
    ASSERT_TRUE(first);
    Bytes buffer(16);
    const auto send = [&](Socket& socket, double x) {
        socket.write(igtl::encode_transform("ProbeToTracker", 1, {{}, {x, 0, 300}}));
    };
    TrackerReading reading;
    const auto x_is = [&](double x) {
        tracker->poll(0, reading);
        return reading.sensors[kProbeSensor].world_from_sensor.translation.x == x;
    };
    ASSERT_TRUE(tracker.eventually([&] {
        send(*first, 1);
        return x_is(1);
    }));
    Result<Socket> second = Socket::connect("127.0.0.1", port, 5);
    ASSERT_TRUE(second);
    EXPECT_TRUE(tracker.eventually([&] {
        send(*first, 1);
        return tracker->health().message.find("second program") != std::string::npos;
    })) << tracker->health().message;
    EXPECT_LT(second->read(buffer, 5), 0);  // closed
    EXPECT_TRUE(x_is(1));
    // A slow drip of a header.
    Result<Socket> third = Socket::connect("127.0.0.1", port, 5);
    ASSERT_TRUE(third);
    const Bytes header = igtl::encode_transform("ProbeToTracker", 1, {});
    std::size_t dripped = 0;
    EXPECT_TRUE(tracker.eventually([&] {
        if (dripped < 57) first->write(std::span(header).subspan(dripped++, 1));
        send(*third, 3);
        return x_is(3);
    }));
}

TEST(IgtlTracker, SaysThatTheReferenceDoesNotCome) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    IgtlTrackerOptions options;
    options.port = server->port();
    options.explain_s = 0.1;
    options.tools = {{"reference", "Foo"}};
    auto started = IgtlTracker::start(options, clock_from_now());
    ASSERT_TRUE(started);
    NotifyingTracker tracker(std::move(*started));
    Socket client = server->accept(15);
    ASSERT_TRUE(client.open());
    EXPECT_TRUE(tracker.eventually([&] {
        client.write(igtl::encode_transform("TransducerToTracker", 1, {{}, {1, 2, 300}}));
        return tracker->health().message.find("not its reference") != std::string::npos;
    })) << tracker->health().message;
    EXPECT_TRUE(tracker.eventually([&] {
        client.write(igtl::encode_transform("Foo", 1, {{}, {1, 2, 300}}));
        client.write(igtl::encode_transform("TransducerToTracker", 1, {{}, {1, 2, 300}}));
        return tracker->health().message.empty();
    })) << tracker->health().message;
}

TEST(IgtlTracker, NamesAFrameOfItsOwnAndASlowSender) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    IgtlTrackerOptions options;
    options.port = server->port();
    options.explain_s = 0.1;
    auto started = IgtlTracker::start(options, clock_from_now());
    ASSERT_TRUE(started);
    NotifyingTracker tracker(std::move(*started));
    Socket client = server->accept(15);
    ASSERT_TRUE(client.open());
    EXPECT_TRUE(tracker.eventually([&] {
        client.write(igtl::encode_transform("ImageToTracker", 1, {{}, {1, 2, 300}}));
        client.write(igtl::encode_transform("StylusToReference", 1, {{}, {1, 2, 300}}));
        return tracker->health().message.find("different frames") != std::string::npos;
    })) << tracker->health().message;
    // The probe itself takes the place of its image.
    client.write(igtl::encode_transform("ProbeToReference", 1, {{}, {5, 2, 300}}));
    TrackerReading reading;
    EXPECT_TRUE(tracker.eventually([&] {
        tracker->poll(0, reading);
        return reading.sensors[kProbeSensor].world_from_sensor.translation.x == 5;
    }));
    auto last = Clock::now() - std::chrono::seconds(1);
    EXPECT_TRUE(tracker.eventually([&] {
        if (seconds_since(last) > 0.25) {
            client.write(igtl::encode_transform("ProbeToReference", 1, {{}, {5, 2, 300}}));
            last = Clock::now();
        }
        return tracker->health().message.find("times a second") != std::string::npos;
    })) << tracker->health().message;
}

// Whatever a sender sends, the tracker keeps 16 names and one message of bounded size: no more
// memory after 20,000 messages than after 2,000.
TEST(IgtlTracker, HostileSendersTakeNoMemoryAndStopNothing) {
    igtl::MessageReader reader;
    sonocase::testing::Random random(8);
    std::size_t poses = 0, broken = 0;
    for (int i = 0; i < 20000; ++i) {
        // Names without end, bodies of negative sizes (0xFF...), random cuts.
        Bytes bytes = igtl::encode_transform("Tool" + std::to_string(i), 1, {{}, {1, 2, 3}});
        if (i % 50 == 17) {
            for (std::size_t k = 42; k < 50; ++k) bytes[k] = 0xFF;
        }
        std::size_t at = 0;
        bool over = false;
        while (at < bytes.size() && !over) {
            const auto n = std::min<std::size_t>(
                bytes.size() - at, 1 + static_cast<std::size_t>(random.uniform(0, 60)));
            reader.add(std::span(bytes).subspan(at, n));
            at += n;
            for (bool more = true; more;) {
                const auto event = reader.next();
                more = event == igtl::MessageReader::Event::message ||
                       event == igtl::MessageReader::Event::bad_crc;
                if (event == igtl::MessageReader::Event::message)
                    poses += igtl::parse_poses(reader.header(), reader.body()).size();
                over = over || event == igtl::MessageReader::Event::broken;
            }
        }
        if (over) reader = {}, ++broken;  // as the tracker closes the connection
        ASSERT_LE(reader.kept_bytes(), igtl::kMaxBody + 16384) << i;
        if (i == 2000) {
            EXPECT_LT(reader.kept_bytes(), 512u);
        }
    }
    EXPECT_EQ(broken, 400u);
    EXPECT_EQ(poses, 19600u);
    EXPECT_LT(reader.kept_bytes(), 512u);
}

TEST(IgtlServer, SurvivesAThousandConnects) {
    Result<std::unique_ptr<IgtlServer>> server = IgtlServer::start("127.0.0.1", 0);
    ASSERT_TRUE(server);
    for (int i = 0; i < 1000; ++i) {
        Result<Socket> socket = Socket::connect("127.0.0.1", (*server)->port(), 5);
        ASSERT_TRUE(socket) << i << " " << socket.error().message();
        if (i % 3 == 0) socket->write(Bytes(100, 0xFF));
    }
    Event never;  // the server does not notify when clients come and go
    EXPECT_TRUE(seen_after_events(never, [&] { return (*server)->clients() == 0; }));
    auto tracker = start_tracker(0, true);
    for (int i = 0; i < 200; ++i) {
        Result<Socket> socket =
            Socket::connect("127.0.0.1", static_cast<IgtlTracker&>(*tracker).port(), 5);
        ASSERT_TRUE(socket) << i;
    }
}

TEST(IgtlAddress, IsReadAndRefused) {
    std::string host = "127.0.0.1";
    int port = 0;
    EXPECT_TRUE(split_address("18944", host, port));
    EXPECT_EQ(host, "127.0.0.1");
    EXPECT_EQ(port, 18944);
    EXPECT_TRUE(split_address("scanner.local:5", host, port));
    EXPECT_EQ(host, "scanner.local");
    EXPECT_TRUE(split_address("[::1]:18944", host, port));
    EXPECT_EQ(host, "::1");
    for (const char* bad : {"", "a:b", "1:", "host:99999", "host:-1", "host:1x"}) {
        EXPECT_FALSE(split_address(bad, host, port)) << bad;
    }
}

}  // namespace
}  // namespace sonocase::runtime
