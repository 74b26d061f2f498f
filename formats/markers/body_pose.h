// SPDX-License-Identifier: Apache-2.0

// The pose of a marker body from all of its tags in one picture: robust least squares on where the
// corners of the tags are, each tag with its covariance, by Gauss and Newton.
//
// Unknowns are rotation, translation, and how far all black squares seem to be too large: glare,
// gamma and print make edges move outwards by some hundredths of a pixel, which would be taken for
// distance. Their outward move has a prior of kBleed.
//
// One tag alone, or tags nearly in one plane, may be seen as two poses (Collins and Bartoli,
// "Infinitesimal plane-based pose estimation", IJCV 2014). Both are fitted; where the second fits
// nearly as well, the answer says so.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "formats/markers/marker_set.h"
#include "formats/markers/tag_fit.h"

namespace sonocase {

inline constexpr double kBleed = 0.02;  // pixels, one standard deviation

// One tag's place in the body and, after fit_tag(), in the picture.
struct TagSight {
    const MarkerTag* tag = nullptr;
    const SeenTag* seen = nullptr;
};

struct BodyPose {
    Rigid camera_from_body;
    // Of a turn about the camera's axes through the body's origin (rad), then of the place (mm);
    // row by row. Widened where the residuals are larger than the corners' own covariance says.
    std::array<double, 36> covariance{};
    double residual = 0;  // root mean square, in standard deviations of the corners
    double residual_px = 0;
    int tags = 0;
    // How much worse the second pose fits, in squared standard deviations; infinite: there is none.
    double margin = 0;
    Rigid second;  // camera_from_body of that pose
};

// Least squares from a start. Nothing: no tags, or points behind the camera.
std::optional<BodyPose> fit_body_pose(const CameraModel& camera,
                                      std::span<const TagSight> tags,
                                      const Rigid& start,
                                      int max_iterations = 15);
// Least squares from the poses of the two tags that are seen largest, each in both of its forms,
// and from the prediction: camera_from_body as it should be now; null: there is none. Cost: about
// 40 us for four tags.
std::optional<BodyPose> find_body_pose(const CameraModel& camera,
                                       std::span<const TagSight> tags,
                                       const Rigid* predicted);

// One standard deviation of where a point of the body is, along the worst direction, mm.
double worst_sigma_mm(const BodyPose& pose, Point3 point_body);
// 3 x 3, row by row, of the place of a point of the body.
std::array<double, 9> point_covariance(const BodyPose& pose, Point3 point_body);
// The same of a turn about the camera's axes.
std::array<double, 9> turn_covariance(const BodyPose& pose);
double worst_sigma_rad(const BodyPose& pose);

}  // namespace sonocase
