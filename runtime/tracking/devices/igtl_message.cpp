// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/igtl_message.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "runtime/engine/tracker_reading.h"

namespace sonocase::runtime::igtl {
namespace {

std::uint64_t big(std::span<const std::uint8_t> b, std::size_t at, std::size_t bytes) {
    std::uint64_t v = 0;
    for (std::size_t i = 0; i < bytes; ++i) v = v << 8 | b[at + i];
    return v;
}

double big_float(std::span<const std::uint8_t> b, std::size_t at) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(big(b, at, 4)));
}

void put(std::vector<std::uint8_t>& out, std::uint64_t v, std::size_t bytes) {
    for (std::size_t i = bytes; i-- > 0;) out.push_back(static_cast<std::uint8_t>(v >> (8 * i)));
}

void put_float(std::vector<std::uint8_t>& out, double v) {
    put(out, std::bit_cast<std::uint32_t>(static_cast<float>(v)), 4);
}

void put_text(std::vector<std::uint8_t>& out, std::string_view text, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i) {
        out.push_back(i < text.size() ? static_cast<std::uint8_t>(text[i]) : std::uint8_t{0});
    }
}

std::string text_of(std::span<const std::uint8_t> b, std::size_t at, std::size_t bytes) {
    std::string text;
    for (std::size_t i = at; i < at + bytes && b[i] != 0; ++i) {
        text += b[i] >= 32 && b[i] < 127 ? static_cast<char>(b[i]) : '?';
    }
    return text;
}

// NDI's number for a tool that is missing, -3.7e28, and others that no tracker measures.
bool is_missing(const Rigid& t) {
    return norm(t.translation) >= kFarthestMm;
}

// Twelve floats, column by column.
NamedPose matrix_at(std::span<const std::uint8_t> b, std::size_t at) {
    NamedPose pose;
    Rigid t;
    for (int c = 0; c < 4; ++c) {
        for (int r = 0; r < 3; ++r) {
            const double v = big_float(b, at + 4 * static_cast<std::size_t>(3 * c + r));
            (c < 3 ? t.rotation(r, c) : t.translation[r]) = v;
        }
    }
    if (!is_finite(t)) {
        pose.fault = PoseFault::not_finite;
    } else if (is_missing(t)) {
        pose.fault = PoseFault::lost;
    } else if (!(determinant(t.rotation) >= 0)) {
        pose.fault = PoseFault::mirrored;
    } else if (!(orthonormality_error(t.rotation) < 1e-2)) {
        pose.fault = PoseFault::scaled;
    } else {
        t.rotation = nearest_rotation(t.rotation);  // single precision is off by 1e-7
        pose.to_from = t;
    }
    return pose;
}

// Position and quaternion x, y, z, w.
NamedPose quaternion_at(std::span<const std::uint8_t> b, std::size_t at, std::size_t parts) {
    NamedPose pose;
    Rigid t;
    double q[4] = {0, 0, 0, 1};
    for (std::size_t i = 0; i < 3; ++i)
        t.translation[static_cast<int>(i)] = big_float(b, at + 4 * i);
    for (std::size_t i = 0; i < parts; ++i) q[i] = big_float(b, at + 12 + 4 * i);
    if (parts == 3) {  // the compressed form leaves w out
        q[3] = std::sqrt(std::max(0.0, 1 - q[0] * q[0] - q[1] * q[1] - q[2] * q[2]));
    }
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!is_finite(t) || !std::isfinite(length)) {
        pose.fault = PoseFault::not_finite;
    } else if (is_missing(t)) {
        pose.fault = PoseFault::lost;
    } else if (parts == 0) {
        pose.fault = PoseFault::unturned;
    } else if (!(std::abs(length - 1) < 0.05)) {
        pose.fault = PoseFault::scaled;
    } else {
        t.rotation = rotation_from_quaternion({q[3], q[0], q[1], q[2]});
        pose.to_from = t;
    }
    return pose;
}

bool is_ours(const std::string& type) {
    return type == "TRANSFORM" || type == "SENSOR" || type == "TDATA" || type == "QTDATA" ||
           type == "POSITION" || type == "QTRANS";
}

}  // namespace

std::uint64_t crc64(std::span<const std::uint8_t> bytes) {
    static const std::array<std::uint64_t, 256> kTable = [] {
        std::array<std::uint64_t, 256> table{};
        for (std::uint64_t i = 0; i < 256; ++i) {
            std::uint64_t v = i << 56;
            for (int bit = 0; bit < 8; ++bit) {
                v = v & 0x8000000000000000ull ? v << 1 ^ 0x42F0E1EBA9EA3693ull : v << 1;
            }
            table[i] = v;
        }
        return table;
    }();
    std::uint64_t crc = 0;
    for (std::uint8_t byte : bytes) crc = kTable[(crc >> 56 ^ byte) & 0xFF] ^ crc << 8;
    return crc;
}

