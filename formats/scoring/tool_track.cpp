// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/tool_track.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "formats/base/constants.h"
#include "formats/base/portable_math.h"

namespace sonocase {
namespace {

// Sums of printed times round: the same recording in another form has the same neighbours.
constexpr double kRoundS = 1e-6;
constexpr double kSameReadingS = 0.02;  // ages below this are not recorded

Point3 position(const TrackPoint& p) {
    return {p.pose.translation.x, p.pose.translation.y, p.pose.translation.z};
}

double turn_deg(const TrackPoint& from, const TrackPoint& to) {
    return kDegPerRad * rotation_angle(to.pose.rotation * transpose(from.pose.rotation));
}

// Counts periods in which `rate` is above the threshold. The state changes once the last reading
// that agreed with the old state is more than the pause ago; a track begins at rest.
class ActionCounter {
  public:
    ActionCounter(double threshold, double pause_s, double start_s)
        : threshold_(threshold), pause_s_(pause_s), agreed_s_(start_s) {}
    void add(double time_s, double rate) {
        const bool moving = rate > threshold_;
        if (moving == active_) {
            agreed_s_ = time_s;
        } else if (time_s - agreed_s_ > pause_s_) {
            active_ = moving;
            agreed_s_ = time_s;
            if (moving) ++count_;
        }
    }
    int count() const { return count_; }

