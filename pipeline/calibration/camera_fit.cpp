// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/camera_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "formats/base/constants.h"
#include "pipeline/calibration/lens.h"

namespace sonocase::pipeline::inline calibration {
namespace {

constexpr double kHuberPx = 0.5;

struct CornerCost {
    Point3 board;
    Pixel seen;
    template <class T>
    bool operator()(const T* camera, const T* pose, T* residual) const {
        const T at[3] = {T(board.x), T(board.y), T(board.z)};
        T p[3];
        ceres::AngleAxisRotatePoint(pose, at, p);
        for (int k = 0; k < 3; ++k) p[k] += pose[3 + k];
        lens_pixel(camera, p, residual);
        residual[0] -= seen.x;
        residual[1] -= seen.y;
        return true;
    }
};

CameraModel model_of(const std::array<double, kIntrinsics>& c, const CameraModel& size) {
    CameraModel m = size;
    m.fx_px = c[0], m.fy_px = c[1], m.cx_px = c[2], m.cy_px = c[3];
    m.k1 = c[4], m.k2 = c[5], m.p1 = c[6], m.p2 = c[7], m.k3 = c[8];
    return m;
}

struct View {
    const MarkerView* seen = nullptr;
    std::array<double, 6> pose{};
    double square = 0;
    int corners = 0;
};

const MarkerTag* tag_of(const MarkerBody& board, int id) {
    const auto at = std::find_if(board.tags.begin(), board.tags.end(),
                                 [&](const MarkerTag& tag) { return tag.id == id; });
    return at == board.tags.end() ? nullptr : &*at;
}

// The board's poses with a camera that is only supposed; what they leave over, per corner.
double place_boards(const CameraModel& camera, const MarkerBody& board, std::vector<View>& views) {
    double sum = 0;
    int found = 0;
    for (View& view : views) {
        std::vector<TagSight> sights;
        for (const SeenTag& seen : view.seen->tags)
            if (const MarkerTag* tag = tag_of(board, seen.id)) sights.push_back({tag, &seen});
        view.corners = 0;
        if (sights.size() < 3) continue;
        const std::optional<BodyPose> pose = find_body_pose(camera, sights, nullptr);
        if (!pose) continue;
        view.corners = 4 * static_cast<int>(sights.size());
        const Matrix3& r = pose->camera_from_body.rotation;
        double column_major[9];
        for (int k = 0; k < 9; ++k) column_major[k] = r(k % 3, k / 3);
        ceres::RotationMatrixToAngleAxis(column_major, view.pose.data());
        for (int k = 0; k < 3; ++k) view.pose[3 + k] = pose->camera_from_body.translation[k];
        sum += pose->residual_px * pose->residual_px;
        ++found;
    }
    return found > 0 ? std::sqrt(sum / found) : 1e9;
}

}  // namespace

CameraFit fit_camera(const std::vector<MarkerView>& seen,
                     const MarkerBody& board,
                     int width_px,
                     int height_px,
                     const CameraFitOptions& options) {
    CameraFit fit;
    std::vector<View> views(seen.size());
    for (std::size_t k = 0; k < seen.size(); ++k) views[k].seen = &seen[k];
    // The lens may be wide or narrow: the start is the one that fits best.
    CameraModel start;
    double best = 1e99;
    for (const double view_deg : {38.0, 52.0, 65.0, 80.0, 100.0}) {
        const CameraModel supposed = assumed_camera(width_px, height_px, view_deg);
        const double left = place_boards(supposed, board, views);
        if (left < best) {
            best = left;
            start = supposed;
        }
    }
    place_boards(start, board, views);
    views.erase(
        std::remove_if(views.begin(), views.end(), [](const View& v) { return v.corners == 0; }),
        views.end());
    fit.views = static_cast<int>(views.size());
    fit.camera = start;
    if (fit.views < options.min_views) {
        fit.problem = "the board is seen in " + std::to_string(fit.views) + " pictures; " +
                      std::to_string(options.min_views) +
                      " or more are needed, in which at least three of its tags are in view";
        return fit;
    }

    std::array<double, kIntrinsics> camera{start.fx_px, start.fy_px, start.cx_px, start.cy_px};
    ceres::Problem problem;
    std::vector<ceres::ResidualBlockId> blocks;
    for (View& view : views) {
        for (const SeenTag& tag : view.seen->tags) {
            const MarkerTag* drawn = tag_of(board, tag.id);
            if (!drawn) continue;
            const std::array<Point3, 4> corners = tag_corners(*drawn);
            for (int k = 0; k < 4; ++k) {
                const Pixel p = tag.corners[k];
                problem.AddResidualBlock(
                    new ceres::AutoDiffCostFunction<CornerCost, 2, kIntrinsics, 6>(
                        new CornerCost{corners[k], p}),
                    new ceres::HuberLoss(kHuberPx), camera.data(), view.pose.data());
                const int column = std::clamp(static_cast<int>(p.x / width_px * kFieldColumns), 0,
                                              kFieldColumns - 1);
                const int row =
                    std::clamp(static_cast<int>(p.y / height_px * kFieldRows), 0, kFieldRows - 1);
                ++fit.fields[row][column];
                ++fit.corners;
            }
        }
    }
    ceres::Solver::Options how;
    how.linear_solver_type = ceres::DENSE_SCHUR;
    how.max_num_iterations = 200;
    how.function_tolerance = 1e-12;
    how.num_threads = 1;  // the order of sums, and with it every bit, is then the same everywhere
    how.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(how, &problem, &summary);
    fit.camera = model_of(camera, start);
    fit.camera.pictures = fit.views;

    double square = 0;
    Vector3 mean{};
    for (View& view : views) {
        view.square = 0;
        for (const SeenTag& tag : view.seen->tags) {
            const MarkerTag* drawn = tag_of(board, tag.id);
            if (!drawn) continue;
            const std::array<Point3, 4> corners = tag_corners(*drawn);
            for (int k = 0; k < 4; ++k) {
                double r[2];
                CornerCost{corners[k], tag.corners[k]}(camera.data(), view.pose.data(), r);
                view.square += r[0] * r[0] + r[1] * r[1];
            }
        }
        square += view.square;
        fit.worst_view_px =
            std::max(fit.worst_view_px, std::sqrt(view.square / (2 * view.corners)));
    }
    fit.camera.rms_px = std::sqrt(square / (2 * fit.corners));
    std::vector<Vector3> normals;
    for (const View& view : views) {
        double m[9];
        ceres::AngleAxisToRotationMatrix(view.pose.data(), m);
        normals.push_back({m[6], m[7], m[8]});
        mean = mean + normals.back();
    }
    mean = normalized(mean);
    double spread = 0;
    for (const Vector3& n : normals) spread += norm(cross(n, mean)) * norm(cross(n, mean));
    fit.tilt_deg = kDegPerRad * std::asin(std::min(
                                    1.0, std::sqrt(spread / static_cast<double>(normals.size()))));
    int covered = 0;
    for (const auto& row : fit.fields)
        for (const int count : row) covered += count >= 4;
    fit.coverage = static_cast<double>(covered) / (kFieldRows * kFieldColumns);

    ceres::Covariance::Options covariance_options;
    covariance_options.algorithm_type = ceres::DENSE_SVD;
    covariance_options.null_space_rank = -1;
    covariance_options.num_threads = 1;
    ceres::Covariance covariance(covariance_options);
    const std::vector<std::pair<const double*, const double*>> pairs{
        {camera.data(), camera.data()}};
    if (covariance.Compute(pairs, &problem)) {
        double c[kIntrinsics * kIntrinsics];
        covariance.GetCovarianceBlock(camera.data(), camera.data(), c);
        const double unknowns = kIntrinsics + 6.0 * fit.views;
        const double variance = square / std::max(1.0, 2.0 * fit.corners - unknowns);
        for (int k = 0; k < 4; ++k)
            fit.sigma_px[k] = std::sqrt(std::max(0.0, c[k * (kIntrinsics + 1)] * variance));
        fit.camera.sigma_focal_px = fit.sigma_px[0];
    }

    const double focal_error = fit.sigma_px[0] / std::max(1.0, fit.camera.fx_px);
    if (fit.tilt_deg < options.min_tilt_deg) {
        fit.problem =
            "the board was always held at nearly the same tilt: tilt it by 30 degrees and more "
            "to all four sides";
    } else if (fit.coverage < options.min_coverage) {
        fit.problem =
            "the board was seen in too small a part of the picture: move it into all corners "
            "and edges";
    } else if (!(fit.sigma_px[0] >= 0) || focal_error > options.max_focal_error ||
               summary.termination_type == ceres::FAILURE) {
        fit.problem =
            "the focal length is not determined: show the board longer, nearer and more tilted";
    } else if (fit.camera.rms_px > 1.5) {
        fit.problem =
            "corners are off by more than a pixel and a half: glue the board to stiff card, and "
            "hold it still or use more light";
    }
    if (fit.camera.rms_px > 0.5)
        fit.warnings.push_back(
            "Corners are off by more than half a pixel: the board may be bent or the "
            "pictures blurred; glue it to stiff card and repeat.");
    if (std::abs(fit.camera.fx_px / fit.camera.fy_px - 1) > 0.01)
        fit.warnings.push_back(
            "Pixels seem not to be square: check that the board was printed without "
            "stretching, or that the camera does not stretch its picture.");
    return fit;
}

}  // namespace sonocase::pipeline::inline calibration
