// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/tool_frames.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/files/load_save.h"
#include "formats/recording/pose_table.h"
#include "formats/recording/session.h"
#include "formats/text/number_text.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

TEST(ToolFrames, NamesSayWhichTransformIsATool) {
    const auto found = [](std::vector<std::string> names, ToolRole role) {
        Sequence sequence;
        sequence.transforms = std::move(names);
        const int i = find_tool(sequence, role);
        return i < 0 ? std::string() : sequence.transforms[static_cast<std::size_t>(i)];
    };
    // What PLUS writes: calibrations beside poses, in the order of the alphabet.
    const std::vector<std::string> plus{
        "ImageToProbe",       "ImageToReference",  "NeedleTipToNeedle",
        "NeedleToReference",  "ProbeToReference",  "ProbeToTracker",
        "ReferenceToTracker", "StylusTipToStylus", "TrackerToReference"};
    EXPECT_EQ(found(plus, ToolRole::probe), "ProbeToTracker");
    EXPECT_EQ(found(plus, ToolRole::needle), "NeedleToReference");
    EXPECT_EQ(found({"ReferenceToProbe", "ImageToReference"}, ToolRole::probe), "ImageToReference");
    EXPECT_EQ(found({"ReferenceToTracker", "TrackerToProbe"}, ToolRole::probe), "");
    EXPECT_EQ(found({"probe_1ToTracker", "NEEDLEToTracker"}, ToolRole::needle), "NEEDLEToTracker");
    EXPECT_EQ(found({"probe_1ToTracker", "NEEDLEToTracker"}, ToolRole::probe), "probe_1ToTracker");
    EXPECT_EQ(found({"UsProbeToReference", "StylusTipToReference"}, ToolRole::probe),
              "UsProbeToReference");
    // The sensor is not the tip, in whatever order they stand, and a stylus is no needle.
    for (const std::string tip : {"NeedleTip", "StylusTip", "needle_tip"}) {
        const std::string sensor = tip.starts_with("S") ? "Stylus" : "Needle";
        const std::string best = tip + "ToReference";
        for (const std::string to : {"ToReference", "ToTracker"}) {
            EXPECT_EQ(found({sensor + to, best}, ToolRole::needle), best);
            EXPECT_EQ(found({best, sensor + to}, ToolRole::needle), best);
        }
    }
    EXPECT_EQ(found({"StylusTipToTracker", "NeedleToTracker"}, ToolRole::needle),
              "NeedleToTracker");
    EXPECT_EQ(split_transform_name("ToolToTracker").from, "Tool");
    EXPECT_EQ(split_transform_name("StylusToRAS").to, "RAS");
    EXPECT_EQ(split_transform_name("Stylus").to, "");
}

// Probe, needle and a moving reference; what is true is the pose in the reference.
struct Moving {
    Sequence sequence;
    std::vector<Rigid> probe, needle;  // reference_from_tool
};
Moving moving_reference() {
    testing::Random random(5);
    Moving out;
    out.sequence.transforms = {"ProbeToTracker", "NeedleToReference", "ReferenceToTracker"};
    for (int i = 0; i < 40; ++i) {
        const Rigid reference = random.rigid(500);
        out.probe.push_back(random.rigid(100));
        out.needle.push_back(random.rigid(100));
        SequenceFrame frame;
        frame.number = i;
        frame.timestamp_s = 0.05 * i;
        frame.poses = {{true, matrix_from_rigid(reference * out.probe.back())},
                       {true, matrix_from_rigid(out.needle.back())},
                       {i != 7, matrix_from_rigid(reference)}};
        out.sequence.frames.push_back(frame);
    }
    return out;
}

