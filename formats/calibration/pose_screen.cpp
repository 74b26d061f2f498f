// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/pose_screen.h"

#include <algorithm>
#include <array>

#include "formats/base/digest.h"
#include "formats/calibration/report_text.h"
#include "formats/calibration/statistics.h"

namespace sonocase {
namespace {

Matrix3 relative(const Matrix3& a, const Matrix3& b) {
    return transpose(a) * b;
}

// Marks rows whose position is in another unit than that of the others: they lie far away, but
// among the others once scaled by the ratio of two units.
std::vector<bool> rows_in_other_units(const std::vector<Pose>& poses, double* factor_seen) {
    std::vector<bool> marked(poses.size(), false);
    if (poses.size() < 4) return marked;
    Vector3 middle;
    std::vector<double> values(poses.size());
    for (int c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < poses.size(); ++i) {
            values[i] = poses[i].tracker_from_tool.translation[c];
        }
        middle[c] = calibrate::median(values);
    }
    const double far = norm(middle);
    // Only if the whole recording is far from the origin compared with its extent: near the origin
    // every length occurs.
    for (std::size_t i = 0; i < poses.size(); ++i) {
        values[i] = norm(poses[i].tracker_from_tool.translation - middle);
    }
    if (!(calibrate::median(values) < 0.25 * far)) return marked;
    constexpr std::array<double, 8> kFactors{1000, 1e-3, 100, 1e-2, 25.4, 1 / 25.4, 10, 0.1};
    for (std::size_t i = 0; i < poses.size(); ++i) {
        const Vector3 t = poses[i].tracker_from_tool.translation;
        const double length = norm(t);
        if (length > far / 6 && length < far * 6) continue;
        for (double f : kFactors) {
            if (norm(f * t - middle) < 0.4 * far) {
                marked[i] = true;
                *factor_seen = f;
                break;
            }
        }
    }
    return marked;
}

// Marks rows whose orientation is the inverse of their neighbours', because the sign of the vector
// part of a quaternion was lost. The rarer of the two kinds of rows is marked.
std::vector<bool> rows_with_inverse_orientation(const std::vector<Pose>& poses) {
    std::vector<bool> marked(poses.size(), false);
    // Only in a continuous recording: between poses taken one by one every jump occurs.
    std::vector<double> jumps;
    for (std::size_t i = 1; i < poses.size(); ++i) {
        jumps.push_back(rotation_angle(relative(poses[i - 1].tracker_from_tool.rotation,
                                                poses[i].tracker_from_tool.rotation)));
    }
    if (jumps.empty() || !(calibrate::median(jumps) < 0.1)) return marked;
    bool now = false;
    std::size_t count = 0;
    for (std::size_t i = 1; i < poses.size(); ++i) {
        const Matrix3& before = poses[i - 1].tracker_from_tool.rotation;
        const Matrix3& here = poses[i].tracker_from_tool.rotation;
        const double jump = rotation_angle(relative(before, here));
        const double jump_of_inverse = rotation_angle(relative(before, transpose(here)));
        // 20 degrees between neighbours is a jump; 5 is a step that a hand makes.
        if (jump > 0.35 && jump_of_inverse < 0.09 && jump_of_inverse < 0.25 * jump) now = !now;
        marked[i] = now;
        count += now;
    }
    if (2 * count > poses.size()) marked.flip();
    return marked;
}

std::vector<Pose> without(const std::vector<Pose>& poses, const std::vector<bool>& marked) {
    std::vector<Pose> kept;
    kept.reserve(poses.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
        if (!marked[i]) kept.push_back(poses[i]);
    }
    return kept;
}

std::string rows_of(int count, int rows) {
    return std::to_string(count) + " of " + std::to_string(rows) + " rows";
}

// One warning per kind of trouble. worst: the largest departure from orthonormality among the rows
// that were straightened; factor: what multiplies the rows in other units.
void describe(double worst, double factor, PoseScreen& screen) {
    using calibrate::text;
    const auto say = [&](const std::string& sentence) { screen.warnings.push_back(sentence); };
    if (screen.not_ok > 0) {
        say(rows_of(screen.not_ok, screen.rows) +
            " have a status other than OK and are left out; keep the sensor in view and in range.");
    }
    if (screen.not_finite > 0) {
        say(rows_of(screen.not_finite, screen.rows) +
            " hold NaN, infinite or impossibly large numbers and are left out; check the "
            "tracker's export.");
    }
    if (screen.not_rotation > 0) {
        say(rows_of(screen.not_rotation, screen.rows) +
            " have a rotation whose columns are not orthonormal and are left out; check the order "
            "of the nine numbers (row by row) and that no scale is mixed in.");
    }
    if (screen.mirrored > 0) {
        say(rows_of(screen.mirrored, screen.rows) +
            " have a mirrored rotation (determinant -1) and are left out; the export's axes are "
            "left-handed: negate one axis there.");
    }
    if (screen.straightened > 0) {
        say(rows_of(screen.straightened, screen.rows) +
            " have a rotation that is orthonormal only to " + text("%.2g", worst) +
            " and were replaced by the nearest rotation; export more digits.");
    }
    if (screen.other_units > 0) {
        say(rows_of(screen.other_units, screen.rows) + " have positions " +
            text("%.4g", factor >= 1 ? factor : 1 / factor) + " times " +
            (factor >= 1 ? "smaller" : "larger") +
            " than the others and are left out; units are mixed: export every row in mm.");
    }
    if (screen.flipped > 0) {
        say(rows_of(screen.flipped, screen.rows) +
            " have the inverse of their neighbours' orientation and are left out; a quaternion "
            "sign flips in the export: flip all four numbers or none.");
    }
    if (screen.rows > 4 && 5 * screen.repeated > screen.rows) {
        say(rows_of(screen.repeated, screen.rows) +
            " repeat the row before; the tracker was slower than the recording or the sensor "
            "froze, so they add nothing.");
    }
}

}  // namespace

