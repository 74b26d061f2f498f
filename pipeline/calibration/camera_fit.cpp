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

// The corners of one tag in one picture.
struct CameraTagCost {
    MarkerTag drawn;
    const SeenTag* seen;
    template <class T>
    void off_px(const T* camera, const T* pose, const T* bleed, T* off) const {
        const std::array<Point3, 4> corners = tag_corners(drawn);
        T view[4][3];
        for (int k = 0; k < 4; ++k) {
            const T at[3] = {T(corners[k].x), T(corners[k].y), T(corners[k].z)};
            ceres::AngleAxisRotatePoint(pose, at, view[k]);
            for (int a = 0; a < 3; ++a) view[k][a] += pose[3 + a];
        }
        tag_off_px(camera, view, bleed[0], *seen, off);
    }
    template <class T>
    bool operator()(const T* camera, const T* pose, const T* bleed, T* residual) const {
        T off[8];
        off_px(camera, pose, bleed, off);
        whiten(*seen, off, residual);
        return true;
    }
};

CameraModel model_of(const std::array<double, kIntrinsics>& c, const CameraModel& size) {
    CameraModel m = size;
    m.fx_px = c[0], m.fy_px = c[1], m.cx_px = c[2], m.cy_px = c[3];
    m.k1 = c[4], m.k2 = c[5], m.p1 = c[6], m.p2 = c[7], m.k3 = c[8];
    return m;
}

struct BoardView {
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
double place_boards(const CameraModel& camera,
                    const MarkerBody& board,
                    std::vector<BoardView>& views) {
    double sum = 0;
    int found = 0;
    for (BoardView& view : views) {
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
    // Their corners are moved in rounds: what the lens bends is known once the lens is.
    std::vector<MarkerView> unbent = seen;
    std::vector<BoardView> views(seen.size());
    for (std::size_t k = 0; k < seen.size(); ++k) views[k].seen = &unbent[k];
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
    views.erase(std::remove_if(views.begin(), views.end(),
                               [](const BoardView& v) { return v.corners == 0; }),
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
    double bleed = 0;
    ceres::Problem problem;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<BleedCost, 1, 1>(new BleedCost),
                             nullptr, &bleed);
    for (BoardView& view : views) {
        for (const SeenTag& tag : view.seen->tags) {
            const MarkerTag* drawn = tag_of(board, tag.id);
            if (!drawn) continue;
            problem.AddResidualBlock(
                new ceres::AutoDiffCostFunction<CameraTagCost, 8, kIntrinsics, 6, 1>(
                    new CameraTagCost{*drawn, &tag}),
                new ceres::HuberLoss(kHuberOfTag), camera.data(), view.pose.data(), &bleed);
            for (const Pixel& p : tag.corners) {
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
    constexpr int kRounds = 4;  // of lenses of 85 degrees the last one moves corners by 0.001 pixel
    for (int round = 0; round < kRounds; ++round) {
        ceres::Solve(how, &problem, &summary);
        fit.camera = model_of(camera, start);
        for (std::size_t k = 0; round + 1 < kRounds && k < seen.size(); ++k)
            for (std::size_t t = 0; t < seen[k].tags.size(); ++t) {
                unbent[k].tags[t].corners = seen[k].tags[t].corners;
                unbend_tag(fit.camera, unbent[k].tags[t]);
            }
    }
    fit.camera.pictures = fit.views;

    double square = 0, white = 0;
    Vector3 mean{};
    for (BoardView& view : views) {
        view.square = 0;
        for (const SeenTag& tag : view.seen->tags) {
            const MarkerTag* drawn = tag_of(board, tag.id);
            if (!drawn) continue;
            double off[8], sigmas[8];
            CameraTagCost{*drawn, &tag}.off_px(camera.data(), view.pose.data(), &bleed, off);
            whiten(tag, off, sigmas);
            for (const double o : off) view.square += o * o;
            for (const double r : sigmas) white += r * r;
        }
        square += view.square;
        fit.worst_view_px =
            std::max(fit.worst_view_px, std::sqrt(view.square / (2 * view.corners)));
    }
    fit.camera.rms_px = std::sqrt(square / (2 * fit.corners));
    std::vector<Vector3> normals;
    for (const BoardView& view : views) {
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
        // Where the corners are off by more than they are given, so is the lens.
        const double unknowns = kIntrinsics + 6.0 * fit.views;
        const double widened = std::max(1.0, white / std::max(1.0, 2.0 * fit.corners - unknowns));
        for (int k = 0; k < 4; ++k)
            fit.sigma_px[k] = std::sqrt(std::max(0.0, c[k * (kIntrinsics + 1)] * widened));
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
