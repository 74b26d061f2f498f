// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/socket.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace sonocase::runtime::inline tracking_devices {
namespace {

bool wait_for(int descriptor, short what, double timeout_s) {
    pollfd p{descriptor, what, 0};
    return ::poll(&p, 1, static_cast<int>(timeout_s * 1000)) > 0;
}

void prepare(int descriptor) {
    ::fcntl(descriptor, F_SETFL, ::fcntl(descriptor, F_GETFL, 0) | O_NONBLOCK);
    ::fcntl(descriptor, F_SETFD, FD_CLOEXEC);
    const int on = 1;  // send a pose at once: it must not wait until a packet is full
    ::setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

struct Addresses {
    addrinfo* first = nullptr;
    ~Addresses() {
        if (first) ::freeaddrinfo(first);
    }
};

}  // namespace

Socket& Socket::operator=(Socket&& other) noexcept {
    if (this != &other) {
        close();
        std::swap(descriptor_, other.descriptor_);
    }
    return *this;
}

void Socket::close() {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
}

Result<Socket> Socket::connect(const std::string& host, int port, double timeout_s) {
    const std::string where = host + ":" + std::to_string(port);
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    Addresses found;
    const int code =
        ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found.first);
    if (code != 0) {
        return Error{Message("the host is not known ({})", {::gai_strerror(code)}), where,
                     "check the name"};
    }
    std::string reason = "no address";
    for (const addrinfo* a = found.first; a; a = a->ai_next) {
        Socket s(::socket(a->ai_family, a->ai_socktype, a->ai_protocol));
        if (!s.open()) continue;
        prepare(s.descriptor_);
        int error = 0;
        if (::connect(s.descriptor_, a->ai_addr, a->ai_addrlen) != 0) error = errno;
        if (error == EINPROGRESS) {
            error = ETIMEDOUT;
            socklen_t size = sizeof error;
            if (wait_for(s.descriptor_, POLLOUT, timeout_s)) {
                ::getsockopt(s.descriptor_, SOL_SOCKET, SO_ERROR, &error, &size);
            }
        }
        if (error == 0) return s;
        reason = std::strerror(error);
    }
    return Error{Message("no connection ({})", {reason}), where,
                 "start the server there, or check the address"};
}

Result<Socket> Socket::listen(const std::string& address, int port) {
    const std::string where = address + ":" + std::to_string(port);
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_PASSIVE | AI_NUMERICHOST;
    Addresses found;
    if (::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found.first) != 0) {
        return Error{"not a numeric address", where, "use e.g. 127.0.0.1:18944"};
    }
    Socket s(::socket(found.first->ai_family, SOCK_STREAM, 0));
    if (s.open()) {
        prepare(s.descriptor_);
        const int on = 1;
        ::setsockopt(s.descriptor_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
        if (::bind(s.descriptor_, found.first->ai_addr, found.first->ai_addrlen) == 0 &&
            ::listen(s.descriptor_, SOMAXCONN) == 0) {
            return s;
        }
    }
    return Error{Message("cannot listen ({})", {std::strerror(errno)}), where,
                 "choose another port, or end the program that has it"};
}

int Socket::port() const {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    if (::getsockname(descriptor_, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
    return ntohs(address.ss_family == AF_INET6
                     ? reinterpret_cast<sockaddr_in6*>(&address)->sin6_port
                     : reinterpret_cast<sockaddr_in*>(&address)->sin_port);
}

Socket Socket::accept(double timeout_s) {
    if (!wait_for(descriptor_, POLLIN, timeout_s)) return Socket();
    const int descriptor = ::accept(descriptor_, nullptr, nullptr);
    if (descriptor >= 0) prepare(descriptor);
    return Socket(descriptor);
}

long Socket::read(std::span<std::uint8_t> buffer, double timeout_s) {
    if (!wait_for(descriptor_, POLLIN, timeout_s)) return 0;
    const ssize_t n = ::recv(descriptor_, buffer.data(), buffer.size(), 0);
    if (n > 0) return n;
    return n < 0 && (errno == EAGAIN || errno == EINTR) ? 0 : -1;
}

long Socket::write(std::span<const std::uint8_t> bytes) {
    const ssize_t n = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n >= 0) return n;
    return errno == EAGAIN || errno == EINTR ? 0 : -1;
}

bool split_address(const std::string& text, std::string& host, int& port) {
    const std::size_t colon = text.rfind(':');
    if (colon != std::string::npos && colon > 0) host = text.substr(0, colon);
    if (host.size() > 2 && host.front() == '[' && host.back() == ']')
        host = host.substr(1, host.size() - 2);  // an address of version 6
    const std::string digits = colon == std::string::npos ? text : text.substr(colon + 1);
    if (digits.empty() || digits.size() > 5 ||
        digits.find_first_not_of("0123456789") != std::string::npos) {
        return false;
    }
    port = std::stoi(digits);
    return port <= 65535 && !host.empty();
}

}  // namespace sonocase::runtime::inline tracking_devices
