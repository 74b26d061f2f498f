// SPDX-License-Identifier: Apache-2.0

// The server's side of a WebSocket (RFC 6455) as far as sending texts to pages needs it: bytes in,
// bytes out, no socket.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase::runtime::websocket {

// The largest request, and the largest frame, that a page may send.
inline constexpr std::size_t kMaxRequestBytes = 8192, kMaxFrameBytes = 4096;

// Sec-WebSocket-Accept for a Sec-WebSocket-Key (part 4.2.2).
std::string accept_of(std::string_view key);

struct Answer {
    std::string text;       // to send
    bool accepted = false;  // false: send it and close
};

// The answer to a request that has ended with an empty line; nothing: it has not ended yet, and
// is not too long either. token: what "token=" of the address must be.
std::optional<Answer> answer_of(std::string_view request, std::string_view token);

// A text as one frame; servers do not mask.
std::vector<std::uint8_t> text_frame(std::string_view text);

// What a client sends, byte after byte. Pings are answered, texts ignored.
class ClientFrames {
  public:
    // Appends what is to be answered. False: the connection ends, after the answer has been sent.
    bool take(std::span<const std::uint8_t> bytes, std::vector<std::uint8_t>& answer);

  private:
    std::vector<std::uint8_t> rest_;
};

}  // namespace sonocase::runtime::websocket
