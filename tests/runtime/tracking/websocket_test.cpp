// SPDX-License-Identifier: Apache-2.0

// The WebSocket by itself, byte after byte, and the pose server against a client of this test and a
// hostile one. tests/runtime/web has node's and Chromium's own clients.
#include "runtime/tracking/devices/websocket.h"

#include <gtest/gtest.h>

#include <array>
#include <cstring>

#include "runtime/tracking/devices/pose_server.h"
#include "support/hard_case.h"

namespace sonocase::runtime {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::string request(const std::string& target,
                    const std::string& more = "Sec-WebSocket-Version: 13\r\n") {
    return "GET " + target +
           " HTTP/1.1\r\nHost: 127.0.0.1\r\nupgrade: WebSocket\r\nConnection: keep-alive, "
           "Upgrade\r\n"
           "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
           more + "\r\n";
}

// A client's frame: masked.
Bytes frame(std::uint8_t first, const std::string& payload) {
    const std::array<std::uint8_t, 4> mask{1, 2, 3, 4};
    Bytes out{first, static_cast<std::uint8_t>(0x80 | payload.size())};
    out.insert(out.end(), mask.begin(), mask.end());
    for (std::size_t n = 0; n < payload.size(); ++n)
        out.push_back(static_cast<std::uint8_t>(payload[n] ^ mask[n % 4]));
    return out;
}

TEST(WebSocket, AcceptsWithTheAnswerOfTheStandardsExample) {
    EXPECT_EQ(websocket::accept_of("dGhlIHNhbXBsZSBub25jZQ=="), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
    const auto answer = websocket::answer_of(request("/?token=abc"), "abc");
    ASSERT_TRUE(answer);
    EXPECT_TRUE(answer->accepted);
    EXPECT_NE(answer->text.find("101 Switching Protocols\r\n"), std::string::npos);
    EXPECT_NE(answer->text.find("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), std::string::npos);
}

TEST(WebSocket, WaitsForTheWholeRequestAndNotForEver) {
    const std::string whole = request("/?token=abc");
    for (std::size_t n = 0; n < whole.size(); ++n)
        ASSERT_FALSE(websocket::answer_of(whole.substr(0, n), "abc")) << n;
    const auto flood = websocket::answer_of("GET /" + std::string(9000, 'a'), "abc");
    ASSERT_TRUE(flood);
    EXPECT_FALSE(flood->accepted);
    std::string endless = "GET /";
    while (!websocket::answer_of(endless, "abc")) endless += 'a';
    sonocase::testing::HardCase waited("bytes of a request without end that are waited for",
                                       sonocase::testing::HardCase::at_most, 8193, "");
    waited.see(static_cast<double>(endless.size() - 1));
}

TEST(WebSocket, RefusesWithoutTheTokenAndWhatIsNoWebSocket) {
    for (const char* target :
         {"/", "/?token=", "/?token=abd", "/?token=abcd", "/?xtoken=abc", "/token=abc"}) {
        const auto answer = websocket::answer_of(request(target), "abc");
        ASSERT_TRUE(answer) << target;
        EXPECT_FALSE(answer->accepted);
        EXPECT_NE(answer->text.find("403"), std::string::npos) << target;
    }
    EXPECT_TRUE(websocket::answer_of(request("/?a=1&token=abc&b"), "abc")->accepted);
    const auto old =
        websocket::answer_of(request("/?token=abc", "Sec-WebSocket-Version: 8\r\n"), "abc");
    EXPECT_NE(old->text.find("426"), std::string::npos);
    for (const char* wrong : {"GET /?token=abc HTTP/1.1\r\n\r\n", "POST / HTTP/1.1\r\n\r\n",
                              "GET  HTTP/1.1\r\n\r\n", "\r\n\r\n", "GET HTTP/1.1\r\n\r\n"})
        EXPECT_NE(websocket::answer_of(wrong, "abc")->text.find("400"), std::string::npos) << wrong;
}

TEST(WebSocket, FramesOfEverySizeHaveTheirHead) {
    EXPECT_EQ(websocket::text_frame("Hello"), (Bytes{0x81, 5, 'H', 'e', 'l', 'l', 'o'}));
    const Bytes middle = websocket::text_frame(std::string(126, 'a'));
    EXPECT_EQ((Bytes{middle.begin(), middle.begin() + 4}), (Bytes{0x81, 126, 0, 126}));
    const Bytes large = websocket::text_frame(std::string(65536, 'a'));
    EXPECT_EQ((Bytes{large.begin(), large.begin() + 10}),
              (Bytes{0x81, 127, 0, 0, 0, 0, 0, 1, 0, 0}));
}

TEST(WebSocket, AnswersPingsAndCloseInAnyPieces) {
    Bytes all = frame(0x81, "ignored");
    for (const Bytes& more : {frame(0x89, "are you there"), frame(0x88, "\x03\xE8 bye")})
        all.insert(all.end(), more.begin(), more.end());
    Bytes wanted{0x8A, 13};
    for (const char c : std::string("are you there"))
        wanted.push_back(static_cast<std::uint8_t>(c));
    for (const int byte : {0x88, 2, 0x03, 0xE8}) wanted.push_back(static_cast<std::uint8_t>(byte));
    for (std::size_t piece = 1; piece <= all.size(); ++piece) {
        websocket::ClientFrames frames;
        Bytes answer;
        bool goes_on = true;
        for (std::size_t at = 0; at < all.size() && goes_on; at += piece)
            goes_on =
                frames.take(std::span(all).subspan(at, std::min(piece, all.size() - at)), answer);
        EXPECT_FALSE(goes_on);
        EXPECT_EQ(answer, wanted) << piece;
    }
}

TEST(WebSocket, EndsOnWhatNoClientMaySend) {
    const Bytes unmasked{0x81, 2, 'a', 'b'}, huge{0x81, 0xFF, 0, 0, 0, 0, 0xFF, 0, 0, 0},
        large{0x81, 0xFE, 0xFF, 0xFF}, extended{0xC1, 0x80, 0, 0, 0, 0},
        long_ping{0x89, 0xFE, 0, 200}, ping_in_parts{0x09, 0x80, 0, 0, 0, 0};
    for (const Bytes& bytes : {unmasked, huge, large, extended, long_ping, ping_in_parts}) {
        websocket::ClientFrames frames;
        Bytes answer;
        EXPECT_FALSE(frames.take(bytes, answer));
        ASSERT_EQ(answer.size(), 4u);
        EXPECT_EQ(answer[0], 0x88);
    }
}

// A client with a socket of its own; what it reads comes within ten seconds or not at all.
struct Peer {
    explicit Peer(int port) : socket(std::move(*Socket::connect("127.0.0.1", port, 10))) {}
    void send(const std::string& text) {
        std::span<const std::uint8_t> left(reinterpret_cast<const std::uint8_t*>(text.data()),
                                           text.size());
        while (!left.empty()) {
            const long n = socket.write(left);
            if (n < 0) return;
            left = left.subspan(static_cast<std::size_t>(n));
        }
    }
    // Reads until the text has come; false: the server has closed first.
    bool read_until(const std::string& text) {
        std::array<std::uint8_t, 4096> buffer;
        while (heard.find(text) == heard.npos) {
            const long n = socket.read(buffer, 10);
            if (n <= 0) return false;
            heard.append(buffer.begin(), buffer.begin() + n);
        }
        return true;
    }
    Socket socket;
    std::string heard;
};

void publish(PoseServer& server, double x, bool has_needle) {
    server.slot() = {1.5, true, has_needle, {Matrix3{}, {x, 0, 0}}, {Matrix3{}, {0, 1.0 / 3, 0}}};
    server.publish();
}

TEST(PoseServer, SendsTheNewestPoseToThoseWhoKnowTheToken) {
    auto started = PoseServer::start("0", "abc");
    ASSERT_TRUE(started) << started.error().message();
    PoseServer& server = **started;
    EXPECT_EQ(server.url(), "ws://127.0.0.1:" + std::to_string(server.port()) + "/?token=abc");
    publish(server, 7, false);
    Peer good(server.port()), stranger(server.port());
    stranger.send(request("/?token=xyz"));
    EXPECT_TRUE(stranger.read_until("403 Forbidden"));
    EXPECT_FALSE(stranger.read_until("probe"));
    good.send(request("/?token=abc"));
    // The newest pose comes at once, and then each new one.
    EXPECT_TRUE(
        good.read_until("{\"time_s\":1.500000,\"probe\":[1,0,0,7,0,1,0,0,0,0,1,0,0,0,0,1],"
                        "\"needle\":null}"));
    publish(server, 8, true);
    EXPECT_TRUE(good.read_until("[1,0,0,8,"));
    EXPECT_TRUE(good.read_until("\"needle\":[1,0,0,0,0,1,0,0.33333333333333331,"));
    const Bytes bye = frame(0x88, "");
    good.send(std::string(bye.begin(), bye.end()));
    EXPECT_FALSE(good.read_until("never sent"));
}

TEST(PoseServer, TokensAreNewEachTimeAndAddressesChecked) {
    const auto a = PoseServer::start("0"), b = PoseServer::start("127.0.0.1:0");
    ASSERT_TRUE(a && b);
    const auto token = [](const auto& s) {
        return (*s)->url().substr((*s)->url().find("token=") + 6);
    };
    EXPECT_EQ(token(a).size(), 32u);
    EXPECT_NE(token(a), token(b));
    for (const char* wrong : {"", "port", "1:2:x", "99999"})
        EXPECT_FALSE(PoseServer::start(wrong)) << wrong;
}

}  // namespace
}  // namespace sonocase::runtime