TEST(ToolFrames, ToolsThatEndInTwoFramesAreBroughtToOne) {
    const Moving given = moving_reference();
    const SessionNames names = guess_names(given.sequence);
    EXPECT_EQ(names.probe, "ProbeToReference");
    const auto session = session_from_sequence(given.sequence, names, "s");
    ASSERT_TRUE(session) << session.error().message();
    ASSERT_EQ(session->notes.size(), 1u);
    EXPECT_NE(session->notes[0].find("is composed of"), std::string::npos);
    for (std::size_t i = 0; i < given.probe.size(); ++i) {
        const SessionSample& s = session->samples[i];
        ASSERT_EQ(s.probe_ok && s.needle_ok, i != 7);
        if (i == 7) continue;
        // The frame is one of the two: what counts is where the tools are to each other.
        const Rigid got = inverse(s.mannequin_from_probe) * s.mannequin_from_needle;
        const Rigid true_one = inverse(given.probe[i]) * given.needle[i];
        EXPECT_LT(norm(got.translation - true_one.translation), 1e-9);
    }
    Sequence apart = given.sequence;
    apart.transforms[2] = "MarkerToRoom";
    const auto refused = session_from_sequence(apart, guess_names(apart), "s");
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message().find("ReferenceToTracker"), std::string::npos);
}

// Raw recordings of PLUS: the tracker's frame is not the mannequin's where that moves.
TEST(ToolFrames, ToolsOfATrackerAreTakenRelativeToItsReference) {
    Moving given = moving_reference();
    given.sequence.transforms[1] = "NeedleToTracker";
    for (std::size_t i = 0; i < given.needle.size(); ++i) {
        auto& poses = given.sequence.frames[i].poses;
        const Rigid reference = *rigid_from_matrix(poses[2].to_from);
        poses[1].to_from = matrix_from_rigid(reference * given.needle[i]);
    }
    SessionNames named;
    named.probe = "ProbeToReference";
    named.needle = "NeedleToReference";
    for (const SessionNames& names : {guess_names(given.sequence), named}) {
        EXPECT_EQ(names.probe, "ProbeToReference");
        const auto session = session_from_sequence(given.sequence, names, "s");
        ASSERT_TRUE(session) << session.error().message();
        ASSERT_EQ(session->notes.size(), 2u);
        EXPECT_EQ(session->notes[1],
                  "NeedleToReference is composed of NeedleToTracker, ReferenceToTracker.");
        for (std::size_t i = 0; i < given.probe.size(); ++i) {
            const SessionSample& s = session->samples[i];
            ASSERT_EQ(s.probe_ok, i != 7);
            ASSERT_EQ(s.needle_ok, i != 7);
            if (i == 7) continue;
            EXPECT_LT(norm(s.mannequin_from_probe.translation - given.probe[i].translation), 1e-9);
            EXPECT_LT(norm(s.mannequin_from_needle.translation - given.needle[i].translation),
                      1e-9);
        }
    }
    // Who names the tracker's frame gets it; other frames are the tools' own.
    named.probe = "ProbeToTracker";
    named.needle = "NeedleToTracker";
    const auto raw = session_from_sequence(given.sequence, named, "s");
    ASSERT_TRUE(raw) << raw.error().message();
    EXPECT_TRUE(raw->notes.empty());
    for (const std::string to : {"Mannequin", "RAS"}) {
        Sequence other = given.sequence;
        other.transforms = {"ProbeTo" + to, "NeedleTo" + to, "ReferenceTo" + to};
        EXPECT_EQ(guess_names(other).probe, "ProbeTo" + to);
        EXPECT_EQ(guess_names(other).needle, "NeedleTo" + to);
    }
}

