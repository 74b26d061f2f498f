// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/flow_codec.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

namespace sonocase::detail {
namespace {

constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kMaxVessels = 65536, kMaxNodes = 1 << 18, kMaxName = 128;
constexpr double kPerMm = 1024, kRadiusPerMm = 256, kPerUnit = 32767;
constexpr double kMaxCoordinateMm = 1e5, kMaxFlowMlPerS = 1e4, kMaxShare = 1e3;

// The smallest vessel: name, kind, junctions, node count, mean, exponent, breathing, wave.
constexpr std::size_t kMinVesselBytes = 2 + 2 + 8 + 4 + 8 + 8 + 8 * kFlowHarmonics;
constexpr std::size_t kMinNodeBytes = 12 + 6 + 2;

template <class T>
void put(std::vector<std::uint8_t>& bytes, T value) {
    static_assert(std::is_trivially_copyable_v<T>);
    const std::size_t at = bytes.size();
    bytes.resize(at + sizeof value);
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

std::int32_t steps(double value, double per_unit) {
    return static_cast<std::int32_t>(std::lround(value * per_unit));
}

// Takes values off the front of bytes, and zeros once they have run out.
class Consumer {
  public:
    explicit Consumer(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
    template <class T>
    T take() {
        T value{};
        if (bytes_.size() < sizeof value) {
            ran_out_ = true;
            return value;
        }
        std::memcpy(&value, bytes_.data(), sizeof value);
        bytes_ = bytes_.subspan(sizeof value);
        return value;
    }
    std::string text(std::size_t count) {
        if (bytes_.size() < count) {
            ran_out_ = true;
            return {};
        }
        std::string out(reinterpret_cast<const char*>(bytes_.data()), count);
        bytes_ = bytes_.subspan(count);
        return out;
    }
    std::size_t left() const { return bytes_.size(); }
    bool ran_out() const { return ran_out_; }

  private:
    std::span<const std::uint8_t> bytes_;
    bool ran_out_ = false;
};

bool sane(double value, double max) {
    return std::isfinite(value) && std::abs(value) <= max;
}

bool printable(const std::string& name) {
    return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
        return static_cast<unsigned char>(c) >= 32 && c != 127;
    });
}

// What is wrong with a vessel; empty if nothing is.
std::string fault_of(const FlowVessel& v, const FlowField& field) {
    if (!printable(v.name)) return "has no printable name";
    const auto known = [&](int junction) { return junction >= -1 && junction < field.junctions; };
    if (!known(v.from) || !known(v.to)) return "meets a junction that does not exist";
    if (v.nodes == 1) return "has a single node";
    if (!(v.mean_ml_s >= 0) || !sane(v.mean_ml_s, kMaxFlowMlPerS))
        return "carries a flow that is negative or not finite";
    if (!(v.exponent >= 1 && v.exponent <= 100))
        return "has a profile whose exponent is not in 1 to 100";
    bool finite = sane(static_cast<double>(v.breathing), kMaxShare);
    for (const FlowHarmonic& h : v.wave)
        finite = finite && sane(static_cast<double>(h.re), kMaxShare) &&
                 sane(static_cast<double>(h.im), kMaxShare);
    return finite ? "" : "has a waveform that is not finite";
}

FlowVessel take_vessel(Consumer& from) {
    FlowVessel v;
    const auto length = from.take<std::uint16_t>();
    v.name = length <= kMaxName ? from.text(length) : std::string();
    const auto kind = from.take<std::uint8_t>();
    v.kind = static_cast<FlowKind>(std::min<std::uint8_t>(kind, 2));
    if (kind > 2) v.name.clear();
    const auto round = from.take<std::uint8_t>();
    v.round = round == 1;
    if (round > 1) v.name.clear();
    v.from = from.take<std::int32_t>();
    v.to = from.take<std::int32_t>();
    v.nodes = static_cast<int>(std::min<std::uint32_t>(from.take<std::uint32_t>(), kMaxNodes + 1));
    v.mean_ml_s = from.take<double>();
    v.exponent = from.take<float>();
    v.breathing = from.take<float>();
    for (FlowHarmonic& h : v.wave) {
        h.re = from.take<float>();
        h.im = from.take<float>();
    }
    return v;
}

// False where the direction is not a unit vector, a radius is 0 or the centre is out of range.
bool take_node(Consumer& from, bool round, FlowNode& node) {
    for (int axis = 0; axis < 3; ++axis) node.centre[axis] = from.take<std::int32_t>() / kPerMm;
    for (int axis = 0; axis < 3; ++axis)
        node.direction[axis] = from.take<std::int16_t>() / kPerUnit;
    bool good = std::abs(norm(node.direction) - 1) < 1e-3;
    for (int axis = 0; axis < 3; ++axis)
        good = good && std::abs(node.centre[axis]) <= kMaxCoordinateMm;
    const auto radius = [&] {
        const auto r = from.take<std::uint16_t>();
        good = good && r > 0;
        return static_cast<float>(r / kRadiusPerMm);
    };
    if (round) {
        node.radius_mm.fill(radius());
    } else {
        for (float& r : node.radius_mm) r = radius();
    }
    return good;
}

}  // namespace

std::vector<std::uint8_t> flow_bytes(const FlowField& field) {
    std::vector<std::uint8_t> bytes;
    put(bytes, kVersion);
    put(bytes, static_cast<std::uint32_t>(field.junctions));
    put(bytes, static_cast<std::uint32_t>(field.vessels.size()));
    put(bytes, static_cast<std::uint32_t>(field.nodes.size()));
    for (const FlowVessel& v : field.vessels) {
        const std::string name = v.name.substr(0, kMaxName);
        put(bytes, static_cast<std::uint16_t>(name.size()));
        bytes.insert(bytes.end(), name.begin(), name.end());
        put(bytes, static_cast<std::uint8_t>(v.kind));
        put(bytes, static_cast<std::uint8_t>(v.round));
        put(bytes, static_cast<std::int32_t>(v.from));
        put(bytes, static_cast<std::int32_t>(v.to));
        put(bytes, static_cast<std::uint32_t>(v.nodes));
        put(bytes, v.mean_ml_s);
        put(bytes, v.exponent);
        put(bytes, v.breathing);
        for (const FlowHarmonic& h : v.wave) {
            put(bytes, h.re);
            put(bytes, h.im);
        }
    }
    for (const FlowVessel& v : field.vessels) {
        for (int i = 0; i < v.nodes; ++i) {
            const FlowNode& node = field.nodes[v.first_node + i];
            for (int axis = 0; axis < 3; ++axis) put(bytes, steps(node.centre[axis], kPerMm));
            for (int axis = 0; axis < 3; ++axis)
                put(bytes, static_cast<std::int16_t>(steps(node.direction[axis], kPerUnit)));
            for (int ray = 0; ray < (v.round ? 1 : kFlowRays); ++ray) {
                const auto r = static_cast<double>(node.radius_mm[ray]);
                put(bytes, static_cast<std::uint16_t>(std::clamp(
                               steps(r, kRadiusPerMm), std::int32_t{1}, std::int32_t{65535})));
            }
        }
    }
    return bytes;
}

Result<FlowField> flow_from_bytes(std::span<const std::uint8_t> bytes, const std::string& where) {
    const auto fault = [&](const std::string& what) {
        return Error{"the flow field " + what, where, "cook the case again"};
    };
    Consumer from(bytes);
    const auto version = from.take<std::uint32_t>();
    if (from.ran_out()) return fault("is cut short");
    if (version != kVersion)
        return Error{"the flow field has version " + std::to_string(version), where,
                     "expected version 1; use a newer program"};
    FlowField field;
    const auto junctions = from.take<std::uint32_t>(), vessels = from.take<std::uint32_t>(),
               nodes = from.take<std::uint32_t>();
    if (from.ran_out()) return fault("is cut short");
    if (junctions > kMaxVessels || vessels > kMaxVessels || nodes > kMaxNodes ||
        vessels * kMinVesselBytes + nodes * kMinNodeBytes > from.left())
        return fault("does not have the size that its counts call for");
    field.junctions = static_cast<int>(junctions);
    field.vessels.reserve(vessels);
    std::size_t first = 0;
    for (std::size_t i = 0; i < vessels; ++i) {
        FlowVessel v = take_vessel(from);
        if (from.ran_out()) return fault("is cut short");
        if (const std::string why = fault_of(v, field); !why.empty())
            return fault("has a vessel " + std::to_string(i) + " that " + why);
        v.first_node = static_cast<int>(first);
        first += static_cast<std::size_t>(v.nodes);
        if (first > nodes) return fault("has fewer nodes than its vessels call for");
        field.vessels.push_back(std::move(v));
    }
    if (first != nodes) return fault("has more nodes than its vessels call for");
    field.nodes.resize(nodes);
    for (const FlowVessel& v : field.vessels) {
        for (int i = 0; i < v.nodes; ++i) {
            const bool good = take_node(from, v.round, field.nodes[v.first_node + i]);
            if (from.ran_out()) return fault("is cut short");
            if (!good)
                return fault("has a node of " + v.name + " without place, direction or radius");
        }
    }
    if (from.left() != 0) return fault("has bytes left over");
    return field;
}

}  // namespace sonocase::detail
