// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/tool_frames.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "formats/text/lower_case.h"

namespace sonocase {
namespace {

constexpr double kHoldS = 0.25;  // as long as a live tool may be silent
constexpr std::array<double, 16> kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

// One step of a chain of transforms.
struct Link {
    int transform = 0;
    bool inverted = false;
};

// The shortest chain that leads from one frame to another; empty: none.
std::vector<Link> chain_between(const Sequence& sequence,
                                std::string_view from,
                                std::string_view to) {
    std::map<std::string_view, std::vector<Link>> reached{{from, {}}};
    std::vector<std::string_view> open{from};
    for (std::size_t next = 0; next < open.size() && !reached.contains(to); ++next) {
        const std::string_view frame = open[next];
        for (std::size_t i = 0; i < sequence.transforms.size(); ++i) {
            const TransformName name = split_transform_name(sequence.transforms[i]);
            if (name.to.empty() || (name.from != frame && name.to != frame)) continue;
            const bool inverted = name.to == frame;
            const std::string_view other = inverted ? name.from : name.to;
            if (reached.contains(other)) continue;
            std::vector<Link> chain = reached[frame];
            chain.push_back({static_cast<int>(i), inverted});
            reached.emplace(other, std::move(chain));
            open.push_back(other);
        }
    }
    const auto found = reached.find(to);
    return found == reached.end() ? std::vector<Link>{} : found->second;
}

// A tool of several names; the first match by words that stand at the beginning counts most.
constexpr std::string_view kProbeWords[] = {"probe", "transducer", "ultrasound", "usprobe"};
constexpr std::string_view kNeedleWords[] = {"needle", "stylus", "pointer"};

}  // namespace

TransformName split_transform_name(std::string_view name) {
    for (std::size_t at = name.rfind("To"); at != std::string_view::npos && at > 0;
         at = name.rfind("To", at - 1)) {
        const std::string_view to = name.substr(at + 2);
        if (!to.empty() && !std::islower(static_cast<unsigned char>(to.front())))
            return {name.substr(0, at), to};
    }
    return {name, {}};
}

int rank_as_tool(std::string_view transform, ToolRole role) {
    const TransformName name = split_transform_name(transform);
    const std::string tool = lower_case(name.from);
    const bool needle = role == ToolRole::needle;
    const auto begins = [&](std::string_view word) { return tool.starts_with(word); };
    const auto holds = [&](std::string_view word) { return tool.find(word) != std::string::npos; };
    const auto any = [](const auto& words, const auto& test) {
        return std::any_of(std::begin(words), std::end(words), test);
    };
    const bool is_needle = any(kNeedleWords, holds);
    int rank = 0;
    if (needle) {
        if (is_needle)
            rank = 1 + (any(kNeedleWords, begins) ? 1 : 0) + (holds("tip") ? 2 : 0) +
                   (holds("needle") ? 4 : 0);
    } else if (!is_needle) {
        const bool image = begins("image") || tool == "us" || holds("image");
        rank = any(kProbeWords, begins) ? 4 : any(kProbeWords, holds) ? 3 : image ? 1 : 0;
    }
    if (rank == 0) return 0;
    const std::string to = lower_case(name.to);
    // The image in the probe, or a needle's tip in the needle, is a calibration and no pose.
    const auto is_tool = [&](const auto& words) {
        return any(words,
                   [&](std::string_view word) { return to.find(word) != std::string::npos; });
    };
    if (is_tool(kProbeWords) || is_tool(kNeedleWords) || to == "image") return 0;
    return 4 * rank + (to == "mannequin" ? 3 : to == "tracker" ? 2 : to.empty() ? 0 : 1);
}

int find_tool(const Sequence& sequence, ToolRole role) {
    int best = -1, best_rank = 0;
    for (std::size_t i = 0; i < sequence.transforms.size(); ++i) {
        const int rank = rank_as_tool(sequence.transforms[i], role);
        if (rank > best_rank) best = static_cast<int>(i), best_rank = rank;
    }
    return best;
}

int compose_transform(Sequence& sequence,
                      std::string_view from,
                      std::string_view to,
                      Message* said) {
    const std::vector<Link> chain = chain_between(sequence, from, to);
    if (chain.empty()) return -1;
    const std::string name = std::string(from) + "To" + std::string(to);
    if (said) {
        std::string parts;
        for (const Link& link : chain)
            parts += (parts.empty() ? "" : ", ") +
                     sequence.transforms[static_cast<std::size_t>(link.transform)];
        *said = Message("{} is composed of {}.", {name, parts});
    }
    struct Last {
        std::optional<Rigid> pose;
        double time_s = 0;
    };
    std::vector<Last> last(chain.size());
    for (SequenceFrame& frame : sequence.frames) {
        bool any = false;
        for (std::size_t i = 0; i < chain.size(); ++i) {
            const SequencePose& given = frame.poses[static_cast<std::size_t>(chain[i].transform)];
            if (given.absent) continue;
            // The tool's own readings say when there is one of the composed.
            any = any || i == 0;
            const auto rigid = rigid_from_matrix(given.to_from);
            last[i] = {given.ok ? rigid : std::nullopt, frame.timestamp_s};
            if (last[i].pose && chain[i].inverted) last[i].pose = inverse(*last[i].pose);
        }
        SequencePose pose;
        pose.absent = !any;
        pose.ok = any;
        Rigid to_from;
        for (const Last& link : last) {
            const double age_s = frame.timestamp_s - link.time_s;
            pose.ok = pose.ok && link.pose && (age_s == 0 || std::abs(age_s) <= kHoldS);
            if (pose.ok) to_from = *link.pose * to_from;
        }
        if (pose.ok) pose.to_from = matrix_from_rigid(to_from);
        frame.poses.push_back(pose);
    }
    sequence.transforms.push_back(name);
    return static_cast<int>(sequence.transforms.size()) - 1;
}

void add_inverses(Sequence& sequence) {
    static constexpr std::string_view kFrames[] = {"Tracker", "Reference", "Mannequin", "World",
                                                   "Base",    "Ras",       "RAS",       "Phantom"};
    for (const ToolRole role : {ToolRole::probe, ToolRole::needle}) {
        if (find_tool(sequence, role) >= 0) continue;
        for (std::size_t i = 0; i < sequence.transforms.size(); ++i) {
            const std::string given = sequence.transforms[i];
            const TransformName name = split_transform_name(given);
            const std::string turned = std::string(name.to) + "To" + std::string(name.from);
            if (std::find(std::begin(kFrames), std::end(kFrames), name.from) == std::end(kFrames) ||
                rank_as_tool(turned, role) == 0 ||
                compose_transform(sequence, name.to, name.from) < 0)
                continue;
            sequence.notes.push_back({"{} is the inverse of {}.", {turned, given}});
            break;
        }
    }
}

int find_reference(const Sequence& sequence, std::string_view tool) {
    const std::string_view tracker = split_transform_name(tool).to;
    if (lower_case(tracker).find("tracker") == std::string::npos) return -1;
    for (std::size_t i = 0; i < sequence.transforms.size(); ++i) {
        const TransformName name = split_transform_name(sequence.transforms[i]);
        if (name.to == tracker && lower_case(name.from) == "reference") return static_cast<int>(i);
    }
    return -1;
}

bool in_two_frames(const std::string& probe, const std::string& needle) {
    const TransformName a = split_transform_name(probe), b = split_transform_name(needle);
    return !a.to.empty() && !b.to.empty() && a.to != b.to;
}

Status bring_to_one_frame(Sequence& sequence,
                          std::string& probe,
                          std::string& needle,
                          const std::string& where) {
    if (!in_two_frames(probe, needle)) return Done{};
    const std::string probe_given = probe, needle_given = needle;
    const TransformName a = split_transform_name(probe_given),
                        b = split_transform_name(needle_given);
    Message said;
    const bool needle_home = b.to == "Mannequin";
    for (const bool move_probe : {needle_home, !needle_home}) {
        const int made = move_probe ? compose_transform(sequence, a.from, b.to, &said)
                                    : compose_transform(sequence, b.from, a.to, &said);
        if (made < 0) continue;
        (move_probe ? probe : needle) = sequence.transforms[static_cast<std::size_t>(made)];
        sequence.notes.push_back(said);
        return Done{};
    }
    const bool tracker = b.to == "Tracker";
    return Error{probe + " and " + needle + " end in different frames, and nothing connects them",
                 where,
                 "record both to one frame, or " + std::string(tracker ? a.to : b.to) + "To" +
                     std::string(tracker ? b.to : a.to) + " as well"};
}

std::string why_no_pose(const Sequence& sequence, int transform) {
    std::array<std::size_t, 5> counts{};
    static constexpr const char* kWhy[] = {
        "have another status than OK", "are not numbers",
        "have their place in the last row instead of the last column (transposed)",
        "are mirrored (left-handed)", "have a scale or shear"};
    for (const SequenceFrame& frame : sequence.frames) {
        const SequencePose& pose = frame.poses[static_cast<std::size_t>(transform)];
        if (pose.absent) continue;
        const auto& m = pose.to_from;
        if (pose.ok && rigid_from_matrix(m)) return {};
        const bool finite =
            std::all_of(m.begin(), m.end(), [](double v) { return std::isfinite(v); });
        Matrix3 turn;
        for (std::size_t r = 0; r < 3; ++r) {
            for (std::size_t c = 0; c < 3; ++c) turn.m[3 * r + c] = m[4 * r + c];
        }
        ++counts[!pose.ok                                               ? 0
                 : !finite                                              ? 1
                 : m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1 ? 2
                 : determinant(turn) < 0                                ? 3
                                                                        : 4];
    }
    std::string out;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        if (counts[i] > 0)
            out += (out.empty() ? "" : ", ") + std::to_string(counts[i]) + " " + kWhy[i];
    }
    return out;
}

