// SPDX-License-Identifier: Apache-2.0

// The protocols of the USB trackers, with known bytes and with damaged ones.
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "runtime/tracking/devices/byte_stream.h"
#include "runtime/tracking/devices/guidance_protocol.h"
#include "runtime/tracking/devices/liberty_protocol.h"
#include "runtime/tracking/devices/viper_protocol.h"
#include "support/random.h"

namespace sonocase::runtime {
namespace {

std::string hex(std::span<const std::uint8_t> bytes) {
    std::string text;
    for (std::uint8_t b : bytes) {
        text += "0123456789abcdef"[b >> 4];
        text += "0123456789abcdef"[b & 15];
    }
    return text;
}

TEST(Viper, CrcOfTheCheckString) {
    const std::string check = "123456789";
    EXPECT_EQ(viper::crc16({reinterpret_cast<const std::uint8_t*>(check.data()), 9}), 0xBB3D);
}

TEST(Viper, EncodesTheKnownCommands) {
    std::vector<std::uint8_t> units, hemisphere;
    put_u32_le(units, 2);
    put_u32_le(units, 2);
    put_u32_le(hemisphere, 0);
    for (float v : {1.0f, 0.0f, 0.0f}) put_f32_le(hemisphere, v);
    EXPECT_EQ(hex(viper::encode(viper::kUnits, viper::kSet, 0xFFFFFFFFu, 0, units)),
              "5650524320000000000000000700000000000000ffffffff000000000200000002000000a0420000");
    EXPECT_EQ(hex(viper::encode(viper::kStationMap, viper::kGet)),
              "5650524318000000000000000a00000001000000000000000000000055ab0000");
    EXPECT_EQ(hex(viper::encode(viper::kContinuousPno, viper::kSet)),
              "5650524318000000000000001300000000000000000000000000000063f20000");
    EXPECT_EQ(hex(viper::encode(viper::kContinuousPno, viper::kReset)),
              "565052431800000000000000130000000200000000000000000000009a350000");
    EXPECT_EQ(
        hex(viper::encode(viper::kHemisphere, viper::kSet, 0xFFFFFFFFu, 0, hemisphere)),
        "5650524328000000000000000000000000000000ffffffff00000000000000000000803f0000000000000000"
        "61b20000");
}

std::vector<std::uint8_t> position_frame(std::uint32_t number, double x_cm) {
    std::vector<std::uint8_t> out = {'V', 'P', 'R', 'P'};
    put_u32_le(out, 16 + 64 + 4);
    for (std::uint32_t word : {0u, number, 0u, 2u}) put_u32_le(out, word);
    for (std::uint32_t sensor : {0u, 1u}) {
        put_u32_le(out, sensor | 2u << 8 | 2u << 10 | 51u << 14);
        for (double v : {x_cm + sensor, -3.0, 4.5, 0.5, 0.5, 0.5, 0.5}) {
            put_f32_le(out, static_cast<float>(v));
        }
    }
    put_u32_le(out, viper::crc16(out));
    return out;
}

TEST(Viper, ReadsPositionsInMillimetres) {
    viper::FrameReader reader;
    reader.add(position_frame(77, 12.5));
    viper::Frame frame;
    ASSERT_TRUE(reader.next(frame));
    TrackerReading reading;
    std::uint32_t number = 0;
    ASSERT_TRUE(viper::parse_positions(frame.body, reading, number));
    EXPECT_EQ(number, 77u);
    EXPECT_EQ(reading.sensor_count, 2);
    EXPECT_EQ(reading.sensors[1].world_from_sensor.translation, (Vector3{135, -30, 45}));
    // Quaternion (1, 1, 1, 1) / 2 turns x to y, y to z, z to x.
    EXPECT_LT(
        norm(reading.sensors[0].world_from_sensor.rotation * Vector3{1, 0, 0} - Vector3{0, 1, 0}),
        1e-12);
    EXPECT_NEAR(reading.sensors[0].quality, 0.8, 1e-6);
    EXPECT_EQ(reading.sensors[0].state, SensorState::ok);
}

TEST(Viper, ReadsEverySplitAndEveryMerge) {
    std::vector<std::uint8_t> stream;
    for (std::uint32_t i = 0; i < 4; ++i) {
        const auto frame = position_frame(i, i);
        stream.insert(stream.end(), frame.begin(), frame.end());
    }
    for (std::size_t chunk = 1; chunk <= stream.size(); ++chunk) {
        viper::FrameReader reader;
        viper::Frame frame;
        int frames = 0;
        for (std::size_t at = 0; at < stream.size(); at += chunk) {
            reader.add(std::span(stream).subspan(at, std::min(chunk, stream.size() - at)));
            while (reader.next(frame)) ++frames;
        }
        ASSERT_EQ(frames, 4) << chunk;
        ASSERT_EQ(reader.bad_frames(), 0u);
    }
}

TEST(Viper, DropsAFrameWithAnyByteDamagedAndTakesTheNext) {
    const auto good = position_frame(5, 1), after = position_frame(6, 2);
    for (std::size_t i = 0; i < good.size(); ++i) {
        auto damaged = good;
        damaged[i] ^= 0x10;
        viper::FrameReader reader;
        reader.add(damaged);
        for (int n = 0; n < 20; ++n) reader.add(after);  // enough for a size that grew
        viper::Frame frame;
        int frames = 0;
        while (reader.next(frame)) {
            TrackerReading reading;
            std::uint32_t number = 0;
            ASSERT_TRUE(viper::parse_positions(frame.body, reading, number));
            ASSERT_EQ(number, 6u) << "byte " << i;
            ++frames;
        }
        EXPECT_GE(frames, 8) << "byte " << i;
        EXPECT_EQ(reader.bad_frames(), 1u) << "byte " << i;
    }
}

TEST(Viper, SurvivesNoise) {
    sonocase::testing::Random random(11);
    viper::FrameReader reader;
    viper::Frame frame;
    for (int i = 0; i < 2000; ++i) {
        std::vector<std::uint8_t> noise(static_cast<std::size_t>(random.uniform(0, 90)));
        for (auto& b : noise) b = static_cast<std::uint8_t>(random.uniform(0, 256));
        if (i % 7 == 0) noise.insert(noise.end(), {'V', 'P', 'R', 'P'});
        reader.add(noise);
        while (reader.next(frame)) {
            TrackerReading reading;
            std::uint32_t number = 0;
            viper::parse_positions(frame.body, reading, number);
        }
    }
    EXPECT_GT(reader.bad_frames(), 0u);
}

TEST(Viper, CallsPosesThatAreNoneLost) {
    auto body = position_frame(1, 0);
    body.erase(body.begin(), body.begin() + 8);
    body.resize(body.size() - 4);
    std::memset(body.data() + 16 + 16, 0, 16);  // quaternion of the first
    const std::uint32_t nan = 0x7FC00000u;
    std::memcpy(body.data() + 16 + 32 + 4, &nan, 4);  // x of the second
    TrackerReading reading;
    std::uint32_t number = 0;
    ASSERT_TRUE(viper::parse_positions(body, reading, number));
    EXPECT_EQ(reading.sensors[0].state, SensorState::lost);
    EXPECT_EQ(reading.sensors[1].state, SensorState::lost);
    EXPECT_TRUE(is_finite(reading.sensors[1].world_from_sensor));
    for (std::size_t n = 0; n < body.size(); ++n) {
        EXPECT_FALSE(viper::parse_positions(std::span(body).first(n), reading, number)) << n;
    }
}

TEST(Guidance, WordsKeepTheirSign) {
    // value = int16((hi << 7 | lo) << 2): the 14 bits of a 16-bit number without its last two.
    for (int value = -32768; value < 32768; value += 4) {
        const auto bits = static_cast<std::uint16_t>(value) >> 2;
        EXPECT_EQ(guidance::word(static_cast<std::uint8_t>(0x80 | (bits & 0x7F)),
                                 static_cast<std::uint8_t>(bits >> 7 & 0x7F)),
                  value);
    }
}

TEST(Guidance, ReadsInchesAndDegrees) {
    std::uint8_t record[12] = {};
    const auto put = [&](std::size_t i, double part) {
        const auto bits = static_cast<std::uint16_t>(static_cast<std::int16_t>(part * 32768)) >> 2;
        record[2 * i] = bits & 0x7F;
        record[2 * i + 1] = bits >> 7 & 0x7F;
    };
    put(0, 0.25);
    put(1, -0.5);
    put(3, 0.5);  // azimuth 90 degrees
    record[0] |= 0x80;
    const auto pose = guidance::parse_angles(record, 36);
    ASSERT_TRUE(pose);
    EXPECT_NEAR(pose->translation.x, 9 * 25.4, 1e-9);
    EXPECT_NEAR(pose->translation.y, -18 * 25.4, 1e-9);
    EXPECT_LT(norm(pose->rotation * Vector3{1, 0, 0} - Vector3{0, 1, 0}), 1e-9);
    EXPECT_NEAR(guidance::parse_angles(record, 72)->translation.x, 18 * 25.4, 1e-9);
    for (std::size_t i = 0; i < 12; ++i) {  // out of phase
        std::uint8_t bad[12];
        std::copy(record, record + 12, bad);
        bad[i] ^= 0x80;
        EXPECT_FALSE(guidance::parse_angles(bad, 36)) << i;
    }
    EXPECT_FALSE(guidance::parse_angles(std::span(record).first(11), 36));
}

TEST(Guidance, KnowsFatalErrors) {
    for (int code = 0; code < 256; ++code) {
        bool fatal = false;
        const std::string text = guidance::error_text(static_cast<std::uint8_t>(code), fatal);
        EXPECT_EQ(text.empty(), code == 0);
        EXPECT_EQ(fatal,
                  code == 1 || code == 2 || code == 15 || code == 16 || (code >= 20 && code <= 27));
    }
}

std::vector<std::uint8_t> liberty_record(int station,
                                         std::uint32_t frame,
                                         double x_cm,
                                         char error = ' ') {
    std::vector<std::uint8_t> out = {
        'L', 'Y', static_cast<std::uint8_t>(station), 'C', static_cast<std::uint8_t>(error), 0,
        40,  0};
    put_u32_le(out, 1000 + frame * 4);
    put_u32_le(out, frame);
    put_u32_le(out, 10);
    for (double v : {x_cm, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0}) put_f32_le(out, static_cast<float>(v));
    return out;
}

TEST(Liberty, ReadsRecordsAcrossSplitsAndRubbish) {
    std::vector<std::uint8_t> stream = {'x', 'L', 'Y', 1};
    for (std::uint32_t i = 0; i < 3; ++i) {
        const auto record = liberty_record(static_cast<int>(i) + 1, i, 1.5);
        stream.insert(stream.end(), record.begin(), record.end());
    }
    for (std::size_t chunk = 1; chunk <= 60; ++chunk) {
        liberty::RecordReader reader;
        liberty::Record record;
        int records = 0;
        for (std::size_t at = 0; at < stream.size(); at += chunk) {
            reader.add(std::span(stream).subspan(at, std::min(chunk, stream.size() - at)));
            while (reader.next(record)) {
                EXPECT_EQ(record.station, ++records);
                EXPECT_EQ(record.reading.world_from_sensor.translation, (Vector3{15, 20, 30}));
            }
        }
        EXPECT_EQ(records, 3);
        EXPECT_EQ(reader.bad_frames(), 1u);
    }
}

TEST(Liberty, MarksErrorsAndBadNumbersLost) {
    liberty::RecordReader reader;
    liberty::Record record;
    reader.add(liberty_record(1, 1, 1, 'I'));
    ASSERT_TRUE(reader.next(record));
    EXPECT_EQ(record.reading.state, SensorState::lost);
    reader.add(liberty_record(1, 1, INFINITY));
    ASSERT_TRUE(reader.next(record));
    EXPECT_EQ(record.reading.state, SensorState::lost);
    EXPECT_TRUE(is_finite(record.reading.world_from_sensor));
    reader.add(liberty_record(40, 1, 1));
    EXPECT_FALSE(reader.next(record));  // no such station
}

}  // namespace
}  // namespace sonocase::runtime
