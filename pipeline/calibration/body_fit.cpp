// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/body_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <Eigen/Dense>

#include "formats/base/constants.h"
#include "formats/calibration/landmarks.h"
#include "pipeline/calibration/lens.h"

namespace sonocase::pipeline::inline calibration {
namespace {

// Where a tag may be before any picture was seen. It holds the body's frame while Ceres runs, and
// is wide enough not to draw the answer.
constexpr double kPriorMm = 5, kPriorRad = 0.1;
using Place = std::array<double, 6>;  // rotation vector, translation

// The corners of one tag in one picture; beside the pose and the tag's place the outward move of
// all edges (formats/markers/body_pose.h).
struct TagCost {
    std::array<double, kIntrinsics> camera;
    MarkerTag drawn;
    const SeenTag* seen;
    template <class T>
    bool operator()(const T* pose, const T* built, const T* bleed, T* residual) const {
        T lens[kIntrinsics], view[4][3], off[8];
        for (int k = 0; k < kIntrinsics; ++k) lens[k] = T(camera[k]);
        const double h = 0.5 * drawn.edge_mm;
        const double square[4][2] = {{-h, -h}, {h, -h}, {h, h}, {-h, h}};
        const Rigid& frame = drawn.body_from_tag;
        for (int k = 0; k < 4; ++k) {
            const T corner[3] = {T(square[k][0]), T(square[k][1]), T(0)};
            T tag[3], body[3];
            ceres::AngleAxisRotatePoint(built, corner, tag);
            for (int a = 0; a < 3; ++a) tag[a] += built[3 + a];
            for (int a = 0; a < 3; ++a)
                body[a] = frame.rotation(a, 0) * tag[0] + frame.rotation(a, 1) * tag[1] +
                          frame.rotation(a, 2) * tag[2] + frame.translation[a];
            ceres::AngleAxisRotatePoint(pose, body, view[k]);
            for (int a = 0; a < 3; ++a) view[k][a] += pose[3 + a];
        }
        tag_off_px(lens, view, bleed[0], *seen, off);
        whiten(*seen, off, residual);
        return true;
    }
};

struct PriorCost {
    std::array<double, 6> weight;
    template <class T>
    bool operator()(const T* built, T* residual) const {
        for (int k = 0; k < 6; ++k) residual[k] = weight[k] * built[k];
        return true;
    }
};
Rigid rigid_of(const Place& p) {
    const Vector3 turn{p[0], p[1], p[2]};
    const double angle = norm(turn);
    Rigid out{{}, {p[3], p[4], p[5]}};
    if (angle > 0) out.rotation = rotation_about(turn / angle, angle);
    return out;
}

Place place_of(const Rigid& r) {
    double column_major[9];
    for (int k = 0; k < 9; ++k) column_major[k] = r.rotation(k % 3, k / 3);
    Place out;
    ceres::RotationMatrixToAngleAxis(column_major, out.data());
    for (int k = 0; k < 3; ++k) out[3 + k] = r.translation[k];
    return out;
}

struct Sight {
    std::size_t tag;
    const SeenTag* seen;
};
struct View {
    std::vector<Sight> sights;
    Rigid camera_from_body;
    Place pose{};
    double residual_px = 0;
};

MarkerBody as_built(const MarkerBody& drawn, const std::vector<Place>& places) {
    MarkerBody body = drawn;
    for (std::size_t t = 0; t < places.size(); ++t)
        body.tags[t].body_from_tag = drawn.tags[t].body_from_tag * rigid_of(places[t]);
    return body;
}

// Poses of all views; those without one are dropped.
void find_poses(const CameraModel& camera, const MarkerBody& body, std::vector<View>& views) {
    std::vector<View> found;
    for (View& view : views) {
        std::vector<TagSight> sights;
        for (const Sight& s : view.sights) sights.push_back({&body.tags[s.tag], s.seen});
        const auto pose = find_body_pose(camera, sights, nullptr);
        if (!pose) continue;
        view.camera_from_body = pose->camera_from_body;
        view.pose = place_of(pose->camera_from_body);
        view.residual_px = pose->residual_px;
        found.push_back(std::move(view));
    }
    views = std::move(found);
}

double rms_px(const std::vector<View>& views) {
    double square = 0, weight = 0;
    for (const View& v : views) {
        const double n = static_cast<double>(v.sights.size());
        square += n * v.residual_px * v.residual_px, weight += n;
    }
    return weight > 0 ? std::sqrt(square / weight) : -1;
}

// Views that say something new: the body was turned or moved since each one that is kept.
std::vector<View> different(const std::vector<View>& views, const BodyFitOptions& options) {
    std::vector<View> kept;
    for (const View& view : views) {
        const bool new_one = std::none_of(kept.begin(), kept.end(), [&](const View& other) {
            const Rigid &a = other.camera_from_body, &b = view.camera_from_body;
            return rotation_angle(transpose(a.rotation) * b.rotation) <
                       options.min_turn_deg * kRadPerDeg &&
                   norm(a.translation - b.translation) < options.min_way_mm;
        });
        if (new_one) kept.push_back(view);
    }
    return kept;
}

// The tags that hang together through pictures in which both are seen.
bool hang_together(const std::vector<View>& views, std::size_t tags) {
    std::vector<std::size_t> root(tags);
    std::iota(root.begin(), root.end(), std::size_t{0});
    const auto find = [&](std::size_t t) {
        while (root[t] != t) t = root[t] = root[root[t]];
        return t;
    };
    for (const View& v : views)
        for (const Sight& s : v.sights) root[find(s.tag)] = find(v.sights[0].tag);
    for (std::size_t t = 1; t < tags; ++t)
        if (find(t) != find(0)) return false;
    return true;
}

// The problem that Ceres solves; its blocks in the order of Jacobian columns.
struct Adjustment {
    ceres::Problem problem;
    std::vector<double*> blocks;
};

void set_up(Adjustment& a,
            const MarkerBody& drawn,
            const CameraModel& c,
            std::vector<View>& views,
            std::vector<Place>& places,
            double& bleed) {
    const std::array<double, kIntrinsics> lens{c.fx_px, c.fy_px, c.cx_px, c.cy_px, c.k1,
                                               c.k2,    c.p1,    c.p2,    c.k3};
    for (Place& place : places) {
        constexpr double r = 1 / kPriorRad, m = 1 / kPriorMm;
        a.problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<PriorCost, 6, 6>(new PriorCost{{r, r, r, m, m, m}}),
            nullptr, place.data());
        a.blocks.push_back(place.data());
    }
    a.problem.AddResidualBlock(new ceres::AutoDiffCostFunction<BleedCost, 1, 1>(new BleedCost),
                               nullptr, &bleed);
    a.blocks.push_back(&bleed);
    for (View& view : views) {
        for (const Sight& s : view.sights)
            a.problem.AddResidualBlock(new ceres::AutoDiffCostFunction<TagCost, 8, 6, 6, 1>(
                                           new TagCost{lens, drawn.tags[s.tag], s.seen}),
                                       new ceres::HuberLoss(kHuberOfTag), view.pose.data(),
                                       places[s.tag].data(), &bleed);
        a.blocks.push_back(view.pose.data());
    }
}

// The covariance of all places, 6 rows for each tag, about the frame that lies nearest to what is
// drawn: motions of the whole body are taken out (Baarda's S-transformation). Empty: none.
Eigen::MatrixXd covariance_of(Adjustment& a,
                              const MarkerBody& drawn,
                              const std::vector<Place>& places) {
    ceres::Problem::EvaluateOptions which;
    which.parameter_blocks = a.blocks;
    which.num_threads = 1;
    ceres::CRSMatrix sparse;
    std::vector<double> residuals;
    if (!a.problem.Evaluate(which, nullptr, &residuals, nullptr, &sparse)) return {};
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(sparse.num_cols, sparse.num_cols);
    for (int row = 0; row < sparse.num_rows; ++row)
        for (int i = sparse.rows[row]; i < sparse.rows[row + 1]; ++i)
            for (int k = sparse.rows[row]; k < sparse.rows[row + 1]; ++k)
                normal(sparse.cols[i], sparse.cols[k]) += sparse.values[i] * sparse.values[k];
    const Eigen::LLT<Eigen::MatrixXd> factor(normal);
    if (factor.info() != Eigen::Success) return {};
    const int n = 6 * static_cast<int>(places.size());
    const Eigen::MatrixXd inverse =
        factor.solve(Eigen::MatrixXd::Identity(normal.rows(), n)).topRows(n);
    // Corners of all tags by their places, and places by a motion of the whole body.
    Eigen::MatrixXd corners = Eigen::MatrixXd::Zero(2 * n, n), gauge = Eigen::MatrixXd::Zero(n, 6);
    for (std::size_t t = 0; t < places.size(); ++t) {
        const MarkerTag& tag = drawn.tags[t];
        const int at = 6 * static_cast<int>(t);
        const std::array<Point3, 4> square = tag_corners(tag);
        const Point3 middle = tag.body_from_tag * Point3{};
        for (int axis = 0; axis < 3; ++axis) {
            const Vector3 e = tag.body_from_tag.rotation.column(axis);
            for (int k = 0; k < 4; ++k) {
                const Vector3 by_turn = cross(e, square[k] - middle);
                for (int r = 0; r < 3; ++r) {
                    corners(12 * static_cast<int>(t) + 3 * k + r, at + axis) = by_turn[r];
                    corners(12 * static_cast<int>(t) + 3 * k + r, at + 3 + axis) = e[r];
                }
            }
            for (int r = 0; r < 3; ++r) {
                Vector3 unit{};
                unit[r] = 1;
                gauge(at + axis, r) = dot(e, unit);
                gauge(at + 3 + axis, r) = dot(e, cross(unit, middle - Point3{}));
                gauge(at + 3 + axis, 3 + r) = dot(e, unit);
            }
        }
    }
    const Eigen::MatrixXd seen = corners * gauge;
    const Eigen::MatrixXd keep =
        Eigen::MatrixXd::Identity(n, n) -
        gauge * (seen.transpose() * seen).ldlt().solve(seen.transpose() * corners);
    return keep * inverse * keep.transpose();
}

double worst(const Eigen::Matrix3d& covariance) {
    return std::sqrt(std::max(
        0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance, Eigen::EigenvaluesOnly)
                 .eigenvalues()[2]));
}