std::size_t mark_lost(Sequence& sequence) {
    constexpr double kStepS = 0.25, kRepeatedS = 0.2, kNearMm = 1;
    constexpr int kNoisy = 4, kOthers = 5;
    std::size_t marked = 0;
    const std::size_t tools = sequence.transforms.size();
    // # frames: how often any transform's pose had changed until then; with its own changes taken
    // away, how often others had.
    std::vector<std::uint32_t> changes(sequence.frames.size(), 0);
    std::vector<const SequencePose*> last(tools, nullptr);
    const auto changed = [](const SequencePose& a, const SequencePose& b) {
        return a.to_from != b.to_from;
    };
    std::uint32_t count = 0;
    for (std::size_t f = 0; f < sequence.frames.size(); ++f) {
        for (std::size_t t = 0; t < tools; ++t) {
            const SequencePose& pose = sequence.frames[f].poses[t];
            if (pose.absent || !pose.ok) continue;
            if (last[t] && changed(pose, *last[t])) ++count;
            last[t] = &pose;
        }
        changes[f] = count;
    }
    for (std::size_t t = 0; t < tools; ++t) {
        std::vector<std::size_t> own;  // frames that speak of this transform
        bool elsewhere = false, identity = false;
        for (std::size_t f = 0; f < sequence.frames.size(); ++f) {
            const SequencePose& pose = sequence.frames[f].poses[t];
            if (pose.absent || !pose.ok) continue;
            own.push_back(f);
            (pose.to_from == kIdentity ? identity : elsewhere) = true;
        }
        const auto pose_at = [&](std::size_t k) -> SequencePose& {
            return sequence.frames[own[k]].poses[t];
        };
        const auto time_at = [&](std::size_t k) { return sequence.frames[own[k]].timestamp_s; };
        if (identity && elsewhere) {
            for (std::size_t k = 0; k < own.size(); ++k) {
                if (pose_at(k).to_from == kIdentity) pose_at(k).ok = false, ++marked;
            }
        }
        std::vector<std::pair<std::size_t, std::size_t>>
            runs;                       // readings that repeat the one before
        std::size_t near = 0, far = 0;  // where the tool was after such a run
        int noisy = 0;
        for (std::size_t k = 1; k < own.size();) {
            if (changed(pose_at(k), pose_at(k - 1))) {
                noisy = time_at(k) - time_at(k - 1) <= kStepS ? noisy + 1 : 0;
                ++k;
                continue;
            }
            std::size_t end = k;
            while (end < own.size() && !changed(pose_at(end), pose_at(k - 1))) ++end;
            const bool long_enough = time_at(end - 1) - time_at(k - 1) >= kRepeatedS;
            const auto others = changes[own[end - 1]] - changes[own[k - 1]];
            if (noisy >= kNoisy && long_enough && others >= kOthers) {
                if (end < own.size()) {
                    const auto &a = pose_at(end).to_from, &b = pose_at(k).to_from;
                    const double x = a[3] - b[3], y = a[7] - b[7], z = a[11] - b[11];
                    ++(x * x + y * y + z * z < kNearMm * kNearMm ? near : far);
                }
                runs.emplace_back(k, end);
            }
            noisy = 0;
            k = end;
        }
        if (near > far) continue;  // a source that rests
        for (const auto& [from, to] : runs) {
            for (std::size_t k = from; k < to; ++k) {
                if (pose_at(k).ok) pose_at(k).ok = false, ++marked;
            }
        }
    }
    return marked;
}

}  // namespace sonocase