  private:
    double threshold_, pause_s_, agreed_s_;
    bool active_ = false;
    int count_ = 0;
};

struct Knot {
    double time_s = 0;
    Point3 p;
};
// Joins readings within a hundredth of a second into one knot, so that the filter's cost does not
// depend on the rate of the tracker.
std::vector<Knot> knots_of(std::span<const TrackPoint> points) {
    constexpr double kBinS = 0.01;
    std::vector<Knot> knots;
    std::size_t i = 0;
    while (i < points.size()) {
        const double start_s = points[i].time_s;
        double time_s = 0;
        Vector3 sum;
        std::size_t n = 0;
        for (; i < points.size() && points[i].time_s < start_s + kBinS - kRoundS; ++i, ++n) {
            time_s += points[i].time_s - start_s;
            sum = sum + points[i].pose.translation;
        }
        const Vector3 mean = sum / static_cast<double>(n);
        knots.push_back({start_s + time_s / static_cast<double>(n), {mean.x, mean.y, mean.z}});
    }
    return knots;
}

// Value at the knot of the quadratic in time fitted to its neighbours, by normal equations in s =
// dt / filter: 3 x 3 and well scaled. With fewer than four neighbours the knot is unchanged.
Point3 smoothed(const std::vector<Knot>& knots, std::size_t at, double filter_s) {
    // Neighbours at the very edge are in, however their times round.
    const double reach_s = 3 * filter_s + kRoundS;
    std::size_t first = at, last = at;
    while (first > 0 && knots[at].time_s - knots[first - 1].time_s <= reach_s) --first;
    while (last + 1 < knots.size() && knots[last + 1].time_s - knots[at].time_s <= reach_s) ++last;
    if (last - first < 3) return knots[at].p;
    double m[5] = {0, 0, 0, 0, 0};
    Vector3 b[3];
    for (std::size_t i = first; i <= last; ++i) {
        const double s = (knots[i].time_s - knots[at].time_s) / filter_s;
        const double w = exponential(-0.5 * s * s);
        const Vector3 p = knots[i].p - knots[at].p;
        double power = w;
        for (int k = 0; k < 5; ++k, power *= s) m[k] += power;
        b[0] = b[0] + w * p;
        b[1] = b[1] + (w * s) * p;
        b[2] = b[2] + (w * s * s) * p;
    }
    // First row of the inverse of the symmetric matrix [m0 m1 m2; m1 m2 m3; m2 m3 m4].
    const double c0 = m[2] * m[4] - m[3] * m[3], c1 = m[2] * m[3] - m[1] * m[4],
                 c2 = m[1] * m[3] - m[2] * m[2];
    const double det = m[0] * c0 + m[1] * c1 + m[2] * c2;
    if (!(std::abs(det) > 1e-12 * m[0] * m[0] * m[0])) return knots[at].p;
    return knots[at].p + (c0 * b[0] + c1 * b[1] + c2 * b[2]) / det;
}

// Length of the natural cubic spline through the knots; Simpson's rule on speed, eight intervals
// per piece.
double spline_length(const std::vector<double>& t, const std::vector<Point3>& p) {
    const std::size_t n = p.size();
    if (n < 2) return 0;
    // Second derivatives by the tridiagonal system of a natural spline.
    std::vector<Vector3> second(n), right(n);
    std::vector<double> upper(n, 0);
    for (std::size_t i = 1; i + 1 < n; ++i) {
        const double h0 = t[i] - t[i - 1], h1 = t[i + 1] - t[i];
        const Vector3 r = 6.0 * ((p[i + 1] - p[i]) / h1 - (p[i] - p[i - 1]) / h0);
        const double pivot = 2 * (h0 + h1) - h0 * upper[i - 1];
        upper[i] = h1 / pivot;
        right[i] = (r - h0 * right[i - 1]) / pivot;
    }
    for (std::size_t i = n - 1; i-- > 1;) second[i] = right[i] - upper[i] * second[i + 1];
    double length = 0;
    for (std::size_t i = 0; i + 1 < n; ++i) {
        const double h = t[i + 1] - t[i];
        const Vector3 chord = (p[i + 1] - p[i]) / h;
        const auto speed = [&](double u) {
            const double v = 1 - u;
            return norm(chord +
                        (h / 6) * ((1 - 3 * v * v) * second[i] + (3 * u * u - 1) * second[i + 1]));
        };
        double sum = speed(0) + speed(1);
        for (int k = 1; k < 8; ++k) sum += (k % 2 ? 4 : 2) * speed(k / 8.0);
        length += h * sum / 24;
    }
    return length;
}

}  // namespace

ToolTrack track_of(const Session& session, Tool tool) {
    ToolTrack track;
    for (std::size_t i = 0; i < session.samples.size(); ++i) {
        const SessionSample& s = session.samples[i];
        const bool ok = tool == Tool::probe ? s.probe_ok : s.needle_ok;
        if (!ok) {
            ++track.untracked;
            continue;
        }
        const Rigid& pose = tool == Tool::probe    ? s.mannequin_from_probe
                            : tool == Tool::needle ? s.mannequin_from_needle
                                                   : s.mannequin_from_drawn;
        const double age_s = tool == Tool::probe ? s.probe_age_s : s.needle_age_s;
        const double time_s = s.time_s - age_s;
        // A pose that was shown for longer than it was measured counts once, at its own time.
        if (age_s > 0 && !track.points.empty() &&
            time_s <= track.points.back().time_s + kSameReadingS)
            continue;
        const bool falls = !track.points.empty() && time_s < track.points.back().time_s;
        if (!std::isfinite(time_s) || !is_finite(pose) || falls) {
            ++track.run_back;
            continue;
        }
        if (!track.points.empty()) {
            track.longest_gap_s =
                std::max(track.longest_gap_s, time_s - track.points.back().time_s);
        }
        track.points.push_back({time_s, pose, i});
    }
    // A tool that was lost and did not come back.
    if (!track.points.empty() && std::isfinite(session.samples.back().time_s)) {
        track.longest_gap_s = std::max(track.longest_gap_s,
                                       session.samples.back().time_s - track.points.back().time_s);
    }
    return track;
}

double filtered_path_length_mm(std::span<const TrackPoint> points, double filter_s) {
    const std::vector<Knot> knots = knots_of(points);
    std::vector<double> times;
    std::vector<Point3> path;
    for (std::size_t i = 0; i < knots.size(); ++i) {
        times.push_back(knots[i].time_s);
        path.push_back(filter_s > 0 ? smoothed(knots, i, filter_s) : knots[i].p);
    }
    return spline_length(times, path);
}

MotionMetrics motion_metrics(std::span<const TrackPoint> points, const MotionOptions& options) {
    MotionMetrics m;
    if (points.empty()) return m;
    m.elapsed_time_s = points.back().time_s - points.front().time_s;
    m.path_length_mm = m.rotation_total_deg = 0;
    Box3 box;
    box.include(position(points[0]));
    double speeds = 0, squared_jerk = 0;
    std::size_t speed_count = 0;
    ActionCounter translations(options.action_speed_mm_s, options.action_pause_s, points[0].time_s);
    ActionCounter rotations(options.action_speed_deg_s, options.action_pause_s, points[0].time_s);
    // The last reading with a new time, the last velocity and acceleration, and their number.
    std::size_t rated = 0;
    Vector3 velocity, acceleration;
    int differences = 0;
    for (std::size_t i = 1; i < points.size(); ++i) {
        const Point3 p = position(points[i]);
        m.path_length_mm += distance(p, position(points[i - 1]));
        m.rotation_total_deg += turn_deg(points[i - 1], points[i]);
        box.include(p);
        // A rate between two readings at the same time is undefined: the later one is left out.
        const double dt = points[i].time_s - points[rated].time_s;
        if (!(dt > 0)) continue;
        const Vector3 v = (p - position(points[rated])) / dt;
        speeds += norm(v);
        ++speed_count;
        translations.add(points[i].time_s, norm(v));
        rotations.add(points[i].time_s, turn_deg(points[rated], points[i]) / dt);
        // Backward differences, each over the step that ends here.
        const Vector3 a = (v - velocity) / dt;
        const Vector3 jerk = (a - acceleration) / dt;
        if (differences >= 2) squared_jerk += dot(jerk, jerk) * dt;
        velocity = v;
        if (differences >= 1) acceleration = a;
        ++differences;
        rated = i;
    }
    m.filtered_path_length_mm = filtered_path_length_mm(points, options.filter_s);
    if (speed_count > 0) m.average_velocity_mm_s = speeds / static_cast<double>(speed_count);
    m.motion_smoothness_mm_s3 = std::sqrt(squared_jerk);
    const double straight = distance(position(points.front()), position(points.back()));
    if (straight > 0) m.path_inefficiency_percent = 100 * (m.path_length_mm / straight - 1);
    m.translational_actions = translations.count();
    m.rotational_actions = rotations.count();
    m.bounding_box_mm = box.extent();
    m.bounding_box_mm3 = m.bounding_box_mm.x * m.bounding_box_mm.y * m.bounding_box_mm.z;
    return m;
}

}  // namespace sonocase