// A recording that has its tools the other way round only; calibrations are none of them.
TEST(ToolFrames, PosesTheOtherWayRoundAreTurnedAndSaid) {
    testing::Random random(9);
    Sequence sequence;
    sequence.transforms = {"ImageToProbe", "TrackerToProbe", "ReferenceToStylus"};
    std::vector<Rigid> probe, needle;
    for (int i = 0; i < 10; ++i) {
        probe.push_back(random.rigid(300));
        needle.push_back(random.rigid(300));
        SequenceFrame frame;
        frame.timestamp_s = 0.05 * i;
        frame.poses = {{true, matrix_from_rigid(random.rigid(9))},
                       {i != 4, matrix_from_rigid(inverse(probe.back()))},
                       {true, matrix_from_rigid(inverse(needle.back()))}};
        sequence.frames.push_back(frame);
    }
    add_inverses(sequence);
    ASSERT_EQ(sequence.transforms.size(), 5u);
    EXPECT_EQ(sequence.notes.size(), 2u);
    const int p = find_tool(sequence, ToolRole::probe), n = find_tool(sequence, ToolRole::needle);
    ASSERT_EQ(sequence.transforms[static_cast<std::size_t>(p)], "ProbeToTracker");
    ASSERT_EQ(sequence.transforms[static_cast<std::size_t>(n)], "StylusToReference");
    const std::vector<Pose> got = poses_of(sequence, p), stylus = poses_of(sequence, n);
    for (std::size_t i = 0; i < probe.size(); ++i) {
        EXPECT_EQ(got[i].ok, i != 4);
        if (i == 4) continue;
        EXPECT_LT(norm(got[i].tracker_from_tool.translation - probe[i].translation), 1e-9);
        EXPECT_LT(norm(stylus[i].tracker_from_tool.translation - needle[i].translation), 1e-9);
    }
    const std::size_t before = sequence.transforms.size();
    add_inverses(sequence);
    EXPECT_EQ(sequence.transforms.size(), before);
}

TEST(ToolFrames, SaysWhyNoPoseCounts) {
    Sequence sequence = moving_reference().sequence;
    EXPECT_EQ(why_no_pose(sequence, 0), "");
    for (SequenceFrame& frame : sequence.frames) {
        for (std::size_t i : {0, 1, 2, 4, 5, 6, 8, 9, 10}) frame.poses[0].to_from[i] *= 0.2;
        std::array<double, 16> transposed{};
        for (std::size_t i = 0; i < 16; ++i)
            transposed[i % 4 * 4 + i / 4] = frame.poses[1].to_from[i];
        frame.poses[1].to_from = transposed;
        frame.poses[2].ok = false;
    }
    EXPECT_NE(why_no_pose(sequence, 0).find("40 have a scale"), std::string::npos);
    EXPECT_NE(why_no_pose(sequence, 1).find("transposed"), std::string::npos);
    EXPECT_NE(why_no_pose(sequence, 2).find("status"), std::string::npos);
}

// A needle of a noisy sensor that is lost from frame 60 to 90 in ways that nobody names; the probe
// moves on.
Sequence silently_lost(bool repeated, double noise_mm, Vector3 back) {
    testing::Random random(11);
    Sequence sequence;
    sequence.transforms = {"ProbeToTracker", "NeedleToTracker"};
    Rigid needle;
    double x = 50;
    for (int i = 0; i < 150; ++i) {
        const bool lost = i >= 60 && i < 90;
        const auto noise = [&](double mm) { return random.uniform(-mm, mm); };
        if (!lost)
            needle =
                Rigid{{}, Vector3{x += 0.1, noise(noise_mm), 300} + (i < 60 ? Vector3{} : back)};
        if (lost && !repeated) needle = {};
        SequenceFrame frame;
        frame.timestamp_s = i / 30.0;
        frame.poses = {{true, matrix_from_rigid({{}, {noise(0.05), 2.0 * i, 100}})},
                       {true, matrix_from_rigid(needle)}};
        sequence.frames.push_back(frame);
    }
    return sequence;
}

TEST(ToolFrames, PosesThatAreNoneThoughNobodySaysSoAreLost) {
    const auto lost_of = [](Sequence sequence, std::size_t tool) {
        mark_lost(sequence);
        std::size_t lost = 0;
        for (const SequenceFrame& frame : sequence.frames) lost += !frame.poses[tool].ok;
        return lost;
    };
    const Vector3 away{9, 0, 0};
    EXPECT_EQ(lost_of(silently_lost(false, 0.05, away), 1), 30u);
    EXPECT_EQ(lost_of(silently_lost(true, 0.05, away), 1), 30u);
    EXPECT_EQ(lost_of(silently_lost(true, 0.05, away), 0), 0u);
    // A simulation rests to the last bit and goes on from there.
    EXPECT_EQ(lost_of(silently_lost(true, 0, {}), 1), 0u);
    // Nobody else moved: it may have been at rest.
    Sequence alone = silently_lost(true, 0.05, away);
    for (SequenceFrame& frame : alone.frames) frame.poses[0] = alone.frames[0].poses[0];
    EXPECT_EQ(lost_of(alone, 1), 0u);
}

