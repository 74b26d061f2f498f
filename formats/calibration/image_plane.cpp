// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/image_plane.h"

#include <cassert>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/calibration/report_text.h"

namespace sonocase {
namespace {

using namespace calibrate;

// Computes the mean of the finite points in the probe's frame and adds their squared scatter and
// their number. False if there are none.
bool mean_in(const Rigid& probe_from_sensor,
             std::span<const Point3> points,
             Point3* mean,
             double* square,
             int* count) {
    std::vector<Point3> good;
    for (const Point3& p : points) {
        if (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)) {
            good.push_back(probe_from_sensor * p);
        }
    }
    if (good.empty()) return false;
    Vector3 sum;
    for (const Point3& p : good) sum = sum + (p - good[0]);
    *mean = good[0] + sum / static_cast<double>(good.size());
    for (const Point3& p : good) *square += dot(p - *mean, p - *mean);
    *count += static_cast<int>(good.size());
    return true;
}

}  // namespace

Point3 ImagePlane::probe_from_pixel(double u, double v) const {
    return {lateral_sign * (u - u0) * mm_per_px, 0, (v - v0) * mm_per_px};
}

ImagePlane fit_image_plane(const ImagePlaneInput& input) {
    assert(input.depth_mm > 0 && input.width_px > 0 && input.height_px > 1);
    ImagePlane out;
    out.sensor_from_probe = input.sensor_from_probe;
    out.footprint_mm = input.footprint_mm;
    out.mm_per_px = input.depth_mm / input.height_px;
    out.u0 = 0.5 * (input.width_px - 1);
    out.v0 = 0;
    out.lateral_sign = input.mark_on_left ? -1 : 1;

    const Rigid probe_from_sensor = inverse(input.sensor_from_probe);
    Point3 mark, other, front;
    double square = 0, unused = 0;
    int count = 0, ignored = 0;
    const bool both = mean_in(probe_from_sensor, input.mark_end, &mark, &square, &count) &&
                      mean_in(probe_from_sensor, input.other_end, &other, &square, &count);
    if (!both) {
        out.problem = "touch both ends of the probe's face with the pointer: the marked end first";
        return out;
    }
    out.rms_mm = std::sqrt(square / count);
    const Vector3 face = mark - other;
    const double width = norm(face);
    if (width < 5) {
        out.problem =
            text("the two touches lie %.1f mm apart; touch the two ends of the face", width);
        return out;
    }
    const double cosine = face.x / width;
    if (std::abs(cosine) < 0.7) {
        out.problem = text(
            "the touched face lies at %.0f degrees to the lateral direction; sweep the probe along "
            "its face again, or touch the two ends of the long side",
            std::acos(std::abs(cosine)) / kRadPerDeg);
        return out;
    }
    out.mirrored = face.x < 0;
    out.face_angle_rad = std::acos(std::min(1.0, std::abs(cosine)));
    out.off_plane_mm = std::sqrt(0.5 * (mark.y * mark.y + other.y * other.y));
    const Point3 middle = other + 0.5 * face;
    if (mean_in(probe_from_sensor, input.in_front, &front, &unused, &ignored)) {
        out.upside_down = front.z - middle.z < 0;
    }

    // Middle of the face in the old frame; then half turns about the depth or the lateral axis.
    Rigid probe_from_new{{}, {middle.x, middle.y, middle.z}};
    Matrix3 turn;
    if (out.mirrored) turn = Matrix3::diagonal({-1, -1, 1}) * turn;
    if (out.upside_down) turn = Matrix3::diagonal({1, -1, -1}) * turn;
    probe_from_new.rotation = turn;
    out.sensor_from_probe = input.sensor_from_probe * probe_from_new;
    out.determined = true;

    if (out.mirrored) {
        out.warnings.push_back(
            "The marked end is on the opposite side to the one that the lateral sweep went to: the "
            "image would be mirrored. The probe's frame was turned round; check the picture, and "
            "sweep towards the mark next time.");
    }
    if (out.upside_down) {
        out.warnings.push_back(
            "The touches in front of the face have negative depth: the image would be upside down. "
            "The probe's frame was turned over; make the depth sweep into the body next time.");
    }
    if (out.face_angle_rad > 5 * kRadPerDeg) {
        out.warnings.push_back(
            text("The face lies at %.1f degrees to the lateral direction; sweep along the face "
                 "again.",
                 out.face_angle_rad / kRadPerDeg));
    }
    if (input.footprint_mm > 0 && std::abs(width - input.footprint_mm) > 0.1 * input.footprint_mm) {
        out.warnings.push_back(
            text("The touches lie %.1f mm apart but the face is said to be %.1f mm wide; touch "
                 "its ends again, or correct the probe's description.",
                 width, input.footprint_mm));
    }
    if (out.rms_mm > 1.5) {
        out.warnings.push_back(
            text("Repeated touches scatter by %.1f mm; hold the pointer still.", out.rms_mm));
    }
    if (input.footprint_mm <= 0) out.footprint_mm = width;
    return out;
}

}  // namespace sonocase