std::optional<Header> parse_header(std::span<const std::uint8_t> bytes) {
    Header h;
    h.version = static_cast<std::uint16_t>(big(bytes, 0, 2));
    if (h.version < 1 || h.version > 3) return std::nullopt;
    h.type = text_of(bytes, 2, 12);
    h.device = text_of(bytes, 14, 20);
    h.time_s = static_cast<double>(big(bytes, 34, 4)) +
               static_cast<double>(big(bytes, 38, 4)) / 4294967296.0;
    h.body_size = big(bytes, 42, 8);
    h.crc = big(bytes, 50, 8);
    return h;
}

namespace {

// Versions 2 and 3 put an extended header before the content and metadata after it. Empty where
// that does not fit.
std::span<const std::uint8_t> content_of(const Header& header,
                                         std::span<const std::uint8_t> body,
                                         std::span<const std::uint8_t>* metadata = nullptr) {
    if (header.version < 2) return body;
    if (body.size() < 12) return {};
    const std::size_t extended = big(body, 0, 2), meta = big(body, 2, 2) + big(body, 4, 4);
    if (extended < 12 || extended + meta > body.size()) return {};
    if (metadata) *metadata = body.last(meta);
    return body.subspan(extended, body.size() - extended - meta);
}

// Calls use(key, value) for each entry: a count, the sizes of all, then keys and values.
template <class Use>
void each_entry(std::span<const std::uint8_t> metadata, Use use) {
    if (metadata.size() < 2) return;
    const std::size_t count = big(metadata, 0, 2);
    std::size_t at = 2 + 8 * count;
    for (std::size_t i = 0; i < count && at <= metadata.size(); ++i) {
        const std::size_t key = big(metadata, 2 + 8 * i, 2), value = big(metadata, 6 + 8 * i, 4);
        if (key > metadata.size() - at || value > metadata.size() - at - key) return;
        const auto text = [&](std::size_t from, std::size_t size) {
            return std::string_view(reinterpret_cast<const char*>(metadata.data()) + from, size);
        };
        use(text(at, key), text(at + key, value));
        at += key + value;
    }
}

// Marks the poses that the metadata says are none: TransformStatus for all of the message, or
// NAMEStatus and NAMETransformStatus for one of a list, with another value than OK.
void mark_lost(std::span<const std::uint8_t> metadata, std::vector<NamedPose>& poses) {
    each_entry(metadata, [&](std::string_view key, std::string_view value) {
        if (!key.ends_with("Status") && !key.ends_with("status")) return;
        while (!value.empty() && (value.back() == ' ' || value.back() == 0)) value.remove_suffix(1);
        if (value == "OK" || value == "ok" || value == "Ok" || value == "VALID" ||
            value == "TOOL_OK" || value.empty())
            return;
        key.remove_suffix(6);
        for (NamedPose& pose : poses) {
            if (key.empty() || key == "Transform" || key == pose.name ||
                key == pose.name + "Transform")
                pose = {pose.name, {}, PoseFault::lost};
        }
    });
}

}  // namespace

std::optional<double> parse_force_n(const Header& header, std::span<const std::uint8_t> body) {
    if (header.type != "SENSOR" || header.device != "ProbeForce") return {};
    body = content_of(header, body);
    if (body.size() < 18 || body[0] < 1 || body.size() != 10 + 8 * std::size_t{body[0]}) return {};
    const double newtons = std::bit_cast<double>(big(body, 10, 8));
    if (!(newtons >= 0 && newtons <= kMaxForceN)) return {};
    return newtons;
}

std::vector<NamedPose> parse_poses(const Header& header, std::span<const std::uint8_t> body) {
    std::span<const std::uint8_t> metadata;
    body = content_of(header, body, &metadata);
    std::vector<NamedPose> poses;
    const auto add = [&](const std::string& name, NamedPose pose) {
        pose.name = name;
        poses.push_back(std::move(pose));
    };
    if (header.type == "TRANSFORM" && body.size() == 48) {
        add(header.device, matrix_at(body, 0));
    } else if ((header.type == "POSITION" || header.type == "QTRANS") &&
               (body.size() == 12 || body.size() == 24 || body.size() == 28)) {
        add(header.device, quaternion_at(body, 0, body.size() / 4 - 3));
    } else if (header.type == "TDATA" && body.size() % 70 == 0) {
        for (std::size_t at = 0; at < body.size(); at += 70) {
            add(text_of(body, at, 20), matrix_at(body, at + 22));
        }
    } else if (header.type == "QTDATA" && body.size() % 50 == 0) {
        for (std::size_t at = 0; at < body.size(); at += 50) {
            add(text_of(body, at, 20), quaternion_at(body, at + 22, 4));
        }
    }
    mark_lost(metadata, poses);
    return poses;
}