// Tables of several tools, as programs of trackers write them: the same readings from each.
TEST(PoseTables, OfSeveralToolsGiveEachItsOwn) {
    testing::Random random(3);
    std::vector<Rigid> probe, needle;
    for (int i = 0; i < 30; ++i)
        probe.push_back(random.rigid(300)), needle.push_back(random.rigid(300));
    const auto cells = [](const Rigid& p, double scale, bool scalar_last, char between) {
        const Quaternion q = quaternion_from_rotation(p.rotation);
        std::string out;
        const auto add = [&](double v) {
            out += (out.empty() ? "" : std::string(1, between)) + number_text(v);
        };
        if (!scalar_last) add(q.w);
        for (const double v : {q.x, q.y, q.z}) add(v);
        if (scalar_last) add(q.w);
        for (const double v : {p.translation.x, p.translation.y, p.translation.z}) add(scale * v);
        return out;
    };
    std::string by_row = "time_s,tool,status,qw,qx,qy,qz,tx,ty,tz\n";
    std::string by_prefix =
        "time_s;probe_qw;probe_qx;probe_qy;probe_qz;probe_x;probe_y;probe_z;"
        "needle_qw;needle_qx;needle_qy;needle_qz;needle_x;needle_y;needle_z;needle_ok\n";
    std::string ndi =
        "Port 1,Frame,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error,Tx,Ty,Tz,"
        "Port 2,Frame,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error,Tx,Ty,Tz\n";
    std::string motive =
        "Format Version,1.23,Take Name,T,Rotation Type,Quaternion,Length Units,Meters\n\n"
        ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,"
        "Rigid Body,Rigid Body Marker,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,"
        "Rigid Body,Rigid Body\n"
        ",Name,Probe,Probe,Probe,Probe,Probe,Probe,Probe,Probe,Probe:M1,Needle,Needle,Needle,"
        "Needle,Needle,Needle,Needle\n"
        ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,"
        "Position,Rotation,Rotation,Rotation,Rotation,Position,Position,Position\n"
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,X,Y,Z,W,X,Y,Z\n";
    for (std::size_t i = 0; i < probe.size(); ++i) {
        const std::string t = number_text(0.02 * static_cast<double>(i)), n = std::to_string(i);
        const bool lost = i % 7 == 3;
        by_row += t + ",Probe,OK," + cells(probe[i], 1, false, ',') + "\n";
        by_row += t + ",Needle," +
                  (lost ? std::string("MISSING,,,,,,,") : "OK," + cells(needle[i], 1, false, ',')) +
                  "\n";
        by_prefix +=
            t + ";" + cells(probe[i], 1, false, ';') + ";" +
            (lost ? "nan;nan;nan;nan;nan;nan;nan;0" : cells(needle[i], 1, false, ';') + ";1") +
            "\n";
        ndi += "a," + n + ",OK," + cells(probe[i], 1, false, ',') + ",0.1,7,8,9,";
        ndi += "b," + n +
               (lost ? ",Missing,,,,,,,,,,,\n"
                     : ",OK," + cells(needle[i], 1, false, ',') + ",0.1,1,2,3\n");
        motive += n + "," + t + "," + cells(probe[i], 1e-3, true, ',') + ",0.001,5," +
                  (lost ? ",,,,,," : cells(needle[i], 1e-3, true, ',')) + "\n";
    }
    std::string unlabelled = motive;  // as older formats are
    for (const std::string label : {",Type,", ",Name,"})
        unlabelled.replace(unlabelled.find(label), label.size(), ",,");
    const testing::TemporaryFolder folder;
    const std::pair<const char*, std::pair<std::string, std::string>> forms[] = {
        {"by_row.csv", {"ProbeToTracker", "NeedleToTracker"}},
        {"by_prefix.csv", {"probeToTracker", "needleToTracker"}},
        {"ndi.csv", {"port_1ToTracker", "port_2ToTracker"}},
        {"motive.csv", {"ProbeToTracker", "NeedleToTracker"}},
        {"unlabelled.csv", {"ProbeToTracker", "NeedleToTracker"}}};
    const std::string* texts[] = {&by_row, &by_prefix, &ndi, &motive, &unlabelled};
    for (std::size_t form = 0; form < 5; ++form) {
        const auto& [file, names] = forms[form];
        const auto read = load_recording_file(folder.write(file, *texts[form]));
        ASSERT_TRUE(read) << read.error().message();
        ASSERT_EQ(read->transforms.size(), 2u) << file;
        for (const auto& [name, truth] :
             {std::pair(names.first, &probe), {names.second, &needle}}) {
            const int tool = read->transform_index(name);
            ASSERT_GE(tool, 0) << file << ": " << read->transforms[0] << read->transforms[1];
            const std::vector<Pose> poses = poses_of(*read, tool);
            ASSERT_EQ(poses.size(), truth->size()) << file;
            for (std::size_t i = 0; i < poses.size(); ++i) {
                ASSERT_EQ(poses[i].ok, truth == &probe || i % 7 != 3) << file << " " << i;
                if (!poses[i].ok) continue;
                // Metres printed with 17 digits come back to within a few roundings.
                EXPECT_LT(norm(poses[i].tracker_from_tool.translation - (*truth)[i].translation),
                          1e-9)
                    << file;
                for (std::size_t k = 0; k < 9; ++k)
                    EXPECT_NEAR(poses[i].tracker_from_tool.rotation.m[k], (*truth)[i].rotation.m[k],
                                1e-9);
            }
        }
    }
}