PoseScreen screen_poses(std::span<const Pose> poses) {
    PoseScreen screen;
    screen.rows = static_cast<int>(poses.size());
    screen.poses.reserve(poses.size());
    double worst = 0;
    for (const Pose& pose : poses) {
        if (!pose.ok) {
            ++screen.not_ok;
            continue;
        }
        // More than ten kilometres from the tracker is not a position; its square might overflow.
        const Vector3 t = pose.tracker_from_tool.translation;
        const bool far = std::abs(t.x) > 1e7 || std::abs(t.y) > 1e7 || std::abs(t.z) > 1e7;
        if (!is_finite(pose.tracker_from_tool) || far) {
            ++screen.not_finite;
            continue;
        }
        Pose kept = pose;
        Matrix3& r = kept.tracker_from_tool.rotation;
        const double error = orthonormality_error(r);
        if (!(error <= 0.05)) {
            ++screen.not_rotation;
            continue;
        }
        if (determinant(r) < 0) {
            ++screen.mirrored;
            continue;
        }
        if (error > 1e-3) {
            ++screen.straightened;
            worst = std::max(worst, error);
        }
        r = nearest_rotation(r);
        if (!screen.poses.empty() &&
            screen.poses.back().tracker_from_tool == kept.tracker_from_tool) {
            ++screen.repeated;
        }
        screen.poses.push_back(kept);
    }

    double factor = 1;
    const std::vector<bool> other = rows_in_other_units(screen.poses, &factor);
    screen.other_units = static_cast<int>(std::count(other.begin(), other.end(), true));
    if (screen.other_units > 0) screen.poses = without(screen.poses, other);
    const std::vector<bool> inverse = rows_with_inverse_orientation(screen.poses);
    screen.flipped = static_cast<int>(std::count(inverse.begin(), inverse.end(), true));
    if (screen.flipped > 0) screen.poses = without(screen.poses, inverse);

    describe(worst, factor, screen);
    return screen;
}

std::vector<Pose> relative_poses(std::span<const Pose> reference, std::span<const Pose> tool) {
    std::vector<Pose> out;
    if (reference.empty()) return out;
    std::vector<Pose> sorted(reference.begin(), reference.end());
    std::stable_sort(sorted.begin(), sorted.end(),
                     [](const Pose& a, const Pose& b) { return a.timestamp_s < b.timestamp_s; });
    std::vector<double> gaps;
    for (std::size_t i = 1; i < sorted.size(); ++i) {
        const double gap = sorted[i].timestamp_s - sorted[i - 1].timestamp_s;
        if (gap > 0) gaps.push_back(gap);
    }
    const double half_frame = gaps.empty() ? 0.5 : 0.5 * calibrate::median(gaps);
    for (const Pose& pose : tool) {
        const auto after =
            std::lower_bound(sorted.begin(), sorted.end(), pose.timestamp_s,
                             [](const Pose& a, double t) { return a.timestamp_s < t; });
        auto best = after;
        if (after == sorted.end() ||
            (after != sorted.begin() && pose.timestamp_s - std::prev(after)->timestamp_s <
                                            after->timestamp_s - pose.timestamp_s)) {
            best = std::prev(after);
        }
        if (!(std::abs(best->timestamp_s - pose.timestamp_s) <= half_frame)) continue;
        Pose relative_pose = pose;
        relative_pose.ok = pose.ok && best->ok;
        Rigid base = best->tracker_from_tool;
        if (orthonormality_error(base.rotation) <= 0.05 && determinant(base.rotation) > 0) {
            base.rotation = nearest_rotation(base.rotation);
        } else {
            relative_pose.ok = false;
        }
        relative_pose.tracker_from_tool = inverse(base) * pose.tracker_from_tool;
        out.push_back(relative_pose);
    }
    return out;
}

std::string digest_of_poses(std::span<const Pose> poses) {
    Digest digest;
    for (const Pose& pose : poses) {
        digest.add(pose.timestamp_s).add(std::int64_t{pose.ok});
        for (double v : pose.tracker_from_tool.rotation.m) digest.add(v);
        for (int c = 0; c < 3; ++c) digest.add(pose.tracker_from_tool.translation[c]);
    }
    return digest.hex();
}

}  // namespace sonocase
