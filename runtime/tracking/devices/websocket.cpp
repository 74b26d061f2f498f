// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/websocket.h"

#include <algorithm>
#include <array>
#include <bit>

#include "formats/base/base64.h"
#include "formats/text/lower_case.h"

namespace sonocase::runtime::websocket {
namespace {

enum Opcode : std::uint8_t { kText = 1, kClose = 8, kPing = 9, kPong = 10 };
constexpr std::uint8_t kLast = 0x80, kMasked = 0x80;
constexpr std::uint16_t kProtocolError = 1002, kTooLarge = 1009;

using Sha1 = std::array<std::uint8_t, 20>;

// FIPS 180-4. For the handshake alone, which needs no strength.
Sha1 sha1(std::string_view text) {
    std::vector<std::uint8_t> bytes(text.begin(), text.end());
    bytes.push_back(0x80);
    while (bytes.size() % 64 != 56) bytes.push_back(0);
    for (int n = 7; n >= 0; --n)
        bytes.push_back(static_cast<std::uint8_t>(8 * std::uint64_t{text.size()} >> 8 * n));
    std::array<std::uint32_t, 5> h{0x67452301, 0xEFCDAB89, 0x98BADCFE, 0x10325476, 0xC3D2E1F0};
    for (std::size_t at = 0; at < bytes.size(); at += 64) {
        std::array<std::uint32_t, 80> w{};
        for (std::size_t t = 0; t < 64; ++t)
            w[t / 4] |= static_cast<std::uint32_t>(bytes[at + t]) << (24 - 8 * (t % 4));
        for (std::size_t t = 16; t < 80; ++t)
            w[t] = std::rotl(w[t - 3] ^ w[t - 8] ^ w[t - 14] ^ w[t - 16], 1);
        auto [a, b, c, d, e] = h;
        for (std::size_t t = 0; t < 80; ++t) {
            const std::uint32_t f = t < 20   ? ((b & c) | (~b & d)) + 0x5A827999
                                    : t < 40 ? (b ^ c ^ d) + 0x6ED9EBA1
                                    : t < 60 ? ((b & c) | (b & d) | (c & d)) + 0x8F1BBCDC
                                             : (b ^ c ^ d) + 0xCA62C1D6;
            const std::uint32_t next = std::rotl(a, 5) + f + e + w[t];
            e = d;
            d = c;
            c = std::rotl(b, 30);
            b = a;
            a = next;
        }
        h = {h[0] + a, h[1] + b, h[2] + c, h[3] + d, h[4] + e};
    }
    Sha1 out;
    for (std::size_t n = 0; n < out.size(); ++n)
        out[n] = static_cast<std::uint8_t>(h[n / 4] >> (24 - 8 * (n % 4)));
    return out;
}

// Value of a header field; "" if there is none.
std::string_view field(std::string_view request, std::string_view name) {
    for (std::size_t at = request.find("\r\n"); at != request.npos;
         at = request.find("\r\n", at + 2)) {
        const std::string_view line = request.substr(at + 2, request.find("\r\n", at + 2) - at - 2);
        const std::size_t colon = line.find(':');
        if (colon == line.npos || lower_case(line.substr(0, colon)) != name) continue;
        std::string_view value = line.substr(colon + 1);
        while (!value.empty() && (value.front() == ' ' || value.front() == '\t'))
            value.remove_prefix(1);
        while (!value.empty() && (value.back() == ' ' || value.back() == '\t'))
            value.remove_suffix(1);
        return value;
    }
    return {};
}

// The same time for any two texts of this length.
bool equal(std::string_view a, std::string_view b) {
    if (a.size() != b.size()) return false;
    unsigned differ = 0;
    for (std::size_t n = 0; n < a.size(); ++n) differ |= static_cast<unsigned>(a[n] ^ b[n]);
    return differ == 0;
}

std::string_view token_of(std::string_view target) {
    const std::size_t query = target.find('?');
    std::string_view rest = query == target.npos ? std::string_view() : target.substr(query + 1);
    while (!rest.empty()) {
        const std::string_view item = rest.substr(0, rest.find('&'));
        if (item.starts_with("token=")) return item.substr(6);
        rest.remove_prefix(std::min(rest.size(), item.size() + 1));
    }
    return {};
}

Answer refusal(const char* status) {
    return {
        std::string("HTTP/1.1 ") + status + "\r\nContent-Length: 0\r\nConnection: close\r\n\r\n",
        false};
}

void add_frame(std::uint8_t opcode,
               std::span<const std::uint8_t> payload,
               std::vector<std::uint8_t>& out) {
    out.push_back(kLast | opcode);
    if (payload.size() < 126) {
        out.push_back(static_cast<std::uint8_t>(payload.size()));
    } else {
        const int bytes = payload.size() < 65536 ? 2 : 8;
        out.push_back(bytes == 2 ? 126 : 127);
        for (int n = bytes - 1; n >= 0; --n)
            out.push_back(static_cast<std::uint8_t>(std::uint64_t{payload.size()} >> 8 * n));
    }
    out.insert(out.end(), payload.begin(), payload.end());
}

bool close_with(std::uint16_t code, std::vector<std::uint8_t>& answer) {
    const std::array<std::uint8_t, 2> bytes{static_cast<std::uint8_t>(code >> 8),
                                            static_cast<std::uint8_t>(code & 0xFF)};
    add_frame(kClose, bytes, answer);
    return false;
}

}  // namespace

std::string accept_of(std::string_view key) {
    return base64(sha1(std::string(key) + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"));
}

std::optional<Answer> answer_of(std::string_view request, std::string_view token) {
    const std::size_t end = request.find("\r\n\r\n");
    if (end == request.npos) {
        if (request.size() > kMaxRequestBytes)
            return refusal("431 Request Header Fields Too Large");
        return std::nullopt;
    }
    request = request.substr(0, end + 2);
    const std::string_view line = request.substr(0, request.find("\r\n"));
    const std::size_t space = line.find(' ');
    if (!line.starts_with("GET ") || !line.ends_with(" HTTP/1.1"))
        return refusal("400 Bad Request");
    const std::string_view target = line.substr(space + 1, line.size() - space - 10);
    const std::string_view key = field(request, "sec-websocket-key");
    if (lower_case(field(request, "upgrade")) != "websocket" || key.size() != 24 ||
        lower_case(field(request, "connection")).find("upgrade") == std::string::npos)
        return refusal("400 Bad Request");
    if (field(request, "sec-websocket-version") != "13")
        return Answer{
            "HTTP/1.1 426 Upgrade Required\r\nSec-WebSocket-Version: 13\r\n"
            "Content-Length: 0\r\nConnection: close\r\n\r\n",
            false};
    if (!equal(token_of(target), token)) return refusal("403 Forbidden");
    return Answer{
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Accept: " +
            accept_of(key) + "\r\n\r\n",
        true};
}

std::vector<std::uint8_t> text_frame(std::string_view text) {
    std::vector<std::uint8_t> out;
    add_frame(kText, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, out);
    return out;
}

bool ClientFrames::take(std::span<const std::uint8_t> bytes, std::vector<std::uint8_t>& answer) {
    rest_.insert(rest_.end(), bytes.begin(), bytes.end());
    std::size_t at = 0;
    bool goes_on = true;
    while (goes_on && rest_.size() - at >= 2) {
        const std::uint8_t *frame = rest_.data() + at, opcode = frame[0] & 0x0F;
        const std::size_t have = rest_.size() - at;
        std::size_t size = frame[1] & 0x7F, head = 2;
        // Clients must mask, and know no extension of ours.
        if (!(frame[1] & kMasked) || (frame[0] & 0x70) != 0)
            return close_with(kProtocolError, answer);
        if (size == 127) return close_with(kTooLarge, answer);
        if (size == 126) {
            head = 4;
            if (have < head) break;
            size = static_cast<std::size_t>(frame[2]) << 8 | frame[3];
        }
        if (size > kMaxFrameBytes) return close_with(kTooLarge, answer);
        if (opcode >= kClose && (size > 125 || !(frame[0] & kLast)))
            return close_with(kProtocolError, answer);
        if (have < head + 4 + size) break;
        const std::uint8_t *mask = frame + head, *from = mask + 4;
        std::vector<std::uint8_t> payload(size);
        for (std::size_t n = 0; n < size; ++n)
            payload[n] = static_cast<std::uint8_t>(from[n] ^ mask[n % 4]);
        if (opcode == kPing) add_frame(kPong, payload, answer);
        if (opcode == kClose) {
            payload.resize(std::min<std::size_t>(size, 2));
            add_frame(kClose, payload, answer);
            goes_on = false;
        }
        at += head + 4 + size;
    }
    rest_.erase(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(at));
    return goes_on;
}

}  // namespace sonocase::runtime::websocket