// What people hand over instead of readings, and what is said: the cause and the cure.
TEST(PoseTables, WhatIsNoTableIsNamed) {
    const testing::TemporaryFolder folder;
    const std::string row = "0,OK,1,2,3,1,0,0,0,1,0,0,0,1\n";
    const std::string head = "timestamp_s,status,tx,ty,tz,r00,r01,r02,r10,r11,r12,r20,r21,r22\n";
    const std::pair<std::string, const char*> cases[] = {
        {std::string("PK\x03\x04\x14\0", 6), "xlsx"},
        {"\x89HDF\r\n", "HDF5"},
        {"\x93NUMPY\x01", "NumPy"},
        {"TDSm....", "TDMS"},
        {"\x1F\x8B\x08", "gzip"},
        {"SQLite format 3", "database"},
        {std::string("a,b\0c", 5), "binary"},
        {"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"},
        {"<!DOCTYPE html><html>", "web page"},
        {"{\"a\": 1}", "JSON"},
        {head + "0,Foo,1,2,3,1,0,0,0,1,0,0,0,1\n", "'Foo'"},
        {"timestamp_s,tx,ty,tz,roll,pitch,yaw\n0,1,2,3,0,0,0\n", "in which order"},
        // Decimal commas between commas: twice as many cells as columns.
        {"timestamp_s,tx,ty,tz,qw,qx,qy,qz\n0,5,1,2,2,4,3,1,1,0,0,0,0,0,0,0\n", "decimal commas"},
        {"Format Version,1.23,Rotation Type,XYZ,Length Units,Meters\n", "Quaternion"},
        {"Format Version,1.23,Rotation Type,Quaternion\n", "unit of length"}};
    for (const auto& [text, sentence] : cases) {
        const auto read = load_recording_file(folder.write("poses.csv", text));
        ASSERT_FALSE(read) << sentence;
        EXPECT_NE(read.error().message().find(sentence), std::string::npos)
            << sentence << ": " << read.error().message();
    }
    // Read all the same.
    const auto poses_in = [](const std::string& text) {
        const auto read = parse_poses(text, "p");
        return read ? static_cast<int>(read->size()) : -1;
    };
    EXPECT_EQ(poses_in("sep=,\n" + head + row + row), 2);
    EXPECT_EQ(poses_in("# timestamp tx ty tz qx qy qz qw\n0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n"), 2);
    EXPECT_EQ(poses_in("timestamp_s,tx,ty,tz,qw,qx,qy,qz\r0,1,2,3,1,0,0,0\r1,1,2,3,1,0,0,0"), 2);
    const auto lost = parse_poses(
        "timestamp_s,tx,ty,tz,qw,qx,qy,qz\n0,1,2,3,1,0,0,0\n"
        "1,,,,,,,\n2,-nan(ind),1.#QNAN,nan,nan,nan,nan,nan\n"
        "3,0,0,0,0,0,0,0\n",
        "p");
    ASSERT_TRUE(lost) << lost.error().message();
    EXPECT_TRUE((*lost)[0].ok);
    for (int i : {1, 2, 3}) EXPECT_FALSE((*lost)[static_cast<std::size_t>(i)].ok) << i;
    const auto ns =
        parse_poses("time_ns,valid,tx,ty,tz,qw,qx,qy,qz\n500000000,True,1,2,3,1,0,0,0\n", "p");
    ASSERT_TRUE(ns) << ns.error().message();
    EXPECT_NEAR((*ns)[0].timestamp_s, 0.5, 1e-12);
    EXPECT_TRUE((*ns)[0].ok);
}