std::vector<std::uint8_t> encode(std::string_view type,
                                 std::string_view device,
                                 double time_s,
                                 std::span<const std::uint8_t> body) {
    std::vector<std::uint8_t> out;
    out.reserve(kHeaderSize + body.size());
    put(out, 1, 2);
    put_text(out, type, 12);
    put_text(out, device, 20);
    const double whole = std::floor(time_s);
    put(out, static_cast<std::uint64_t>(whole), 4);
    put(out, static_cast<std::uint64_t>((time_s - whole) * 4294967296.0), 4);
    put(out, body.size(), 8);
    put(out, crc64(body), 8);
    out.insert(out.end(), body.begin(), body.end());
    return out;
}

std::vector<std::uint8_t> encode_transform(std::string_view device, double time_s, const Rigid& t) {
    std::vector<std::uint8_t> body;
    for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r) put_float(body, t.rotation(r, c));
    }
    for (int r = 0; r < 3; ++r) put_float(body, t.translation[r]);
    return encode("TRANSFORM", device, time_s, body);
}

std::vector<std::uint8_t> encode_request(double time_s) {
    std::vector<std::uint8_t> body;
    put(body, 16, 4);
    put_text(body, "", 32);
    return encode("STT_TDATA", "", time_s, body);
}

std::vector<std::uint8_t> encode_sensor(std::string_view device,
                                        double time_s,
                                        std::span<const double> values) {
    std::vector<std::uint8_t> body;
    put(body, values.size(), 1);
    put(body, 0, 1);  // status, reserved
    put(body, 0, 8);  // unit
    for (const double value : values) put(body, std::bit_cast<std::uint64_t>(value), 8);
    return encode("SENSOR", device, time_s, body);
}

std::vector<std::uint8_t> encode_image(std::string_view device,
                                       double time_s,
                                       int width_px,
                                       int height_px,
                                       double spacing_mm,
                                       const Rigid& ras_from_image,
                                       std::span<const std::uint8_t> pixels) {
    std::vector<std::uint8_t> body;
    body.reserve(72 + pixels.size());
    put(body, 1, 2);
    for (std::uint64_t byte : {1, 3, 1, 1}) put(body, byte, 1);  // one grey byte, big-endian, RAS
    for (int n : {width_px, height_px, 1}) put(body, static_cast<std::uint64_t>(n), 2);
    for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r) put_float(body, spacing_mm * ras_from_image.rotation(r, c));
    }
    for (int r = 0; r < 3; ++r) put_float(body, ras_from_image.translation[r]);
    for (int n : {0, 0, 0, width_px, height_px, 1}) put(body, static_cast<std::uint64_t>(n), 2);
    body.insert(body.end(), pixels.begin(), pixels.end());
    return encode("IMAGE", device, time_s, body);
}

void MessageReader::add(std::span<const std::uint8_t> bytes) {
    if (skip_ > 0) {
        const std::size_t n =
            static_cast<std::size_t>(std::min<std::uint64_t>(skip_, bytes.size()));
        skip_ -= n;
        bytes = bytes.subspan(n);
    }
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(at_));
    at_ = 0;
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
}

MessageReader::Event MessageReader::next() {
    const std::span<const std::uint8_t> b(buffer_.data() + at_, buffer_.size() - at_);
    if (b.size() < kHeaderSize) return Event::need_more;
    const std::optional<Header> header = parse_header(b);
    if (!header) {
        problem_ = "it does not speak OpenIGTLink version 1 to 3";
        return Event::broken;
    }
    if (!is_ours(header->type)) {
        // Skipped without being kept, however long it is.
        header_ = *header;
        body_ = {};
        const std::uint64_t here =
            std::min<std::uint64_t>(b.size() - kHeaderSize, header->body_size);
        at_ += kHeaderSize + static_cast<std::size_t>(here);
        skip_ = header->body_size - here;
        return Event::message;
    }
    if (header->body_size > kMaxBody) {
        problem_ = "it announces a " + header->type + " of " + std::to_string(header->body_size) +
                   " bytes";
        return Event::broken;
    }
    const std::size_t size = static_cast<std::size_t>(header->body_size);
    if (b.size() - kHeaderSize < size) return Event::need_more;
    header_ = *header;
    body_ = b.subspan(kHeaderSize, size);
    at_ += kHeaderSize + size;
    return crc64(body_) == header_.crc ? Event::message : Event::bad_crc;
}

}  // namespace sonocase::runtime::igtl
