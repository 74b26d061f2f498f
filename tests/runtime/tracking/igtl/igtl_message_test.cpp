// SPDX-License-Identifier: Apache-2.0

// The codec of OpenIGTLink by itself.
#include "runtime/tracking/devices/igtl_message.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "support/hard_case.h"
#include "support/random.h"

namespace sonocase::runtime {
namespace {

using Bytes = std::vector<std::uint8_t>;

TEST(IgtlMessage, CrcOfTheCheckString) {
    // CRC-64 of ECMA-182 with this polynomial.
    const std::string check = "123456789";
    EXPECT_EQ(igtl::crc64({reinterpret_cast<const std::uint8_t*>(check.data()), 9}),
              0x6C40DF5F0B497347ull);
}

TEST(IgtlMessage, TransformComesBack) {
    sonocase::testing::Random random(5);
    for (int i = 0; i < 50; ++i) {
        const Rigid pose = random.rigid(500);
        igtl::MessageReader reader;
        reader.add(igtl::encode_transform("ProbeToTracker", 1700000000.25, pose));
        ASSERT_EQ(reader.next(), igtl::MessageReader::Event::message);
        EXPECT_EQ(reader.header().time_s, 1700000000.25);
        const auto poses = igtl::parse_poses(reader.header(), reader.body());
        ASSERT_EQ(poses.size(), 1u);
        EXPECT_EQ(poses[0].name, "ProbeToTracker");
        // Single precision.
        EXPECT_LT(norm(poses[0].to_from.translation - pose.translation), 1e-4);
        EXPECT_LT(rotation_angle(transpose(poses[0].to_from.rotation) * pose.rotation), 1e-6);
    }
}

// Header version 2: 12 bytes before the content, then metadata.
Bytes with_metadata(const Bytes& version1,
                    const std::vector<std::pair<std::string, std::string>>& entries) {
    Bytes sizes, texts;
    const auto put = [](Bytes& to, std::uint64_t v, int bytes) {
        while (bytes-- > 0) to.push_back(static_cast<std::uint8_t>(v >> (8 * bytes)));
    };
    put(sizes, entries.size(), 2);
    for (const auto& [key, value] : entries) {
        put(sizes, key.size(), 2);
        put(sizes, 3, 2);
        put(sizes, value.size(), 4);
        texts.insert(texts.end(), key.begin(), key.end());
        texts.insert(texts.end(), value.begin(), value.end());
    }
    Bytes body;
    put(body, 12, 2);
    put(body, sizes.size(), 2);
    put(body, texts.size(), 4);
    put(body, 1, 4);
    body.insert(body.end(), version1.begin() + igtl::kHeaderSize, version1.end());
    body.insert(body.end(), sizes.begin(), sizes.end());
    body.insert(body.end(), texts.begin(), texts.end());
    return body;
}

TEST(IgtlMessage, MetadataSaysWhichPosesAreNone) {
    igtl::Header header;
    header.version = 2;
    header.type = "TRANSFORM";
    header.device = "NeedleToTracker";
    const Bytes message = igtl::encode_transform(header.device, 1, {});
    using igtl::PoseFault;
    for (const auto& [key, value, fault] :
         {std::tuple("TransformStatus", "INVALID", PoseFault::lost),
          {"TransformStatus", "OUT_OF_VIEW", PoseFault::lost},
          {"NeedleToTrackerStatus", "MISSING", PoseFault::lost},
          {"NeedleToTrackerTransformStatus", "INVALID", PoseFault::lost},
          {"TransformStatus", "OK", PoseFault::none},
          {"ProbeToTrackerStatus", "INVALID", PoseFault::none},
          {"Comment", "INVALID", PoseFault::none}}) {
        const auto poses =
            igtl::parse_poses(header, with_metadata(message, {{"FrameNumber", "7"}, {key, value}}));
        ASSERT_EQ(poses.size(), 1u);
        EXPECT_EQ(poses[0].fault, fault) << key << " " << value;
    }
    // Cut anywhere, or with sizes beyond the message: no fault but that of the bytes.
    const Bytes whole = with_metadata(message, {{"TransformStatus", "INVALID"}});
    for (std::size_t n = 0; n < whole.size(); ++n)
        igtl::parse_poses(header, std::span(whole).first(n));
    for (std::size_t at = 0; at < whole.size(); ++at) {
        Bytes damaged = whole;
        damaged[at] = 255;
        igtl::parse_poses(header, damaged);
    }
}

TEST(IgtlMessage, FaultsOfAMatrixAreTold) {
    const auto fault_of = [](Matrix3 m) {
        const Bytes message = igtl::encode_transform("ProbeToTracker", 1, {m, {1, 2, 3}});
        igtl::MessageReader reader;
        reader.add(message);
        EXPECT_EQ(reader.next(), igtl::MessageReader::Event::message);
        const auto poses = igtl::parse_poses(reader.header(), reader.body());
        return poses.size() == 1 ? poses[0].fault : igtl::PoseFault::none;
    };
    Matrix3 scaled, mirrored, no_number, zero{{0, 0, 0, 0, 0, 0, 0, 0, 0}};
    for (double& v : scaled.m) v *= 0.2;
    mirrored(0, 0) = -1;
    no_number(1, 1) = NAN;
    EXPECT_EQ(fault_of({}), igtl::PoseFault::none);
    EXPECT_EQ(fault_of(scaled), igtl::PoseFault::scaled);
    EXPECT_EQ(fault_of(zero), igtl::PoseFault::scaled);
    EXPECT_EQ(fault_of(mirrored), igtl::PoseFault::mirrored);
    EXPECT_EQ(fault_of(no_number), igtl::PoseFault::not_finite);
    const Bytes missing = igtl::encode_transform("ProbeToTracker", 1, {{}, {-3.697314e28, 0, 0}});
    igtl::MessageReader reader;
    reader.add(missing);
    ASSERT_EQ(reader.next(), igtl::MessageReader::Event::message);
    const auto poses = igtl::parse_poses(reader.header(), reader.body());
    ASSERT_EQ(poses.size(), 1u);
    EXPECT_EQ(poses[0].fault, igtl::PoseFault::lost);
}

TEST(IgtlMessage, ForceComesBackAndNonsenseDoesNot) {
    const auto read = [](const Bytes& message) {
        igtl::MessageReader reader;
        reader.add(message);
        EXPECT_EQ(reader.next(), igtl::MessageReader::Event::message);
        EXPECT_TRUE(igtl::parse_poses(reader.header(), reader.body()).empty());
        return igtl::parse_force_n(reader.header(), reader.body());
    };
    const auto sensor = [](std::vector<double> values) {
        return igtl::encode_sensor("ProbeForce", 1, values);
    };
    EXPECT_EQ(read(sensor({7.25})), 7.25);
    EXPECT_EQ(read(sensor({0, 3})), 0.0);
    int taken = read(sensor({})).has_value();
    for (const double bad : {-1.0, 501.0, 1e9, std::nan(""), HUGE_VAL})
        taken += read(sensor({bad})).has_value();
    taken += read(igtl::encode_sensor("Glucose", 1, std::vector<double>{5})).has_value();
    // Every length but the right one.
    for (std::size_t size = 0; size < 40; ++size) {
        Bytes body(size, 0);
        if (size > 0) body[0] = 2;
        const bool is_taken = read(igtl::encode("SENSOR", "ProbeForce", 1, body)).has_value();
        EXPECT_TRUE(is_taken || size != 26);
        taken += is_taken && size != 26;
    }
    sonocase::testing::HardCase none("of 46 force messages that are none, taken",
                                     sonocase::testing::HardCase::at_most, 0, "");
    none.see(taken);
}

TEST(IgtlMessage, ReadsEverySplit) {
    Bytes stream;
    for (int i = 0; i < 3; ++i) {
        for (const Bytes& m :
             {igtl::encode_transform("A", 1, {}), igtl::encode("STATUS", "B", 1, Bytes(31, 7))}) {
            stream.insert(stream.end(), m.begin(), m.end());
        }
    }
    for (std::size_t chunk = 1; chunk < stream.size(); chunk += 3) {
        igtl::MessageReader reader;
        int messages = 0, poses = 0;
        for (std::size_t at = 0; at < stream.size(); at += chunk) {
            reader.add(std::span(stream).subspan(at, std::min(chunk, stream.size() - at)));
            while (reader.next() == igtl::MessageReader::Event::message) {
                ++messages;
                poses += static_cast<int>(igtl::parse_poses(reader.header(), reader.body()).size());
            }
        }
        EXPECT_EQ(messages, 6) << chunk;
        EXPECT_EQ(poses, 3) << chunk;
    }
}

TEST(IgtlMessage, DamageGivesNoPose) {
    const Bytes good = igtl::encode_transform("ProbeToTracker", 1, {});
    for (std::size_t i = 58; i < good.size(); ++i) {
        Bytes damaged = good;
        damaged[i] ^= 1;
        igtl::MessageReader reader;
        reader.add(damaged);
        EXPECT_EQ(reader.next(), igtl::MessageReader::Event::bad_crc) << i;
    }
    igtl::Header header;
    for (const char* type : {"TRANSFORM", "TDATA", "QTDATA", "POSITION", "NONSENSE"}) {
        header.type = type;
        for (std::size_t n = 0; n < 160; ++n) {
            for (const std::uint8_t fill : Bytes{0, 255}) {
                for (const auto& pose : igtl::parse_poses(header, Bytes(n, fill))) {
                    EXPECT_TRUE(is_finite(pose.to_from));
                }
            }
        }
    }
    for (int version : {2, 3}) {
        header.version = static_cast<std::uint16_t>(version);
        header.type = "TRANSFORM";
        for (std::size_t n = 0; n < 90; ++n) igtl::parse_poses(header, Bytes(n, 255));
    }
}

}  // namespace
}  // namespace sonocase::runtime