// What others call things.
TEST(PoseTables, OtherNamesAreUnderstood) {
    const auto read_one = [](const std::string& text) {
        const auto read = parse_pose_table(text, "p");
        return read && read->size() == 1 ? read->front() : ToolReadings{"none", {}};
    };
    const ToolReadings ros = read_one(
        "%time,field.header.seq,field.pose.position.x,field.pose.position.y,field.pose.position.z,"
        "field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,"
        "field.pose.orientation.w\n0.5,1,1,2,3,0,0,0,1\n");
    EXPECT_EQ(ros.name, "");
    ASSERT_EQ(ros.poses.size(), 1u);
    EXPECT_EQ(ros.poses[0].tracker_from_tool.translation, (Vector3{1, 2, 3}));
    EXPECT_EQ(ros.poses[0].timestamp_s, 0.5);
    const ToolReadings matrix = read_one(
        "time_s,m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n0,0,-1,0,4,1,0,0,5,0,0,1,6\n");
    ASSERT_EQ(matrix.poses.size(), 1u);
    EXPECT_EQ(matrix.poses[0].tracker_from_tool.translation, (Vector3{4, 5, 6}));
    EXPECT_EQ(matrix.poses[0].tracker_from_tool.rotation(1, 0), 1);
    // Rows and columns from 1, from 0, and in brackets as C programs print them.
    std::string one = "t", zero = "t",
                brackets = "t,Position X (mm),Position Y (mm),Position Z (mm)";
    for (int r = 0; r < 4; ++r) {
        for (int c = 0; c < 4; ++c) {
            const auto cell = [&](int from) {
                return ",T" + std::to_string(r + from) + std::to_string(c + from);
            };
            one += cell(1);
            zero += cell(0);
            if (r < 3 && c < 3)
                brackets += ",Rotation[" + std::to_string(r) + "][" + std::to_string(c) + "]";
        }
    }
    for (const std::string& header : {one, zero, brackets}) {
        const ToolReadings given =
            read_one(header + (header == brackets ? "\n0,4,5,6,0,-1,0,1,0,0,0,0,1\n"
                                                  : "\n0,0,-1,0,4,1,0,0,5,0,0,1,6,0,0,0,1\n"));
        ASSERT_EQ(given.poses.size(), 1u) << header;
        EXPECT_EQ(given.poses[0].tracker_from_tool, matrix.poses[0].tracker_from_tool) << header;
    }
    // Times of Unix in whatever unit: the question names it.
    for (const auto& [step, unit] :
         {std::pair{50.0, "time_ms"}, {5e4, "time_us"}, {5e7, "time_ns"}}) {
        std::string table = "timestamp,tx,ty,tz,qw,qx,qy,qz\n";
        for (int i = 0; i < 20; ++i) table += number_text(step * (i + 1e5)) + ",1,2,3,1,0,0,0\n";
        const auto asked = parse_pose_table(table, "p");
        ASSERT_FALSE(asked);
        EXPECT_NE(asked.error().message().find(unit), std::string::npos) << asked.error().message();
    }
    const auto date = parse_pose_table(
        "timestamp,tx,ty,tz,qw,qx,qy,qz\n2024-05-01T12:00:00,1,2,3,1,0,0,0\n", "p");
    ASSERT_FALSE(date);
    EXPECT_NE(date.error().message().find("numbers of seconds"), std::string::npos);
}

