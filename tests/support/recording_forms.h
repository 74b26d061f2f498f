// SPDX-License-Identifier: Apache-2.0

// One recording of probe and needle, written in every form that is read: tables of ours, of
// spreadsheets and with quaternions, IGSIO with and without its pixels beside it, 3D Slicer's and
// PerkTutor's, all with the digits that bring every number back.
#pragma once

#include <string>
#include <vector>

#include "formats/recording/poses.h"
#include "formats/recording/sequence.h"
#include "formats/text/number_text.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace sonocase::testing {

// Poses of a needle and a probe, 20 a second; the needle is lost in every seventh.
inline std::vector<Pose> tool_poses(std::uint64_t seed, int lost_every) {
    Random random(seed);
    std::vector<Pose> poses;
    for (int i = 0; i < 60; ++i) {
        Pose pose;
        pose.frame = i;
        pose.timestamp_s = 0.05 * i;
        pose.ok = lost_every == 0 || i % lost_every != 0;
        pose.tracker_from_tool = random.rigid(200);
        poses.push_back(pose);
    }
    return poses;
}

inline std::string quaternion_table(const std::vector<Pose>& poses,
                                    const char* header,
                                    char between) {
    std::string text = header;
    for (const Pose& pose : poses) {
        const Quaternion q = quaternion_from_rotation(pose.tracker_from_tool.rotation);
        const Vector3 t = pose.tracker_from_tool.translation;
        text += pose.ok ? "\nOK" : "\nMissing";
        for (const double v : {q.w, q.x, q.y, q.z, t.x, t.y, t.z, 1000 * pose.timestamp_s})
            text += between + number_text(v);
    }
    return text;
}

inline std::string other_cells(std::string csv, char between, bool decimal_commas) {
    for (char& c : csv) {
        if (c == ',') c = between;
        if (c == '.' && decimal_commas) c = ',';
    }
    return csv;
}

inline std::string log_lines(const std::vector<Pose>& poses, const char* tool, std::size_t i) {
    if (!poses[i].ok) return "";
    std::string text = "  <log TimeStampSec=\"" + std::to_string(i / 20) + "\" TimeStampNSec=\"" +
                       std::to_string(i % 20 * 50000000) + "\" type=\"transform\" DeviceName=\"" +
                       tool + "\" transform=\"";
    for (const double v : matrix_from_rigid(poses[i].tracker_from_tool))
        text += number_text(v) + " ";
    return text + "\" />\n";
}

// As 3D Slicer saves transforms: no picture, no numbers of frames, no blank after '=', no last line
// end.
inline std::string slicer_sequence(const std::vector<Pose>& probe,
                                   const std::vector<Pose>& needle) {
    std::string text = "ObjectType = Image\nNDims = 3\nDimSize = 0 0 " +
                       std::to_string(probe.size()) + "\nElementType = MET_UCHAR\n";
    for (std::size_t i = 0; i < probe.size(); ++i) {
        const std::string frame = "Seq_Frame" + std::to_string(i) + "_";
        for (const auto& [name, pose] :
             {std::pair("ProbeToReference", &probe[i]), {"NeedleToReference", &needle[i]}}) {
            text += frame + name + "Transform =";
            for (const double v : matrix_from_rigid(pose->tracker_from_tool))
                text += number_text(v) + " ";
            text += "\n" + frame + name + "TransformStatus = " + (pose->ok ? "OK" : "OUT_OF_VIEW") +
                    "\n";
        }
        text += frame + "Timestamp = " + number_text(probe[i].timestamp_s) + "\n";
    }
    return text + "ElementDataFile = LOCAL";
}

// Names of the files, as `sonocase score` and `replay:` take them.
inline std::vector<std::string> write_recording_forms(const TemporaryFolder& folder,
                                                      const std::vector<Pose>& probe,
                                                      const std::vector<Pose>& needle) {
    const auto both = [&](const std::string& name, auto text) {
        return folder.write(name + "_probe.csv", text(probe)) + "," +
               folder.write(name + "_needle.csv", text(needle));
    };
    std::vector<std::string> forms;
    forms.push_back(both("ours", format_poses));
    forms.push_back(both("semicolon", [](const auto& poses) {
        return other_cells(format_poses(poses), ';', false);
    }));
    forms.push_back(both(
        "german", [](const auto& poses) { return other_cells(format_poses(poses), ';', true); }));
    forms.push_back(both(
        "tab", [](const auto& poses) { return other_cells(format_poses(poses), '\t', true); }));
    forms.push_back(both("ndi", [](const auto& poses) {
        return quaternion_table(poses, "State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,time_ms", ',');
    }));
    forms.push_back(folder.write("slicer.seq.mha", slicer_sequence(probe, needle)));
    Sequence sequence = sequence_of({{"ProbeToTracker", probe}, {"NeedleToTracker", needle}});
    const auto written = write_sequence(sequence, SequenceForm::mha);
    forms.push_back(folder.write("igsio.igs.mha",
                                 {reinterpret_cast<const char*>(written.data()), written.size()}));
    // The same header with its pixels in another file.
    std::string header(reinterpret_cast<const char*>(written.data()), written.size());
    const std::size_t end = header.find("LOCAL\n");
    folder.write("apart.raw", header.substr(end + 6));
    forms.push_back(folder.write("apart.mhd", header.substr(0, end) + "apart.raw"));
    Sequence pictures = sequence;
    pictures.width = pictures.height = 2;
    const auto shown = write_sequence(pictures, SequenceForm::mha, true);
    forms.push_back(folder.write("pictures.igs.mha",
                                 {reinterpret_cast<const char*>(shown.data()), shown.size()}));
    std::string in_turn = "<TransformRecorderLog>\n", by_tool = in_turn;
    for (std::size_t i = 0; i < probe.size(); ++i)
        in_turn += log_lines(probe, "ProbeToRAS", i) + log_lines(needle, "NeedleToRAS", i);
    for (std::size_t i = 0; i < probe.size(); ++i) by_tool += log_lines(needle, "NeedleToRAS", i);
    for (std::size_t i = probe.size(); i-- > 0;) by_tool += log_lines(probe, "ProbeToRAS", i);
    forms.push_back(folder.write("in_turn.xml", in_turn + "</TransformRecorderLog>"));
    forms.push_back(folder.write("by_tool.xml", by_tool + "</TransformRecorderLog>"));
    return forms;
}

}  // namespace sonocase::testing
