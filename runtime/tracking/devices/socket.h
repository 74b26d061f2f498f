// SPDX-License-Identifier: Apache-2.0

// TCP as far as OpenIGTLink needs it: connect, listen, reads with a time limit.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "formats/base/result.h"

namespace sonocase::runtime::inline tracking_devices {

class Socket {
  public:
    Socket() = default;
    explicit Socket(int descriptor) : descriptor_(descriptor) {}
    ~Socket() { close(); }
    Socket(Socket&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }
    Socket& operator=(Socket&& other) noexcept;
    Socket(const Socket&) = delete;
    Socket& operator=(const Socket&) = delete;

    static Result<Socket> connect(const std::string& host, int port, double timeout_s);
    // address: numeric; "127.0.0.1" keeps it on this machine. port: 0 takes a free one.
    static Result<Socket> listen(const std::string& address, int port);

    bool open() const { return descriptor_ >= 0; }
    int descriptor() const { return descriptor_; }
    int port() const;  // of this end
    void close();
    // Waits up to timeout_s; returns a socket that is not open if nobody connected.
    Socket accept(double timeout_s);
    // Returns the number of bytes read; 0: nothing came in time; -1: closed or broken.
    long read(std::span<std::uint8_t> buffer, double timeout_s);
    // Returns the number of bytes written without waiting; -1: closed or broken.
    long write(std::span<const std::uint8_t> bytes);

  private:
    int descriptor_ = -1;
};

// Splits "HOST:PORT", "[::1]:PORT", ":PORT" or "PORT"; `host` stays as it was if none is given.
// False: `text` is none of these.
bool split_address(const std::string& text, std::string& host, int& port);

}  // namespace sonocase::runtime::inline tracking_devices