TEST(PoseTables, ARowOfUnitsBelowTheNamesIsTaken) {
    const auto read = [](const std::string& units) {
        return parse_pose_table(
            "time,tx,ty,tz,qw,qx,qy,qz\n" + units + "\n0,1,2,3,1,0,0,0\n500,2,2,3,1,0,0,0\n", "p");
    };
    for (const auto& [units, scale, last_s] :
         {std::tuple{"s,mm,mm,mm,,,,", 1.0, 500.0},
          {"ms,m,m,m,-,-,-,-", 1000.0, 0.5},
          {"[s],[cm],[cm],[cm],quaternion,quaternion,quaternion,quaternion", 10.0, 500.0}}) {
        const auto table = read(units);
        ASSERT_TRUE(table) << table.error().message();
        const std::vector<Pose>& poses = table->front().poses;
        ASSERT_EQ(poses.size(), 2u) << units;
        EXPECT_EQ(poses[0].tracker_from_tool.translation, scale * (Vector3{1, 2, 3})) << units;
        EXPECT_NEAR(poses[1].timestamp_s, last_s, 1e-9) << units;
    }
    const auto inches = read("s,in,in,in,,,,");
    ASSERT_FALSE(inches);
    EXPECT_EQ(inches.error().message(), "p:2: places are in 'in'; expected mm, cm or m");
    EXPECT_FALSE(read("s,a,b,c,,,,"));
    EXPECT_FALSE(read("a,b,c,d,,,,"));
    for (const char* names :
         {"t,x (in),y (in),z (in)", "t,probe_tx_inch,probe_ty_inch,probe_tz_inch"}) {
        const auto named =
            parse_pose_table(std::string(names) + ",qw,qx,qy,qz\n0,1,2,3,1,0,0,0\n", "p");
        ASSERT_FALSE(named);
        EXPECT_NE(named.error().message().find("unit of"), std::string::npos)
            << named.error().message();
    }
}

// What NDI's programs write for what was not measured.
TEST(PoseTables, NdisMissingValueIsALostTool) {
    std::string text = "Frame,Q0,Qx,Qy,Qz,Tx,Ty,Tz\n0,1,0,0,0,1,2,3\n1";
    for (int i = 0; i < 7; ++i) text += ",-3.697314e28";
    const auto table = parse_pose_table(text + "\n", "p");
    ASSERT_TRUE(table) << table.error().message();
    ASSERT_EQ(table->front().poses.size(), 2u);
    EXPECT_TRUE(table->front().poses[0].ok);
    EXPECT_FALSE(table->front().poses[1].ok);
}

TEST(PoseTables, OneToolTwiceInARowIsRefused) {
    const auto twice = parse_pose_table(
        "timestamp,probe_tx,probe_ty,probe_tz,probe_qw,probe_qx,probe_qy,probe_qz,"
        "probe_tx,probe_ty,probe_tz,probe_qw,probe_qx,probe_qy,probe_qz\n"
        "0,1,2,3,1,0,0,0,4,5,6,1,0,0,0\n",
        "p");
    ASSERT_FALSE(twice);
    EXPECT_NE(twice.error().message().find("twice"), std::string::npos) << twice.error().message();
}

TEST(PoseTables, TimesThatTellNothingAreRefused) {
    std::vector<double> same(40, 7.0), ms, coarse, good;
    for (int i = 0; i < 40; ++i) {
        ms.push_back(16.7 * i);
        coarse.push_back(i / 20);
        good.push_back(i / 60.0);
    }
    const auto said = [](const std::vector<double>& times) {
        const Status status = check_times(times, "t");
        return status ? std::string() : status.error().message();
    };
    EXPECT_NE(said(same).find("no times"), std::string::npos);
    EXPECT_NE(said(ms).find("milliseconds"), std::string::npos);
    EXPECT_NE(said(coarse).find("more digits"), std::string::npos);
    EXPECT_EQ(said(good), "");
}

}  // namespace
}  // namespace sonocase
