// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/transform_log.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "formats/recording/pose_table.h"
#include "formats/recording/session.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

std::string_view attribute(std::string_view element, std::string_view name) {
    std::size_t from = 0;
    while (true) {
        from = element.find(name, from);
        if (from == std::string_view::npos) return {};
        const bool starts = from == 0 || std::string_view(" \t\r\n").find(element[from - 1]) !=
                                             std::string_view::npos;
        const std::size_t after = from + name.size();
        const char quote = after + 1 < element.size() ? element[after + 1] : 0;
        if (starts && element[after] == '=' && (quote == '"' || quote == '\'')) {
            const std::size_t end = element.find(quote, after + 2);
            if (end == std::string_view::npos) return {};
            return element.substr(after + 2, end - after - 2);
        }
        from = after;
    }
}

bool parse_matrix(std::string_view text, std::array<double, 16>& matrix) {
    for (double& value : matrix) {
        text = trimmed(text);
        const std::size_t end = std::min(text.find_first_of(" \t\r\n"), text.size());
        if (!parse_number(text.substr(0, end), value)) {
            if (end == 0 || !is_none(text.substr(0, end))) return false;
            value = std::numeric_limits<double>::quiet_NaN();
        }
        text.remove_prefix(end);
    }
    return trimmed(text).empty();
}

}  // namespace

bool looks_like_transform_log(std::string_view text) {
    return text.substr(0, 4096).find("<TransformRecorderLog") != std::string_view::npos;
}

Result<Sequence> parse_transform_log(std::string_view xml, const std::string& where) {
    Sequence sequence;
    std::vector<std::pair<double, std::string>> messages;
    std::size_t at = 0;
    int count = 0;
    while ((at = xml.find("<log", at)) != std::string_view::npos) {
        at += 4;
        if (at < xml.size() && std::string_view(" \t\r\n").find(xml[at]) == std::string_view::npos)
            continue;  // another element's name
        const std::size_t end = xml.find('>', at);
        ++count;
        const std::string here = where + ", log " + std::to_string(count);
        if (end == std::string_view::npos)
            return Error{"ends inside an element", here, "copy the file again"};
        const std::string_view element = xml.substr(at, end - at);
        at = end;
        double seconds = 0, nanoseconds = 0;
        if (!parse_number(attribute(element, "TimeStampSec"), seconds) ||
            !parse_number(attribute(element, "TimeStampNSec"), nanoseconds)) {
            return Error{"has no time", here, "expected TimeStampSec and TimeStampNSec"};
        }
        if (attribute(element, "type") == "message") {
            messages.push_back(
                {seconds + 1e-9 * nanoseconds, std::string(attribute(element, "message"))});
            continue;
        }
        SequencePose pose;
        if (!parse_matrix(attribute(element, "transform"), pose.to_from)) {
            return Error{"has no matrix", here, "expected 16 numbers"};
        }
        pose.ok = true;
        const std::string tool(attribute(element, "DeviceName"));
        int index = sequence.transform_index(tool);
        if (index < 0) {
            if (sequence.transforms.size() >= 64)
                return Error{"has too many tools", here, "expected at most 64"};
            index = static_cast<int>(sequence.transforms.size());
            sequence.transforms.push_back(tool);
        }
        SequenceFrame frame;
        frame.number = static_cast<std::int64_t>(sequence.frames.size());
        frame.timestamp_s = seconds + 1e-9 * nanoseconds;
        frame.unfiltered_timestamp_s = frame.timestamp_s;
        frame.poses.resize(index + 1, {.absent = true});
        frame.poses[index] = pose;
        sequence.frames.push_back(std::move(frame));
    }
    for (SequenceFrame& frame : sequence.frames)
        frame.poses.resize(sequence.transforms.size(), {.absent = true});
    if (sequence.frames.empty())
        return Error{"holds no readings", where, "expected a transform log"};
    join_frames(sequence);
    for (const auto& [time_s, text] : messages) {
        // In the last frame at or before it, with its own time.
        auto frame = std::upper_bound(
            sequence.frames.begin(), sequence.frames.end(), time_s,
            [](double time, const SequenceFrame& f) { return time < f.timestamp_s; });
        if (frame != sequence.frames.begin()) --frame;
        std::string detail = "message|text=" + text;
        if (frame->timestamp_s != time_s) detail += " t=" + number_text(time_s);
        frame->fields.push_back({"Event", detail});
    }
    return sequence;
}

}  // namespace sonocase