// Moves all places by one motion of the body so that corners lie nearest to the drawn ones.
void lay_frame(const MarkerBody& drawn, std::vector<Place>& places) {
    const MarkerBody built = as_built(drawn, places);
    std::vector<Point3> from, to;
    for (std::size_t t = 0; t < places.size(); ++t) {
        const auto a = tag_corners(built.tags[t]), b = tag_corners(drawn.tags[t]);
        from.insert(from.end(), a.begin(), a.end());
        to.insert(to.end(), b.begin(), b.end());
    }
    const RigidFit fit = fit_rigid(from, to, {}, {.reject_outliers = false});
    for (std::size_t t = 0; t < places.size(); ++t)
        places[t] = place_of(inverse(drawn.tags[t].body_from_tag) * fit.to_from *
                             built.tags[t].body_from_tag);
}

std::string number(double value, const char* format) {
    char text[32];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

}  // namespace

BodyFit fit_body(const std::vector<MarkerView>& seen,
                 const MarkerBody& drawn,
                 const CameraModel& camera,
                 const BodyFitOptions& options) {
    BodyFit fit;
    const std::size_t tags = drawn.tags.size();
    fit.tags.resize(tags);
    for (std::size_t t = 0; t < tags; ++t) fit.tags[t].built.id = drawn.tags[t].id;
    std::vector<View> views;
    for (const MarkerView& one : seen) {
        View view;
        for (const SeenTag& tag : one.tags)
            for (std::size_t t = 0; t < tags; ++t)
                if (drawn.tags[t].id == tag.id) view.sights.push_back({t, &tag});
        if (view.sights.size() >= 2) views.push_back(std::move(view));
    }
    find_poses(camera, drawn, views);
    views = different(views, options);
    fit.views = static_cast<int>(views.size());
    fit.drawn_rms_px = rms_px(views);
    for (const View& view : views)
        for (const Sight& s : view.sights) ++fit.tags[s.tag].sights;
    if (fit.views < options.min_views) {
        fit.problem = "the " + drawn.name + "'s body is seen from " + std::to_string(fit.views) +
                      " sides or places; " + std::to_string(options.min_views) +
                      " or more are needed: turn it slowly about all axes";
        return fit;
    }
    for (const TagOfBody& tag : fit.tags) {
        if (tag.sights >= options.min_sights) continue;
        fit.problem = "tag " + std::to_string(tag.built.id) + " is seen beside another in " +
                      std::to_string(tag.sights) + " different pictures; " +
                      std::to_string(options.min_sights) +
                      " or more are needed: turn every side to the camera for a while";
        return fit;
    }
    if (!hang_together(views, tags)) {
        fit.problem =
            "no picture shows how one part of the body lies beside the rest: turn it slowly, so "
            "that neighbouring tags are seen together";
        return fit;
    }

    // With tags as drawn a pose may be the wrong one of two: poses are found anew with what is
    // known of the tags by then.
    constexpr int kRounds = 3;
    std::vector<Place> places(tags, Place{});
    for (int round = 0; round < kRounds; ++round) {
        double bleed = 0;
        Adjustment adjustment;
        set_up(adjustment, drawn, camera, views, places, bleed);
        ceres::Solver::Options how;
        how.linear_solver_type = ceres::DENSE_SCHUR;
        how.max_num_iterations = 100;
        how.function_tolerance = 1e-10;
        how.num_threads = 1;  // the same bits everywhere
        how.logging_type = ceres::SILENT;
        ceres::Solver::Summary summary;
        ceres::Solve(how, &adjustment.problem, &summary);
        if (summary.termination_type == ceres::FAILURE) {
            fit.problem = "the places of the tags are not determined: turn the body more";
            return fit;
        }
        if (round + 1 == kRounds) {
            const Eigen::MatrixXd covariance = covariance_of(adjustment, drawn, places);
            double square = 0, count = 0;
            for (const View& v : views) {
                for (const Sight& s : v.sights) {
                    double r[8];
                    TagCost{{camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, camera.k1,
                             camera.k2, camera.p1, camera.p2, camera.k3},
                            drawn.tags[s.tag],
                            s.seen}(v.pose.data(), places[s.tag].data(), &bleed, r);
                    // What is far off weighs little in the answer, and here.
                    double sum = 0;
                    for (const double x : r) sum += x * x;
                    square += std::min(sum, kHuberOfTag * kHuberOfTag);
                    count += 8;
                }
            }
            const double unknowns = 6.0 * (fit.views + static_cast<double>(tags) - 1) + 1;
            const double widen = std::max(1.0, square / std::max(1.0, count - unknowns));
            for (std::size_t t = 0; t < tags && covariance.size() > 0; ++t) {
                const int at = 6 * static_cast<int>(t);
                fit.tags[t].sigma_deg = kDegPerRad * worst(widen * covariance.block<3, 3>(at, at));
                fit.tags[t].sigma_mm = worst(widen * covariance.block<3, 3>(at + 3, at + 3));
            }
        }
        lay_frame(drawn, places);
        find_poses(camera, as_built(drawn, places), views);
    }
    fit.rms_px = rms_px(views);
    int worst_tag = 0;
    for (std::size_t t = 0; t < tags; ++t) {
        const Place& p = places[t];
        BuiltTag& built = fit.tags[t].built;
        built.turned_rad = {p[0], p[1], p[2]};
        built.moved_mm = {p[3], p[4], p[5]};
        if (norm(built.moved_mm) > fit.worst_moved_mm) worst_tag = built.id;
        fit.worst_moved_mm = std::max(fit.worst_moved_mm, norm(built.moved_mm));
        fit.worst_turned_deg = std::max(fit.worst_turned_deg, kDegPerRad * norm(built.turned_rad));
    }
    for (const TagOfBody& tag : fit.tags) {
        if (tag.sigma_mm >= 0 && tag.sigma_mm <= options.max_sigma_mm &&
            tag.sigma_deg <= options.max_sigma_deg)
            continue;
        fit.problem = "the place of tag " + std::to_string(tag.built.id) +
                      " is not determined (one standard deviation is " +
                      number(tag.sigma_mm, "%.2f") + " mm and " + number(tag.sigma_deg, "%.2f") +
                      " degrees): turn it to the camera longer and nearer";
        return fit;
    }
    if (fit.rms_px > options.max_rms_px) {
        fit.problem = "corners are off by " + number(fit.rms_px, "%.2f") +
                      " pixels: the body bends or a tag is not flat, or the camera's file is "
                      "another camera's";
    } else if (fit.worst_moved_mm > kMaxTagMoved_mm ||
               fit.worst_turned_deg > kDegPerRad * kMaxTagTurned_rad) {
        fit.problem = "a tag is " + number(fit.worst_moved_mm, "%.1f") +
                      " mm and one is turned by " + number(fit.worst_turned_deg, "%.1f") +
                      " degrees from where it is drawn: check the size of the body (--body of "
                      "calibrate camera) and that tag " +
                      std::to_string(worst_tag) + " is on its side";
    } else if (fit.worst_moved_mm > 3) {
        fit.warnings.push_back("Tag " + std::to_string(worst_tag) + " is " +
                               number(fit.worst_moved_mm, "%.1f") +
                               " mm from where it is drawn: check that the body is stiff.");
    }
    return fit;
}

}  // namespace sonocase::pipeline::inline calibration
